//! Sixteen instances: one unit of work.

use super::grasps::Grasps;
use super::search::{Ends, Outcome, Scratch, substep};
use super::topology::{ModulusFactor, Topology};
use crate::registers::{BLOCK, Block, parts};
use fearless_simd::{Level, Simd, dispatch};
use trocar_core::Pose;

/// The state of sixteen instances, one in each lane. Lanes without an instance are at rest.
pub(super) struct Group {
    /// The factor that serves all of them.
    pub factor: usize,
    /// Number of its instances: those of the first lanes.
    pub members: usize,
    /// Displacements of the nodes (cells), and velocities (cells/s).
    pub u: Vec<[Block<f32>; 3]>,
    pub v: Vec<[Block<f32>; 3]>,
    /// One over the square of the substep, Young's modulus and the edge of a cell (1/kg).
    pub inertia: Block<f32>,
    /// Gravity (cells/s2).
    pub gravity: [Block<f32>; 3],
    pub grasps: Grasps,
}

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
    /// At rest, without instances.
    pub fn new(factor: usize, count: usize) -> Self {
        let zero = [Block([0.0; BLOCK]); 3];
        Self {
            factor,
            members: 0,
            u: vec![zero; count],
            v: vec![zero; count],
            inertia: Block([1.0; BLOCK]),
            gravity: zero,
            grasps: Grasps::new(),
        }
    }

    /// Bits of the lanes that stay as they are.
    pub fn idle(&self) -> u16 {
        let stays = |lane: usize| lane >= self.members || !self.grasps.is_sound(lane);
        (0..BLOCK).filter(|lane| stays(*lane)).fold(0, |bits, lane| bits | 1 << lane)
    }

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
