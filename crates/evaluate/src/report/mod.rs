//! HTML reports: one self-contained file each, no scripts, nothing loaded from elsewhere.
//!
//! [`reconstruction`] shows how a recording became organs, [`surface`] what became of a ready surface, [`grasp_lift`] how
//! the organs behaved when they were lifted.

mod axis;
mod campaign;
mod cell_lift;
mod colors;
mod controller_grid;
mod convergence;
mod element_quality;
mod figures;
mod funnel;
mod grasp_designs;
mod integrators;
mod meshing;
mod moving_picture;
mod overlays;
mod page;
mod plots;
mod port_budget;
mod random_actions;
mod reconstruction_experiment;
mod rollouts;
mod run;
mod scaling;
mod seen;
mod settling;
mod severed;
mod similarity;
mod table;
mod truth;
mod views;
mod wrench;

use crate::bench::{MeshingResult, ScalingResult};
use crate::campaign::{CampaignResult, Kept, Plan, Store};
use crate::experiment::{
    ControllerGridResult, ConvergenceResult, ElementQualityResult, GraspDesignsResult, IntegratorsResult,
    PortBudgetResult, RandomActionsResult, ReconstructionResult, RolloutsResult, SettlingResult, SimilarityPictures,
    SimilarityResult, WrenchResult,
};
use crate::{Error, Result};
use moving_picture::Lift;
use std::path::Path;
use trocar_camera::{ColorImage, Mask};
use trocar_cell::GraspLiftRun;
use trocar_geometry::RepairReport;
use trocar_reconstruct::Reconstruction;
use trocar_specimen::Specimen;

/// The page of a specimen reconstructed from a recording. `truth_dir` is the phantom's `truth` folder or the recording that
/// holds it; with `color.png` or `depth.png` (0.1 mm a unit) in it, the composite is compared with them.
///
/// # Errors
/// Images of differing sizes, an unreadable truth file, a picture that cannot be encoded.
pub fn reconstruction(r: &Reconstruction, truth_dir: Option<&Path>) -> Result<String> {
    let truth = match truth_dir {
        Some(dir) => {
            seen::check_sizes(r)?;
            truth::section(r, dir)?
        }
        None => String::new(),
    };
    let body = reconstruction_sections(r)? + &truth + &provenance(&r.specimen);
    Ok(page::page(&r.specimen.name, &made_from(&r.specimen, "Reconstruction"), &body))
}

/// The sections of the reconstruction's page without its frame, to put before those of a run.
///
/// # Errors
/// Images of differing sizes, a picture that cannot be encoded.
pub fn reconstruction_sections(r: &Reconstruction) -> Result<String> {
    seen::check_sizes(r)?;
    let specimen = &r.specimen;
    Ok(seen::overview(r)
        + &seen::images(r)?
        + &run::bodies(specimen, true)?
        + &seen::depth_errors(r)?
        + &notes(&r.notes))
}

/// The page of a grasp-lift in the cell.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn cell_lift(
    made: &crate::CellRun,
    run: &trocar_cell::CellLiftRun,
    pictures: &crate::watched::Pictures,
) -> Result<String> {
    let subtitle = format!("Grasp-lift in the cell '{}'", made.scene);
    Ok(page::page(&made.scene, &subtitle, &cell_lift::body(made, run, pictures)?))
}

/// The page of the reconstruction experiment; `made` are the reconstructions of its phantoms in their order.
///
/// # Errors
/// Images of differing sizes, a picture that cannot be encoded.
pub(crate) fn reconstruction_experiment(result: &ReconstructionResult, made: &[Reconstruction]) -> Result<String> {
    made.iter().try_for_each(seen::check_sizes)?;
    let subtitle = format!("{} organs of {} phantoms, one set of settings", result.organs.len(), made.len());
    Ok(page::page("Reconstruction", &subtitle, &reconstruction_experiment::body(result, made)?))
}

