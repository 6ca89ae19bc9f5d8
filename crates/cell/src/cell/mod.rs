//! The cell of a scene: tissue, and one or two arms with instruments, stepped by actions.
//!
//! A control period (1/30 s) is a number of tissue frames (1/60 s), each of them a number of
//! physics steps of the arms (1/480 s); [`period`] has its stages. Instruments push each other, the
//! bed and tissue that cannot move ([`solid`]); an event reports where instruments touch.

mod action;
mod arm;
mod build;
mod crtk;
mod delay;
mod drive;
mod exchange;
mod figures;
mod haptic_model;
mod inside;
mod link_poses;
mod period;
mod placed;
mod pressed;
mod reach;
mod report;
mod restart;
mod rule_counts;
mod rules;
mod setpoint;
mod settle;
mod shadow;
mod solid;
mod speeds;
mod start;
mod state;
mod surfaces;
mod workspace;

pub use action::{Action, ActionSpace};
pub use exchange::MAX_LOAD;
pub use figures::Carried;
pub use haptic_model::HapticModel;
pub use placed::Placed;
pub use reach::{REACH_TOLERANCE, ToolReach, tool_reach};
pub use report::{ArmObservation, CellEvent, CellReport, TaggedForce, TissueObservation};
pub use rule_counts::RuleCounts;
pub use setpoint::Setpoint;
pub use settle::Settling;
pub use shadow::Moment;
pub use speeds::{ROLL_SPEED, SWING_SPEED, TIP_SPEED};
pub use start::check_starts;
pub use state::CellState;
pub use workspace::{FreeSpace, PortSpace, Reached, Workspace};

use crate::{Error, Result, World};
use arm::ArmUnit;
use delay::{Delay, Waiting};
use rules::{Edges, OrganWatch};
use solid::{PinnedSurface, Solids};
use std::time::Duration;
use trocar_scene::Scene;
use trocar_specimen::Specimen;
use trocar_tissue::ToolMotion;

/// Frames of tissue a second (Hz).
const FRAMES_HZ: u32 = 60;

/// Wall time since the cell was built, by part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timing {
    /// The arms: controllers, ports, dynamics.
    pub arms: Duration,
    /// The tissue, contact included.
    pub tissue: Duration,
    /// Everything.
    pub all: Duration,
    /// Iterations of the tissue's solver, of all organs and substeps.
    pub iterations: usize,
}

/// Which contacts a cell has: for measuring the cost of contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ContactParts {
    /// Organs touch each other.
    pub organs: bool,
    /// Instruments touch organs, tissue that cannot move included.
    pub instruments: bool,
}

impl Default for ContactParts {
    fn default() -> Self {
        Self { organs: true, instruments: true }
    }
}

/// A cell.
///
/// ```
/// use trocar_cell::{Action, Cell};
/// # let (scene, specimen) = (trocar_testing::tube::resection(), trocar_testing::tube::meshed(trocar_testing::tube::ONE_END, 4e-3));
///
/// let mut cell = Cell::new(&scene, &specimen, 1)?;
/// let start: Vec<_> = cell.observe().iter().map(|arm| arm.commanded).collect();
/// let mut targets = start.clone();
/// // The five numbers of an arm in a port: two pivots, insertion, roll, jaw opening.
/// targets.iter_mut().for_each(|target| target.0[2] += 0.002);
/// for _ in 0..10 {
///     cell.step(&Action::targets(&targets))?;
/// }
/// assert!(cell.observe()[0].measured.0[2] > start[0].0[2] + 0.001, "the left arm went deeper");
/// # Ok::<(), trocar_cell::Error>(())
/// ```
pub struct Cell {
    world: World,
    arms: Vec<ArmUnit>,
    /// Number of completed control periods.
    periods: u64,
    control_hz: u32,
    /// Tissue frames of a control period, and physics steps of the arms in a frame.
    frames: u32,
    physics_steps: u32,
    /// The control delay, and the actions that wait.
    delay: Delay,
    waiting: Waiting,
    /// Whether cuts sever tissue.
    sever: bool,
    /// Whether the force guard sees the strain of tissue.
    strain_guard: bool,
    /// Motions of the tools in the last frame.
    motions: Vec<ToolMotion>,
    edges: Edges,
    /// Everything that instruments push, except each other.
    solids: Solids,
    /// Which contacts there are.
    contact: ContactParts,
    /// By body: frames for which it has been strained without an instrument at it.
    watches: Vec<OrganWatch>,
    /// Whether the instruments touch and that was reported.
    touch: bool,
    timing: Timing,
}

impl Cell {
    /// The cell of `scene` around `specimen`, whose tissue is stepped by `threads` threads (0: as
    /// many as the machine has). The arms are in their start poses, the organs as recorded. A start
    /// in an organ is drawn back along the shaft. Results do not depend on the threads.
    ///
    /// # Errors
    /// Names the field of the scene, or the organ, arm or instrument that cannot be used.
    pub fn new(scene: &Scene, specimen: &Specimen, threads: usize) -> Result<Self> {
        Self::with_contact(scene, specimen, threads, ContactParts::default())
    }

