//! The demonstration: record a phantom, reconstruct it, lift its appendix, and write a report.

use crate::lift::Lift;
use crate::lift_result::LiftResult;
use crate::reconstruct::{Reconstructed, reconstruct_recording};
use crate::{Result, pages};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_reconstruct::Settings;

/// Settings of the demonstration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Demo {
    /// Frames of the recording.
    pub frames: usize,
    /// Seed of the anatomy and the noise.
    pub seed: u64,
    /// Worker threads of the simulation, 0 for all.
    pub threads: usize,
}

/// The figures of the demonstration.
#[derive(Clone, Debug, Serialize)]
pub struct DemoResult {
    /// Number of organs.
    pub organs: usize,
    /// Number of watertight surfaces.
    pub watertight: usize,
    /// The figures of the grasp-lift.
    #[serde(flatten)]
    pub lift: LiftResult,
    /// The figures of the reconstruction.
    pub reconstructed: Reconstructed,
    /// Total wall time (s).
    pub seconds: f64,
}

impl Demo {
    /// Writes `recording/`, `specimen/` and `run/` into the folder `output`. The report is in
    /// `run/`.
    ///
    /// # Errors
    /// A folder that cannot be written, or that holds something else than an earlier demonstration.
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
