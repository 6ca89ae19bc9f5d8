//! A measured body: beads in a cube of silicone under compression, beside where our tissue puts
//! them.

mod cube;
mod data;
mod lattice;
mod method;
mod page;
mod result;
mod stepped;

pub use result::TruthCubeResult;

use crate::study::{Job, Kind as StudyKind, Study};
use crate::trials::Outcomes;
use crate::{Error, Result};
use clap::Args;
use cube::{Cube, Kind, Law, distances};
use data::Beads;
use glam::DVec3;
use method::{Method, Model};
use result::{ByStrain, CubeRow, figures};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use trocar_report::document::Document;
use trocar_tissue::ConstitutiveModel;
use xxhash_rust::xxh3::xxh3_64;

/// Where the data are unless told otherwise, beside the project.
const DATA: &str = "../shared/data/truth_cube/uniaxial_positions.csv";

/// Cells across the cube, of tetrahedra at three sizes.
const CELLS: [usize; 3] = [4, 6, 8];

/// A finer size, of lattices.
const FINE_CELLS: usize = 16;

/// The judge of the others of the law of both backends: quadratic tetrahedra of this size.
const JUDGE: (Method, usize) = (Method::Tetrahedra(Kind::Quadratic), CELLS[2]);

/// The model of the study's headline: what the cell steps unless told otherwise, with Poisson's
/// ratio as the authors of the data give it.
const CHOSEN: Trial =
    Trial { method: Method::Tetrahedra(Kind::Linear), cells: 8, law: NEO_HOOKEAN, poisson_ratio: 0.499 };

/// The law of both backends.
const NEO_HOOKEAN: Law = Law::Finite(ConstitutiveModel::StableNeoHookean);

/// Poisson's ratios.
const RATIOS: [f64; 3] = [0.45, 0.49, 0.499];

/// Where beads in a cube of silicone go when it is compressed, by each material, kind and size of
/// elements, beside where a scanner saw them (Kerdok and others 2003).
#[derive(Clone, Debug, Args)]
pub struct TruthCubeExperiment {
    /// The beads (CSV): their places at rest, and under each compression. The line above the names
    /// of the columns gives the strains.
    #[arg(long, value_name = "FILE", default_value = DATA)]
    pub data: PathBuf,
    /// Models in parallel; all threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// One model of the cube.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Trial {
    method: Method,
    cells: usize,
    law: Law,
    poisson_ratio: f64,
}

impl Study for TruthCubeExperiment {
    const NAME: &'static str = "truth-cube";
    const KIND: StudyKind = StudyKind::Experiment;
    const FOLDER: Option<&'static str> =
        Some("Output folder of trials and report. Finished trials in it are used again.");
    const SCHEMA: u32 = 2;
    type Figures = TruthCubeResult;

    fn run(&self, job: &Job<'_>) -> Result<(TruthCubeResult, Document)> {
        let beads = Beads::read(&self.data)?;
        job.claim()?;
        let cube = Cube::new(&beads);
        let trials = trials();
        let judges = Judges::new(&trials);
        let places: Vec<_> = beads.strains.iter().map(|strain| (&strain.percent, &strain.at)).collect();
        let settings = format!("{:016x}", xxh3_64(format!("{:?} {places:?}", beads.rest).as_bytes()));
        let Outcomes { rows, .. } =
            job.trials("models", &settings, &trials, Trial::key, self.threads, |trial, _| {
                trial.run(&cube, &beads, &judges)
            })?;
        let model = CHOSEN.model(&cube)?;
        let predicted = beads.strains.iter().map(|strain| model.predict(strain)).collect::<Result<_>>()?;
        let chosen = trials.iter().position(|trial| *trial == CHOSEN).and_then(|k| rows.get(k)).cloned();
        let chosen = chosen.ok_or_else(|| Error::Mismatch("the chosen model is not among the models".to_owned()))?;
        let result = TruthCubeResult::of(&beads, rows, chosen, predicted);
        let document = page::document(&beads, &result)?;
        Ok((result, document))
    }
}

