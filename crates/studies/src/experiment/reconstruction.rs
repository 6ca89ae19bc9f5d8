//! Table I and Fig. 6(a): all phantoms recorded, reconstructed with one set of settings, and
//! compared with their truth.

use crate::names::{BackName, MesherName, Recorded, SensorName, phantoms_or_papers};
use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};
use trocar_camera::DepthImage;
use trocar_core::Pose;
use trocar_geometry::io::{Unit, read_surface};
use trocar_phantom::RecordOptions;
use trocar_reconstruct::truth::DEPTH_UNIT;
use trocar_reconstruct::{BackRule, Reconstruction, Settings, SurfaceRule, depth_error, modelled_volume};
use trocar_recording::Recording;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card, Columns};
use trocar_report::table::{count, fixed, percent, yes_or_no};
use trocar_report::{colors, figures, overlays};
use trocar_workflow::pages::{check_sizes, organ_views};
use trocar_workflow::paper::table_i;
use trocar_workflow::phantoms::recorded;
use trocar_workflow::{CompositeFigures, reconstruct_recording};

/// Table I and Fig. 6(a): all phantoms recorded, reconstructed and compared with their truth.
#[derive(Clone, Debug, Args)]
pub struct ReconstructionExperiment {
    /// Phantoms; phantom-a, phantom-b and phantom-c by default.
    #[arg(long = "phantom")]
    pub phantoms: Vec<String>,
    /// How they are recorded.
    #[command(flatten)]
    pub recorded: Recorded,
    /// The depth noise.
    #[arg(long, value_enum, default_value_t = SensorName::Plain)]
    pub sensor: SensorName,
    /// The model of the unseen back of the organs.
    #[arg(long, value_enum, default_value_t = BackName::Rounded)]
    pub back: BackName,
    /// The mesher.
    #[arg(long, value_enum, default_value_t = MesherName::Lattice)]
    pub mesher: MesherName,
}

/// Figures of one organ, and those of the paper.
#[derive(Clone, Debug, Serialize)]
pub struct ReconstructionRow {
    /// Name of the phantom.
    pub phantom: String,
    /// Name.
    pub organ: String,
    /// Nodes of the body.
    pub nodes: usize,
    /// Tetrahedra of the body.
    pub tets: usize,
    /// Whether the surface is closed.
    pub watertight: bool,
    /// Number of inverted elements.
    pub inverted: usize,
    /// Smallest dihedral angle (degrees).
    pub min_dihedral_deg: f64,
    /// Median over elements of the smallest dihedral angle (degrees).
    pub median_dihedral_deg: f64,
    /// Median edge (mm).
    pub median_edge_mm: f64,
    /// Median absolute error of the surface, seen through the recording camera, against the depth
    /// of the composite (mm).
    pub depth_error_median_mm: f64,
    /// The same, signed: surface minus depth (mm).
    pub signed_error_median_mm: f64,
    /// Share of the pixels of the organ that are compared.
    pub covered: f64,
    /// Median absolute error against the true depth, without noise and quantisation (mm).
    pub truth_error_median_mm: f64,
    /// The same, signed (mm).
    pub truth_error_signed_mm: f64,
    /// Volume of the body (cm3).
    pub volume_cm3: f64,
    /// Volume over that between the true front and the modelled back (paper eq. 1), minus 1.
    pub volume_error: f64,
    /// Volume over that of the true organ, minus 1: the error of the model of the back.
    pub volume_error_truth: f64,
    /// Signed depth error of a surface from a binary grid, as in the paper (mm).
    pub binary_grid_signed_error_mm: Option<f64>,
    /// Nodes in the paper's Table I.
    pub paper_nodes: Option<usize>,
    /// Tetrahedra in the paper's Table I.
    pub paper_tets: Option<usize>,
}

/// Recording and composite of one phantom.
#[derive(Clone, Debug, Serialize)]
pub struct PhantomFigures {
    /// Name.
    pub phantom: String,
    /// Figures of the composite.
    pub composite: CompositeFigures,
    /// Wall time of the reconstruction with its report (s).
    pub seconds: f64,
    /// Path of the report of the reconstruction.
    pub report: String,
}

/// Figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct ReconstructionResult {
    /// All organs of all phantoms.
    pub organs: Vec<ReconstructionRow>,
    /// All phantoms.
    pub phantoms: Vec<PhantomFigures>,
}

impl Study for ReconstructionExperiment {
    const NAME: &'static str = "reconstruction";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> =
        Some("Output folder of recordings, specimens and report. Finished recordings in it are used again.");
    type Figures = ReconstructionResult;

