//! A run in the cell, in figures.

use serde::Serialize;
use trocar_cell::{CellEvent, CellLiftSummary};

/// A run in the cell that was made, in figures.
#[derive(Clone, Debug, Serialize)]
pub struct CellRun {
    /// Name of the scene.
    pub scene: String,
    /// The measurements.
    #[serde(flatten)]
    pub summary: CellLiftSummary,
    /// What happened.
    pub events: Vec<TimedEvent>,
    /// The report's path.
    pub report: String,
}

/// Something that happened, and when.
#[derive(Clone, Debug, Serialize)]
pub struct TimedEvent {
    /// Time at the end of its control period [s].
    pub time_s: f64,
    /// What.
    #[serde(flatten)]
    pub event: CellEvent,
}
