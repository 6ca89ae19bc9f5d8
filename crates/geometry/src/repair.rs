//! Repair of surfaces: from any triangle file to a surface that encloses a volume.

use crate::distance::check;
use crate::tri_mesh::edge_groups;
use crate::{Error, MeshDistance, Result, SignedDistance, TriMesh, isosurface, sample_everywhere, taubin};
use glam::DVec3;

/// Vertices closer than this fraction of the bounding box's diagonal are merged.
const MERGE_DISTANCE: f64 = 1e-9;
/// A triangle is degenerate below this area, as a fraction of the squared diagonal.
const MIN_AREA: f64 = 1e-18;
/// Least volume that a surface must enclose, as a fraction of the cubed diagonal. A body 1 m long
/// falls below it if it is thinner than about 1 mm in both directions.
const MIN_VOLUME: f64 = 1e-6;
/// Components of a closed surface are strays if they together enclose at most this fraction of the
/// largest.
const MAX_STRAY_VOLUME: f64 = 0.05;
/// Grid cells along the diagonal of a rebuilt surface.
const REBUILD_CELLS: f64 = 160.0;
/// Pairs of smoothing steps of a rebuilt surface.
const SMOOTHING_PAIRS: usize = 5;

/// What [`repair`] found and changed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RepairReport {
    /// Coincident vertices merged. The triangles of an STL file share none.
    pub merged_vertices: usize,
    /// Removed triangles: without area or with a repeated vertex.
    pub degenerate_triangles: usize,
    /// Edges that did not have exactly two triangles before the repair.
    pub open_edges: usize,
    /// Connected components found.
    pub components: usize,
    /// Whether the surface was rebuilt from its winding number because it was not watertight.
    pub rebuilt: bool,
    /// Whether the triangles faced inward and were flipped.
    pub flipped: bool,
}

/// Makes `mesh` watertight with outward triangles.
///
/// 1. Merges vertices closer than 1e-9 of the bounding box's diagonal and removes degenerate
///    triangles.
/// 2. Flips triangles that disagree with their neighbours, and an inward surface as a whole.
/// 3. Keeps the component with the largest volume of a closed surface if the others are strays
///    (together at most 5% of it).
/// 4. Rebuilds a surface that is still not watertight, or has several large components. The result
///    is the largest piece of the isosurface of its generalized winding number on a grid of 1/160
///    of the diagonal, slightly smoothed. It has no colours.
///
/// # Errors
/// Vertices that are not finite, indices out of range, no triangles, or a surface that encloses no
/// volume (less than 1e-6 of the cubed diagonal).
pub fn repair(mesh: &TriMesh) -> Result<(TriMesh, RepairReport)> {
    check(mesh)?;
    let mut report = RepairReport::default();
    let diagonal = mesh.bounds().map_or(0.0, |(low, high)| (high - low).length());
    let mut clean = merge_vertices(mesh, MERGE_DISTANCE * diagonal, &mut report);
    remove_degenerate(&mut clean, diagonal, &mut report);
    if clean.triangles.is_empty() {
        return Err(Error::Mesh(
            "no triangle of the surface has an area; a surface needs non-degenerate triangles".into(),
        ));
    }
    report.open_edges = clean.open_edges();
    orient_consistently(&mut clean);
    let (label, count) = clean.components();
    report.components = count;
    let volumes = clean.component_volumes(&label, count);
    let total: f64 = if report.open_edges == 0 { volumes.iter().sum() } else { clean.volume() };

    if clean.is_watertight() {
        let size: f64 = volumes.iter().map(|v| v.abs()).sum();
        let mut largest = clean.largest_component();
        let volume = largest.volume();
        if size - volume.abs() <= MAX_STRAY_VOLUME * volume.abs() {
            if volume < 0.0 {
                largest.flip();
                report.flipped = true;
            }
            return check_encloses(largest, diagonal).map(|mesh| (mesh, report));
        }
    }
    if total < 0.0 {
        clean.flip();
        report.flipped = true;
    }
    report.rebuilt = true;
    check_encloses(rebuild(&clean, diagonal)?, diagonal).map(|mesh| (mesh, report))
}

/// Returns `mesh` if it is watertight and encloses a volume.
fn check_encloses(mesh: TriMesh, diagonal: f64) -> Result<TriMesh> {
    let volume = mesh.volume();
    if volume.is_nan() || volume < MIN_VOLUME * diagonal.powi(3) || !mesh.is_watertight() {
        return Err(Error::Mesh(format!(
            "the surface encloses no volume ({volume:.1e} m3 in a box with a diagonal of {diagonal:.3} m); it must be closed, \
             or nearly so, around a body"
        )));
    }
    Ok(mesh)
}