/// The page of a campaign: how far each policy came, on what, and how it failed.
///
/// # Errors
/// A plot that cannot be drawn, channels that cannot be read.
pub(crate) fn campaign(plan: &Plan, result: &CampaignResult, kept: &[Kept], store: &Store) -> Result<String> {
    let title = format!("{}: {}", plan.scene, plan.task);
    let failed: usize = result.policies.iter().map(|p| p.ends[4]).sum();
    let again = match failed {
        0 => String::new(),
        1 => "; in one the policy failed, and --retry-failed does it again".to_owned(),
        n => format!("; in {n} the policy failed, and --retry-failed does them again"),
    };
    let subtitle = format!("Campaign of {} episodes, seeds from {}{again}", result.episodes, plan.seed);
    Ok(page::page(&title, &subtitle, &campaign::body(plan, result, kept, store)?))
}

/// The page of the rollouts beside the paper.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn rollouts(plan: &Plan, result: &RolloutsResult, kept: &[Kept]) -> Result<String> {
    let subtitle = "Lift and RCM deviation of six controllers, beside the paper's Fig. 6(d, e)";
    Ok(page::page("Rollouts", subtitle, &rollouts::body(plan, result, kept)?))
}

/// The page of the meshing benchmark.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn meshing(result: &MeshingResult) -> Result<String> {
    Ok(page::page("Meshing", "From closed surfaces to tetrahedra", &meshing::body(result)?))
}

/// The page of the scaling benchmark.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn scaling(result: &ScalingResult) -> Result<String> {
    Ok(page::page("Scaling", "Stepping over elements, threads and models", &scaling::body(result)?))
}

/// The page of the integrators' comparison.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn integrators(result: &IntegratorsResult) -> Result<String> {
    Ok(page::page("Integrators", "Which stay bounded, and which are right", &integrators::body(result)?))
}

/// The page of random actions.
pub(crate) fn random_actions(result: &RandomActionsResult) -> String {
    page::page("Random actions", "What breaks under random but legal actions", &random_actions::body(result))
}

/// The page of the settling experiment.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn settling(result: &SettlingResult) -> Result<String> {
    Ok(page::page("Settling", "Phantoms released into the cell", &settling::body(result)?))
}

/// The page of the grasp designs.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn grasp_designs(result: &GraspDesignsResult) -> Result<String> {
    Ok(page::page("Grasp designs", "Four ways to hold the appendix", &grasp_designs::body(result)?))
}

/// The page of the element-quality experiment.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn element_quality(result: &ElementQualityResult) -> Result<String> {
    Ok(page::page("Element quality", "Lifts of the appendix against its pins", &element_quality::body(result)?))
}

/// The page of the convergence experiment.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn convergence(result: &ConvergenceResult) -> Result<String> {
    let subtitle = "Position and energy error of one substep, over iterations and over time";
    Ok(page::page("Convergence", subtitle, &convergence::body(result)?))
}

/// The page of the port budget.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn port_budget(result: &PortBudgetResult) -> Result<String> {
    Ok(page::page("Port budget", "How far a shaft may lie beside its port's centre", &port_budget::body(result)?))
}

/// The page of the controllers' grid.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn controller_grid(result: &ControllerGridResult) -> Result<String> {
    let subtitle = "182 configurations on the same motion, and the one that is chosen";
    Ok(page::page("Controllers", subtitle, &controller_grid::body(result)?))
}

/// The page of the similarity experiment; `shown` and `oblique` are the pictures of its rows and of its oblique views.
///
/// # Errors
/// A picture that cannot be encoded.
pub(crate) fn similarity(
    result: &SimilarityResult,
    shown: &[SimilarityPictures],
    oblique: &[SimilarityPictures],
) -> Result<String> {
    let subtitle = "Reconstructions rendered beside what was filmed";
    Ok(page::page("Similarity", subtitle, &similarity::body(result, shown, oblique)?))
}

/// The page of the wrench experiment.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn wrench(result: &WrenchResult) -> Result<String> {
    Ok(page::page("Force at the tool mount", "An instrument weighed, tared and touched", &wrench::body(result)?))
}

