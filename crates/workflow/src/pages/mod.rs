//! The pages of specimens and runs.
//!
//! [`reconstruction`] is the page of a specimen from a recording, [`surface`] that of a specimen
//! from a surface file. Lifts and episodes have pages, too.

mod bodies;
mod cut;
mod episode;
mod images;
mod lift;
mod organ_table;
pub mod organ_views;
mod over_time;
mod truth;

use crate::lift_result::FinishedLift;
use crate::{Result, counted};
use trocar_geometry::RepairReport;
use trocar_reconstruct::Reconstruction;
use trocar_reconstruct::truth::Truth;
use trocar_report::{page, table};
use trocar_specimen::Specimen;

pub(crate) use episode::episode;
pub use images::check_sizes;

/// The page of a specimen reconstructed from a recording, with its [`reconstruction_sections`]. The
/// composite is compared with the `truth` of a phantom.
///
/// # Errors
/// A picture that cannot be encoded.
pub fn reconstruction(r: &Reconstruction, sections: &str, truth: Option<&Truth>) -> Result<String> {
    let truth = truth.map_or(Ok(String::new()), |truth| truth::section(r, truth))?;
    let body = sections.to_owned() + &truth + &provenance(&r.specimen);
    Ok(page::page(&r.specimen.name, &made_from(&r.specimen, "Reconstruction"), &body))
}

/// The sections of the reconstruction, for a page that shows a run as well.
///
/// # Errors
/// Images of different sizes, a picture that cannot be encoded.
pub fn reconstruction_sections(r: &Reconstruction) -> Result<String> {
    images::check_sizes(r)?;
    let surfaces = organ_views::surfaces(&r.specimen);
    let bodies = || bodies::section(&r.specimen, &surfaces, true);
    let (images, (bodies, depth_errors)) =
        rayon::join(|| images::images(r, &surfaces), || rayon::join(bodies, || images::depth_errors(r)));
    Ok(images::overview(r) + &images? + &bodies? + &depth_errors? + &notes(&r.notes))
}

/// The page of a specimen made from a surface file.
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
        did(repair.flipped, "The triangles faced inward and were flipped."),
        did(
            repair.rebuilt,
            "The surface was not watertight. It was rebuilt from its winding number; only its largest piece was used.",
        ),
        did(!repair.rebuilt, "The surface encloses a volume and is used unchanged."),
    ]
    .into_iter()
    .flatten()
    .collect();
    let body = bodies::section(s, &organ_views::surfaces(s), false)?
        + &page::section("Surface file", "Defects of the surface and their repair.", &page::list(&lines))
        + &provenance(s);
    Ok(page::page(&s.name, &made_from(s, "Organ"), &body))
}

/// The page of a lift. `before` are sections to insert after the outcome, such as
/// [`reconstruction_sections`].
pub(crate) fn lift(s: &Specimen, lifted: &FinishedLift, before: Option<&str>) -> Result<String> {
    let (outcome, details) = lift::sections(lifted)?;
    let body = match before {
        Some(before) => outcome + before + &details,
        None => outcome + &bodies::section(s, &organ_views::surfaces(s), s.camera.is_some())? + &details,
    };
    let summary = &lifted.recording.summary;
    let done = if summary.cuts > 0 { "grasp, lift and cut" } else { "grasp and lift" };
    let title = format!("{}: {done} of the {}", s.name, summary.details.organ);
    Ok(page::page(&title, &made_from(s, "Specimen"), &(body + &provenance(s))))
}

fn made_from(s: &Specimen, what: &str) -> String {
    let organs = counted(s.organs.len(), "organ");
    if s.provenance.source.is_empty() {
        return format!("{what}, {organs}");
    }
    format!("{what} from {}, {organs}", s.provenance.source)
}

fn notes(notes: &[String]) -> String {
    if notes.is_empty() {
        return String::new();
    }
    page::section("Notes", "Remarks of the reconstruction.", &page::list(notes))
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
