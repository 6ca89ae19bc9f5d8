//! How hard an instrument was pressed against each organ in the last moments.
//!
//! An instrument that comes through the surface of an organ within a frame was stopped by it in the
//! frames before, or in this one. So the largest force of several frames shows how hard it pressed.

use super::solid::Meeting;
use glam::DVec3;
use trocar_tissue::ToolForce;

/// Number of tissue frames that are remembered (0.1 s).
const FRAMES: usize = 6;

/// The force of each organ on one instrument.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Pressed {
    by_organ: Vec<Press>,
}

/// The force of an organ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Press {
    /// Sum of the force of its pinned tissue over the arm's physics steps of this frame (N).
    pinned: DVec3,
    /// In the last frames, the last one first (N).
    last: [f64; FRAMES],
}

impl Pressed {
    /// Adds the `force` of a meeting with a solid in a physics step (N), if that is an organ.
    pub fn add(&mut self, meeting: &Meeting, force: f64) {
        if let Some(organ) = meeting.organ {
            self.of(organ).pinned += force * meeting.normal;
        }
    }

    /// Ends a tissue frame of `steps` physics steps, with the contact of each organ on the
    /// instrument's tools.
    pub fn end_frame(&mut self, steps: u32, organs: impl Iterator<Item = [ToolForce; 3]>) {
        for (organ, forces) in organs.enumerate() {
            let tools = forces.map(|force| force.contact.force);
            let press = self.of(organ);
            let pinned = std::mem::take(&mut press.pinned) / f64::from(steps);
            // Tools press together, or against each other, as jaws do that close.
            let whole = (tools.iter().sum::<DVec3>() + pinned).length();
            press.last.rotate_right(1);
            press.last[0] = tools.iter().map(|force| force.length()).fold(whole, f64::max);
        }
    }

    /// The largest force of an organ in the last frames (N).
    pub fn peak(&self, organ: usize) -> f64 {
        self.by_organ.get(organ).map_or(0.0, |press| press.last.iter().copied().fold(0.0, f64::max))
    }

    /// Whether an organ pressed in the last frames.
    pub fn is_any(&self) -> bool {
        self.by_organ.iter().any(|press| press.last.iter().any(|force| *force > 0.0))
    }

    fn of(&mut self, organ: usize) -> &mut Press {
        if self.by_organ.len() <= organ {
            self.by_organ.resize(organ + 1, Press::default());
        }
        &mut self.by_organ[organ]
    }

    /// Every number of it; those of an organ that is not touched are left out.
    pub fn numbers(&self) -> impl Iterator<Item = f64> + '_ {
        let touched = self.by_organ.iter().enumerate().filter(|(_, press)| **press != Press::default());
        touched.flat_map(|(organ, Press { pinned, last })| {
            std::iter::once(organ as f64).chain(pinned.to_array()).chain(*last)
        })
    }
}
