//! What a grasp-lift is measured by. Words as in the specification: lift, follow ratio, slip, snap,
//! held, settled.

use crate::blades::FRICTION;
use crate::{GraspDesign, Severance};
use serde::Serialize;

/// What was measured in one frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sample {
    /// Time at the end of the frame [s].
    pub time_s: f64,
    /// Phase: settle, approach, close, lift, hold, lower, open; with a cut reach, snip, carry, keep
    /// instead of the last two.
    pub phase: &'static str,
    /// Rise of the jaw since activation [mm].
    pub jaw_lift_mm: f64,
    /// Rise of the grasped cluster's centroid since activation [mm].
    pub tissue_lift_mm: f64,
    /// Distance of the centroid in the jaw frame from where it was at activation [mm].
    pub slip_mm: f64,
    /// Angle between the blades [degrees].
    pub jaw_angle_deg: f64,
    /// Force with which tissue pushes the blades apart [N]: contact.
    pub jaw_force_n: f64,
    /// Contact force on gripper and blades together [N].
    pub contact_n: f64,
    /// Pull of the held nodes at the gripper [N]: constraint.
    pub constraint_n: f64,
    /// Largest node speed over all organs [m/s].
    pub max_speed_m_s: f64,
    /// Inverted elements over all organs.
    pub inverted: usize,
    /// Smallest element volume over its rest volume.
    pub min_volume_ratio: f64,
}

/// A run in figures.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// Organ grasped.
    pub organ: String,
    /// Organ coordinate of the grasped cluster.
    pub at: f64,
    /// Name of the grasp design.
    pub design: &'static str,
    /// Force that the jaws may use [N].
    pub jaw_force_n: f64,
    /// How far beside the tissue's middle the gripper came [mm].
    pub approach_offset_mm: f64,
    /// Tissue was between the blades when they had closed.
    pub attached: bool,
    /// Gap between the blades then, in the middle of that tissue [mm].
    pub gap_mm: f64,
    /// Force with which tissue pushed the blades apart then [N].
    pub closing_force_n: f64,
    /// Weight of the whole organ [N].
    pub organ_weight_n: f64,
    /// Nodes held.
    pub held_nodes: usize,
    /// Rise of the cluster's centroid from activation to the end of the hold [mm].
    pub lift_mm: f64,
    /// Tissue lift over jaw lift.
    pub follow_ratio: f64,
    /// Slip at the end of the hold [mm].
    pub slip_mm: f64,
    /// Substeps in which held nodes could not follow the jaws without inverting or overstretching
    /// an element: the grasp yields.
    pub yielded_substeps: usize,
    /// Largest distance between where the constraint first prescribes a node and where it was [mm].
    pub snap_mm: f64,
    /// Mean of that distance over the nodes [mm].
    pub snap_mean_mm: f64,
    /// Mean distance of the grasped nodes from their places at rest when the jaws had closed [mm].
    pub displaced_mm: f64,
    /// Largest pull of held nodes at the gripper in any frame [N]: constraint.
    pub peak_constraint_n: f64,
    /// Largest contact force on gripper and blades in any frame [N].
    pub peak_contact_n: f64,
    /// Frames in which held tissue began to slide through the jaws.
    pub slipped: usize,
    /// The tissue tore out of the jaws.
    pub torn: bool,
    /// Largest motion of any node in the frame of activation [mm].
    pub activation_step_mm: f64,
    /// Follow ratio at least 0.80 and slip under 3 mm.
    pub held: bool,
    /// Inverted elements at rest, before the first step.
    pub inverted_rest: usize,
    /// Largest number of inverted elements in any frame.
    pub inverted_peak: usize,
    /// Smallest element volume over its rest volume in any frame.
    pub min_volume_ratio: f64,
    /// Largest node speed in any frame [m/s].
    pub peak_speed_m_s: f64,
    /// Largest node speed one second after release, before anything is calmed [m/s].
    pub settled_speed_m_s: f64,
    /// Settled by itself: that speed is below 0.01 m/s.
    pub settled: bool,
    /// How long organs that had not settled were calmed by kinetic damping before the grasp [s].
    pub calmed_s: f64,
    /// Largest node speed when the gripper sets out [m/s].
    pub resting_speed_m_s: f64,
    /// Largest motion of a pinned node over the run [mm].
    pub pin_drift_mm: f64,
    /// The run diverged.
    pub diverged: bool,
    /// Why, if it did.
    pub divergence: Option<String>,
    /// Simulated time [s].
    pub simulated_s: f64,
    /// Wall time of the stepping [s].
    pub wall_s: f64,
    /// Simulated over wall time.
    pub real_time_factor: f64,
    /// Hash of the final state, hexadecimal.
    pub state_hash: String,
    /// The cut, where one was asked for and the run came so far.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sever: Option<Severance>,
}

impl Summary {
    /// For a grasp that pressed and yet did not hold: a sentence on the jaw force that would bear
    /// the organ's weight. None for one that held, and for designs that tie nodes, which no force
    /// of the jaws makes hold.
    pub fn force_advice(&self) -> Option<String> {
        let presses = [GraspDesign::Friction, GraspDesign::Compliant].iter().any(|d| d.name() == self.design);
        if self.held || self.diverged || !self.attached || self.torn || !presses || self.lift_mm <= 0.0 {
            return None;
        }
        let (bears, weight) = (2.0 * FRICTION * self.jaw_force_n, self.organ_weight_n);
        let needs = weight / (2.0 * FRICTION);
        Some(if needs > self.jaw_force_n {
            // Rounded up, so that what is named is enough.
            let force = (20.0 * needs).ceil() / 20.0;
            format!(
                "it slipped: the {} weighs {weight:.2} N and jaws of {} N bear 2 x {FRICTION} x {} = {bears:.2} N; --jaw-force {force:.2} or more bears its weight (and what its pins pull comes on top)",
                self.organ, self.jaw_force_n, self.jaw_force_n
            )
        } else {
            format!(
                "it slipped: jaws of {} N bear 2 x {FRICTION} x {} = {bears:.2} N, more than the {}'s weight of {weight:.2} N, so its pins hold it back; lift less, grasp farther from the pins, or raise --jaw-force",
                self.jaw_force_n, self.jaw_force_n, self.organ
            )
        })
    }
}

/// Least share of the jaw's lift that held tissue follows.
pub(crate) const HELD_FOLLOW_RATIO: f64 = 0.80;
/// Most slip of held tissue [mm].
pub(crate) const HELD_SLIP_MM: f64 = 3.0;
/// Node speed below which tissue is settled [m/s].
pub(crate) const SETTLED_SPEED: f64 = 0.01;
