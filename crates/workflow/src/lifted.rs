//! A finished lift.

use crate::recorder::Pictures;
use serde::Serialize;
use trocar_task::{EpisodeResult, Recording};

/// A run that was made, in figures.
#[derive(Clone, Debug, Serialize)]
pub struct LiftResult {
    /// The episode's figures and events.
    #[serde(flatten)]
    pub episode: EpisodeResult,
    /// Organ coordinate of the grasp; that asked for where nothing was grasped.
    pub at: f64,
    /// How far beside the tissue's middle the jaws came (mm).
    pub approach_offset_mm: f64,
    /// Simulated time (s).
    pub simulated_s: f64,
    /// Wall time of the episode (s), pictures left out.
    pub wall_s: f64,
    /// Simulated over wall time.
    pub real_time_factor: f64,
    /// The page's path.
    pub report: String,
}

/// A finished lift.
pub(crate) struct Lifted {
    pub result: LiftResult,
    pub recording: Recording,
    /// Phase of the script in each row.
    pub phases: Vec<&'static str>,
    pub pictures: Pictures,
}
