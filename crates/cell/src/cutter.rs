//! Scissors: what blades that close through tissue part.
//!
//! A cutter has the gripper's blades. Its cut is in the plane in which they swing, over their
//! length and as wide as they were open. A tube across the blades is cut through where the mouth
//! holds all of it, and in part otherwise. Its edges have no width: they push no tissue.

use crate::gripper::{BLADE_TIP, JAW_REGION_BEGIN};
use crate::{Gripper, Result, World};
use glam::DVec3;
use trocar_tissue::{Cut, Piece, sever};

/// Blades that were open wider than this (rad) are ready to cut (SPEC E1) ...
pub const CUT_OPENED: f64 = 0.50;

/// ... and cut when they close to less than this (rad).
pub const CUT_CLOSED: f64 = 0.15;

/// Watches the blades of a cutter: a cut is made by blades that were open and close.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scissors {
    /// Blades wider than the first angle are ready to cut, and do when they close to less than the
    /// second (rad).
    angles: [f64; 2],
    /// Widest angle (rad) since the last cut, if that is wide enough for the next.
    opened: Option<f64>,
}

impl Default for Scissors {
    fn default() -> Self {
        Self::new(CUT_OPENED, CUT_CLOSED)
    }
}

impl Scissors {
    /// Scissors that cut once they have been open wider than `opened` (rad) and close to less than
    /// `closed` (rad).
    pub fn new(opened: f64, closed: f64) -> Self {
        Self { angles: [opened, closed], opened: None }
    }

    /// How wide they are or were (rad), if they are ready to cut.
    pub fn opened(&self) -> Option<f64> {
        self.opened
    }

    /// The numbers of their state.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> + use<> {
        let Self { angles, opened } = *self;
        angles.into_iter().chain([opened.unwrap_or(-1.0)])
    }

    /// Forgets that they were open: nothing was between them for a while.
    pub fn rest(&mut self) {
        self.opened = None;
    }

    /// The cutter is at `gripper` now. When its blades have closed, after they were open, the
    /// gripper there with the blades as wide as they were: what lies between those is cut
    /// ([`Gripper::cut`]). None otherwise; blades that close again without having opened cut
    /// nothing.
    pub fn follow(&mut self, gripper: &Gripper) -> Option<Gripper> {
        let angle = gripper.jaw_angle;
        if angle < self.angles[1] {
            return self.opened.take().map(|jaw_angle| Gripper { jaw_angle, ..*gripper });
        }
        if angle > self.angles[0] {
            self.opened = Some(self.opened.map_or(angle, |widest| widest.max(angle)));
        }
        None
    }
}

impl Gripper {
    /// What its blades cut of body `body` when they close from where they are now.
    pub fn cut(&self, body: usize) -> Cut {
        self.cut_along(body, BLADE_TIP)
    }

    /// The same for blades of another `length` (m).
    pub fn cut_along(&self, body: usize, length: f64) -> Cut {
        let turned = |axis: DVec3| self.pose.rotation * axis;
        let middle = 0.5 * (JAW_REGION_BEGIN + length);
        Cut {
            body,
            point: self.pose.transform(middle * DVec3::X),
            normal: turned(DVec3::Z),
            along: turned(DVec3::X),
            half_extents: [0.5 * (length - JAW_REGION_BEGIN), self.half_gap(length)],
        }
    }
}

impl World {
    /// Cuts a body; it keeps its index, and what it lost comes behind all others. The pieces, or
    /// none where nothing was cut. Nothing of it can be undone but by a clone of model and state.
    ///
    /// # Errors
    /// A cut that cannot be, or pieces that cannot be stepped.
    pub fn sever(&mut self, cut: &Cut) -> Result<Vec<Piece>> {
        let severed = sever(&self.model, &self.state, cut)?;
        if severed.faces == 0 {
            return Ok(Vec::new());
        }
        self.stepper.set_model(&severed.model)?;
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
        self.cuts += 1;
        Ok(severed.pieces)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MAX_ANGLE;

    #[test]
    fn scissors_cut_once_where_they_close_after_they_were_open() {
        let at = |jaw_angle: f64| Gripper::over(DVec3::ZERO, DVec3::Z, DVec3::X, jaw_angle);
        let cuts = |angles: &[f64]| {
            let mut scissors = Scissors::default();
            angles.iter().filter_map(|a| scissors.follow(&at(*a))).map(|g| g.jaw_angle).collect::<Vec<_>>()
        };
        assert_eq!(cuts(&[0.0, 0.49, 0.1, 0.0]), [0.0; 0], "never open");
        assert_eq!(cuts(&[0.51, 0.15, 0.3]), [0.0; 0], "never closed");
        assert_eq!(cuts(&[0.6, MAX_ANGLE, 0.7, 0.3, 0.149, 0.0, 0.2, 0.0]), [MAX_ANGLE], "as wide as they were, once");
        assert_eq!(cuts(&[0.6, 0.0, 0.8, 0.0]), [0.6, 0.8]);
    }
}
