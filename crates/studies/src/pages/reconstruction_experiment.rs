//! The page of the reconstruction experiment: Table I and Fig. 6(a) beside the paper's.

use crate::Result;
use crate::experiment::{ReconstructionResult, ReconstructionRow};
use std::fmt::Write;
use trocar_core::Pose;
use trocar_reconstruct::Reconstruction;
use trocar_render::phong::PhongScene;
use trocar_report::page::{self, Card, Columns};
use trocar_report::table::{count, fixed, percent};
use trocar_report::{colors, figures, overlays};

/// What is asked of each organ: depth error, signed error [mm], volume error, dihedral angle [degrees].
const DEPTH_ERROR: f64 = 1.0;
const SIGNED_ERROR: f64 = 0.3;
const VOLUME_ERROR: f64 = 0.1;
const DIHEDRAL: f64 = 10.0;

pub(super) fn body(result: &ReconstructionResult, made: &[Reconstruction]) -> Result<String> {
    Ok(summary(result) + &table(result) + &errors(made)? + &composites(result) + &looks(made)?)
}

fn summary(result: &ReconstructionResult) -> String {
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
        Card::new("Inverted elements", count(inverted), "of all; paper 0").met(inverted == 0),
        Card::new("Smallest dihedral", format!("{}\u{b0}", fixed(dihedral, 1)), "of all elements; at least 10\u{b0}")
            .met(dihedral >= DIHEDRAL),
        Card::new("Depth error", format!("{} mm", fixed(depth, 2)), "the worst organ's median; paper 1.33 to 4.77 mm")
            .met(depth <= DEPTH_ERROR),
        Card::new(
            "Signed error",
            format!("{} mm", fixed(signed, 2)),
            "the worst organ's median, either way; paper \u{2212}1.15 to \u{2212}4.88 mm",
        )
        .met(signed <= SIGNED_ERROR),
        Card::new("Volume", percent(volume, 1), "off the true front with the modelled back, at worst")
            .met(volume <= VOLUME_ERROR),
    ];
    page::section("Together", "", &page::cards(&cards))
}

fn table(result: &ReconstructionResult) -> String {
    let mut out = String::from(
        "<div class=\"wide\"><table><thead><tr><th>Organ</th><th>Nodes</th><th>Tetra\u{ad}hedra</th>\
         <th>Min. dihedral<br>[\u{b0}]</th><th>Median dihedral<br>[\u{b0}]</th><th>Median edge<br>[mm]</th>\
         <th>Water\u{ad}tight</th><th>In\u{ad}verted</th><th>Depth error<br>[mm]</th><th>signed<br>[mm]</th>\
         <th>binary grid, signed<br>[mm]</th><th>against truth<br>[mm]</th><th>Covered</th><th>Volume<br>[cm\u{b3}]</th>\
         <th>off the model</th><th>off the truth</th></tr></thead><tbody>\n",
    );
    let paper = |n: Option<usize>| n.map_or(String::new(), |n| format!("<small>{}</small>", count(n)));
    let cell = |good: bool, text: String| format!("<td{}>{text}</td>", if good { "" } else { " class=\"bad\"" });
    for r in &result.organs {
        let _ = writeln!(
            out,
            "<tr><td>{}<small>{}</small></td><td>{}{}</td><td>{}{}</td>{}<td>{}</td><td>{}</td>{}{}{}{}<td>{}</td><td>{}</td>\
             <td>{}</td><td>{}</td>{}<td>{}</td></tr>",
            page::escape(&r.organ),
            page::escape(&r.phantom),
            count(r.nodes),
            paper(r.paper_nodes),
            count(r.tets),
            paper(r.paper_tets),
            cell(r.min_dihedral_deg >= DIHEDRAL, fixed(r.min_dihedral_deg, 1)),
            fixed(r.median_dihedral_deg, 1),
            fixed(r.median_edge_mm, 2),
            cell(r.watertight, if r.watertight { "yes" } else { "no" }.to_owned()),
            cell(r.inverted == 0, count(r.inverted)),
            cell(r.depth_error_median_mm <= DEPTH_ERROR, fixed(r.depth_error_median_mm, 2)),
            cell(r.signed_error_median_mm.abs() <= SIGNED_ERROR, fixed(r.signed_error_median_mm, 2)),
            fixed(r.binary_grid_signed_error_mm.unwrap_or(f64::NAN), 2),
            fixed(r.truth_error_median_mm, 2),
            percent(r.covered, 0),
            fixed(r.volume_cm3, 2),
            cell(r.volume_error.abs() <= VOLUME_ERROR, percent(r.volume_error, 1)),
            percent(r.volume_error_truth, 0),
        );
    }
    out.push_str("</tbody></table></div>\n");
    page::section(
        "Table I",
        "Small figures: the paper's. The depth error is the paper's measure: the surface through the recording camera against the \
         depth it was made from. <i>Off the model</i>: the volume against that between the true front and the back that the paper's \
         closure puts behind it. <i>Off the truth</i>: against the organ itself, whose back no camera saw.",
        &out,
    )
}

