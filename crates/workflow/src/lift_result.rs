//! The result of a lift.

use crate::recorder::Pictures;
use serde::Serialize;
use trocar_task::{EpisodeResult, Recording};

/// The figures of a lift.
#[derive(Clone, Debug, Serialize)]
pub struct LiftResult {
    /// The episode's figures and events.
    #[serde(flatten)]
    pub episode: EpisodeResult,
    /// Organ coordinate of the grasp; without a grasp, the commanded one.
    pub at: f64,
    /// Commanded distance of the jaws from the organ's axis (mm).
    pub approach_offset_mm: f64,
    /// Simulated time (s).
    pub simulated_s: f64,
    /// Wall time of the episode (s), without pictures.
    pub wall_s: f64,
    /// Simulated time over wall time.
    pub real_time_factor: f64,
    /// The page's path.
    pub report: String,
}

/// A finished lift with its recording and pictures.
pub(crate) struct FinishedLift {
    pub result: LiftResult,
    pub recording: Recording,
    /// Phase of the script in each row of the channels.
    pub phases: Vec<&'static str>,
    pub pictures: Pictures,
}
