//! The grasp-lift task: settle, approach, close, lift 15 mm in 1 s, hold 1 s, lower, open.

use crate::{Gripper, Result};
use glam::DVec3;
use serde::Serialize;
use trocar_progress::Progress;
use trocar_specimen::Specimen;

/// How the task is run.
#[derive(Clone, Debug, PartialEq)]
pub struct GraspLift {
    /// Organ to grasp; the appendix if there is one, else the first, when `None`.
    pub organ: Option<String>,
    /// Organ coordinate of the grasp, 0 to 1.
    pub at: f64,
    /// Jaw lift [m].
    pub lift: f64,
    /// Worker threads, 0 for all.
    pub threads: usize,
    /// Keep a snapshot every this many frames, for the moving picture; 0 for none.
    pub snapshot_every: usize,
}

impl Default for GraspLift {
    fn default() -> Self {
        Self { organ: None, at: 0.5, lift: 0.015, threads: 0, snapshot_every: 0 }
    }
}

/// What was measured in one frame of 1/60 s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sample {
    /// Time [s].
    pub time_s: f64,
    /// Phase: settle, approach, close, lift, hold, lower, open, recover.
    pub phase: &'static str,
    /// Rise of the jaw since activation [mm].
    pub jaw_lift_mm: f64,
    /// Rise of the grasped cluster's centroid since activation [mm].
    pub tissue_lift_mm: f64,
    /// Distance of the centroid in the jaw frame from where it was at activation [mm].
    pub slip_mm: f64,
    /// Largest node speed over all organs [m/s].
    pub max_speed_m_s: f64,
    /// Inverted elements over all organs.
    pub inverted: usize,
    /// Smallest element volume over its rest volume.
    pub min_volume_ratio: f64,
}

/// Shapes at one instant, for pictures.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Time [s].
    pub time_s: f64,
    /// Node positions of each organ [m].
    pub nodes: Vec<Vec<DVec3>>,
    /// The gripper.
    pub gripper: Gripper,
}

/// The run in figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Organ grasped.
    pub organ: String,
    /// Organ coordinate of the grasped cluster's centroid.
    pub at: f64,
    /// Nodes held.
    pub held_nodes: usize,
    /// Rise of the cluster's centroid from activation to the end of the hold [mm].
    pub lift_mm: f64,
    /// Tissue lift over jaw lift.
    pub follow_ratio: f64,
    /// Slip at the end of the hold [mm].
    pub slip_mm: f64,
    /// Largest distance between where the constraint first prescribes a node and where it was [mm].
    pub snap_mm: f64,
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
    /// Largest node speed at the end of settling [m/s].
    pub settled_speed_m_s: f64,
    /// Largest motion of a pinned node [mm].
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
    /// Hash of the final state.
    pub state_hash: String,
}

/// A finished run.
#[derive(Clone, Debug)]
pub struct GraspLiftRun {
    /// In figures.
    pub summary: Summary,
    /// Frame by frame.
    pub samples: Vec<Sample>,
    /// Shapes, if asked for.
    pub snapshots: Vec<Snapshot>,
}

impl GraspLift {
    /// Runs the task on `specimen`.
    pub fn run(&self, specimen: &Specimen, progress: &dyn Progress) -> Result<GraspLiftRun> {
        let _ = (specimen, progress);
        todo!()
    }
}
