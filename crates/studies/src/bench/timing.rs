//! Wall times of frames of a scene.

use crate::Result;
use crate::scenes::{FRAME, Run};
use crate::statistics::median;
use serde::Serialize;
use std::time::Instant;
use trocar_core::Progress;
use trocar_workflow::check_interrupted;

/// Wall times of frames.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Timing {
    /// Median wall time of a frame (ms).
    pub frame_ms_median: f64,
    /// Mean wall time of a frame (ms).
    pub frame_ms_mean: f64,
    /// The slowest frame (ms).
    pub frame_ms_worst: f64,
    /// 1/60 s over the median wall time of a frame.
    pub real_time_factor: f64,
    /// Number of timed frames.
    pub frames: usize,
    /// Largest number of inverted elements after any frame, warm-up included.
    pub inverted: usize,
    /// Substeps in which a grasp yielded.
    pub yielded_substeps: usize,
    /// Iterations per frame, over all bodies and substeps.
    pub iterations_per_frame: f64,
    /// Substeps in which a body fell back to sweeps.
    pub fallbacks: usize,
}

impl Timing {
    /// Steps `warm_up` frames, then times `frames`; stops early after `seconds` of wall time (at
    /// least 3 timed frames).
    ///
    /// # Errors
    /// A scene that diverges, an interruption.
    pub fn of(run: &mut Run<'_>, warm_up: usize, frames: usize, seconds: f64, progress: &dyn Progress) -> Result<Self> {
        let mut timing = Self::default();
        let mut times = Vec::with_capacity(frames);
        let mut iterations = 0;
        let whole = Instant::now();
        for frame in 0..warm_up + frames {
            check_interrupted(progress)?;
            let clock = Instant::now();
            let report = run.frame()?;
            let took = clock.elapsed().as_secs_f64();
            progress.advance(1);
            timing.inverted = timing.inverted.max(report.inverted);
            timing.yielded_substeps += report.grasp_limited;
            timing.fallbacks += report.fallbacks;
            if frame >= warm_up {
                times.push(took);
                iterations += report.iterations;
            }
            if times.len() >= 3 && whole.elapsed().as_secs_f64() > seconds {
                break;
            }
        }
        let count = times.len().max(1) as f64;
        timing.frame_ms_mean = 1e3 * times.iter().sum::<f64>() / count;
        let median = median(&mut times);
        timing.frames = times.len();
        timing.frame_ms_median = 1e3 * median;
        timing.frame_ms_worst = 1e3 * times.last().copied().unwrap_or(f64::NAN);
        timing.real_time_factor = FRAME / median;
        timing.iterations_per_frame = iterations as f64 / count;
        Ok(timing)
    }
}
