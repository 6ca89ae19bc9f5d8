//! Organs cut open by a plane: the skin is clipped, and the plane shows a slice of every element it
//! intersects.

use crate::organ::{EXPOSED, OrganSkin};
use glam::DVec3;
use trocar_geometry::TriMesh;

/// Edges of an element by corner.
const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Part of a slice that is drawn as its rim.
const RIM: f64 = 0.10;

/// The part of `organ` on the side of the plane opposite to `normal`. `skin` and `nodes` are
/// current positions (m).
pub(crate) fn section(organ: &OrganSkin, skin: &[DVec3], nodes: &[DVec3], point: DVec3, normal: DVec3) -> TriMesh {
    let height = |p: DVec3| (p - point).dot(normal);
    let mut mesh = TriMesh { vertices: skin.to_vec(), triangles: Vec::new(), colors: organ.surface.colors.clone() };
    for triangle in &organ.surface.triangles {
        let h = triangle.map(|v| height(skin[v as usize]));
        let below = h.iter().filter(|h| **h < 0.0).count();
        if below == 3 {
            mesh.triangles.push(*triangle);
        }
        if below == 1 || below == 2 {
            // The corner that is alone on its side comes first.
            let lone = (0..3).find(|k| (h[*k] < 0.0) == (below == 1)).unwrap_or(0);
            let [a, b, c] = [lone, (lone + 1) % 3, (lone + 2) % 3];
            let mut cross = |i: usize, j: usize| {
                let share = h[i] / (h[i] - h[j]);
                let (p, q) = (triangle[i] as usize, triangle[j] as usize);
                mesh.vertices.push(skin[p].lerp(skin[q], share));
                let mix = |k: usize| {
                    let (x, y) = (f64::from(organ.surface.colors[p][k]), f64::from(organ.surface.colors[q][k]));
                    (x + share * (y - x)) as u8
                };
                mesh.colors.push([mix(0), mix(1), mix(2)]);
                mesh.vertices.len() as u32 - 1
            };
            let (ab, ac) = (cross(a, b), cross(a, c));
            if below == 1 {
                mesh.triangles.push([triangle[a], ab, ac]);
            } else {
                mesh.triangles.extend([[ab, triangle[b], triangle[c]], [ab, triangle[c], ac]]);
            }
        }
    }
    let tint = mean(&organ.surface.colors);
    for (index, tet) in organ.body.tets.iter().enumerate() {
        slice(&mut mesh, tet.map(|i| nodes[i as usize]), &height, normal, shade(tint, index));
    }
    mesh
}

/// Adds the slice of one element with a darker rim.
fn slice(mesh: &mut TriMesh, corners: [DVec3; 4], height: &dyn Fn(DVec3) -> f64, normal: DVec3, color: [u8; 3]) {
    let h = corners.map(height);
    let mut ring: Vec<DVec3> = EDGES
        .iter()
        .filter(|[i, j]| (h[*i] < 0.0) != (h[*j] < 0.0))
        .map(|[i, j]| corners[*i].lerp(corners[*j], h[*i] / (h[*i] - h[*j])))
        .collect();
    if ring.len() < 3 {
        return;
    }
    let middle = ring.iter().sum::<DVec3>() / ring.len() as f64;
    let (x, y) = normal.any_orthonormal_pair();
    let angle = |p: &DVec3| libm::atan2((*p - middle).dot(y), (*p - middle).dot(x));
    ring.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    let rim = color.map(|c| (0.62 * f64::from(c)) as u8);
    let n = ring.len() as u32;
    let mut add = |p: DVec3, color: [u8; 3]| {
        mesh.vertices.push(p);
        mesh.colors.push(color);
        mesh.vertices.len() as u32 - 1
    };
    let outer: Vec<u32> = ring.iter().map(|p| add(*p, rim)).collect();
    let inner: Vec<u32> = ring.iter().map(|p| add(p.lerp(middle, RIM), rim)).collect();
    let flat: Vec<u32> = ring.iter().map(|p| add(p.lerp(middle, RIM), color)).collect();
    for k in 0..n {
        let (a, b) = (k as usize, ((k + 1) % n) as usize);
        mesh.triangles.extend([[outer[a], outer[b], inner[b]], [outer[a], inner[b], inner[a]]]);
    }
    for k in 1..n as usize - 1 {
        mesh.triangles.push([flat[0], flat[k], flat[k + 1]]);
    }
}

/// A mixture of the organ's colour and the colour of flesh, slightly different for each element.
fn shade(tint: [f64; 3], element: usize) -> [u8; 3] {
    let stir = (element as u32).wrapping_mul(2_654_435_761) >> 16;
    let light = 0.86 + 0.28 * f64::from(stir & 0xff) / 255.0;
    [0, 1, 2].map(|k| (light * (0.65 * tint[k] + 0.35 * f64::from(EXPOSED[k]) + 18.0)).clamp(0.0, 255.0) as u8)
}

fn mean(colors: &[[u8; 3]]) -> [f64; 3] {
    let n = colors.len().max(1) as f64;
    [0, 1, 2].map(|k| colors.iter().map(|c| f64::from(c[k])).sum::<f64>() / n)
}
