//! The figures of the controller grid.

use super::motion::{ControllerFigures, ControllerInstant};
use crate::trials::Resumed;
use serde::{Deserialize, Serialize};

/// The chosen configuration is below every target by this share.
pub(super) const MARGIN: f64 = 0.2;

/// The paper's figures of its controller (section VI-A), which are the targets.
pub(super) const TARGETS: ControllerTargets =
    ControllerTargets { rcm_p95_mm: 0.34, tracking_rms_mm: 0.048, droop_mm: 0.26 };

/// Targets of a controller.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ControllerTargets {
    /// 95th percentile of the RCM deviation over all steps (mm).
    pub rcm_p95_mm: f64,
    /// RMS tracking error in free motion (mm).
    pub tracking_rms_mm: f64,
    /// Tracking error at rest (mm).
    pub droop_mm: f64,
}

/// One configuration and its figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControllerRow {
    /// Name of the law.
    pub controller: String,
    /// Bandwidth of the error (rad/s).
    pub bandwidth: f64,
    /// Damping ratio.
    pub damping: f64,
    /// Bandwidth of the integral action (rad/s), if the law has one.
    pub integral: Option<f64>,
    /// Bandwidth of the disturbance observer (rad/s), if the law has one.
    pub observer: Option<f64>,
    /// Figures.
    #[serde(flatten)]
    pub figures: ControllerFigures,
}

impl ControllerRow {
    /// The largest ratio of a figure to its target; infinite if unstable.
    pub fn share_of_targets(&self) -> f64 {
        let f = &self.figures;
        let shares = [
            f.rcm_p95_mm / TARGETS.rcm_p95_mm,
            f.tracking_rms_mm / TARGETS.tracking_rms_mm,
            f.droop_mm / TARGETS.droop_mm,
        ];
        if f.stable { shares.into_iter().fold(0.0, f64::max) } else { f64::INFINITY }
    }
}

/// Figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct ControllerGridResult {
    /// All configurations.
    pub rows: Vec<ControllerRow>,
    /// The chosen configuration: of those with the margin the one with the lowest bandwidth, then
    /// the best; none if no configuration has the margin.
    pub chosen: Option<ControllerRow>,
    /// The chosen controller with the FR3's own friction instead of the grid's.
    pub chosen_with_own_friction: Option<ControllerFigures>,
    /// Whether the chosen controller is the default of the program.
    pub chosen_is_default: bool,
    /// Targets: the paper's figures.
    pub bars: ControllerTargets,
    /// Number of stable configurations.
    pub stable: usize,
    /// Number of configurations that meet all targets.
    pub within_bars: usize,
    /// Run of the left arm with the chosen controller.
    pub trace: Vec<ControllerInstant>,
    /// The same with the same gains, without observer or integral action.
    pub plain_trace: Vec<ControllerInstant>,
    /// Configurations of an earlier run.
    pub resumed: Resumed,
}
