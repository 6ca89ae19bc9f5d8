//! The blades of an arm's cutter: when a cut begins, how far it has come, and when an event reports
//! it.

use super::ArmUnit;
use crate::bite::Bite;
use crate::section::{chords, slit};
use crate::{Gripper, JawRegion, World};

/// The work of a cutter in one tissue frame.
#[derive(Clone, Debug)]
pub(in crate::cell) struct Sheared {
    /// The cutter with the blades at their open angle.
    pub open: Gripper,
    /// The part of the blades along which tissue is cut: distances from the pivot (m).
    pub part: [f64; 2],
    /// An event reports the cut.
    pub told: bool,
    /// The blades open again, or are out of the tissue.
    pub ends: bool,
}

impl ArmUnit {
    /// Cuts tissue with blades that were open around it and now close. The cut reaches as far as
    /// the edges have come.
    ///
    /// Edges that pass each other shear tissue instead of pressing it flat. So the contact of
    /// closing blades is off until no tissue is left where the open blades were and the blades are
    /// out of all organs. The shaft's contact stays, and the jaws feel the force of the cut.
    pub fn cut(&mut self, world: &World) -> Option<Sheared> {
        let length = self.model.blades.length;
        let between = |open: &Gripper| JawRegion::sized(open, length).fullest(world).map(|(organ, _)| organ);
        if let Some(jaw_angle) = self.state.shears
            && between(&Gripper { jaw_angle, ..self.state.gripper }).is_none()
            && self.inside_organs(world, 3).is_empty()
        {
            self.state.shears = None;
        }
        let closes = self.state.jaw_rate < 0.0;
        if let Some(jaw_angle) = self.state.scissors.opened().filter(|_| closes) {
            match between(&Gripper { jaw_angle, ..self.state.gripper }) {
                Some(organ) => {
                    self.state.shears = Some(jaw_angle);
                    if self.state.bite.is_none() {
                        self.bite(world, organ, jaw_angle);
                    }
                }
                None => self.state.scissors.rest(),
            }
        }
        let state = &mut self.state;
        let closed = state.scissors.follow(&state.gripper).is_some();
        let bite = state.bite.as_mut()?;
        let open = Gripper { jaw_angle: bite.opened, ..state.gripper };
        let ends = state.shears.is_none() || state.jaw_rate > 0.0;
        if !ends {
            bite.measure(
                &chords(world, bite.organ, &state.gripper, length, open.half_gap(length)),
                state.gripper.jaw_angle,
            );
        }
        // Below the gate, an event also follows when the rest is cut.
        let rest = state.scissors.opened().is_none() && bite.is_through();
        let told = (closed || ends || rest) && bite.has_news();
        // A cut that is through spans the whole blades: tissue at the rims is thinner than the gap
        // between the edges.
        let part = if bite.is_through() { Some([f64::NEG_INFINITY, f64::INFINITY]) } else { bite.part() };
        if told {
            bite.told = bite.area();
        }
        match part {
            Some(part) => Some(Sheared { open, part, told, ends }),
            None => {
                if ends {
                    state.bite = None;
                }
                None
            }
        }
    }

    /// Begins to cut body `organ` with blades that were `opened` (rad).
    fn bite(&mut self, world: &World, organ: usize, opened: f64) {
        let (gripper, blades) = (&self.state.gripper, &self.model.blades);
        let slit = slit(world, organ, gripper, blades.length);
        self.state.bite = Some(Bite::new(organ, opened, world.toughness[organ], blades.lever(), slit));
    }
}
