//! Scissors: when closing blades cut, and which tissue they cut.
//!
//! A cutter's blades move like the gripper's. The cut lies in the plane between the blades, over
//! their length and as wide as they were open. It opens as far as the edges have come. A tube
//! across the blades is cut through if its whole cross-section is between them, else in part. The
//! cutting edges have no width: they push no tissue.

use crate::gripper::{BLADE_TIP, JAW_REGION_BEGIN};
use crate::{Gripper, Result, World};
use glam::DVec3;
use trocar_tissue::{Cut, Piece, Severed, sever, sever_part};

/// Blades that were open wider than this (rad) are ready to cut ...
pub const CUT_OPENED: f64 = 0.50;

/// ... and cut when they close to less than this (rad).
pub const CUT_CLOSED: f64 = 0.15;

/// Watches the blades of a cutter: open blades that close make a cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scissors {
    /// Blades open by more than the first angle are ready to cut; they cut when they close below
    /// the second (rad).
    angles: [f64; 2],
    /// Widest angle (rad) since the last cut, if it is wide enough for another.
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

    /// Widest angle of the blades (rad), if they are ready to cut.
    pub fn opened(&self) -> Option<f64> {
        self.opened
    }

    /// The numbers of their state.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> + use<> {
        let Self { angles, opened } = *self;
        angles.into_iter().chain([opened.unwrap_or(-1.0)])
    }

    /// Forgets the open angle: nothing was between the blades.
    pub fn rest(&mut self) {
        self.opened = None;
    }

    /// Follows the cutter to its present place. If its open blades have just closed, returns the
    /// gripper there with the blades as wide as they were: the tissue between them is cut
    /// ([`Gripper::cut`]). `None` otherwise; blades that close again without opening cut nothing.
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
    /// The cut of body `body` when the blades close from here.
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
    /// Cuts a body. The first piece keeps the body's index; the other pieces become the last
    /// bodies. Returns the pieces, or none if nothing was cut. Only a copy of model and state
    /// undoes it.
    ///
    /// # Errors
    /// An invalid cut, or pieces that cannot be stepped.
    pub fn sever(&mut self, cut: &Cut) -> Result<Vec<Piece>> {
        let severed = sever(&self.model, &self.state, cut)?;
        self.take_over(severed, cut.body)
    }

    /// The same for a part of the cut's rectangle: from and to, along the blades from its middle
    /// (m); `sides` are those of the body's elements ([`trocar_tissue::sides`]).
    ///
    /// # Errors
    /// As [`World::sever`].
    pub fn sever_part(&mut self, cut: &Cut, part: [f64; 2], sides: &[bool]) -> Result<Vec<Piece>> {
        let severed = sever_part(&self.model, &self.state, cut, part, sides)?;
        self.take_over(severed, cut.body)
    }

    fn take_over(&mut self, severed: Severed, body: usize) -> Result<Vec<Piece>> {
        if severed.faces == 0 {
            return Ok(Vec::new());
        }
        self.stepper.set_model(&severed.model)?;
        let (whole, toughness) = (self.axes[body].clone(), self.toughness[body]);
        for piece in &severed.pieces {
            let mut axis = whole.clone();
            axis.s = piece.nodes.iter().map(|node| whole.s[*node as usize]).collect();
            if piece.body < self.axes.len() {
                self.axes[piece.body] = axis;
            } else {
                self.axes.push(axis);
                self.toughness.push(toughness);
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
