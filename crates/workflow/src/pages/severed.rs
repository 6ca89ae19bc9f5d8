//! An organ in its pieces: its surface with the faces that were cut, its elements, and the report's section on the cut.

use super::moving_picture::Lift;
use super::organ_views::{self, Directions};
use crate::Result;
use glam::DVec3;
use std::collections::BTreeSet;
use trocar_cell::{CutOrgan, Severance, Snapshot};
use trocar_geometry::{Skin, TetMesh, TriMesh};
use trocar_report::page::{self, Card, Columns};
use trocar_report::table::{self, count, fixed};
use trocar_report::views::View;
use trocar_report::{colors, figures};
use trocar_specimen::{Organ, Specimen};

/// Colour of what a cut laid bare.
const BARED: [u8; 3] = [158, 34, 40];

/// A close-up shows this much around the middle of a cut [m].
const AROUND: f64 = 0.009;

/// The surface of an organ that was cut, bound to its pieces.
///
/// The recorded surface knows nothing of the cut, and its triangles are not the elements': where elements fell apart, and beside them, the elements' own outer faces take its place.
pub(super) struct CutSkin<'a> {
    cut: &'a CutOrgan,
    body: TetMesh,
    /// Triangles of the recorded surface that stay.
    kept: Vec<[u32; 3]>,
    /// Outer faces of elements that take the others' place, and the colour of each node.
    rim: Vec<[u32; 3]>,
    tint: Vec<[u8; 3]>,
}

impl<'a> CutSkin<'a> {
    /// Of `organ` with its `skin`, `color` being what it is drawn in where its surface has none.
    pub(super) fn new(organ: &Organ, skin: &Skin, cut: &'a CutOrgan, color: [u8; 3]) -> Self {
        let mut copies = vec![0; organ.body.vertices.len()];
        cut.parents.iter().for_each(|i| copies[*i as usize] += 1);
        let beside = |nodes: &[bool]| -> Vec<bool> {
            organ.body.tets.iter().map(|tet| tet.iter().any(|i| nodes[*i as usize])).collect()
        };
        // Elements at the cut, and with them those that share a node: skin and faces overlap there, so that nothing gapes.
        let split: Vec<bool> = copies.iter().map(|n| *n > 1).collect();
        let at_cut = beside(&split);
        let mut near = vec![false; split.len()];
        for (tet, _) in organ.body.tets.iter().zip(&at_cut).filter(|(_, at)| **at) {
            tet.iter().for_each(|i| near[*i as usize] = true);
        }
        let around = beside(&near);
        let stays = |triangle: &&[u32; 3]| {
            triangle.iter().all(|v| skin.bindings.get(*v as usize).is_some_and(|(t, _)| !at_cut[*t as usize]))
        };
        let kept = organ.surface.triangles.iter().filter(stays).copied().collect();
        let vertices: Vec<DVec3> = cut.parents.iter().map(|i| organ.body.vertices[*i as usize]).collect();
        let body = TetMesh { vertices, tets: cut.tets.clone() };
        let mut rim_node = vec![false; cut.parents.len()];
        for (tet, _) in cut.tets.iter().zip(&around).filter(|(_, around)| **around) {
            tet.iter().for_each(|i| rim_node[*i as usize] = true);
        }
        let bared = sorted(&cut.faces);
        let (shell, nodes) = body.boundary();
        let faces = shell.triangles.iter().map(|t| t.map(|v| nodes[v as usize]));
        let rim: Vec<[u32; 3]> =
            faces.filter(|f| f.iter().all(|i| rim_node[*i as usize]) && !bared.contains(&key(f))).collect();
        let mut tint = vec![color; cut.parents.len()];
        if organ.surface.colors.len() == organ.surface.vertices.len() {
            let mut wanted: Vec<u32> = rim.iter().flatten().copied().collect();
            wanted.sort_unstable();
            wanted.dedup();
            for i in wanted {
                let p = body.vertices[i as usize];
                let distance = |v: &DVec3| v.distance_squared(p);
                let nearest = organ.surface.vertices.iter().zip(&organ.surface.colors);
                let nearest = nearest.min_by(|a, b| distance(a.0).total_cmp(&distance(b.0)));
                tint[i as usize] = nearest.map_or(color, |(_, c)| *c);
            }
        }
        Self { cut, body, kept, rim, tint }
    }

