//! From a surface as found on disk to one that encloses a volume.

use crate::{Error, MeshDistance, Result, TriMesh, isosurface, sample_distance, taubin};
use glam::DVec3;
use std::collections::HashMap;

/// What [`repair`] found and did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RepairReport {
    /// Coincident vertices merged (an STL file has none shared).
    pub merged_vertices: usize,
    /// Triangles without area or with a repeated vertex, removed.
    pub degenerate_triangles: usize,
    /// Edges with other than two triangles before the repair.
    pub open_edges: usize,
    /// Connected components found.
    pub components: usize,
    /// True when the surface was rebuilt from its winding number because it was not watertight.
    pub rebuilt: bool,
    /// True when the triangles faced inward and were turned.
    pub flipped: bool,
}

/// Vertices nearer to each other than this share of the bounding box's diagonal are one.
const MERGE: f64 = 1e-9;

/// A surface encloses no volume when that is below this share of the cube of its diagonal (a sheet 1 mm thick and 1 m wide has 1e-3).
const LEAST_VOLUME: f64 = 1e-6;

/// A rebuilt surface has this many grid cells along its bounding box's diagonal.
const REBUILD_CELLS: f64 = 160.0;

/// Makes `mesh` watertight and outward, or says why it cannot be. Merges vertices, drops degenerate triangles, turns an
/// inward surface; a surface that still is not watertight is rebuilt as the isosurface of its generalized winding number. The largest
/// piece is kept.
///
/// # Errors
/// NaN or infinite vertices, indices out of range, no triangles, or a surface that encloses no volume.
pub fn repair(mesh: &TriMesh) -> Result<(TriMesh, RepairReport)> {
    mesh.check()?;
    let (lo, hi) = mesh.bounds().ok_or_else(|| Error::Mesh("the surface has no vertex".to_owned()))?;
    let diagonal = (hi - lo).length();
    let (mut surface, mut report) = merge(mesh, MERGE * diagonal);
    if surface.triangles.is_empty() {
        return Err(Error::Mesh("the surface has no triangle with an area".to_owned()));
    }
    report.open_edges = surface.open_edges();
    report.components = surface.components().1;
    if report.open_edges > 0 && orient(&mut surface) {
        report.flipped = true;
    }
    if surface.open_edges() == 0 {
        surface = surface.largest_component();
    }
    if surface.volume() < 0.0 {
        surface.flip();
        report.flipped = true;
    }
    if surface.open_edges() > 0 {
        surface = rebuild(&surface, diagonal / REBUILD_CELLS)?;
        report.rebuilt = true;
    }
    if surface.volume() < LEAST_VOLUME * diagonal.powi(3) {
        return Err(Error::Mesh(format!(
            "the surface encloses no volume ({:.3e} m3 within a box of {:.3e} m): is it flat, or open on one side?",
            surface.volume(),
            diagonal
        )));
    }
    Ok((surface, report))
}

/// Makes vertices within `distance` of each other one (by cells of that size), drops degenerate triangles and unused vertices.
fn merge(mesh: &TriMesh, distance: f64) -> (TriMesh, RepairReport) {
    let mut report = RepairReport::default();
    let mut first: HashMap<[i64; 3], u32> = HashMap::with_capacity(mesh.vertices.len());
    let mut merged = TriMesh::default();
    let key = |v: &DVec3| {
        v.to_array().map(|x| if distance > 0.0 { (x / distance).round() as i64 } else { x.to_bits() as i64 })
    };
    let index: Vec<u32> = (0..mesh.vertices.len())
        .map(|i| {
            *first.entry(key(&mesh.vertices[i])).or_insert_with(|| {
                merged.vertices.push(mesh.vertices[i]);
                merged.colors.extend(mesh.colors.get(i));
                merged.vertices.len() as u32 - 1
            })
        })
        .collect();
    report.merged_vertices = mesh.vertices.len() - merged.vertices.len();
    merged.triangles = mesh.triangles.iter().map(|t| t.map(|i| index[i as usize])).collect();
    let total = merged.triangles.len();
    // An area of zero between three different vertices (a needle) is kept: dropping it would open the surface.
    merged.triangles.retain(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]);
    report.degenerate_triangles = total - merged.triangles.len();
    (merged.keep(|_| true), report)
}

/// Makes neighbouring triangles run along their shared edge in opposite directions, spreading from the first of each component.
/// Edges of more than two triangles do not spread. True when a triangle was turned.
fn orient(mesh: &mut TriMesh) -> bool {
    let mut of_edge: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * mesh.triangles.len());
    for (t, [a, b, c]) in mesh.triangles.iter().enumerate() {
        for (i, j) in [(a, b), (b, c), (c, a)] {
            of_edge.push((*i.min(j), *i.max(j), t as u32));
        }
    }
    of_edge.sort_unstable();
    let mut neighbours = vec![Vec::new(); mesh.triangles.len()];
    for run in of_edge.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)).filter(|run| run.len() == 2) {
        neighbours[run[0].2 as usize].push((run[1].2, run[0].0, run[0].1));
        neighbours[run[1].2 as usize].push((run[0].2, run[0].0, run[0].1));
    }
    let runs = |t: [u32; 3], a: u32, b: u32| (0..3).any(|k| t[k] == a && t[(k + 1) % 3] == b);
    let mut seen = vec![false; mesh.triangles.len()];
    let mut turned = false;
    for start in 0..mesh.triangles.len() {
        let mut queue = vec![start];
        while let Some(t) = queue.pop() {
            if std::mem::replace(&mut seen[t], true) {
                continue;
            }
            for (other, a, b) in &neighbours[t] {
                let other = *other as usize;
                if !seen[other] {
                    if runs(mesh.triangles[t], *a, *b) == runs(mesh.triangles[other], *a, *b) {
                        mesh.triangles[other].swap(1, 2);
                        turned = true;
                    }
                    queue.push(other);
                }
            }
        }
    }
    turned
}

/// The surface where the generalized winding number says inside becomes outside; its largest piece.
fn rebuild(mesh: &TriMesh, spacing: f64) -> Result<TriMesh> {
    let field = MeshDistance::new(mesh)?;
    let Some(bounds) = mesh.bounds() else { return Ok(TriMesh::default()) };
    let mut surface = isosurface(&sample_distance(&field, bounds, spacing), 0.0).largest_component();
    taubin(&mut surface, 0.5, -0.53, 5);
    Ok(surface)
}