    fn run(&self, job: &Job<'_>) -> Result<(ReconstructionResult, Document)> {
        job.claim()?;
        let record = RecordOptions { sensor: self.sensor.into(), ..self.recorded.options() };
        let settings = Settings { back: self.back.into(), mesher: self.mesher.into(), ..Settings::default() };
        let mut result = ReconstructionResult { organs: Vec::new(), phantoms: Vec::new() };
        let mut reconstructions = Vec::new();
        for phantom in &phantoms_or_papers(&self.phantoms) {
            let folder = job.output().join(phantom);
            let recording = folder.join("recording");
            recorded(phantom, &record, &recording, job.progress)?;
            let made = reconstruct_recording(&recording, &settings, &folder.join("specimen"), job.progress)?;
            let binary_grid = Settings { surface: SurfaceRule::BinaryGrid, ..settings.clone() };
            let binary_grid =
                trocar_reconstruct::reconstruct(&Recording::open(&recording)?, &binary_grid, job.progress)?;
            result.organs.extend(rows(phantom, &recording, &made.reconstruction, &binary_grid, settings.back)?);
            result.phantoms.push(PhantomFigures {
                phantom: phantom.clone(),
                composite: CompositeFigures::of(&made.reconstruction, made.truth.as_ref()),
                seconds: made.figures.seconds,
                report: made.figures.report,
            });
            reconstructions.push(made.reconstruction);
        }
        let document = document(&result, &reconstructions)?;
        Ok((result, document))
    }
}

fn rows(
    phantom: &str,
    recording: &Path,
    made: &Reconstruction,
    binary_grid: &Reconstruction,
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
        let binary_grid_signed = binary_grid.specimen.organs.get(i).and_then(|o| o.facts.depth_error_signed_mm);
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
            binary_grid_signed_error_mm: binary_grid_signed,
            paper_nodes: paper.map(|p| p.nodes),
            paper_tets: paper.map(|p| p.tets),
        })
    };
    made.specimen.organs.iter().enumerate().map(row).collect()
}

/// Targets of each organ: depth error (mm), signed error (mm), volume error, smallest dihedral
/// angle (degrees).
const MAX_DEPTH_ERROR: f64 = 1.0;
const MAX_SIGNED_ERROR: f64 = 0.3;
const MAX_VOLUME_ERROR: f64 = 0.1;
const MIN_DIHEDRAL: f64 = 10.0;

fn document(result: &ReconstructionResult, made: &[Reconstruction]) -> Result<Document> {
    made.iter().try_for_each(check_sizes)?;
    let subtitle = format!("{} organs of {} phantoms, one set of settings", result.organs.len(), made.len());
    let document = Document::new("Reconstruction", subtitle).with(summary(result)).with(table_i_beside_paper(result));
    Ok(document.with(errors(made)?).with(composites(result)).with(pictures(made)?))
}

fn summary(result: &ReconstructionResult) -> Section {
    let rows = &result.organs;
    let n = rows.len();
    let tight = rows.iter().filter(|r| r.watertight).count();
    let inverted: usize = rows.iter().map(|r| r.inverted).sum();
    let worst = |f: &dyn Fn(&ReconstructionRow) -> f64| rows.iter().map(|r| f(r).abs()).fold(0.0, f64::max);
    let dihedral = rows.iter().map(|r| r.min_dihedral_deg).fold(f64::INFINITY, f64::min);
    let (depth, signed, volume) =
        (worst(&|r| r.depth_error_median_mm), worst(&|r| r.signed_error_median_mm), worst(&|r| r.volume_error));
    let cards = [
        Card::new("Watertight", format!("{tight} of {n}"), "organs; paper 13 of 13").met(tight == n),
        Card::new("Inverted elements", count(inverted), "paper 0").met(inverted == 0),
        Card::new("Smallest dihedral", format!("{}\u{b0}", fixed(dihedral, 1)), "of all elements; at least 10\u{b0}")
            .met(dihedral >= MIN_DIHEDRAL),
        Card::new("Depth error", format!("{} mm", fixed(depth, 2)), "median of the worst organ; paper 1.33 to 4.77 mm")
            .met(depth <= MAX_DEPTH_ERROR),
        Card::new(
            "Signed error",
            format!("{} mm", fixed(signed, 2)),
            "largest absolute median of an organ; paper \u{2212}1.15 to \u{2212}4.88 mm",
        )
        .met(signed <= MAX_SIGNED_ERROR),
        Card::new("Volume", percent(volume, 1), "largest error against the true front with the modelled back")
            .met(volume <= MAX_VOLUME_ERROR),
    ];
    Section::new("Summary", "").cards(cards)
}

