//! Error of a body's mesh: static deflections of an appendix by linear tetrahedra, lattices and
//! others, beside those of the body itself.

mod body;
mod elements;
mod lattice;
mod page;
mod result;

pub use result::MeshConvergenceResult;

use crate::names::AppendixChoice;
use crate::study::{Job, Kind, Study};
use crate::trials::Outcomes;
use crate::{Error, Result};
use body::TestBody;
use clap::Args;
use elements::{Method, Trial};
use trocar_report::document::Document;
use xxhash_rust::xxh3::xxh3_64;

/// Error of the mesh, not of the solver: sag, lift, local pull and grasp-lift of an appendix over
/// the size of elements, by linear tetrahedra and by lattices, beside the converged body.
#[derive(Clone, Debug, Args)]
pub struct MeshConvergenceExperiment {
    /// The appendix. Its mesh is the body: finer elements divide it, lattices are cut from it.
    #[command(flatten)]
    pub appendix: AppendixChoice,
    /// Poisson's ratios.
    #[arg(long = "poisson", value_delimiter = ',', default_values_t = [0.45, 0.49, 0.499])]
    pub poisson_ratios: Vec<f64>,
    /// Edges of the cells of coarser meshes, over that of the appendix's mesh.
    #[arg(long = "coarser", value_delimiter = ',', default_values_t = [1.6, 1.25])]
    pub coarser: Vec<f64>,
    /// Cells of the lattices (mm).
    #[arg(long = "lattice-mm", value_delimiter = ',', default_values_t = [4.0, 3.0, 2.3, 1.5])]
    pub lattice_mm: Vec<f64>,
    /// Further lattices, by their cells along the longest axis; the paper's hexahedra have 16.
    #[arg(long = "lattice-cells", value_delimiter = ',', default_values_t = [16])]
    pub lattice_cells: Vec<u32>,
    /// Meshes in parallel; all threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

impl Study for MeshConvergenceExperiment {
    const NAME: &'static str = "mesh-convergence";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> = Some(
        "Output folder of recording, specimen, trials and report. A finished recording in it is used again, and so \
         are finished trials with the same settings: an interrupted run resumes.",
    );
    type Figures = MeshConvergenceResult;

    fn run(&self, job: &Job<'_>) -> Result<(MeshConvergenceResult, Document)> {
        self.check()?;
        job.claim()?;
        let (specimen, _) = self.appendix.read(job.output(), job.progress)?;
        let body = TestBody::of(&specimen)?;
        let trials: Vec<Trial> = self.poisson_ratios.iter().flat_map(|nu| self.trials(*nu, &body)).collect();
        let fingerprint = xxh3_64(format!("{:?} {:?}", body.mesh.vertices, body.mesh.tets).as_bytes());
        let settings = format!("{fingerprint:016x}");
        let Outcomes { rows, resumed } =
            job.trials("meshes", &settings, &trials, Trial::key, self.threads, |trial, _| trial.run(&body))?;
        let result = MeshConvergenceResult::from_rows(rows, body.size(), resumed)?;
        let document = page::document(&result)?;
        Ok((result, document))
    }
}

impl MeshConvergenceExperiment {
    fn check(&self) -> Result<()> {
        let within = |values: &[f64], range: std::ops::RangeInclusive<f64>, what: &str| match values
            .iter()
            .find(|v| !range.contains(v))
        {
            Some(v) => Err(Error::Mismatch(format!("{what} is {v}; must be in {range:?}"))),
            None => Ok(()),
        };
        within(&self.poisson_ratios, 0.0..=0.4999, "--poisson")?;
        within(&self.coarser, 1.0..=3.0, "--coarser")?;
        within(&self.lattice_mm, 0.8..=10.0, "--lattice-mm")?;
        let cells: Vec<f64> = self.lattice_cells.iter().map(|count| f64::from(*count)).collect();
        within(&cells, 8.0..=64.0, "--lattice-cells")
    }

    fn trials(&self, nu: f64, body: &TestBody) -> Vec<Trial> {
        let coarser = self.coarser.iter().map(|by| Method::LinearCoarser { by: *by });
        let own = [
            Method::Quadratic,
            Method::Default,
            Method::Corrected,
            Method::Linear,
            Method::LinearFiner,
            Method::Patches,
        ];
        let longest = body.extent().max_element();
        let along = self.lattice_cells.iter().map(|count| longest / f64::from(*count));
        let sized = self.lattice_mm.iter().map(|mm| 1e-3 * mm);
        let lattices = along.chain(sized).map(|cell| Method::Lattice { cell });
        own.into_iter().chain(coarser).chain(lattices).map(|method| Trial { method, nu }).collect()
    }
}
