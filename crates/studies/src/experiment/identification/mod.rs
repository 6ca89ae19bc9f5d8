//! What lifts tell of support and tissue: phantoms of known truth, their posteriors and how often
//! these hold the truth.

mod page;
mod phantom;
mod result;

pub use result::IdentificationResult;

use crate::study::{Job, Kind, Study};
use crate::trials::Outcomes;
use crate::{Error, Result};
use clap::Args;
use phantom::Phantom;
use result::{FitRow, NOISE_MM, coverage, errors, support_width};
use trocar_core::Progress;
use trocar_report::document::Document;
use trocar_specimen::Parameter;

/// Cells of the coarse mesh of the fit, by default and in a coarser variant (mm).
const CELL_MM: f64 = 4.0;
const COARSER_MM: f64 = 4.8;

/// Share of the phantoms whose interval must hold the truth.
const COVERED: f64 = 0.8;

/// Phantoms of known support and tissue: how often the 90% intervals of `identify` hold the truth,
/// how wide they are, and how well other lifts are predicted.
#[derive(Clone, Debug, Args)]
pub struct IdentificationExperiment {
    /// Phantoms.
    #[arg(long, default_value_t = 20)]
    pub count: u64,
    /// Seed of the first phantom's anatomy, support, tissue and noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Fit each phantom with a coarser mesh, and with measured forces, besides.
    #[arg(long)]
    pub variants: bool,
    /// Phantoms in parallel; all threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// One fit of one phantom.
struct Trial {
    seed: u64,
    cell_mm: f64,
    forces: bool,
}

impl Study for IdentificationExperiment {
    const NAME: &'static str = "identification";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> = Some(
        "Output folder of phantoms, fits and report. Finished fits in it are used again: an interrupted run resumes.",
    );
    type Figures = IdentificationResult;

    fn run(&self, job: &Job<'_>) -> Result<(IdentificationResult, Document)> {
        if !(1..=1000).contains(&self.count) {
            return Err(Error::Mismatch(format!("--count is {}; must be in [1, 1000]", self.count)));
        }
        job.claim()?;
        let mut fits = vec![("default", CELL_MM, false)];
        if self.variants {
            fits.extend([("coarser", COARSER_MM, false), ("forces", CELL_MM, true)]);
        }
        let seeds = self.seed..self.seed + self.count;
        let trial =
            |seed: u64| fits.iter().map(move |(_, cell_mm, forces)| Trial { seed, cell_mm: *cell_mm, forces: *forces });
        let trials: Vec<Trial> = seeds.flat_map(trial).collect();
        let folder = job.output().join("phantoms");
        let key = |t: &Trial| format!("phantom {}, {} mm, forces {}", t.seed, t.cell_mm, t.forces);
        let run = |t: &Trial, progress: &dyn Progress| -> Result<FitRow> {
            // Each fit has its own folder: two of one phantom may run at once.
            let own = folder.join(format!("{}-{}", t.cell_mm, t.forces));
            Phantom::new(t.seed, &own, progress)?.fit(1e-3 * t.cell_mm, t.forces, progress)
        };
        let Outcomes { rows, resumed } = job.trials("fits", "6", &trials, key, self.threads, run)?;
        let of = |cell_mm: f64, forces: bool| -> Vec<&FitRow> {
            rows.iter().filter(|r| r.cell_mm == cell_mm && r.forces == forces).collect()
        };
        let coverage: Vec<_> = fits.iter().flat_map(|(fit, cell, forces)| coverage(fit, &of(*cell, *forces))).collect();
        let errors: Vec<_> = fits.iter().map(|(fit, cell, forces)| errors(fit, &of(*cell, *forces))).collect();
        let nodes = |cell: f64| trocar_core::median(of(cell, false).iter().map(|r| r.nodes as f64).collect::<Vec<_>>());
        let lifts: Vec<f64> = rows.iter().filter_map(|r| r.lift_mm).collect();
        let result = IdentificationResult {
            covered: coverage.iter().filter(|c| c.fit == "default" && c.coverage >= COVERED).count(),
            landmark_rmse_mm: errors.first().and_then(|e| e.held_out_mm),
            landmark_floor_mm: NOISE_MM,
            lift_mm: trocar_core::median(lifts),
            support_width: support_width(&coverage[..Parameter::ALL.len()]),
            nodes: [nodes(CELL_MM), nodes(COARSER_MM)],
            coverage,
            errors,
            rows,
            resumed,
        };
        let document = page::document(&result, self.count as usize)?;
        Ok((result, document))
    }
}
