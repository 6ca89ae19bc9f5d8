//! The figures of the controller grid.

use super::motion::{ControllerFigures, ControllerInstant};
use crate::trials::Resumed;
use serde::{Deserialize, Serialize};

/// The chosen configuration is better than the limits by this share of them.
pub(super) const MARGIN: f64 = 0.2;

/// The paper's figures for its chosen controller (section VI-A), which are the bars.
pub(super) const BARS: ControllerBars = ControllerBars { rcm_p95_mm: 0.34, tracking_rms_mm: 0.048, droop_mm: 0.26 };

/// Figures that a controller must not exceed.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ControllerBars {
    /// RCM deviation that 95% of all steps stay below (mm).
    pub rcm_p95_mm: f64,
    /// Tracking in free motion, RMS (mm).
    pub tracking_rms_mm: f64,
    /// Droop at rest (mm).
    pub droop_mm: f64,
}

/// One configuration and what it came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControllerRow {
    /// The law by name.
    pub controller: String,
    /// Bandwidth of the error (rad/s).
    pub bandwidth: f64,
    /// Damping ratio.
    pub damping: f64,
    /// Bandwidth of the integral action (rad/s), where the law has it.
    pub integral: Option<f64>,
    /// Bandwidth of the disturbance observer (rad/s), where the law has it.
    pub observer: Option<f64>,
    /// Its figures.
    #[serde(flatten)]
    pub figures: ControllerFigures,
}

impl ControllerRow {
    /// The greatest of its figures as a share of its bar; infinite where it is not stable.
    pub fn share_of_bars(&self) -> f64 {
        let f = &self.figures;
        let shares =
            [f.rcm_p95_mm / BARS.rcm_p95_mm, f.tracking_rms_mm / BARS.tracking_rms_mm, f.droop_mm / BARS.droop_mm];
        if f.stable { shares.into_iter().fold(0.0, f64::max) } else { f64::INFINITY }
    }
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct ControllerGridResult {
    /// All configurations.
    pub rows: Vec<ControllerRow>,
    /// The chosen one: of those that have a fifth of every bar in hand the one of the least
    /// bandwidth, and of these the best; none where no configuration has.
    pub chosen: Option<ControllerRow>,
    /// The chosen one with the FR3's own friction in place of the grid's.
    pub chosen_with_own_friction: Option<ControllerFigures>,
    /// Whether the program's default controller is the chosen one.
    pub chosen_is_default: bool,
    /// The paper's figures.
    pub bars: ControllerBars,
    /// How many configurations are stable, and how many of them meet all bars.
    pub stable: usize,
    /// Those that meet all bars.
    pub within_bars: usize,
    /// The left arm under the chosen controller.
    pub trace: Vec<ControllerInstant>,
    /// The same with the same gains without observer or integral action.
    pub plain_trace: Vec<ControllerInstant>,
    /// Configurations that an earlier run had finished.
    pub resumed: Resumed,
    /// Wall time (s).
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}
