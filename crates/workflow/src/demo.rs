//! The demonstration: record, reconstruct, grasp-lift and report in a row.

use crate::lift::Lift;
use crate::lifted::LiftResult;
use crate::workflow::{Reconstructed, reconstruct_recording};
use crate::{Result, pages};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_reconstruct::Settings;

/// How the demonstration is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Demo {
    /// Frames of the recording.
    pub frames: usize,
    /// Seed of the anatomy and the noise.
    pub seed: u64,
    /// Worker threads of the simulation, 0 for all.
    pub threads: usize,
}

/// The demonstration in figures.
#[derive(Clone, Debug, Serialize)]
pub struct DemoResult {
    /// Number of organs.
    pub organs: usize,
    /// How many of their surfaces close.
    pub watertight: usize,
    /// The grasp-lift (inverted_rest, lift_mm, slip_mm, snap_mm, inverted_peak, diverged, ...).
    #[serde(flatten)]
    pub lift: LiftResult,
    /// The reconstruction.
    pub reconstructed: Reconstructed,
    /// Wall time of everything [s].
    pub seconds: f64,
}

impl Demo {
    /// Runs everything into the folder `output`: `recording/`, `specimen/` and `run/`, the last with the whole report.
    ///
    /// # Errors
    /// When the folder cannot be written, or it holds something that is not an earlier demonstration.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<DemoResult> {
        let clock = Instant::now();
        let [recording, specimen, run] = ["recording", "specimen", "run"].map(|name| output.join(name));
        let options = RecordOptions { frames: self.frames, seed: self.seed, ..RecordOptions::default() };
        trocar_phantom::record("phantom-a", &options, &recording, progress)?;
        let (reconstructed, reconstruction) =
            reconstruct_recording(&recording, &Settings::default(), &specimen, progress)?;
        let before = pages::reconstruction_sections(&reconstruction)?;
        let lift = Lift { threads: self.threads, ..Lift::default() };
        let lifted = lift.write_specimen(&reconstruction.specimen, &specimen, Some(&before), &run, progress)?;
        Ok(DemoResult {
            organs: reconstructed.organs.len(),
            watertight: reconstructed.organs.iter().filter(|o| o.facts.watertight).count(),
            lift: lifted.result,
            reconstructed,
            seconds: clock.elapsed().as_secs_f64(),
        })
    }
}
