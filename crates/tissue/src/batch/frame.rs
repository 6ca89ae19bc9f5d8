//! A frame of sixteen instances: its substeps, one after the other.

use super::group::Group;
use super::search::{Ends, Outcome, Scratch, substep};
use super::topology::{ModulusFactor, Topology};
use crate::registers::{BLOCK, parts};
use fearless_simd::{Level, Simd, dispatch};
use trocar_core::Pose;

/// What a lane did in a frame.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LaneReport {
    pub rounds: usize,
    pub unconverged: usize,
    pub damaged: bool,
}

/// How a frame is stepped.
#[derive(Clone, Copy, Debug)]
pub(super) struct Schedule {
    pub substeps: usize,
    /// Length of a substep (s).
    pub h: f64,
    pub ends: Ends,
}

impl Group {
    /// Advances all lanes by a frame. `tool` is where a lane's tool is when a share of the frame is
    /// over, in the organ's frame.
    pub fn step(
        &mut self,
        level: Level,
        topology: &Topology,
        factor: &ModulusFactor,
        schedule: &Schedule,
        scratch: &mut Scratch,
        tool: impl Fn(usize, f64) -> Pose,
    ) -> [LaneReport; BLOCK] {
        let mut reports = [LaneReport::default(); BLOCK];
        for number in 1..=schedule.substeps {
            let share = number as f64 / schedule.substeps as f64;
            for lane in (0..self.members).filter(|lane| self.grasps.holds(*lane)).collect::<Vec<_>>() {
                self.grasps.carry(lane, &tool(lane, share), topology.cell);
            }
            let idle = self.idle();
            let outcomes = dispatch!(level, simd => self.substep(simd, topology, factor, schedule, scratch));
            for (lane, report) in reports.iter_mut().enumerate().take(self.members) {
                let lanes = BLOCK / outcomes.1;
                let (outcome, bit) = (&outcomes.0[lane / lanes], 1u16 << (lane % lanes));
                report.rounds += usize::from(outcome.rounds[lane % lanes]);
                report.damaged |= outcome.damaged & bit != 0 || idle >> lane & 1 == 1;
                report.unconverged += usize::from(outcome.converged & bit == 0);
            }
        }
        reports
    }

    /// A substep of all parts; with their number.
    #[inline(always)]
    fn substep<S: Simd>(
        &mut self,
        simd: S,
        topology: &Topology,
        factor: &ModulusFactor,
        schedule: &Schedule,
        scratch: &mut Scratch,
    ) -> ([Outcome; 4], usize) {
        let mut outcomes = [Outcome::default(); 4];
        for part in 0..parts::<S>() {
            let (h, ends) = (schedule.h as f32, schedule.ends);
            outcomes[part] = substep(simd, topology, factor, (&mut *self, &mut *scratch), (h, ends), part);
        }
        (outcomes, parts::<S>())
    }
}