/// Merges vertices within `tolerance` (m) of each other. Removes those that no triangle uses.
fn merge_vertices(mesh: &TriMesh, tolerance: f64, report: &mut RepairReport) -> TriMesh {
    // After sorting along a generic direction, coincident vertices are close in the order.
    let direction = DVec3::new(0.754_877_666, 0.569_840_291, 0.324_717_957);
    let along: Vec<f64> = mesh.vertices.iter().map(|v| v.dot(direction)).collect();
    let mut order: Vec<u32> = (0..along.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| along[a as usize].total_cmp(&along[b as usize]).then(a.cmp(&b)));
    let mut representative: Vec<u32> = (0..along.len() as u32).collect();
    let mut kept: Vec<u32> = Vec::new();
    let scale = along.iter().fold(0.0, |m: f64, a| m.max(a.abs()));
    let reach = tolerance + 4.0 * f64::EPSILON * scale;
    for &v in &order {
        let recent = kept.iter().rev().take_while(|&&k| along[v as usize] - along[k as usize] <= reach);
        let near =
            recent.copied().find(|&k| mesh.vertices[v as usize].distance(mesh.vertices[k as usize]) <= tolerance);
        match near {
            Some(k) => representative[v as usize] = k,
            None => kept.push(v),
        }
    }
    report.merged_vertices = mesh.vertices.len() - kept.len();
    let triangles = mesh.triangles.iter().map(|t| t.map(|v| representative[v as usize])).collect();
    TriMesh { triangles, vertices: mesh.vertices.clone(), colors: mesh.colors.clone() }.submesh(|_| true)
}

/// Removes triangles with a repeated vertex, and triangles without area unless the surface is
/// closed only with them.
fn remove_degenerate(mesh: &mut TriMesh, diagonal: f64, report: &mut RepairReport) {
    let before = mesh.triangles.len();
    mesh.triangles.retain(|&[a, b, c]| a != b && b != c && c != a);
    if mesh.open_edges() > 0 {
        let smallest = MIN_AREA * diagonal * diagonal;
        *mesh = mesh.submesh(|t| mesh.area_vector(t).length() > smallest);
    }
    report.degenerate_triangles = before - mesh.triangles.len();
}

/// Flips triangles so that the two neighbours across an edge agree, where possible. Each patch
/// keeps the orientation of most of its area.
fn orient_consistently(mesh: &mut TriMesh) {
    let sides = mesh.half_edges();
    let mut across: Vec<Vec<(u32, bool)>> = vec![Vec::new(); mesh.triangles.len()];
    for pair in edge_groups(&sides).filter(|group| group.len() == 2) {
        let disagree = pair[0].forward == pair[1].forward;
        across[pair[0].triangle as usize].push((pair[1].triangle, disagree));
        across[pair[1].triangle as usize].push((pair[0].triangle, disagree));
    }
    let mut flipped: Vec<Option<bool>> = vec![None; mesh.triangles.len()];
    for seed in 0..mesh.triangles.len() {
        if flipped[seed].is_some() {
            continue;
        }
        flipped[seed] = Some(false);
        let mut patch = vec![seed];
        let mut next = 0;
        let mut kept_minus_flipped = 0.0;
        while next < patch.len() {
            let t = patch[next];
            next += 1;
            let is_flipped = flipped[t] == Some(true);
            kept_minus_flipped += mesh.area_vector(t).length() * if is_flipped { -1.0 } else { 1.0 };
            for &(other, disagree) in &across[t] {
                if flipped[other as usize].is_none() {
                    flipped[other as usize] = Some(is_flipped != disagree);
                    patch.push(other as usize);
                }
            }
        }
        for t in patch {
            if (flipped[t] == Some(true)) == (kept_minus_flipped >= 0.0) {
                mesh.triangles[t].swap(1, 2);
            }
        }
    }
}

/// A continuous distance to a surface with holes: (1 - 2w) d with the winding number w in [0, 1]
/// and the unsigned distance d. At the surface it equals the signed distance. Across a hole, where
/// the sign of the signed distance jumps, it passes smoothly through 0 at w = 1/2.
struct ContinuousDistance<'a>(&'a MeshDistance);

impl SignedDistance for ContinuousDistance<'_> {
    fn distance(&self, p: DVec3) -> f64 {
        (1.0 - 2.0 * self.0.winding(p).clamp(0.0, 1.0)) * self.0.unsigned(p)
    }
}

