//! The shapes of an arm's links out of its description: meshes and simple shapes, in their colours.

use crate::solid::{along, join, turned};
use crate::{Error, Result};
use glam::DVec3;
use std::collections::BTreeMap;
use std::path::Path;
use trocar_geometry::TriMesh;
use trocar_geometry::io::{Unit, read_surface};
use trocar_robot::chain::{Visual, VisualShape, mjcf_visuals, urdf_visuals};

/// Cosine between triangles from which an edge is sharp: 40 degrees.
const CREASE: f64 = 0.766;

/// The shapes of base and links, each in its own frame, of the description `file` with the flange `tip`; empty for a link that shows nothing. `arm` is for messages.
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
                let right = "the file belongs there, or shapes = \"simple\" draws the arm without";
                fail(format!("link '{}' of {}: {why}; {right}", visual.link, file.display()))
            })?;
            join(&mut whole, &mesh);
        }
        links.push(whole);
    }
    Ok(links)
}

/// One visual in its link's axes, every vertex with its colour.
fn shape(visual: &Visual) -> std::result::Result<TriMesh, trocar_geometry::Error> {
    let mut mesh = match &visual.shape {
        VisualShape::Mesh { file, scale } => {
            let mut mesh = read_surface(file, Unit::Metre)?;
            mesh.vertices.iter_mut().for_each(|p| *p *= *scale);
            creased(&mesh)
        }
        VisualShape::Block(half) => block(*half),
        VisualShape::Cylinder { radius, half } => {
            let can = turned(&[[-half, 0.0], [-half, *radius], [*half, *radius], [*half, 0.0]]);
            along(&can, DVec3::ZERO, DVec3::Z)
        }
        VisualShape::Capsule { radius, half } => round(*radius, *half),
        VisualShape::Ball(radius) => round(*radius, 0.0),
    };
    for p in &mut mesh.vertices {
        *p = visual.pose.transform(*p);
    }
    let color = visual.color.map(|c| (255.0 * c).round() as u8);
    mesh.colors = vec![color; mesh.vertices.len()];
    Ok(mesh)
}

/// Two half balls and what lies between them, about z.
fn round(radius: f64, half: f64) -> TriMesh {
    let profile: Vec<[f64; 2]> = (0..=16)
        .map(|k| {
            let (sin, cos) = (std::f64::consts::PI * f64::from(k) / 16.0).sin_cos();
            let end = if k <= 8 { -half } else { half };
            [end - radius * cos, if k % 16 == 0 { 0.0 } else { radius * sin }]
        })
        .collect();
    along(&turned(&profile), DVec3::ZERO, DVec3::Z)
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

/// The same surface with vertices that are shared where it is smooth, and not across sharp edges: files share none (STL) or all.
fn creased(mesh: &TriMesh) -> TriMesh {
    let place = |p: DVec3| (p + 0.0).to_array().map(f64::to_bits);
    // Vertices of the new mesh at each place, each with the normal of its first triangle.
    let mut there: BTreeMap<[u64; 3], Vec<(DVec3, u32)>> = BTreeMap::new();
    let mut made = TriMesh::default();
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| mesh.vertices[v as usize]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let corner = |p: DVec3| {
            let known = there.entry(place(p)).or_default();
            if let Some((_, vertex)) = known.iter().find(|(n, _)| n.dot(normal) > CREASE) {
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
    fn edges_stay_sharp_and_the_rest_is_smooth() {
        // A box out of single triangles has 36 vertices; 4 to each side are enough.
        let mut soup = block(DVec3::new(0.1, 0.2, 0.3));
        let corners: Vec<DVec3> = soup.triangles.iter().flatten().map(|v| soup.vertices[*v as usize]).collect();
        soup.triangles = (0..12).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        soup.vertices = corners;
        let made = creased(&soup);
        assert_eq!((made.vertices.len(), made.triangles.len()), (24, 12));
        assert!((made.volume() - 8.0 * 0.006).abs() < 1e-12);
        let ball = creased(&round(0.05, 0.0));
        let volume = 4.0 / 3.0 * std::f64::consts::PI * 0.05_f64.powi(3);
        assert!((ball.volume() / volume - 1.0).abs() < 0.03 && ball.is_watertight(), "{}", ball.volume() / volume);
    }
}
