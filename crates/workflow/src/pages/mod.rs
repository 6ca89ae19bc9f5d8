//! The pages of specimens and runs.
//!
//! [`reconstruction`] shows how a recording became organs, [`surface`] what became of a ready surface, and the page of a lift how
//! the organs behaved when they were lifted.

mod bodies;
mod lift;
mod organ_table;
pub mod organ_views;
mod seen;
mod severed;
mod truth;

use crate::Result;
use crate::lifted::Lifted;
use std::path::Path;
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
        + &bodies::section(specimen, true)?
        + &seen::depth_errors(r)?
        + &notes(&r.notes))
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
    let body = bodies::section(s, false)?
        + &page::section(
            "The surface as found",
            "What was wrong with the file's surface, and what was done.",
            &page::list(&lines),
        )
        + &provenance(s);
    Ok(page::page(&s.name, &made_from(s, "Organ"), &body))
}

/// The page of a lift; `before` are sections to put first, such as [`reconstruction_sections`].
///
/// # Errors
/// A picture or plot that cannot be made.
pub(crate) fn lift(s: &Specimen, lifted: &Lifted, before: Option<&str>) -> Result<String> {
    let (outcome, details) = lift::sections(lifted)?;
    let body = match before {
        // The outcome first: it is what the reader came for.
        Some(before) => outcome + before + &details,
        None => outcome + &bodies::section(s, s.camera.is_some())? + &details,
    };
    let summary = &lifted.recording.summary;
    let done = if summary.cuts > 0 { "grasp, lift and cut" } else { "grasp and lift" };
    let title = format!("{}: {done} of the {}", s.name, summary.details.organ);
    Ok(page::page(&title, &made_from(s, "Specimen"), &(body + &provenance(s))))
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