/// Fig. 6(a): where the surfaces lie before or behind the depth.
fn errors(made: &[Reconstruction]) -> Result<String> {
    let mut shown = Vec::new();
    for r in made {
        let mut picture = overlays::dimmed(&r.background);
        for organ in &r.organs {
            overlays::error(&mut picture, &organ.depth_error, &organ.compared);
        }
        let img = figures::img(&picture, "signed depth error of all organs")?;
        shown.push(page::figure(&img, &format!("<b>{}.</b>", page::escape(&r.specimen.name))));
    }
    let bar = page::scale_bar(&colors::DIVERGING, "\u{2212}5", "surface minus measured depth [mm]", "+5");
    Ok(page::section(
        "Depth error (Fig. 6a)",
        "Blue: the surface lies nearer to the camera than measured; red: behind.",
        &(page::grid(Columns::Three, &shown) + &bar),
    ))
}

fn composites(result: &ReconstructionResult) -> String {
    let head = [
        "Phantom",
        "Frames",
        "Recovered (paper 3.4 %)",
        "Coverage (90.3 %)",
        "Depth range (2.0 mm)",
        "Depth error, median",
        "95th percentile",
        "under the instruments",
        "Reconstruction",
    ];
    let rows: Vec<Vec<String>> = result
        .phantoms
        .iter()
        .map(|p| {
            let c = &p.composite;
            let truth = c.truth.unwrap_or_default();
            let mm = |v: f64| format!("{} mm", fixed(v, 2));
            vec![
                p.phantom.clone(),
                count(c.frames_used),
                percent(c.recovered_share, 1),
                percent(c.coverage, 1),
                mm(c.depth_range_median_mm),
                mm(truth.depth_error_median_mm),
                mm(truth.depth_error_p95_mm),
                mm(truth.under_instruments_median_mm.unwrap_or(f64::NAN)),
                format!("{} s", fixed(p.seconds, 1)),
            ]
        })
        .collect();
    page::section(
        "Composites",
        "What the window's frames say of the scene behind the instruments, and how far that is from the truth.",
        &trocar_report::table::plain(&head, &rows),
    )
}

/// Photograph and reconstruction, side by side.
fn looks(made: &[Reconstruction]) -> Result<String> {
    let mut shown = Vec::new();
    for r in made {
        let Some(camera) = &r.specimen.camera else { continue };
        let name = page::escape(&r.specimen.name);
        let input = figures::img(&r.input, "input frame")?;
        shown.push(page::figure(&input, &format!("<b>{name}.</b> The window's centre frame as recorded.")));
        let scene =
            PhongScene::new(trocar_workflow::pages::organ_views::surfaces(&r.specimen), None, colors::VIEW_GROUND)
                .with_ambient_occlusion(24, 0.012);
        let rendered = scene.render(camera, &Pose::IDENTITY, 2).color;
        let rendered = figures::img(&rendered, "reconstructed surfaces through the recording camera")?;
        shown.push(page::figure(&rendered, "<b>Reconstructed.</b> The surfaces through the recording camera."));
    }
    Ok(page::section("What came of it", "", &page::grid(Columns::Two, &shown)))
}
