//! Registers depth: moves it from its own camera to the pixels of the colour camera.

use glam::{DMat3, DVec3};
use trocar_camera::{Camera, DepthImage, draw_triangle};

/// Neighbouring depths that differ by more than this share belong to two surfaces, not to a steep
/// one.
const MAX_SLOPE: f32 = 0.03;

/// A depth camera beside the colour camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Registration {
    /// The depth camera.
    pub depth: Camera,
    /// The colour camera, to whose pixels depth is moved.
    pub color: Camera,
    /// Rotation from the depth camera's frame to the colour camera's.
    pub rotation: DMat3,
    /// The depth camera's origin in the colour camera's frame (m).
    pub translation: DVec3,
}

impl Registration {
    /// Depth along the colour camera's axis on the colour camera's pixels (m); 0 where there is
    /// none.
    ///
    /// Four neighbouring depth pixels of one surface are drawn as two triangles; a depth pixel
    /// without such neighbours is drawn as the small square it covers. Where several pieces cover a
    /// pixel the nearest wins, so that a surface that only the depth camera sees behind an edge
    /// does not show through.
    pub fn apply(&self, depth: &DepthImage) -> DepthImage {
        let (width, height) = (self.color.width, self.color.height);
        let mut out = DepthImage::new(width, height);
        let (w, h) = (depth.width, depth.height);
        if (w, h) != (self.depth.width, self.depth.height) {
            return out;
        }
        let mut draw = |i: usize, z: f64| {
            let nearest = &mut out.depth[i];
            if z > 0.0 && (*nearest == 0.0 || z < f64::from(*nearest)) {
                *nearest = z as f32;
            }
        };
        // (u, v, 1/z) in the colour camera of the point that the depth camera sees at (u, v).
        let moved = |u: f64, v: f64, z: f64| {
            let p = self.rotation * (self.depth.ray(u, v) * z) + self.translation;
            Some(self.color.project(p)?.extend(1.0 / p.z))
        };
        let seen: Vec<Option<DVec3>> = (0..w * h)
            .map(|i| match f64::from(depth.depth[i]) {
                z if z > 0.0 => moved((i % w) as f64, (i / w) as f64, z),
                _ => None,
            })
            .collect();
        let mut drawn = vec![false; w * h];
        for v in 1..h {
            for u in 1..w {
                let cell = [(v - 1) * w + u - 1, (v - 1) * w + u, v * w + u, v * w + u - 1];
                let [Some(a), Some(b), Some(c), Some(d)] = cell.map(|i| seen[i]) else { continue };
                let depths = cell.map(|i| depth.depth[i]);
                let [low, high] = [f32::min, f32::max].map(|f| depths.into_iter().fold(depths[0], f));
                if high - low <= MAX_SLOPE * low {
                    draw_triangle([a, b, c], width, height, &mut draw);
                    draw_triangle([a, c, d], width, height, &mut draw);
                    cell.iter().for_each(|&i| drawn[i] = true);
                }
            }
        }
        for i in (0..w * h).filter(|i| !drawn[*i] && seen[*i].is_some()) {
            let (u, v, z) = ((i % w) as f64, (i / w) as f64, f64::from(depth.depth[i]));
            let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(x, y)| moved(u + x, v + y, z));
            if let [Some(a), Some(b), Some(c), Some(d)] = corners {
                draw_triangle([a, b, c], width, height, &mut draw);
                draw_triangle([a, c, d], width, height, &mut draw);
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_camera::Distortion;

    fn camera(width: usize, height: usize, f: f64) -> Camera {
        let [cx, cy] = [width, height].map(|n| 0.5 * (n as f64 - 1.0));
        Camera { width, height, fx: f, fy: f, cx, cy, distortion: Distortion::default() }
    }

    /// The depth image that `camera`, at `from` in the world and with `rotation` (camera to world),
    /// has of a slanted plane.
    fn plane(camera: &Camera, rotation: DMat3, from: DVec3) -> DepthImage {
        let mut image = DepthImage::new(camera.width, camera.height);
        let normal = DVec3::new(0.2, -0.1, 1.0);
        for i in 0..image.depth.len() {
            let ray = rotation * camera.ray((i % camera.width) as f64, (i / camera.width) as f64);
            image.depth[i] = ((0.5 - normal.dot(from)) / normal.dot(ray)) as f32;
        }
        image
    }

    #[test]
    fn a_plane_stays_a_plane_without_holes() {
        // The colour camera has a finer resolution: a depth pixel covers several of its pixels.
        let mut color = camera(160, 120, 150.0);
        color.distortion = Distortion([0.1, -0.05, 1e-3, -1e-3, 0.0, 0.0, 0.0, 0.0]);
        let registration = Registration {
            depth: camera(120, 90, 70.0),
            color,
            rotation: DMat3::from_euler(glam::EulerRot::XYZ, 0.02, -0.03, 0.01),
            translation: DVec3::new(0.025, -0.004, 0.003),
        };
        // The world is the colour camera's frame.
        let seen = plane(&registration.depth, registration.rotation, registration.translation);
        let truth = plane(&color, DMat3::IDENTITY, DVec3::ZERO);
        let moved = registration.apply(&seen);
        let (mut worst, mut holes) = (0.0f32, 0);
        for v in 10..110 {
            for u in 10..150 {
                let i = v * 160 + u;
                if moved.depth[i] == 0.0 {
                    holes += 1;
                } else {
                    worst = worst.max((moved.depth[i] - truth.depth[i]).abs());
                }
            }
        }
        // One depth pixel is 7 mm wide at half a metre, and the plane rises 22 mm over 100.
        assert!(worst < 1e-4, "{worst}");
        assert_eq!(holes, 0);
    }

    #[test]
    fn the_nearest_wins_and_nothing_moves_without_a_baseline() {
        let camera = camera(40, 30, 40.0);
        let mut depth = DepthImage::new(40, 30);
        depth.depth.fill(0.8);
        for v in 10..20 {
            depth.depth[v * 40 + 15..v * 40 + 25].fill(0.4);
        }
        depth.depth[5 * 40 + 5] = 0.0;
        let still = Registration { depth: camera, color: camera, rotation: DMat3::IDENTITY, translation: DVec3::ZERO };
        let unmoved = still.apply(&depth);
        for i in 0..40 * 30 {
            assert!((unmoved.depth[i] - depth.depth[i]).abs() < 1e-6, "pixel {i}: {}", unmoved.depth[i]);
        }
        // 20 mm at 0.4 m and 40 px are 2 px, at 0.8 m 1 px: the near block covers what the far
        // plane would show.
        let moved = Registration { translation: DVec3::new(0.02, 0.0, 0.0), ..still }.apply(&depth);
        let row = &moved.depth[15 * 40..16 * 40];
        assert!((row[18] - 0.4).abs() < 1e-6 && (row[26] - 0.4).abs() < 1e-6 && (row[27] - 0.8).abs() < 1e-6);
        assert_eq!(row[16], 0.0, "behind the block's left edge neither saw anything");
    }
}
