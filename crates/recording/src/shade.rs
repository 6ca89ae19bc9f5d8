//! Replaces colour in a recording of depth alone.

use glam::DVec3;
use trocar_camera::{Camera, ColorImage, DepthImage};

/// A grey image by how much the surface faces the camera.
pub fn shade(depth: &DepthImage, camera: &Camera) -> ColorImage {
    let (width, height) = (depth.width, depth.height);
    let mut image = ColorImage::new(width, height, [0; 3]);
    let point = |u: usize, v: usize| {
        let z = f64::from(depth.depth[v * width + u]);
        let q = DVec3::new((u as f64 - camera.cx) / camera.fx, (v as f64 - camera.cy) / camera.fy, 1.0);
        (z > 0.0).then_some(z * q)
    };
    // Two pixels on each side, because a depth step of one unit would otherwise be shaded as a
    // slope.
    const REACH: usize = 2;
    for v in 0..height {
        for u in 0..width {
            let Some(here) = point(u, v) else { continue };
            let along_u = [point(u.saturating_sub(REACH), v), point((u + REACH).min(width - 1), v)];
            let along_v = [point(u, v.saturating_sub(REACH)), point(u, (v + REACH).min(height - 1))];
            let [a, b] = [along_u, along_v].map(|[p, q]| q.unwrap_or(here) - p.unwrap_or(here));
            let facing = a.cross(b).try_normalize().map_or(1.0, |n| n.dot(here.normalize()).abs());
            image.pixels[v * width + u] = [(40.0 + 200.0 * facing) as u8; 3];
        }
    }
    image
}
