//! Scissors: what blades that close through tissue part.
//!
//! A cutter has the gripper's blades. Its cut is in the plane in which they swing, over their length and as wide as they were open. A tube across the blades is cut through where the mouth holds all of
//! it, and in part otherwise.

use crate::gripper::{BLADE_TIP, MOUTH_BEGIN};
use crate::{Gripper, Result, World};
use glam::DVec3;
use trocar_tissue::{Cut, Piece, sever};

impl Gripper {
    /// What its blades cut of body `body` when they close from where they are now.
    pub fn cut(&self, body: usize) -> Cut {
        let turned = |axis: DVec3| self.pose.rotation * axis;
        let middle = 0.5 * (MOUTH_BEGIN + BLADE_TIP);
        Cut {
            body,
            point: self.pose.transform(middle * DVec3::X),
            normal: turned(DVec3::Z),
            along: turned(DVec3::X),
            half_extents: [0.5 * (BLADE_TIP - MOUTH_BEGIN), self.half_gap(BLADE_TIP)],
        }
    }
}

impl World {
    /// Cuts a body; it keeps its index, and what it lost comes behind all others. The pieces, or none where nothing was cut. Nothing of it can be undone but by a clone of model and state.
    ///
    /// # Errors
    /// A cut that cannot be, or pieces that cannot be stepped.
    pub fn sever(&mut self, cut: &Cut) -> Result<Vec<Piece>> {
        let severed = sever(&self.model, &self.state, cut)?;
        if severed.faces == 0 {
            return Ok(Vec::new());
        }
        self.stepper.follow(&severed.model)?;
        let whole = self.axes[cut.body].clone();
        for piece in &severed.pieces {
            let mut axis = whole.clone();
            axis.s = piece.nodes.iter().map(|node| whole.s[*node as usize]).collect();
            if piece.body < self.axes.len() {
                self.axes[piece.body] = axis;
            } else {
                self.axes.push(axis);
            }
        }
        (self.model, self.state) = (severed.model, severed.state);
        Ok(severed.pieces)
    }
}
