//! The demonstration: record a phantom, reconstruct it, lift its appendix, and write a report.
//!
//! While it runs, `index.html` in its folder shows what the camera saw. It leads to the report when
//! that is written.

use crate::Result;
use crate::lift::Lift;
use crate::lift_result::LiftResult;
use crate::reconstruct::{REPORT, Reconstructed, reconstruct_recording};
use crate::video::write_whole;
use serde::Serialize;
use std::path::Path;
use std::time::Instant;
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_reconstruct::Settings;
use trocar_recording::Recording;
use trocar_report::page::{self, Columns, escape};
use trocar_report::{figures, picture_colors};

/// Title of the page that leads to the report.
const TITLE: &str = "Demonstration";

/// After this time (s) the browser loads that page again.
const REFRESH_S: u32 = 2;

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
    /// Writes `recording/`, `specimen/`, `run/` and `index.html` into the folder `output`. The
    /// report is in `run/`. Calls `show` with the path of `index.html` when that has a picture.
    ///
    /// # Errors
    /// A folder that cannot be written, or that holds something else than an earlier demonstration.
    pub fn run(&self, output: &Path, show: &dyn Fn(&Path), progress: &dyn Progress) -> Result<DemoResult> {
        let index = output.join("index.html");
        let mut shown = false;
        let result = self.stages(output, progress, |page| {
            write_whole(&index, page.as_bytes())?;
            if !std::mem::replace(&mut shown, true) {
                show(&index);
            }
            Ok(())
        });
        if let (Err(error), true) = (&result, shown) {
            let text =
                page::warning(&format!("The demonstration ended before its report: {}.", escape(&error.to_string())));
            write_whole(&index, page::page(TITLE, "", &text).as_bytes())?;
        }
        result
    }

    /// The stages; `index` writes the page that leads to the report.
    fn stages(
        &self,
        output: &Path,
        progress: &dyn Progress,
        mut index: impl FnMut(String) -> Result<()>,
    ) -> Result<DemoResult> {
        let clock = Instant::now();
        let [recording, specimen, run] = ["recording", "specimen", "run"].map(|name| output.join(name));
        let options = RecordOptions { frames: self.frames, seed: self.seed, ..RecordOptions::default() };
        trocar_phantom::record("phantom-a", &options, &recording, progress)?;
        index(page::refreshed(&under_way(&recording)?, REFRESH_S, None))?;
        let made = reconstruct_recording(&recording, &Settings::default(), &specimen, progress)?;
        let lift = Lift { threads: self.threads, ..Lift::default() };
        let organs = &made.reconstruction.specimen;
        let lifted = lift.write_specimen(organs, &specimen, Some(&made.sections), &run, progress)?;
        let reconstructed = made.figures;
        let report = format!("run/{REPORT}");
        let link = format!("<p><a href=\"{report}\">The report</a></p>");
        index(page::refreshed(&page::page(TITLE, "", &link), 0, Some(&report)))?;
        Ok(DemoResult {
            organs: reconstructed.organs.len(),
            watertight: reconstructed.organs.iter().filter(|o| o.facts.watertight).count(),
            lift: lifted.result,
            reconstructed,
            seconds: clock.elapsed().as_secs_f64(),
        })
    }
}

/// The page of a demonstration whose recording is finished: a frame of it, with its depth.
fn under_way(recording: &Path) -> Result<String> {
    let frames = Recording::open(recording)?;
    let middle = frames.frame(frames.len() / 2)?;
    let figures = [
        figures::figure(
            &middle.color,
            "A frame of the recording",
            "The colour camera, with two instruments in front.",
        )?,
        figures::figure(&picture_colors::shown(&middle.depth), "Its depth", "Its depth, near in yellow.")?,
    ];
    let lead = "Organs are reconstructed from this recording now, and then one of them is lifted. This page leads \
                to the report when that is written.";
    let body = page::section("Recorded", lead, &page::grid(Columns::Two, &figures));
    Ok(page::page(TITLE, "under way", &body))
}
