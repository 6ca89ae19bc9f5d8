//! What is measured of one integrator.

use serde::Serialize;

/// One integrator.
#[derive(Clone, Debug, Serialize)]
pub struct IntegratorRow {
    /// Its name.
    pub name: &'static str,
    /// Its settings.
    pub settings: String,
    /// What the paper says of it.
    pub paper: &'static str,
    /// It ran to the end and no node came to the speed limit.
    pub bounded: bool,
    /// What ended it, if anything did.
    pub event: Option<String>,
    /// The time at whose frame it ended (s).
    pub ended_at_s: Option<f64>,
    /// Greatest node speed at the end of any frame (m/s); at the speed limit where it reached that.
    pub peak_speed_m_s: f64,
    /// Greatest node speed in the last frame (m/s).
    pub last_speed_m_s: f64,
    /// Mean distance of the nodes from the static equilibrium over their mean displacement in it,
    /// positions averaged over the last third of the run; none if it diverged.
    pub sag_error: Option<f64>,
    /// Mean displacement over the equilibrium's.
    pub sag_ratio: Option<f64>,
    /// Median wall time of a frame (ms).
    pub frame_ms: f64,
    /// Time (s) and greatest node speed (m/s), frame by frame.
    pub speeds: Vec<(f64, f64)>,
}