    /// The same with less contact: for measuring the cost of contact.
    ///
    /// # Errors
    /// As [`Cell::new`].
    pub fn with_contact(scene: &Scene, specimen: &Specimen, threads: usize, contact: ContactParts) -> Result<Self> {
        let (frames, physics_steps) = rates(scene)?;
        let placed = Placed::new(scene, specimen)?;
        start::check(scene, &placed)?;
        let Placed { specimen, mut surroundings, floor } = placed;
        let bed = surroundings.bed_friction.map(|_| floor);
        let mut arms = build::arms(scene, floor)?;
        let colliders = arms.iter().flat_map(|s| s.model.blades.colliders(s.model.tools));
        let colliders = colliders.filter(|_| contact.instruments).collect();
        if !contact.organs {
            surroundings.body_contact = None;
        }
        let schedule = build::schedule(scene.tissue.schedule);
        let world = World::surrounded(&specimen, &surroundings, colliders, schedule, threads)?;
        let solids = Solids { bed, pinned: PinnedSurface::felt(&world, contact), holes: Vec::new() };
        for arm in &mut arms {
            if !arm.is_out(&world, &solids) {
                let start = arm.state.commanded;
                arm.begin(&start, &world, &solids)?;
            }
        }
        Ok(Self {
            motions: Vec::with_capacity(3 * arms.len()),
            edges: Edges::of(&world),
            solids,
            contact,
            watches: vec![OrganWatch::default(); world.model.bodies().len()],
            touch: false,
            world,
            arms,
            periods: 0,
            control_hz: scene.rates.control_hz,
            frames,
            physics_steps,
            delay: Delay::new(1e-3 * scene.rates.control_delay_ms, scene.rates.physics_hz, frames * physics_steps),
            waiting: Waiting::default(),
            sever: scene.task.sever,
            strain_guard: scene.safety.rules.strain_guard,
            timing: Timing::default(),
        })
    }

    /// The gap between the two instruments now (m). It is negative while they press on each other:
    /// then it is the depth by which they yield.
    pub fn clearance(&self) -> f64 {
        match &self.arms[..] {
            [one, other] => solid::clearance(&one.rods(), &other.rods()),
            _ => f64::INFINITY,
        }
    }

    /// Simulated time (s).
    pub fn time(&self) -> f64 {
        self.periods as f64 / f64::from(self.control_hz)
    }

    /// Length of a control period (s).
    pub fn period(&self) -> f64 {
        1.0 / f64::from(self.control_hz)
    }

    /// Tissue frames a control period.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// The tissue, in the cell frame: privileged, not for policies.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Length of the most stretched edge of any organ over that at rest: privileged, too. It visits
    /// all edges.
    pub fn max_stretch(&mut self) -> f64 {
        self.edges.strains(&self.world, 1.0).iter().fold(1.0, |most, s| s.stretch.max(most))
    }

    /// Whether the axis of an instrument's part lies inside an organ, by arm: privileged. Held
    /// tissue, tissue that blades shear, and organs in a hole of which the instrument is do not
    /// count.
    pub fn axes_inside(&self) -> Vec<bool> {
        self.arms.iter().map(|arm| !arm.pierces(&self.world).is_empty()).collect()
    }

    /// The organs that the instrument of arm `k` has punctured and is still in, by their bodies, in
    /// the order of the punctures. Empty if the arm does not exist.
    pub fn punctured_by(&self, k: usize) -> Vec<usize> {
        let tool = self.arms.get(k).map(|arm| arm.model.tools.gripper);
        let holes = self.world.state.holes.iter().filter(|hole| tool.is_some_and(|tool| hole.tools.contains(&tool)));
        holes.map(|hole| hole.body).collect()
    }

    /// Wall time since the cell was built.
    pub fn timing(&self) -> Timing {
        self.timing
    }
}

/// Tissue frames a control period and physics steps a frame.
fn rates(scene: &Scene) -> Result<(u32, u32)> {
    let rates = scene.rates;
    let wrong = |field: &str, reason: String| Error::Scene { scene: scene.label(), field: field.into(), reason };
    if rates.control_hz == 0 || !FRAMES_HZ.is_multiple_of(rates.control_hz) {
        let reason =
            format!("is {}; it must divide {FRAMES_HZ}, tissue's frames a second: 30, 20, 60", rates.control_hz);
        return Err(wrong("rates.control_hz", reason));
    }
    if rates.physics_hz == 0 || !rates.physics_hz.is_multiple_of(FRAMES_HZ) {
        let reason = format!("is {}; a multiple of {FRAMES_HZ}, tissue's frames a second: 480, 960", rates.physics_hz);
        return Err(wrong("rates.physics_hz", reason));
    }
    Ok((FRAMES_HZ / rates.control_hz, rates.physics_hz / FRAMES_HZ))
}
