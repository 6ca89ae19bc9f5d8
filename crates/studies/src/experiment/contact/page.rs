//! The page of the study.

use super::result::ContactResult;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::Card;
use trocar_report::table::{count, fixed, or_dash, percent};

/// Greatest error of a force at rest, and of the one at which a tool slides.
const MAX_ERROR: f64 = 0.02;
const MAX_ERROR_DRAGGED: f64 = 0.04;

pub(super) fn document(r: &ContactResult) -> Document {
    Document::new("Contact", "Contact beside the oracle and Hertz")
        .with(spheres(r))
        .with(scenes(r))
        .with(drags(r))
        .with(bodies(r))
}

fn spheres(r: &ContactResult) -> Section {
    let lead = format!(
        "A sphere of {} mm is pressed {} mm without friction into a layer of {} mm, {} kPa and Poisson's ratio {}, \
         which is fixed to its ground. The oracle is Newton's method in double precision on the same mesh, with the \
         same stiffness of contact and the true distance at every place. Stiff is the oracle with contact 50 times as \
         stiff. Hertz's force is that of a half-space; that of the layer is Dimitriadis and others' (2002). What \
         separates them from the oracle is the mesh.",
        fixed(r.radius_mm, 0),
        fixed(r.depth_mm, 1),
        fixed(r.thickness_mm, 0),
        fixed(1e-3 * r.young_modulus_pa, 1),
        fixed(r.poisson_ratio, 2)
    );
    let most = |of: &dyn Fn(&super::SphereRow) -> f64| r.spheres.iter().map(of).fold(0.0, f64::max);
    let (force, field) = (most(&|row| row.force_error), most(&|row| row.field_error));
    let cards = [
        Card::new("Force", percent(force, 3), "greatest difference from the oracle; 2% at most")
            .met(force <= MAX_ERROR),
        Card::new("Field", percent(field, 3), "greatest distance of a node, over the greatest displacement")
            .met(field <= MAX_ERROR),
    ];
    let table = Table::of(
        &r.spheres,
        &[
            ("Contact", &|row| row.tool_contact.clone()),
            ("Edge (mm)", &|row| fixed(row.edge_mm, 2)),
            ("Nodes", &|row| count(row.nodes)),
            ("Touching", &|row| count(row.touching)),
            ("Fast (N)", &|row| fixed(row.fast_n, 4)),
            ("Oracle (N)", &|row| fixed(row.oracle_n, 4)),
            ("Error", &|row| percent(row.force_error, 3)),
            ("Field", &|row| percent(row.field_error, 3)),
            ("Stiff (N)", &|row| or_dash(row.stiff_n, 4)),
            ("Overlap (mm)", &|row| fixed(row.overlap_mm, 3)),
            ("Hertz (N)", &|row| fixed(row.hertz_n, 4)),
            ("Layer (N)", &|row| fixed(row.layer_n, 4)),
        ],
    );
    Section::new("A pressed sphere", lead).cards(cards).table(table)
}

fn scenes(r: &ContactResult) -> Section {
    let lead = "The same layer with the tissue that a scene gives an organ, beside Hertz's force for the layer: \
                tetrahedra with mesh_correction, and the lattice with cells as large as the edges.";
    let table = Table::of(
        &r.scenes,
        &[
            ("Poisson's ratio", &|row| fixed(row.poisson_ratio, 3)),
            ("Backend", &|row| row.backend.clone()),
            ("Contact", &|row| row.tool_contact.clone()),
            ("Edge (mm)", &|row| fixed(row.edge_mm, 2)),
            ("Nodes", &|row| count(row.nodes)),
            ("Touching", &|row| count(row.touching)),
            ("Force (N)", &|row| fixed(row.force_n, 4)),
            ("Overlap (mm)", &|row| fixed(row.overlap_mm, 3)),
            ("Layer (N)", &|row| fixed(row.layer_n, 4)),
            ("Over the layer's", &|row| percent(row.layer_error, 1)),
        ],
    );
    Section::new("Tissue of a scene", lead).table(table)
}

fn drags(r: &ContactResult) -> Section {
    let lead = "A capsule of 3 mm is pressed 1 mm into the layer and dragged along it, with a friction of 0.15. The \
                force is the greatest along the surface: the tool begins to slide. The oracle takes the same substeps.";
    let most = r.drags.iter().map(|row| row.error).fold(0.0, f64::max);
    let card = Card::new("Threshold", percent(most, 2), "greatest difference from the oracle; 4% at most");
    let table = Table::of(
        &r.drags,
        &[
            ("Contact", &|row| row.tool_contact.clone()),
            ("Edge (mm)", &|row| fixed(row.edge_mm, 2)),
            ("Speed (mm/s)", &|row| fixed(row.speed_mm_s, 1)),
            ("Fast (N)", &|row| fixed(row.fast_n, 4)),
            ("Oracle (N)", &|row| fixed(row.oracle_n, 4)),
            ("Error", &|row| percent(row.error, 2)),
        ],
    );
    Section::new("A dragged capsule", lead).cards([card.met(most <= MAX_ERROR_DRAGGED)]).table(table)
}

fn bodies(r: &ContactResult) -> Section {
    let lead = "A cube of 8 mm, held at its top, is pressed on the layer without friction: 2 mm down from a gap of \
                1.7 mm.";
    let most = r.bodies.iter().map(|row| row.force_error.max(row.field_error)).fold(0.0, f64::max);
    let card = Card::new("Force and field", percent(most, 3), "greatest difference from the oracle; 2% at most");
    let table = Table::of(
        &r.bodies,
        &[
            ("Edge (mm)", &|row| fixed(row.edge_mm, 2)),
            ("Nodes", &|row| count(row.nodes)),
            ("Fast (N)", &|row| fixed(row.fast_n, 4)),
            ("Oracle (N)", &|row| fixed(row.oracle_n, 4)),
            ("Error", &|row| percent(row.force_error, 3)),
            ("Field", &|row| percent(row.field_error, 3)),
        ],
    );
    Section::new("A body on another", lead).cards([card.met(most <= MAX_ERROR)]).table(table)
}
