//! A measured body: a beam of silicone that is let go under a known load and swings, beside the
//! same beam of our tissue.

mod model;
mod page;
mod recording;
mod result;
mod swing;

pub use result::BeamResult;

use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use model::{Beam, Silicone};
use result::{BeamCase, SubstepRow};
use std::path::PathBuf;
use swing::{Swing, Track};
use trocar_report::document::Document;
use trocar_workflow::check_interrupted;

/// The load of the default fit (N): 52 g.
const FIT_LOAD_N: f64 = 0.510;

/// Substeps of a frame of 10 ms with which the fit and the prediction are simulated: numerical
/// damping is small beside the silicone's.
const FINE_SUBSTEPS: usize = 32;

/// Length of a substep of the default schedule (ms): two in a frame of 1/60 s.
const DEFAULT_SUBSTEP_MS: f64 = 1e3 / 120.0;

/// A beam of silicone (Dragon Skin 10, 30 x 30 x 100 mm) that is let go: Young's modulus and
/// viscosity are fitted to one load, and what it does under another is predicted (Zhang and others,
/// "Sim2Real for soft robotic fish via differentiable simulation", 2022: their recordings).
#[derive(Clone, Debug, Args)]
pub struct BeamExperiment {
    /// Recordings (C3D) of the load that is fitted; their mean counts.
    #[arg(long, value_name = "FILE", default_values = [
        "../shared/data/eth_beam/beam_load52_V2_a.c3d", "../shared/data/eth_beam/beam_load52_V2_b.c3d"
    ])]
    pub fit: Vec<PathBuf>,
    /// That load, a weight on the end (N).
    #[arg(long, value_name = "N", default_value_t = FIT_LOAD_N)]
    pub fit_load_n: f64,
    /// Recordings (C3D) of the load that is predicted; their mean counts.
    #[arg(long, value_name = "FILE", default_values = [
        "../shared/data/eth_beam/beam_gravity_V2_a.c3d", "../shared/data/eth_beam/beam_gravity_V2_b.c3d"
    ])]
    pub data: Vec<PathBuf>,
    /// That load (N).
    #[arg(long, value_name = "N", default_value_t = 0.0)]
    pub load_n: f64,
}

impl Study for BeamExperiment {
    const NAME: &'static str = "beam";
    const KIND: Kind = Kind::Experiment;
    type Figures = BeamResult;

    fn run(&self, job: &Job<'_>) -> Result<(BeamResult, Document)> {
        for (name, load) in [("--fit-load-n", self.fit_load_n), ("--load-n", self.load_n)] {
            if !(0.0..=2.0).contains(&load) {
                return Err(Error::Mismatch(format!("{name} is {load} N; it must be in [0, 2]")));
            }
        }
        let read = |files: &[PathBuf]| files.iter().map(|file| recording::read(file)).collect::<Result<Vec<Track>>>();
        let (fitted, seen) = (read(&self.fit)?, read(&self.data)?);
        let mean = |tracks: &[Track]| -> Result<Swing> {
            Ok(Swing::mean(&tracks.iter().map(Track::swing).collect::<Result<Vec<_>>>()?))
        };
        let (target, measured) = (mean(&fitted)?, mean(&seen)?);
        job.claim()?;
        job.progress.begin("fits and swings", 7);
        let step = || -> Result<()> {
            job.progress.advance(1);
            check_interrupted(job.progress)
        };
        let beam = Beam::new();
        let young_modulus = beam.fit_modulus(1e-3 * target.settled_mm, self.fit_load_n)?;
        step()?;
        let viscosity = beam.fit_viscosity(young_modulus, self.fit_load_n, target.damping, FINE_SUBSTEPS)?;
        let silicone = Silicone { young_modulus, viscosity };
        step()?;
        let (own, fit_track) = beam.swing(silicone, self.fit_load_n, FINE_SUBSTEPS)?;
        step()?;
        let (simulated, track) = beam.swing(silicone, self.load_n, FINE_SUBSTEPS)?;
        step()?;
        let mut substeps = Vec::new();
        for (substep_ms, number) in [(DEFAULT_SUBSTEP_MS, None), (5.0, Some(2)), (2.5, Some(4))] {
            let simulated = match number {
                Some(number) => beam.swing(silicone, self.load_n, number)?.0,
                None => beam.swing_by_default(silicone, self.load_n)?,
            };
            substeps.push(SubstepRow { substep_ms, is_default: number.is_none(), simulated });
            step()?;
        }
        substeps.push(SubstepRow { substep_ms: 10.0 / FINE_SUBSTEPS as f64, is_default: false, simulated });
        job.progress.end();
        let predicted = BeamCase { case: "predicted", load_n: self.load_n, measured, simulated };
        let result = BeamResult {
            displacement_error: predicted.error(|s| s.settled_mm),
            period_error: predicted.error(|s| s.period_s),
            first_peak_error: predicted.error(|s| s.first_peak_mm),
            damping_error: predicted.error(|s| s.damping),
            young_modulus,
            viscosity,
            nodes: beam.nodes(),
            cases: vec![
                BeamCase { case: "fitted", load_n: self.fit_load_n, measured: target, simulated: own },
                predicted,
            ],
            substeps,
        };
        let document = page::document(&result, [(&fitted, &fit_track), (&seen, &track)])?;
        Ok((result, document))
    }
}
