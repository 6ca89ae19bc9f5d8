//! The figures of re-grasps through arm and port.

use crate::trials::Resumed;
use serde::{Deserialize, Serialize};
use trocar_task::Warnings;

/// One re-grasp.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Regrasp {
    /// How the second grasp holds.
    pub design: String,
    /// Whether the cell's safety rules acted.
    pub rules: bool,
    /// Drag between the grasps (mm).
    pub drag_mm: f64,
    /// The jaws took hold a second time.
    pub grasped_twice: bool,
    /// Mean distance of the nodes from their places at rest at the last grasp (mm).
    pub displaced_mm: Option<f64>,
    /// Snap of the last grasp (mm).
    pub snap_mm: Option<f64>,
    /// Largest pull of held tissue on an arm (N).
    pub pull_n: f64,
    /// Largest RCM deviation of either arm after the second grasp (mm).
    pub rcm_peak_mm: f64,
    /// Control periods that were looked at: 60 if the episode lasted.
    pub steps: usize,
    /// Of these, with a deviation beyond the threshold.
    pub steps_over: usize,
    /// Largest deviation of either arm in each (mm).
    pub rcm_mm: Vec<f64>,
    /// What was beyond what tissue withstands.
    pub warnings: Warnings,
    /// Why it diverged.
    pub divergence: Option<String>,
}

/// All of them.
#[derive(Clone, Debug, Serialize)]
pub struct PortRegraspResult {
    /// Organ coordinate of the grasps.
    pub at: f64,
    /// Deviation beyond which control periods are counted (mm).
    pub threshold_mm: f64,
    /// The runs.
    pub rows: Vec<Regrasp>,
    /// How much came from an earlier run.
    pub resumed: Resumed,
}
