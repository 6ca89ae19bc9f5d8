//! The pages of specimens and runs.
//!
//! [`reconstruction`] shows how a recording became organs, [`surface`] what became of a ready surface, [`grasp_lift`] how
//! the organs behaved when they were lifted.

mod cell_lift;
mod moving_picture;
mod organ_table;
pub mod organ_views;
mod run;
mod seen;
mod severed;
mod summary_table;
mod truth;

use crate::cell_figures::CellRun;
use crate::watched::Pictures;
use crate::{Error, Result};
use moving_picture::Lift;
use std::path::Path;
use trocar_cell::GraspLiftRun;
use trocar_geometry::RepairReport;
use trocar_reconstruct::Reconstruction;
use trocar_report::{page, table};
use trocar_specimen::Specimen;

pub use seen::check_sizes;

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
pub(crate) fn cell_lift(made: &CellRun, run: &trocar_cell::CellLiftRun, pictures: &Pictures) -> Result<String> {
    let subtitle = format!("Grasp-lift in the cell '{}'", made.scene);
    Ok(page::page(&made.scene, &subtitle, &cell_lift::body(made, run, pictures)?))
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
