//! The report of a step of the cell: observations of arms and tissue, and events.

use super::rule_counts::RuleCounts;
use super::setpoint::Setpoint;
use crate::severance::Severance;
use glam::DVec3;
use serde::Serialize;
use trocar_core::Pose;
use trocar_core::Wrench;
use trocar_robot::wrench::ForceKind;
use trocar_scene::Side;
use trocar_tissue::{Divergence, StepReport};

/// A force with its kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaggedForce {
    /// Contact, or the constraint of a latched grasp.
    pub kind: ForceKind,
    /// Force and torque; [`ArmObservation`] and [`crate::Cell::measured_cf`] say in which frame.
    pub wrench: Wrench,
}

/// The measurements of one arm at the end of a control period.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmObservation {
    /// Which arm.
    pub side: Side,
    /// Measured numbers, in the order of an action of absolute targets.
    pub measured: Setpoint,
    /// Their rates (1/s).
    pub rates: [f64; 5],
    /// Measured pose of the tip frame in the cell.
    pub tip: Pose,
    /// RCM deviation (m): from the port's centre to the shaft's axis, in the port's plane.
    pub rcm_deviation: f64,
    /// Largest RCM deviation over the period's physics steps (m).
    pub rcm_peak: f64,
    /// The peak is beyond the scene's threshold (3 mm).
    pub rcm_over_threshold: bool,
    /// The peak is beyond the deviation at which hardware stops (5 mm).
    pub rcm_over_abort: bool,
    /// Angle between shaft and port normal (rad).
    pub tilt: f64,
    /// The command for the end of the period.
    pub commanded: Setpoint,
    /// The rejected part of the wanted orientation: axis times angle (rad) in the cell, from the
    /// commanded to the wanted one.
    pub rejected_rotation: DVec3,
    /// Whether the command stops short of the request: it was too far for one period, below the
    /// cell's floor, or against a force near the limit.
    pub held_back: bool,
    /// Whether the force guard was the reason: the scene's `safety.force_limit_n` shortened or
    /// reversed the last command.
    pub guarded: bool,
    /// The wrench of tissue on the instrument, about the tip, in the cell frame: the constraint
    /// force of a latched grasp, otherwise contact.
    pub force: TaggedForce,
    /// Contact force on shaft and blades (N), whether a grasp is latched or not.
    pub contact: DVec3,
    /// Constraint force of a latched grasp (N).
    pub constraint: DVec3,
    /// Force of solids (N) at the end of the period, mean over its last frame of tissue: the other
    /// instrument, the bed, tissue that cannot move.
    pub solid: DVec3,
    /// Largest magnitude of that force in a physics step of the period (N).
    pub solid_peak: f64,
    /// Force with which tissue pushes the blades apart (N): the mean of the contact forces on both,
    /// and that of cutting.
    pub jaw_force: f64,
    /// Force with which contact pushes each blade outwards (N): the one that opens towards +y of
    /// the tip frame, and the one towards -y.
    pub blade_forces: [f64; 2],
    /// Whether the load of tissue was above the limit of the arm and was cut off there.
    pub load_limited: bool,
    /// Whether the jaws hold tissue.
    pub attached: bool,
}

/// Measures of the tissue: privileged, not for policies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TissueObservation {
    /// Largest node speed at the end (m/s).
    pub max_speed: f64,
    /// Most inverted elements in any frame.
    pub inverted: usize,
    /// Smallest element volume over its rest volume in any frame.
    pub min_volume_ratio: f64,
    /// Substeps in which held nodes could not follow the jaws.
    pub yielded_substeps: usize,
    /// Substeps in which the solver fell back to sweeps.
    pub fallbacks: usize,
    /// Why the tissue's numbers are invalid, if they are.
    pub divergence: Option<Divergence>,
}

impl Default for TissueObservation {
    fn default() -> Self {
        Self {
            max_speed: 0.0,
            inverted: 0,
            min_volume_ratio: f64::INFINITY,
            yielded_substeps: 0,
            fallbacks: 0,
            divergence: None,
        }
    }
}

