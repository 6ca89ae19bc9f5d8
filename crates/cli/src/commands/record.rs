//! `trocar record`.

use crate::{cli::Record, output};
use serde::Serialize;
use std::time::Instant;
use trocar_core::Progress;
use trocar_phantom::{LiftOptions, RecordOptions};
use trocar_workflow::{Result, counted};

#[derive(Serialize)]
struct Recorded {
    recording: String,
    frames: usize,
    /// Grasp-lifts after these frames.
    lifts: usize,
    seconds: f64,
}

pub fn run(arguments: &Record, json: bool, progress: &dyn Progress) -> Result<()> {
    let clock = Instant::now();
    let lifts = LiftOptions { count: arguments.lifts, support: arguments.support.into(), ..LiftOptions::default() };
    let options =
        RecordOptions { frames: arguments.frames, seed: arguments.seed, sensor: arguments.sensor.into(), lifts };
    trocar_phantom::record(&arguments.phantom, &options, &arguments.output, progress)?;
    let recorded = Recorded {
        recording: arguments.output.display().to_string(),
        frames: arguments.frames,
        lifts: arguments.lifts,
        seconds: clock.elapsed().as_secs_f64(),
    };
    output::print(json, &recorded, |r| {
        let lifts = if r.lifts > 0 { format!(" and {}", counted(r.lifts, "lift")) } else { String::new() };
        let measure = if r.lifts > 0 { format!("; trocar measure {}", r.recording) } else { String::new() };
        format!(
            "{}{lifts} of {} in {} ({:.1} s); next: trocar reconstruct {} -o SPECIMEN{measure}",
            counted(r.frames, "frame"),
            arguments.phantom,
            r.recording,
            r.seconds,
            r.recording
        )
    });
    Ok(())
}
