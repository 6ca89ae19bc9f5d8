//! Shapes of an arm's links from its description file: meshes and primitives in their colours.

use crate::solid::{align_x, append, revolve};
use crate::{Error, Result};
use glam::DVec3;
use std::collections::BTreeMap;
use std::path::Path;
use trocar_geometry::TriMesh;
use trocar_geometry::io::{Unit, read_surface};
use trocar_robot::chain::{Visual, VisualShape, mjcf_visuals, urdf_visuals};

/// Cosine of the angle between triangles above which their edge is smooth: 40 degrees.
const SMOOTH_EDGE_COSINE: f64 = 0.766;

/// Shapes of base and links, each in its own frame, from the description `file` with the flange
/// `tip`. The mesh of an invisible link is empty. `arm` is used in error messages.
pub(crate) fn links(arm: &str, file: &Path, tip: Option<&str>) -> Result<Vec<TriMesh>> {
    let fail = |reason: String| Error::Shapes { arm: arm.to_owned(), reason };
    let urdf = file.extension().is_some_and(|e| e.eq_ignore_ascii_case("urdf"));
    let seen = if urdf { urdf_visuals(file, None, tip) } else { mjcf_visuals(file, tip) };
    let seen = seen.map_err(|e| fail(e.to_string()))?;
    let mut links = Vec::new();
    for visuals in &seen {
        let mut whole = TriMesh::default();
        for visual in visuals {
            let mesh = shape(visual).map_err(|why| {
                let right = "add the file, or set shapes = \"simple\" to draw the arm without it";
                fail(format!("link '{}' of {}: {why}; {right}", visual.link, file.display()))
            })?;
            append(&mut whole, &mesh);
        }
        links.push(whole);
    }
    Ok(links)
}

/// One visual in its link's frame, with a colour per vertex.
fn shape(visual: &Visual) -> std::result::Result<TriMesh, trocar_geometry::Error> {
    let mut mesh = match &visual.shape {
        VisualShape::Mesh { file, scale } => {
            let mut mesh = read_surface(file, Unit::Metre)?;
            mesh.vertices.iter_mut().for_each(|p| *p *= *scale);
            split_sharp_edges(&mesh)
        }
        VisualShape::Block(half) => block(*half),
        VisualShape::Cylinder { radius, half } => {
            let can = revolve(&[[-half, 0.0], [-half, *radius], [*half, *radius], [*half, 0.0]]);
            align_x(&can, DVec3::ZERO, DVec3::Z)
        }
        VisualShape::Capsule { radius, half } => capsule(*radius, *half),
        VisualShape::Ball(radius) => capsule(*radius, 0.0),
    };
    for p in &mut mesh.vertices {
        *p = visual.pose.transform(*p);
    }
    let color = visual.color.map(|c| (255.0 * c).round() as u8);
    mesh.colors = vec![color; mesh.vertices.len()];
    Ok(mesh)
}

/// A capsule along z; a ball if `half` is 0.
fn capsule(radius: f64, half: f64) -> TriMesh {
    let profile: Vec<[f64; 2]> = (0..=16)
        .map(|k| {
            let (sin, cos) = libm::sincos(std::f64::consts::PI * f64::from(k) / 16.0);
            let end = if k <= 8 { -half } else { half };
            [end - radius * cos, if k % 16 == 0 { 0.0 } else { radius * sin }]
        })
        .collect();
    align_x(&revolve(&profile), DVec3::ZERO, DVec3::Z)
}

fn block(half: DVec3) -> TriMesh {
    let mut mesh = TriMesh::default();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let first = mesh.vertices.len() as u32;
            for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let mut p = DVec3::ZERO;
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, a, b);
                mesh.vertices.push(p * half);
            }
            let corners = if side > 0.0 { [[0, 1, 2], [0, 2, 3]] } else { [[0, 2, 1], [0, 3, 2]] };
            mesh.triangles.extend(corners.map(|t| t.map(|v: u32| v + first)));
        }
    }
    mesh
}

/// Merges the vertices of smooth neighbours and splits those at sharp edges. STL files share no
/// vertices, other files share all of them.
fn split_sharp_edges(mesh: &TriMesh) -> TriMesh {
    let place = |p: DVec3| (p + 0.0).to_array().map(f64::to_bits);
    // For each position: the vertices of the new mesh, with the normal of their first triangle.
    let mut there: BTreeMap<[u64; 3], Vec<(DVec3, u32)>> = BTreeMap::new();
    let mut made = TriMesh::default();
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| mesh.vertices[v as usize]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let corner = |p: DVec3| {
            let known = there.entry(place(p)).or_default();
            if let Some((_, vertex)) = known.iter().find(|(n, _)| n.dot(normal) > SMOOTH_EDGE_COSINE) {
                return *vertex;
            }
            let vertex = made.vertices.len() as u32;
            made.vertices.push(p);
            known.push((normal, vertex));
            vertex
        };
        let corners = [a, b, c].map(corner);
        made.triangles.push(corners);
    }
    made
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sharp_edges_are_split_and_smooth_ones_shared() {
        // A box of separate triangles has 36 vertices; 4 per side suffice.
        let mut soup = block(DVec3::new(0.1, 0.2, 0.3));
        let corners: Vec<DVec3> = soup.triangles.iter().flatten().map(|v| soup.vertices[*v as usize]).collect();
        soup.triangles = (0..12).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        soup.vertices = corners;
        let made = split_sharp_edges(&soup);
        assert_eq!((made.vertices.len(), made.triangles.len()), (24, 12));
        assert!((made.volume() - 8.0 * 0.006).abs() < 1e-12);
        let ball = split_sharp_edges(&capsule(0.05, 0.0));
        let volume = 4.0 / 3.0 * std::f64::consts::PI * 0.05_f64.powi(3);
        assert!((ball.volume() / volume - 1.0).abs() < 0.03 && ball.is_watertight(), "{}", ball.volume() / volume);
    }
}
