//! `trocar record`.

use crate::{cli::Record, output};
use serde::Serialize;
use std::time::Instant;
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_workflow::{Result, counted};

#[derive(Serialize)]
struct Recorded {
    recording: String,
    frames: usize,
    seconds: f64,
}

pub fn run(arguments: &Record, json: bool, progress: &dyn Progress) -> Result<()> {
    let clock = Instant::now();
    let options = RecordOptions { frames: arguments.frames, seed: arguments.seed, sensor: arguments.sensor.into() };
    trocar_phantom::record(&arguments.phantom, &options, &arguments.output, progress)?;
    let recorded = Recorded {
        recording: arguments.output.display().to_string(),
        frames: arguments.frames,
        seconds: clock.elapsed().as_secs_f64(),
    };
    output::print(json, &recorded, |r| {
        format!(
            "{} of {} in {} ({:.1} s); next: trocar reconstruct {} -o SPECIMEN",
            counted(r.frames, "frame"),
            arguments.phantom,
            r.recording,
            r.seconds,
            r.recording
        )
    });
    Ok(())
}