/// All models: every law, ratio and size with linear tetrahedra, what mends their locking, and
/// lattices; and what the solver of the cell makes of the two backends.
fn trials() -> Vec<Trial> {
    let laws = ConstitutiveModel::ALL.map(Law::Finite).into_iter().chain([Law::Linear]);
    let mut all = Vec::new();
    for law in laws {
        for poisson_ratio in RATIOS {
            for cells in CELLS {
                for kind in [Kind::Linear, Kind::Corrected, Kind::Patches] {
                    all.push(Trial { method: Method::Tetrahedra(kind), cells, law, poisson_ratio });
                }
            }
            all.push(Trial { method: Method::Tetrahedra(Kind::Quadratic), cells: CELLS[1], law, poisson_ratio });
            if law == NEO_HOOKEAN {
                let (method, cells) = JUDGE;
                all.push(Trial { method, cells, law, poisson_ratio });
            }
        }
    }
    for law in [NEO_HOOKEAN, Law::Rotated] {
        for poisson_ratio in RATIOS {
            let cells = CELLS.into_iter().chain([FINE_CELLS]);
            all.extend(cells.map(|cells| Trial { method: Method::Lattice, cells, law, poisson_ratio }));
        }
    }
    for method in [Method::SteppedTetrahedra, Method::SteppedLattice] {
        all.push(Trial { method, cells: CELLS[1], law: NEO_HOOKEAN, poisson_ratio: CHOSEN.poisson_ratio });
    }
    all
}

impl Trial {
    fn key(&self) -> String {
        format!("{:?}, {}, {:?}, {}", self.method, self.cells, self.law, self.poisson_ratio)
    }

    fn model<'a>(&self, cube: &'a Cube<'a>) -> Result<Model<'a>> {
        self.method.model(cube, self.cells, self.law, self.poisson_ratio)
    }

    fn run(&self, cube: &Cube<'_>, beads: &Beads, judges: &Judges) -> Result<CubeRow> {
        let model = self.model(cube)?;
        let judged = judges.of(self, cube, beads)?;
        let (mut median_mm, mut rms_mm, mut mesh_mm) = (ByStrain::new(), ByStrain::new(), ByStrain::new());
        for (k, strain) in beads.strains.iter().enumerate() {
            let predicted = match &judged {
                Some((judge, places)) if *judge == self => Ok(places[k].clone()),
                _ => model.predict(strain),
            };
            // A law may have no equilibrium there: St. Venant-Kirchhoff tissue gives way when
            // pressed.
            let Ok(predicted) = predicted else { continue };
            let [median, rms] = figures(distances(&predicted, strain));
            median_mm.insert(strain.percent.clone(), median);
            rms_mm.insert(strain.percent.clone(), rms);
            if let Some((_, places)) = &judged {
                let off = predicted.iter().zip(&places[k]).map(|(p, right)| p.distance(*right)).collect();
                mesh_mm.insert(strain.percent.clone(), figures(off)[0]);
            }
        }
        Ok(CubeRow {
            elements: self.method.name().to_owned(),
            cell_mm: model.cell_mm,
            nodes: model.nodes,
            law: self.law.name().to_owned(),
            poisson_ratio: self.poisson_ratio,
            median_mm,
            rms_mm,
            mesh_mm,
        })
    }
}

/// Places of the inner beads (m), by compression.
type Places = Vec<Vec<DVec3>>;

/// Where the judge puts the beads, by Poisson's ratio; found when first asked for.
struct Judges(Vec<(Trial, Mutex<Option<Arc<Places>>>)>);

impl Judges {
    fn new(trials: &[Trial]) -> Self {
        let judges = trials.iter().filter(|trial| (trial.method, trial.cells) == JUDGE);
        Self(judges.map(|trial| (*trial, Mutex::new(None))).collect())
    }

    /// The judge of a trial, if its law has one.
    fn of(&self, trial: &Trial, cube: &Cube<'_>, beads: &Beads) -> Result<Option<(&Trial, Arc<Places>)>> {
        let alike = |judge: &Trial| judge.law == trial.law && judge.poisson_ratio == trial.poisson_ratio;
        let Some((judge, found)) = self.0.iter().find(|(judge, _)| alike(judge)) else { return Ok(None) };
        let mut found = found.lock().unwrap_or_else(PoisonError::into_inner);
        if found.is_none() {
            let model = judge.model(cube)?;
            let places = beads.strains.iter().map(|strain| model.predict(strain)).collect::<Result<_>>()?;
            *found = Some(Arc::new(places));
        }
        Ok(found.clone().map(|places| (judge, places)))
    }
}
