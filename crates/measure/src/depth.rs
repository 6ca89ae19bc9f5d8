//! Depth between pixels.

use glam::DVec2;
use trocar_camera::{DepthImage, Mask};

/// Pixels to each side that are averaged.
const REACH: i64 = 3;

/// Distance from the median within which depths are averaged (m).
const NEAR: f32 = 2e-3;

/// Least number of pixels with depth.
const LEAST: usize = 8;

/// Depth around a pixel (m): the mean of the depths near their median. It averages noise and whole
/// millimetres. `None` outside the picture, where depth is missing, and on `hidden` pixels.
pub(crate) fn depth_at(depth: &DepthImage, hidden: Option<&Mask>, p: DVec2) -> Option<f64> {
    let (u, v) = (p.x.round() as i64, p.y.round() as i64);
    let mut near = Vec::with_capacity(49);
    for y in v - REACH..=v + REACH {
        for x in u - REACH..=u + REACH {
            if x < 0 || y < 0 || x >= depth.width as i64 || y >= depth.height as i64 {
                continue;
            }
            let i = y as usize * depth.width + x as usize;
            if depth.depth[i] > 0.0 && hidden.is_none_or(|mask| !mask.set[i]) {
                near.push(depth.depth[i]);
            }
        }
    }
    if near.len() < LEAST {
        return None;
    }
    near.sort_unstable_by(f32::total_cmp);
    let median = near[near.len() / 2];
    let (sum, count) = near
        .iter()
        .filter(|z| (**z - median).abs() <= NEAR)
        .fold((0.0, 0.0), |(sum, count), z| (sum + f64::from(*z), count + 1.0));
    Some(sum / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_millimetres_are_averaged_and_edges_are_not() {
        let mut depth = DepthImage::new(40, 30);
        for (i, z) in depth.depth.iter_mut().enumerate() {
            let slope = 0.15 + 1e-4 * (i % 40) as f32;
            *z = if i % 40 >= 30 { 0.3 } else { (slope * 1000.0).round() / 1000.0 };
        }
        let found = depth_at(&depth, None, DVec2::new(15.0, 15.0)).unwrap();
        assert!((found - 0.1515).abs() < 0.3e-3, "{found}");
        let beside = depth_at(&depth, None, DVec2::new(28.0, 15.0)).unwrap();
        assert!((beside - 0.153).abs() < 1e-3, "{beside}");
        assert_eq!(depth_at(&depth, None, DVec2::new(-20.0, 5.0)), None);
        let all = Mask { width: 40, height: 30, set: vec![true; 1200] };
        assert_eq!(depth_at(&depth, Some(&all), DVec2::new(15.0, 15.0)), None);
    }
}
