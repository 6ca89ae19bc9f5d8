//! Surfaces of round shapes and cuboids, for pictures.

use glam::{DQuat, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};
use trocar_geometry::TriMesh;

/// Sides of a ring; a chord is then off the circle by 0.5% of the radius.
const SIDES: u32 = 32;

/// Rings from a pole to the equator.
const RINGS: u32 = 8;

/// All points at `radius` from a segment, or from a point where the ends coincide.
pub(super) fn capsule([a, b]: [DVec3; 2], radius: f64) -> TriMesh {
    let axis = (b - a).try_normalize().unwrap_or(DVec3::Z);
    let (u, v) = axis.any_orthonormal_pair();
    let mut mesh = TriMesh::default();
    let mut ring = |centre: DVec3, latitude: f64| {
        for k in 0..SIDES {
            let (sin, cos) = libm::sincos(TAU * f64::from(k) / f64::from(SIDES));
            let outwards = libm::cos(latitude) * (cos * u + sin * v) + libm::sin(latitude) * axis;
            mesh.vertices.push(centre + radius * outwards);
        }
    };
    let latitude = |k: u32| FRAC_PI_2 * f64::from(k) / f64::from(RINGS);
    (1..=RINGS).for_each(|k| ring(a, latitude(k) - FRAC_PI_2));
    // A sphere has one equator, a capsule two.
    let first = u32::from(a == b);
    (first..RINGS).for_each(|k| ring(b, latitude(k)));
    let rings = 2 * RINGS - first;
    let south = mesh.vertices.len() as u32;
    let north = south + 1;
    mesh.vertices.extend([a - radius * axis, b + radius * axis]);
    for k in 0..SIDES {
        let next = (k + 1) % SIDES;
        mesh.triangles.push([south, next, k]);
        for r in 0..rings - 1 {
            let (low, high) = (r * SIDES, (r + 1) * SIDES);
            mesh.triangles.push([low + k, low + next, high + next]);
            mesh.triangles.push([low + k, high + next, high + k]);
        }
        let last = (rings - 1) * SIDES;
        mesh.triangles.push([north, last + k, last + next]);
    }
    mesh
}

/// A cuboid of half edges `half`.
pub(super) fn cuboid(centre: DVec3, rotation: DQuat, half: DVec3) -> TriMesh {
    let corner = |c: u32| DVec3::from_array([0, 1, 2].map(|k| if c >> k & 1 == 1 { 1.0 } else { -1.0 }));
    let vertices = (0..8).map(|c| centre + rotation * (half * corner(c))).collect();
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    TriMesh { vertices, triangles, colors: Vec::new() }
}
