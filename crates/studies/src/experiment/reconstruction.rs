//! Table I and Fig. 6(a): every phantom recorded, reconstructed with one set of settings, and measured against its truth.

use super::{claim, write};
use crate::{Error, Result, pages};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;
use trocar_camera::DepthImage;
use trocar_core::Progress;
use trocar_geometry::io::{Unit, read_surface};
use trocar_phantom::RecordOptions;
use trocar_reconstruct::{BackRule, Reconstruction, Settings, SurfaceRule, depth_error, modelled_volume};
use trocar_recording::Recording;
use trocar_workflow::paper::table_i;
use trocar_workflow::phantoms::recorded;
use trocar_workflow::truth::DEPTH_UNIT;
use trocar_workflow::{CompositeFigures, REPORT, reconstruct_recording};

/// The file that makes a folder one of this experiment's.
const MARKER: &str = "reconstruction.json";

/// The experiment's options.
#[derive(Clone, Debug)]
pub struct ReconstructionExperiment {
    /// Which phantoms.
    pub phantoms: Vec<String>,
    /// How they are filmed. An earlier recording in the output folder is used again when it is of the same options.
    pub record: RecordOptions,
    /// How they are reconstructed.
    pub settings: Settings,
}

/// One organ: what is asked of it, and the paper's beside it.
#[derive(Clone, Debug, Serialize)]
pub struct ReconstructionRow {
    /// Its phantom.
    pub phantom: String,
    /// Its name.
    pub organ: String,
    /// Nodes of the body.
    pub nodes: usize,
    /// Tetrahedra of the body.
    pub tets: usize,
    /// The surface closes.
    pub watertight: bool,
    /// Elements with volume at or below 0.
    pub inverted: usize,
    /// Smallest dihedral angle [degrees].
    pub min_dihedral_deg: f64,
    /// Median over elements of the smallest dihedral angle [degrees].
    pub median_dihedral_deg: f64,
    /// Median edge [mm].
    pub median_edge_mm: f64,
    /// SPEC R9: median absolute error of the surface through the recording camera against the composite's depth [mm].
    pub depth_error_median_mm: f64,
    /// The same, signed, surface minus depth [mm].
    pub signed_error_median_mm: f64,
    /// Share of the organ's pixels that were compared.
    pub covered: f64,
    /// The surface against the true depth, without noise and quantisation: median absolute error [mm].
    pub truth_error_median_mm: f64,
    /// The same, signed [mm].
    pub truth_error_signed_mm: f64,
    /// Volume of the body [cm3].
    pub volume_cm3: f64,
    /// Volume over that between the true front and the back modelled behind it (paper eq. 1), minus 1.
    pub volume_error: f64,
    /// Volume over the true organ's, minus 1: what the model of the unseen back is worth.
    pub volume_error_truth: f64,
    /// Signed depth error of a surface made the paper's way, from a binary grid [mm].
    pub binary_grid_signed_error_mm: Option<f64>,
    /// Nodes in the paper's Table I.
    pub paper_nodes: Option<usize>,
    /// Tetrahedra in the paper's Table I.
    pub paper_tets: Option<usize>,
}