fn table_i_beside_paper(result: &ReconstructionResult) -> Section {
    let paper = |n: Option<usize>| n.map_or(String::new(), count);
    let table = Table::of(
        &result.organs,
        &[
            ("Organ", &|r| r.organ.clone()),
            ("Phantom", &|r| r.phantom.clone()),
            ("Nodes", &|r| count(r.nodes)),
            ("(paper)", &|r| paper(r.paper_nodes)),
            ("Tetrahedra", &|r| count(r.tets)),
            ("(paper)", &|r| paper(r.paper_tets)),
            ("Min. dihedral (\u{b0})", &|r| fixed(r.min_dihedral_deg, 1)),
            ("Median dihedral (\u{b0})", &|r| fixed(r.median_dihedral_deg, 1)),
            ("Median edge (mm)", &|r| fixed(r.median_edge_mm, 2)),
            ("Watertight", &|r| yes_or_no(r.watertight)),
            ("Inverted", &|r| count(r.inverted)),
            ("Depth error (mm)", &|r| fixed(r.depth_error_median_mm, 2)),
            ("signed (mm)", &|r| fixed(r.signed_error_median_mm, 2)),
            ("binary grid, signed (mm)", &|r| fixed(r.binary_grid_signed_error_mm.unwrap_or(f64::NAN), 2)),
            ("against truth (mm)", &|r| fixed(r.truth_error_median_mm, 2)),
            ("Covered", &|r| percent(r.covered, 0)),
            ("Volume (cm\u{b3})", &|r| fixed(r.volume_cm3, 2)),
            ("error, model", &|r| percent(r.volume_error, 1)),
            ("error, truth", &|r| percent(r.volume_error_truth, 0)),
        ],
    );
    Section::new(
        "Table I",
        "The depth error is the paper's measure: the surface, seen through the recording camera, against the input \
         depth. <i>Error, model</i>: the volume against that between the true front and the modelled back of the \
         paper's closure. <i>Error, truth</i>: against the true organ, whose back is unseen.",
    )
    .table(table)
}

/// Fig. 6(a): signed depth error of the surfaces.
fn errors(made: &[Reconstruction]) -> Result<Section> {
    let mut shown = Vec::new();
    for r in made {
        let mut picture = overlays::dimmed(&r.composite.color);
        for organ in &r.organs {
            overlays::error(&mut picture, &organ.depth_error, &organ.compared);
        }
        let caption = format!("<b>{}.</b>", page::escape(&r.specimen.name));
        shown.push(figures::figure(&picture, "signed depth error of all organs", &caption)?);
    }
    let bar = page::scale_bar(&colors::DIVERGING, "\u{2212}5", "surface minus measured depth (mm)", "+5");
    let lead = "Blue: the surface is nearer to the camera than the measured depth; red: farther.";
    let section = Section::new("Depth error (Fig. 6a)", lead);
    Ok(shown.into_iter().fold(section, |s, f| s.figure(Columns::Three, f)).html(bar))
}

fn composites(result: &ReconstructionResult) -> Section {
    let mm = |v: f64| format!("{} mm", fixed(v, 2));
    let truth = |p: &PhantomFigures| p.composite.truth.unwrap_or_default();
    let table = Table::of(
        &result.phantoms,
        &[
            ("Phantom", &|p| p.phantom.clone()),
            ("Frames", &|p| count(p.composite.frames_used)),
            ("Recovered (paper 3.4 %)", &|p| percent(p.composite.recovered_share, 1)),
            ("Coverage (90.3 %)", &|p| percent(p.composite.coverage, 1)),
            ("Depth range (2.0 mm)", &|p| mm(p.composite.depth_range_median_mm)),
            ("Depth error, median", &|p| mm(truth(p).depth_error_median_mm)),
            ("95th percentile", &|p| mm(truth(p).depth_error_p95_mm)),
            ("under the instruments", &|p| mm(truth(p).under_instruments_median_mm.unwrap_or(f64::NAN))),
            ("Reconstruction", &|p| format!("{} s", fixed(p.seconds, 1))),
        ],
    );
    let lead = "The scene behind the instruments, from the frames of the window, and its error against the truth.";
    Section::new("Composites", lead).table(table)
}

/// Input picture and reconstruction side by side.
fn pictures(made: &[Reconstruction]) -> Result<Section> {
    let mut shown = Vec::new();
    for r in made {
        let Some(camera) = &r.specimen.camera else { continue };
        let name = page::escape(&r.specimen.name);
        let caption = format!("<b>{name}.</b> The centre frame of the window.");
        shown.push(figures::figure(&r.composite.input, "input frame", &caption)?);
        let rendered = organ_views::surfaces(&r.specimen).render(camera, &Pose::IDENTITY, 2).color;
        let caption = "<b>Reconstructed.</b> The surfaces through the recording camera.";
        shown.push(figures::figure(&rendered, "reconstructed surfaces through the recording camera", caption)?);
    }
    Ok(Section::new("Pictures", "").figures(shown))
}
