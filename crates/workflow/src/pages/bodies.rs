//! The section on the bodies of a specimen: views and table.

use super::organ_table;
use super::organ_views::{self, Directions};
use crate::Result;
use glam::DVec3;
use trocar_render::phong::PhongScene;
use trocar_report::page::{self, Columns};
use trocar_report::views::View;
use trocar_report::{colors, figures};
use trocar_specimen::Specimen;

/// Views of the organs, whose `surfaces` are a scene, and their table.
pub(super) fn section(s: &Specimen, surfaces: &PhongScene, beside_paper: bool) -> Result<String> {
    // Bodies are included, because a lattice may extend beyond its surface.
    let points: Vec<DVec3> =
        s.organs.iter().flat_map(|o| o.surface.vertices.iter().chain(&o.body.vertices).copied()).collect();
    let d = Directions::of(s);
    let size = (640, 416);
    let oblique = View::framing(&points, d.oblique(), d.up, size);
    let low = View::framing(&points, d.low(), d.up, size);
    let rest = organ_views::rest(s);
    let picture =
        |view: &View, scene: &PhongScene, alt: &str, caption: &str| figures::figure(&view.picture(scene), alt, caption);
    let names = s.organs.iter().enumerate().map(|(i, o)| (o.name.as_str(), colors::organ(i)));
    let wires = format!("<b>Tetrahedra.</b> Outer faces of the simulated bodies.{}", page::legend(names));
    let cut = "<b>Cut-away.</b> Each organ opened by an upright plane through its middle; cut elements are lighter.";
    let figures = [
        picture(&oblique, surfaces, "organ surfaces, oblique view", "<b>Surfaces</b> obliquely from the front.")?,
        picture(&low, surfaces, "organ surfaces, low view", "<b>Surfaces, from low on the other side.</b>")?,
        picture(&oblique, &organ_views::wires(s, &rest, None), "tetrahedral meshes", &wires)?,
        picture(&oblique, &organ_views::wires(s, &rest, Some(d.front)), "tetrahedral meshes, cut open", cut)?,
    ];
    let lead = if beside_paper {
        "Each organ is a watertight surface around a body of tetrahedra. Small figures: the paper\u{2019}s Table I, for \
         organs of the same name."
    } else {
        "Each organ is a watertight surface around a body of tetrahedra."
    };
    let body = page::grid(Columns::Two, &figures) + &organ_table::organs(s, beside_paper);
    Ok(page::section("The organs", lead, &body))
}
