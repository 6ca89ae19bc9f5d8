//! The tissue around an organ in the picture.

use glam::DVec3;
use std::collections::VecDeque;
use trocar_camera::{Camera, DepthImage, Mask, pixel_neighbours};

/// Width of the ring around the organ (m), and the gap between both (px).
const WIDTH: f64 = 0.03;
const GAP: usize = 5;

/// Every so many columns and rows give a point.
const STRIDE: usize = 3;

/// Points (m) of the ring around `mask`, without `hidden` pixels.
pub(crate) fn surroundings(mask: &Mask, hidden: &Mask, depth: &DepthImage, camera: &Camera) -> Vec<DVec3> {
    let mut depths: Vec<f32> =
        (0..mask.set.len()).filter(|i| mask.set[*i]).map(|i| depth.depth[i]).filter(|z| *z > 0.0).collect();
    depths.sort_unstable_by(f32::total_cmp);
    let Some(middle) = depths.get(depths.len() / 2) else { return Vec::new() };
    let reach = (WIDTH * camera.fx / f64::from(*middle)).ceil() as usize;
    let mut steps = vec![usize::MAX; mask.set.len()];
    let mut open: VecDeque<usize> = (0..mask.set.len()).filter(|i| mask.set[*i]).collect();
    open.iter().for_each(|i| steps[*i] = 0);
    let mut points = Vec::new();
    while let Some(i) = open.pop_front() {
        let (u, v) = (i % mask.width, i / mask.width);
        let z = depth.depth[i];
        if steps[i] > GAP && z > 0.0 && !hidden.set[i] && u.is_multiple_of(STRIDE) && v.is_multiple_of(STRIDE) {
            points.push(camera.ray(u as f64, v as f64) * f64::from(z));
        }
        if steps[i] < reach + GAP {
            for k in pixel_neighbours(i, mask.width, mask.height) {
                if steps[k] == usize::MAX {
                    steps[k] = steps[i] + 1;
                    open.push_back(k);
                }
            }
        }
    }
    points
}
