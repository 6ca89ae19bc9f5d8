//! Shapes for tests.

#![allow(dead_code, reason = "not every test uses all of them")]

use glam::DVec3;
use trocar_geometry::TriMesh;

pub fn sphere(centre: DVec3, radius: f64, rings: u32) -> TriMesh {
    let sides = 2 * rings;
    let mut mesh = TriMesh::default();
    for i in 0..=rings {
        let (sin, cos) = (std::f64::consts::PI * f64::from(i) / f64::from(rings)).sin_cos();
        for j in 0..sides {
            let (y, x) = (std::f64::consts::TAU * f64::from(j) / f64::from(sides)).sin_cos();
            mesh.vertices.push(centre + radius * DVec3::new(sin * x, sin * y, cos));
        }
    }
    for i in 0..rings {
        for j in 0..sides {
            let (a, b) = (i * sides + j, i * sides + (j + 1) % sides);
            mesh.triangles.extend([[a, a + sides, b], [b, a + sides, b + sides]]);
        }
    }
    mesh
}

/// A rectangle with `corner` and edges `x` and `y`.
pub fn quad(corner: DVec3, x: DVec3, y: DVec3) -> TriMesh {
    TriMesh {
        vertices: vec![corner, corner + x, corner + x + y, corner + y],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        colors: Vec::new(),
    }
}