/// One phantom's recording and composite.
#[derive(Clone, Debug, Serialize)]
pub struct PhantomFigures {
    /// Its name.
    pub phantom: String,
    /// The composite.
    pub composite: CompositeFigures,
    /// Wall time of the reconstruction, report included [s].
    pub seconds: f64,
    /// Its report.
    pub report: String,
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct ReconstructionResult {
    /// Every organ of every phantom.
    pub organs: Vec<ReconstructionRow>,
    /// Every phantom.
    pub phantoms: Vec<PhantomFigures>,
    /// Wall time of everything [s].
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}

impl ReconstructionExperiment {
    /// Runs everything into the folder `output`: `<phantom>/recording`, `<phantom>/specimen`, and the report.
    ///
    /// # Errors
    /// When the folder cannot be written, or an interruption; what is finished by then is used again the next time.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<ReconstructionResult> {
        let clock = Instant::now();
        claim(output, MARKER)?;
        let mut result = ReconstructionResult {
            organs: Vec::new(),
            phantoms: Vec::new(),
            seconds: 0.0,
            report: output.join(REPORT).display().to_string(),
        };
        let mut pictures = Vec::new();
        for phantom in &self.phantoms {
            let folder = output.join(phantom);
            let recording = folder.join("recording");
            recorded(phantom, &self.record, &recording, progress)?;
            let (made, reconstruction) =
                reconstruct_recording(&recording, &self.settings, &folder.join("specimen"), progress)?;
            let paper_way = Settings { surface: SurfaceRule::BinaryGrid, ..self.settings.clone() };
            let paper_way = trocar_reconstruct::reconstruct(&Recording::open(&recording)?, &paper_way, progress)?;
            result.organs.extend(rows(phantom, &recording, &reconstruction, &paper_way, self.settings.back)?);
            result.phantoms.push(PhantomFigures {
                phantom: phantom.clone(),
                composite: CompositeFigures::of(&reconstruction, &recording)?,
                seconds: made.seconds,
                report: made.report,
            });
            pictures.push(reconstruction);
        }
        result.seconds = clock.elapsed().as_secs_f64();
        let html = pages::reconstruction_experiment(&result, &pictures)?;
        write(&output.join(REPORT), html.as_bytes())?;
        let json = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        write(&output.join(MARKER), &json)?;
        Ok(result)
    }
}

fn rows(
    phantom: &str,
    recording: &Path,
    made: &Reconstruction,
    paper_way: &Reconstruction,
    back: BackRule,
) -> Result<Vec<ReconstructionRow>> {
    let truth = recording.join("truth");
    let true_depth = DepthImage::read(&truth.join("depth.png"), DEPTH_UNIT)?;
    let front: Vec<f64> = true_depth.depth.iter().map(|z| f64::from(*z)).collect();
    let Some(camera) = made.specimen.camera else {
        return Err(Error::Mismatch(format!("'{phantom}' has no recording camera")));
    };
    let row = |(i, organ): (usize, &trocar_specimen::Organ)| -> Result<ReconstructionRow> {
        let facts = &organ.facts;
        let mask = &made.organs[i].mask;
        let against_truth = depth_error(&organ.surface, &true_depth, mask, &camera);
        let [truth_error_median_mm, truth_error_signed_mm] =
            against_truth.map_or([f64::NAN; 2], |c| [1e3 * c.median_absolute, 1e3 * c.median_signed]);
        let path: PathBuf = truth.join(format!("{}.ply", organ.name));
        let true_volume = read_surface(&path, Unit::Metre).map_err(trocar_reconstruct::Error::from)?.volume();
        let volume = 1e-6 * facts.volume_cm3;
        let paper = table_i(phantom, &organ.name);
        let signed_the_papers_way = paper_way.specimen.organs.get(i).and_then(|o| o.facts.depth_error_signed_mm);
        Ok(ReconstructionRow {
            phantom: phantom.to_owned(),
            organ: organ.name.clone(),
            nodes: facts.nodes,
            tets: facts.tets,
            watertight: facts.watertight,
            inverted: facts.inverted,
            min_dihedral_deg: facts.min_dihedral_deg,
            median_dihedral_deg: facts.median_dihedral_deg,
            median_edge_mm: facts.median_edge_mm,
            depth_error_median_mm: facts.depth_error_median_mm.unwrap_or(f64::NAN),
            signed_error_median_mm: facts.depth_error_signed_mm.unwrap_or(f64::NAN),
            covered: facts.covered.unwrap_or(f64::NAN),
            truth_error_median_mm,
            truth_error_signed_mm,
            volume_cm3: facts.volume_cm3,
            volume_error: volume / modelled_volume(&front, mask, &camera, back) - 1.0,
            volume_error_truth: volume / true_volume - 1.0,
            binary_grid_signed_error_mm: signed_the_papers_way,
            paper_nodes: paper.map(|p| p.nodes),
            paper_tets: paper.map(|p| p.tets),
        })
    };
    made.specimen.organs.iter().enumerate().map(row).collect()
}