impl TissueObservation {
    /// Adds a frame.
    pub(super) fn add(&mut self, report: &StepReport) {
        self.max_speed = report.max_speed;
        self.inverted = self.inverted.max(report.inverted);
        self.min_volume_ratio = self.min_volume_ratio.min(report.min_volume_ratio);
        self.yielded_substeps += report.grasp_limited;
        self.fallbacks += report.fallbacks;
        self.divergence = self.divergence.or(report.divergence);
    }
}

/// An event in a control period.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
pub enum CellEvent {
    /// Jaws closed on tissue and hold it.
    Attached {
        /// The arm.
        arm: Side,
        /// Name of the organ.
        organ: String,
        /// Organ coordinate of the attached cluster.
        s: f64,
        /// Nodes that the grasp holds; 0 for friction.
        nodes: usize,
        /// Largest distance between where the grasp first prescribes a node and where it was (mm).
        snap_mm: f64,
        /// Mean of that distance over the nodes (mm).
        snap_mean_mm: f64,
        /// Mean distance of the nodes from their places at rest (mm).
        displaced_mm: f64,
        /// Gap between the blades in the middle of that tissue (mm).
        gap_mm: f64,
        /// Force with which tissue pushed the blades apart (N).
        closing_force_n: f64,
    },
    /// The jaws opened, or they no longer have tissue between them.
    Released {
        /// The arm.
        arm: Side,
    },
    /// Held tissue began to slide through the jaws.
    Slipped {
        /// The arm.
        arm: Side,
    },
    /// Held tissue tore out of the jaws.
    Torn {
        /// The arm.
        arm: Side,
        /// Pull at which it tore (N).
        force_n: f64,
    },
    /// A cutter has closed through tissue as far as it gets: through all of it, to the scene's
    /// gate, or until it opens again.
    Cut {
        /// The arm.
        arm: Side,
        /// Name of the organ.
        organ: String,
        /// Number of pieces of the organ now; 1 in scenes that do not sever.
        pieces: usize,
        /// Work of the jaws since they began to close through it (mJ).
        work_mj: f64,
        /// The largest force of tissue on the blades since then, at their middle (N).
        force_peak_n: f64,
        /// Figures of the cut, in scenes that sever.
        #[serde(skip_serializing_if = "Option::is_none")]
        parted: Option<Box<Severance>>,
    },
    /// The instrument has punctured an organ: it came through the surface after it had pressed on
    /// it with at least the scene's `safety.puncture_force_n`. Around the hole, it has no contact
    /// with the organ until it is out.
    Punctured {
        /// The arm.
        arm: Side,
        /// Name of the organ.
        organ: String,
        /// Organ coordinate of the hole.
        s: f64,
        /// Where the instrument's axis is inside the organ, in the cell (mm).
        at_mm: [f64; 3],
        /// The largest force with which it pressed on the organ in the last 0.1 s (N).
        force_n: f64,
    },
    /// The axis of the instrument came into an organ that its jaws do not hold, with less force
    /// than a puncture needs.
    Pierced {
        /// The arm.
        arm: Side,
        /// Name of the organ.
        organ: String,
    },
    /// The instrument strained tissue beyond what tissue withstands. It is reported once until the
    /// organ has recovered.
    Overstretched {
        /// The arm.
        arm: Side,
        /// Name of the organ.
        organ: String,
        /// Length of its most stretched edge over that at rest.
        stretch: f64,
        /// Least volume of an element over that at rest.
        volume: f64,
    },
    /// An organ stays strained with no instrument near it.
    Folded {
        /// Name of the organ.
        organ: String,
        /// Length of its most stretched edge over that at rest.
        stretch: f64,
        /// Least volume of an element over that at rest.
        volume: f64,
    },
    /// Tissue and solids pushed the instrument with more than the scene's limit; the instrument
    /// retracts.
    ForceLimit {
        /// The arm.
        arm: Side,
        /// The force (N).
        force_n: f64,
    },
    /// The instruments touch, and push each other.
    InstrumentsTouch {
        /// By how much they yield (mm).
        depth_mm: f64,
    },
    /// The RCM deviation went beyond the scene's threshold.
    RcmThreshold {
        /// The arm.
        arm: Side,
        /// The deviation (mm).
        deviation_mm: f64,
    },
    /// The RCM deviation went beyond the limit at which the hardware stops.
    RcmAbort {
        /// The arm.
        arm: Side,
        /// The deviation (mm).
        deviation_mm: f64,
    },
}