    /// The surface when the nodes are at `nodes` [m]; `skin` and `organ` are those that it was made of.
    pub(super) fn surface(&self, organ: &Organ, skin: &Skin, nodes: &[DVec3], color: [u8; 3]) -> TriMesh {
        let mut mesh = organ.surface.clone();
        skin.deform(&self.body, nodes, &mut mesh.vertices);
        mesh.triangles.clone_from(&self.kept);
        if mesh.colors.len() != mesh.vertices.len() {
            mesh.colors = vec![color; mesh.vertices.len()];
        }
        add(&mut mesh, &self.rim, nodes, |i| self.tint[i as usize]);
        add(&mut mesh, &self.cut.faces, nodes, |_| BARED);
        mesh
    }

    /// The outer faces of the elements in `color` when the nodes are at `nodes` [m]; those of the cut in theirs.
    pub(super) fn wires(&self, nodes: &[DVec3], color: [u8; 3]) -> TriMesh {
        let (shell, index) = self.body.boundary();
        let bared = sorted(&self.cut.faces);
        let faces: Vec<[u32; 3]> = shell.triangles.iter().map(|t| t.map(|v| index[v as usize])).collect();
        let (cut, whole): (Vec<_>, Vec<_>) = faces.into_iter().partition(|f| bared.contains(&key(f)));
        let mut mesh = TriMesh::default();
        add(&mut mesh, &whole, nodes, |_| color);
        add(&mut mesh, &cut, nodes, |_| colors::mix(BARED, [255; 3], 0.25));
        mesh
    }
}

/// The nodes of a face in an order that does not depend on the side it is seen from.
fn key(face: &[u32; 3]) -> [u32; 3] {
    let mut key = *face;
    key.sort_unstable();
    key
}

fn sorted(faces: &[[u32; 3]]) -> BTreeSet<[u32; 3]> {
    faces.iter().map(key).collect()
}

/// Adds `faces` of `nodes` with vertices of their own, so that no colour runs over into what is beside them.
fn add(mesh: &mut TriMesh, faces: &[[u32; 3]], nodes: &[DVec3], color: impl Fn(u32) -> [u8; 3]) {
    let mut used: Vec<u32> = faces.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let first = mesh.vertices.len() as u32;
    let place = |i: u32| first + used.binary_search(&i).unwrap_or(0) as u32;
    mesh.triangles.extend(faces.iter().map(|f| f.map(place)));
    mesh.vertices.extend(used.iter().map(|i| nodes[*i as usize]));
    mesh.colors.extend(used.iter().map(|i| color(*i)));
}

/// The section on the cut; `lift` has the run's pictures, if it kept any.
pub(super) fn section(specimen: &Specimen, s: &Severance, lift: Option<&Lift<'_>>) -> Result<String> {
    let went_through = s.outcome == "severed";
    let mut body = page::cards(&[
        Card::new("Outcome", s.outcome, format!("at s = {}", fixed(if s.faces > 0 { s.at } else { s.aimed_at }, 2)))
            .met(went_through),
        Card::new(
            "Pieces",
            count(s.pieces.len().max(1)),
            s.pieces.iter().map(|p| p.name.clone()).collect::<Vec<_>>().join(", "),
        ),
        Card::new(
            "Held on",
            if s.held { "yes" } else { "no" },
            format!("jaws rose {} mm, tissue in them {} mm", fixed(s.jaw_rise_mm, 1), fixed(s.held_rise_mm, 1)),
        )
        .met(s.held),
        Card::new(
            "Cut face",
            format!("{} mm\u{b2}", fixed(s.area_mm2, 0)),
            format!("{} faces, one side", count(s.faces)),
        ),
        Card::new(
            "Volume kept",
            if s.volume_error > 0.0 { format!("to {:.0e}", s.volume_error) } else { "to the bit".to_owned() },
            format!("{} mm\u{b3} before and after", fixed(s.volume_before_mm3, 0)),
        )
        .met(s.volume_error < 1e-6),
        Card::new("Inverted since", count(s.inverted_after.max(s.inverted_peak)), "elements in any frame")
            .met(s.inverted_after.max(s.inverted_peak) == 0),
        Card::new(
            "Blades",
            format!("{} to {} rad", fixed(s.opened_rad, 2), fixed(s.closed_rad, 2)),
            format!("closed {} s into the run", fixed(s.time_s, 2)),
        ),
        Card::new("Cost", format!("{} ms", fixed(s.cut_ms, 0)), "wall time of the cut, once"),
    ]);
    if let Some(lift) = lift {
        body += &pictures(specimen, lift, s)?;
    }
    if !s.pieces.is_empty() {
        body += &pieces(s);
    }
    // A sentence begins with a capital on the page.
    let mut said = s.said.clone();
    if let Some(first) = said.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    Ok(page::section("The cut", &page::escape(&format!("{said}.")), &body))
}

