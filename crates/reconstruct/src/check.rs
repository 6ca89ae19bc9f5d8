//! Compares the reconstructed surface with the depth it was made from.

use glam::DVec3;
use trocar_camera::{Camera, DepthImage, Mask, draw_triangle};
use trocar_geometry::TriMesh;

/// Depth errors of a surface.
pub struct DepthCheck {
    /// Surface minus measured depth on the compared pixels (m); 0 elsewhere.
    pub error: Vec<f32>,
    /// Compared pixels: in the mask, measured, and covered by the surface.
    pub compared: Mask,
    /// Median of the absolute error (m).
    pub median_absolute: f64,
    /// Median of the signed error (m).
    pub median_signed: f64,
    /// Compared pixels over pixels of the mask.
    pub covered: f64,
}

/// Renders `surface` through `camera` and compares it with `measured` inside `mask`. `None` without
/// a pixel to compare.
pub fn check(surface: &TriMesh, measured: &DepthImage, mask: &Mask, camera: &Camera) -> Option<DepthCheck> {
    let rendered = render_depth(surface, camera);
    let mut error = vec![0.0; rendered.len()];
    let mut compared = Mask::new(mask.width, mask.height);
    let mut signed = Vec::new();
    for i in 0..rendered.len() {
        if mask.set[i] && measured.depth[i] > 0.0 && rendered[i].is_finite() {
            let e = rendered[i] - f64::from(measured.depth[i]);
            error[i] = e as f32;
            compared.set[i] = true;
            signed.push(e);
        }
    }
    let median = |mut v: Vec<f64>| {
        v.sort_by(f64::total_cmp);
        v.get(v.len() / 2).copied()
    };
    let covered = signed.len() as f64 / mask.count() as f64;
    let median_absolute = median(signed.iter().map(|e| e.abs()).collect())?;
    Some(DepthCheck { error, compared, median_absolute, median_signed: median(signed)?, covered })
}

/// Depth of the nearest surface at each pixel's centre (m); infinite where there is none. Triangles
/// are small against the lens's distortion, so they are drawn straight between their projected
/// corners; 1/z is linear on the image.
fn render_depth(surface: &TriMesh, camera: &Camera) -> Vec<f64> {
    let (w, h) = (camera.width, camera.height);
    let mut depth = vec![f64::INFINITY; w * h];
    let projected: Vec<Option<DVec3>> =
        surface.vertices.iter().map(|p| Some(camera.project(*p)?.extend(1.0 / p.z))).collect();
    for triangle in &surface.triangles {
        let [Some(a), Some(b), Some(c)] = triangle.map(|v| projected[v as usize]) else { continue };
        draw_triangle([a, b, c], w, h, |i, z| depth[i] = depth[i].min(z));
    }
    depth
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slanted_plane_renders_exactly() {
        let camera = Camera { width: 64, height: 48, ..Camera::d405() };
        let camera = Camera { cx: 31.5, cy: 23.5, fx: 60.0, fy: 60.0, ..camera };
        // z = 0.3 + 0.2 x
        let plane = |x: f64, y: f64| DVec3::new(x, y, 0.3 + 0.2 * x);
        let vertices = vec![plane(-0.5, -0.5), plane(0.5, -0.5), plane(0.5, 0.5), plane(-0.5, 0.5)];
        let surface = TriMesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]], colors: vec![] };
        let mut measured = DepthImage::new(64, 48);
        let mut mask = Mask::new(64, 48);
        mask.set.fill(true);
        for i in 0..64 * 48 {
            let ray = camera.ray((i % 64) as f64, (i / 64) as f64);
            measured.depth[i] = (0.3 / (1.0 - 0.2 * ray.x) - 0.001) as f32;
        }
        let check = check(&surface, &measured, &mask, &camera).unwrap();
        assert_eq!(check.covered, 1.0);
        assert!((check.median_signed - 0.001).abs() < 1e-7);
        assert!(check.error.iter().all(|e| (e - 0.001).abs() < 1e-6));
    }
}