impl std::fmt::Display for CellEvent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Attached { arm, organ, s, nodes, snap_mm, .. } => write!(
                f,
                "the {} jaws took hold of the {organ} at s = {s:.2}: {nodes} nodes, a snap of {snap_mm:.2} mm",
                arm.name()
            ),
            Self::Released { arm } => write!(f, "the {} jaws let go", arm.name()),
            Self::Slipped { arm } => write!(f, "tissue began to slide through the {} jaws", arm.name()),
            Self::Torn { arm, force_n } => {
                write!(f, "tissue tore out of the {} jaws at {force_n:.2} N", arm.name())
            }
            Self::Cut { arm, organ, pieces, work_mj, .. } => {
                let into = if *pieces == 1 { "without parting it".to_owned() } else { format!("into {pieces} pieces") };
                write!(f, "the {} blades cut the {organ} with {work_mj:.1} mJ, {into}", arm.name())
            }
            Self::Punctured { arm, organ, s, force_n, .. } => {
                write!(f, "the {} instrument punctured the {organ} at s = {s:.2} with {force_n:.1} N", arm.name())
            }
            Self::Pierced { arm, organ } => write!(f, "the {} instrument has pierced the {organ}", arm.name()),
            Self::Overstretched { arm, organ, stretch, volume } => write!(
                f,
                "the {} instrument strains the {organ} beyond what tissue withstands (stretch {stretch:.1}, smallest element {:.1}% of its volume)",
                arm.name(),
                1e2 * volume
            ),
            Self::Folded { organ, stretch, volume } => write!(
                f,
                "the {organ} stays strained with no instrument at it (stretch {stretch:.1}, smallest element {:.1}% of its volume)",
                1e2 * volume
            ),
            Self::InstrumentsTouch { depth_mm } => write!(f, "the instruments touch; they yield by {depth_mm:.2} mm"),
            Self::ForceLimit { arm, force_n } => {
                write!(f, "the {} instrument is pushed with {force_n:.1} N, beyond the limit", arm.name())
            }
            Self::RcmThreshold { arm, deviation_mm } => {
                write!(f, "the {} RCM deviation of {deviation_mm:.2} mm is beyond the threshold", arm.name())
            }
            Self::RcmAbort { arm, deviation_mm } => {
                write!(f, "the {} RCM deviation of {deviation_mm:.2} mm is where hardware stops", arm.name())
            }
        }
    }
}

/// The record of a control period while it runs.
#[derive(Debug, Default)]
pub(super) struct PeriodLog {
    pub events: Vec<CellEvent>,
    pub tissue: TissueObservation,
    pub rules: RuleCounts,
    /// Largest motion of a node in the first frame of a grasp (m).
    pub activation_step: f64,
}

/// The report of a control period.
#[derive(Clone, Debug, PartialEq)]
pub struct CellReport {
    /// Time at its end (s).
    pub time: f64,
    /// The arms, the left one first.
    pub arms: Vec<ArmObservation>,
    /// Gap between the two instruments at its end (m): negative where they press on each other, by
    /// as much as they yield.
    pub clearance: f64,
    /// The tissue.
    pub tissue: TissueObservation,
    /// The events, in order.
    pub events: Vec<CellEvent>,
    /// How often each safety rule acted.
    pub rules: RuleCounts,
    /// Largest motion of a node in the first frame of a grasp (m); 0 without a new grasp.
    pub activation_step: f64,
}