/// The page of a specimen made from a ready surface.
///
/// # Errors
/// A picture that cannot be encoded.
pub fn surface(s: &Specimen, repair: &RepairReport) -> Result<String> {
    let did = |yes: bool, text: &str| yes.then(|| text.to_owned());
    let found = |n: usize, text: &str| (n > 0).then(|| format!("{} {text}", table::count(n)));
    let lines: Vec<String> = [
        found(repair.components, "connected component(s) found"),
        found(repair.merged_vertices, "coincident vertices merged"),
        found(repair.degenerate_triangles, "degenerate triangles removed"),
        found(repair.open_edges, "edges with other than two triangles before the repair"),
        did(repair.flipped, "The triangles faced inward and were turned."),
        did(
            repair.rebuilt,
            "The surface was not watertight; it was rebuilt from its winding number and its largest piece kept.",
        ),
        did(!repair.rebuilt, "The surface is used as it came: it encloses a volume."),
    ]
    .into_iter()
    .flatten()
    .collect();
    let body = run::bodies(s, false)?
        + &page::section(
            "The surface as found",
            "What was wrong with the file's surface, and what was done.",
            &page::list(&lines),
        )
        + &provenance(s);
    Ok(page::page(&s.name, &made_from(s, "Organ"), &body))
}

/// The page of a grasp-lift run; `before` are sections to put first, such as [`reconstruction_sections`].
///
/// # Errors
/// Snapshots that are not of this specimen, a picture that cannot be encoded.
pub fn grasp_lift(s: &Specimen, run: &GraspLiftRun, before: Option<&str>) -> Result<String> {
    let (outcome, details) = run::sections(s, run)?;
    let body = match before {
        // The outcome first: it is what the reader came for.
        Some(before) => outcome + before + &details,
        None => outcome + &run::bodies(s, s.camera.is_some())? + &details,
    };
    let done = if run.summary.sever.is_some() { "grasp, lift and cut" } else { "grasp and lift" };
    let title = format!("{}: {done} of the {}", s.name, run.summary.organ);
    Ok(page::page(&title, &made_from(s, "Specimen"), &(body + &provenance(s))))
}

/// The moving picture of a run as a GIF, 480 x 300 pixels, 15 frames a second, endless.
///
/// # Errors
/// A run without snapshots, or with snapshots that are not of this specimen.
pub fn lift_gif(s: &Specimen, run: &GraspLiftRun) -> Result<Vec<u8>> {
    Lift::new(s, run)?.ok_or(Error::NoSnapshots)?.gif()
}

/// Tints and outlines `mask` in `picture`, in the colour that organ `index` has everywhere.
pub(crate) fn overlay(picture: &mut ColorImage, mask: &Mask, index: usize) {
    overlays::tint(picture, mask, colors::organ(index), 0.42);
    overlays::outline(picture, mask, colors::organ(index));
}

fn made_from(s: &Specimen, what: &str) -> String {
    let organs = match s.organs.len() {
        1 => "1 organ".to_owned(),
        n => format!("{n} organs"),
    };
    if s.provenance.source.is_empty() {
        return format!("{what}, {organs}");
    }
    format!("{what} from {}, {organs}", s.provenance.source)
}

fn notes(notes: &[String]) -> String {
    if notes.is_empty() {
        return String::new();
    }
    page::section("Notes", "What the reconstruction met on the way.", &page::list(notes))
}

fn provenance(s: &Specimen) -> String {
    let p = &s.provenance;
    let mut entries =
        vec![("Source", p.source.clone()), ("Input hash", p.input_hash.clone()), ("Program", p.program.clone())];
    entries.retain(|e| !e.1.is_empty());
    if !p.settings.is_empty() {
        entries.push(("Settings", p.settings.join("; ")));
    }
    if entries.is_empty() {
        return String::new();
    }
    page::section("Provenance", "", &page::definitions(&entries))
}
