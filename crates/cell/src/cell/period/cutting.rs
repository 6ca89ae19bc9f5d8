//! Cuts by blades within a frame: the tissue parts as far as the blades have come, and events
//! report it.

use crate::Result;
use crate::cell::Cell;
use crate::cell::arm::{ArmUnit, Sheared};
use crate::cell::report::CellEvent;
use crate::cell::solid::PinnedSurface;
use crate::gripper::JAW_REGION_BEGIN;
use crate::severance::{Parting, Severance};
use glam::DVec3;

/// Tissue parts each time the cut is longer by this (m) than at the last parting: two rows of
/// elements of an appendix. Each parting sets up the solver again.
const ADVANCE: f64 = 0.003;

impl Cell {
    /// Applies the cut that the cutter of arm `k` has made in the frame.
    pub(super) fn cut(&mut self, k: usize, sheared: &Sheared, events: &mut Vec<CellEvent>) -> Result<()> {
        let Some(bite) = &self.arms[k].state.bite else { return Ok(()) };
        let (organ, work_mj, force_peak_n) = (bite.organ, 1e3 * bite.work, bite.force_peak);
        if self.sever {
            self.part(k, organ, sheared)?;
        }
        let arm = &mut self.arms[k];
        // A cut that separates no further faces of elements is not reported again.
        let parts = arm.state.parting.as_ref().is_none_or(|p| p.told != Some(p.figures.faces));
        if sheared.told && parts {
            let closed_rad = arm.state.gripper.jaw_angle;
            let figures = |parting: &Parting| {
                Box::new(Severance { work_mj, force_peak_n, closed_rad, ..parting.figures.clone() })
            };
            let parted = arm.state.parting.as_ref().map(figures);
            arm.state.parting.iter_mut().for_each(|parting| parting.told = Some(parting.figures.faces));
            events.push(CellEvent::Cut {
                arm: arm.model.side,
                organ: self.world.model.bodies()[organ].name().to_owned(),
                pieces: parted.as_ref().map_or(1, |parted| parted.pieces.len().max(1)),
                work_mj,
                force_peak_n,
                parted,
            });
        }
        if sheared.ends {
            (arm.state.bite, arm.state.parting) = (None, None);
        }
        Ok(())
    }

    /// Parts the tissue of body `organ` as far as the blades of arm `k` have come, if that is
    /// farther than before.
    fn part(&mut self, k: usize, organ: usize, sheared: &Sheared) -> Result<()> {
        let length = self.arms[k].model.blades.length;
        let parting = self.arms[k].state.parting.take().filter(|parting| parting.is_of(&self.world));
        let mut parting = match parting {
            Some(parting) => parting,
            None => Parting::new(&self.world, organ, &sheared.open, length)?,
        };
        let ([from, to], [was_from, was_to]) = (sheared.part, parting.part);
        let longer =
            if parting.part == sheared.part { 0.0 } else { (was_from - from).max(0.0) + (to - was_to).max(0.0) };
        if longer >= ADVANCE || sheared.told && longer > 0.0 {
            parting.part = sheared.part;
            let middle = 0.5 * (JAW_REGION_BEGIN + length);
            let was: Vec<DVec3> = self.arms.iter().map(|s| s.held_now(&self.world)).collect();
            let volumes = parting.volumes(&self.world);
            let cut = sheared.open.cut_along(organ, length);
            let pieces = self.world.sever_part(&cut, [from - middle, to - middle], &parting.sides())?;
            self.solids.pinned = PinnedSurface::felt(&self.world, self.contact);
            for (arm, was) in self.arms.iter_mut().zip(was) {
                if arm.holds(organ) && !pieces.is_empty() {
                    arm.follow_cut(&self.world, &pieces, was);
                }
            }
            let held: Vec<(usize, usize)> = self.arms.iter().filter_map(ArmUnit::held_nodes).collect();
            parting.follow(&self.world, &pieces, &volumes, &held);
        }
        self.arms[k].state.parting = Some(parting);
        Ok(())
    }
}