fn pieces(s: &Severance) -> String {
    let head = [
        "Piece",
        "s",
        "Nodes",
        "Pinned",
        "In the jaws",
        "Elements",
        "Volume before [mm\u{b3}]",
        "after [mm\u{b3}]",
        "Rose since [mm]",
    ];
    let row = |p: &trocar_cell::SeveredPiece| {
        vec![
            p.name.clone(),
            format!("{}\u{2013}{}", fixed(p.s_from, 2), fixed(p.s_to, 2)),
            count(p.nodes),
            count(p.pinned),
            count(p.held),
            count(p.elements),
            fixed(p.volume_before_mm3, 1),
            fixed(p.volume_after_mm3, 1),
            fixed(p.rise_mm, 1),
        ]
    };
    table::plain(&head, &s.pieces.iter().map(row).collect::<Vec<_>>())
}

fn pictures(specimen: &Specimen, lift: &Lift<'_>, s: &Severance) -> Result<String> {
    let img = |view: &View, instances, alt: &str| figures::img(&view.picture(instances, 2), alt);
    let view = lift.view(2);
    let mut all = Vec::new();
    if let Some(open) = lift.before_cut() {
        let caption = format!("<b>The cutter,</b> open, {} s into the run.", fixed(open.time_s, 2));
        all.push(page::figure(&img(&view, lift.surfaces(open), "the open cutter at the lifted organ")?, &caption));
    }
    let last = lift.last();
    let end =
        if s.pieces.is_empty() { "<b>At the end.</b>" } else { "<b>At the end.</b> Dark red: what the cut laid bare." };
    all.push(page::figure(&img(&view, lift.surfaces(last), "the organ at the end of the run")?, end));
    if let Some(cut) = lift.cut().filter(|_| last.cut) {
        all.push(page::figure(
            &img(&view, lift.wires(last), "elements at the end of the run")?,
            "<b>Elements at the end;</b> faces that opened are reddish.",
        ));
        if let Some(view) = close_up(specimen, cut, last) {
            let picture = img(&view, lift.organs(last), "the stump's cut face, close up")?;
            all.push(page::figure(
                &picture,
                "<b>Close up:</b> the face of what stayed behind, without the instruments.",
            ));
        }
    }
    Ok(page::grid(Columns::Two, &all))
}

/// A view on the face that the cut left on the first piece.
fn close_up(specimen: &Specimen, cut: &CutOrgan, at: &Snapshot) -> Option<View> {
    let nodes = at.nodes.get(cut.organ)?;
    let of_first = || cut.faces.iter().filter(|f| cut.piece[f[0] as usize] == 0).map(|f| f.map(|i| nodes[i as usize]));
    let normal: DVec3 = of_first().map(|[a, b, c]| (b - a).cross(c - a)).sum();
    let (sum, n) = of_first().flatten().fold((DVec3::ZERO, 0.0), |(sum, n), p| (sum + p, n + 1.0));
    let (middle, out) = ((n > 0.0).then(|| sum / n)?, normal.try_normalize()?);
    let d = Directions::of(specimen);
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let points: Vec<DVec3> = axes.iter().flat_map(|a| [middle + AROUND * a, middle - AROUND * a]).collect();
    Some(View::framing(&points, out + 0.7 * d.up, d.up, (960, 600)))
}

/// The organ at `index` of the specimen, cut, as a body of its own in a picture.
pub(super) fn instance(index: usize, mesh: TriMesh, gloss: f32, wireframe: bool) -> trocar_render::phong::Instance {
    let shading = trocar_render::phong::Shading { color: colors::organ(index), gloss, wireframe };
    trocar_render::phong::Instance { mesh, label: organ_views::label(index), shading }
}
