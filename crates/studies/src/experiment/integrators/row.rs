//! Figures of one integrator.

use serde::Serialize;

/// Figures of one integrator.
#[derive(Clone, Debug, Serialize)]
pub struct IntegratorRow {
    /// Name.
    pub name: &'static str,
    /// Settings.
    pub settings: String,
    /// The paper's finding.
    pub paper: &'static str,
    /// Whether it ran to the end with all nodes below the speed limit.
    pub bounded: bool,
    /// Why it ended early, if it did.
    pub event: Option<String>,
    /// Time of the frame in which it ended (s).
    pub ended_at_s: Option<f64>,
    /// Largest node speed at the end of any frame (m/s); at most the speed limit.
    pub peak_speed_m_s: f64,
    /// Largest node speed in the last frame (m/s).
    pub last_speed_m_s: f64,
    /// Mean distance of the nodes from the static equilibrium over their mean displacement in it,
    /// with positions averaged over the last third of the run; none if it diverged.
    pub sag_error: Option<f64>,
    /// Mean displacement over that of the equilibrium.
    pub sag_ratio: Option<f64>,
    /// Median wall time of a frame (ms).
    pub frame_ms: f64,
    /// Time (s) and largest node speed (m/s) of each frame.
    pub speeds: Vec<(f64, f64)>,
}