/// The surface around all points with a winding number of `mesh` above 1/2.
fn rebuild(mesh: &TriMesh, diagonal: f64) -> Result<TriMesh> {
    let field = MeshDistance::new(mesh)?;
    let bounds = mesh.bounds().unwrap_or_default();
    let grid = sample_everywhere(&ContinuousDistance(&field), bounds, diagonal / REBUILD_CELLS);
    let mut surface = isosurface(&grid, 0.0).largest_component();
    taubin(&mut surface, 0.5, -0.53, SMOOTHING_PAIRS);
    Ok(surface)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{cube, icosphere, scattered};

    /// Triangles in shuffled order with three vertices each, as in an STL file.
    fn soup(mesh: &TriMesh) -> TriMesh {
        let mut order: Vec<usize> = (0..mesh.triangles.len()).collect();
        let keys = scattered(order.len());
        order.sort_by(|&a, &b| keys[a].x.total_cmp(&keys[b].x));
        let vertices = order.iter().flat_map(|&t| mesh.corners(t)).collect();
        let triangles = (0..order.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        TriMesh { vertices, triangles, colors: Vec::new() }
    }

    #[test]
    fn a_sound_mesh_is_unchanged() {
        let mut mesh = icosphere(2, 0.1);
        mesh.colors = vec![[1, 2, 3]; mesh.vertices.len()];
        let (repaired, report) = repair(&mesh).unwrap();
        assert_eq!(repaired, mesh);
        assert_eq!(report, RepairReport { components: 1, ..RepairReport::default() });
    }

    #[test]
    fn a_soup_is_merged() {
        let clean = icosphere(4, 0.1);
        let mut shaken = soup(&clean);
        for (v, shift) in shaken.vertices.iter_mut().zip(scattered(3 * clean.triangles.len())) {
            *v += 2e-11 * shift;
        }
        shaken.triangles.push([0, 0, 1]);
        let (repaired, report) = repair(&shaken).unwrap();
        assert!(repaired.is_watertight());
        assert_eq!(repaired.vertices.len(), clean.vertices.len());
        assert_eq!(report.merged_vertices, shaken.vertices.len() - clean.vertices.len());
        assert_eq!((report.degenerate_triangles, report.open_edges, report.rebuilt), (1, 0, false));
        assert!((repaired.volume() / clean.volume() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn inward_and_mixed_spheres_are_flipped() {
        let clean = icosphere(3, 0.1);
        let mut inward = clean.clone();
        inward.flip();
        let (repaired, report) = repair(&inward).unwrap();
        assert!(report.flipped && !report.rebuilt);
        assert!((repaired.volume() - clean.volume()).abs() < 1e-12);
        let mut mixed = clean.clone();
        for t in (0..mixed.triangles.len()).step_by(3) {
            mixed.triangles[t].swap(0, 1);
        }
        let (repaired, report) = repair(&mixed).unwrap();
        assert!(repaired.is_watertight() && !report.rebuilt && !report.flipped);
        assert!((repaired.volume() - clean.volume()).abs() < 1e-12);
    }

    #[test]
    fn a_missing_patch_is_closed_for_either_orientation() {
        let clean = icosphere(4, 0.1);
        // The hole's radius is 0.34 of the sphere's.
        let mut cut = clean.submesh(|t| clean.corners(t).iter().all(|v| v.z < 0.094));
        for _ in 0..2 {
            let (repaired, report) = repair(&cut).unwrap();
            assert!(report.rebuilt && report.open_edges > 10);
            assert!(repaired.is_watertight());
            assert_eq!(repaired.components().1, 1);
            assert!((repaired.volume() / clean.volume() - 1.0).abs() < 0.03, "{}", repaired.volume() / clean.volume());
            cut.flip();
        }
    }

    #[test]
    fn strays_are_removed_and_overlapping_bodies_merged() {
        let large = cube(DVec3::ZERO, 1.0);
        let join = |other: &TriMesh| {
            let mut both = other.clone();
            both.vertices.extend(&large.vertices);
            both.triangles.extend(large.triangles.iter().map(|t| t.map(|v| v + other.vertices.len() as u32)));
            both
        };
        let (repaired, report) = repair(&join(&cube(DVec3::splat(0.7), 0.1))).unwrap();
        assert_eq!((repaired, report.components, report.rebuilt), (large.clone(), 2, false));
        let (repaired, report) = repair(&join(&cube(DVec3::X * 0.5, 0.8))).unwrap();
        assert!(report.rebuilt && repaired.is_watertight());
        let union = 1.0 + 0.4 * 0.64;
        assert!((repaired.volume() / union - 1.0).abs() < 0.01, "{}", repaired.volume());
    }

    #[test]
    fn surfaces_without_volume_are_rejected() {
        let rejected = |mesh: &TriMesh, why: &str| {
            let message = repair(mesh).unwrap_err().to_string();
            assert!(message.contains(why), "{message}");
        };
        rejected(&TriMesh::default(), "no triangles");
        let mut bad = cube(DVec3::ZERO, 1.0);
        bad.vertices[3].z = f64::INFINITY;
        rejected(&bad, "vertex 3");
        let square = TriMesh {
            vertices: vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            colors: Vec::new(),
        };
        rejected(&square, "encloses no volume");
        let mut both_sides = square.clone();
        both_sides.triangles.extend([[0, 2, 1], [0, 3, 2]]);
        rejected(&both_sides, "encloses no volume");
        let mut line = square;
        line.vertices = (0..4).map(|i| DVec3::X * f64::from(i)).collect();
        rejected(&line, "area");
        rejected(&TriMesh { vertices: vec![DVec3::X; 3], triangles: vec![[0, 1, 2]], colors: Vec::new() }, "area");
    }
}
