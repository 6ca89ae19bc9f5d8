//! Colours of labels and of depth.

use crate::colors::{self, SEQUENTIAL};
use trocar_camera::ColorImage;

/// A colour per label. Hues are steps of the golden angle, which makes neighbours differ most.
pub fn label_color(label: u16) -> [u8; 3] {
    if label == 0 {
        return [0; 3];
    }
    let hue = (f64::from(label) * 0.618_033_988_75).fract() * 6.0;
    let light = if label.is_multiple_of(2) { 0.95 } else { 0.72 };
    let x = 1.0 - (hue % 2.0 - 1.0).abs();
    let rgb = match hue as u32 {
        0 => [1.0, x, 0.0],
        1 => [x, 1.0, 0.0],
        2 => [0.0, 1.0, x],
        3 => [0.0, x, 1.0],
        4 => [x, 0.0, 1.0],
        _ => [1.0, 0.0, x],
    };
    rgb.map(|c| (255.0 * light * (0.18 + 0.82 * c)) as u8)
}

/// Depth in colours from near (bright) to far; black without depth.
pub fn shown(depth: &trocar_camera::DepthImage) -> ColorImage {
    // Depth is rounded to millimetres, so that a flat area has one rank.
    let whole = |d: f32| (d * 1e3).round() * 1e-3;
    let mut valid: Vec<f32> = depth.depth.iter().copied().filter(|d| *d > 0.0).map(whole).collect();
    valid.sort_by(f32::total_cmp);
    let at = |share: f64| valid.get((share * valid.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(1.0);
    let (near, far) = (at(0.01), at(0.97));
    let color = |d: &f32| {
        if *d <= 0.0 {
            return [0; 3];
        }
        // Half by depth and half by rank, so that a flat object on a table is not all one colour.
        let rank = valid.partition_point(|v| *v < whole(*d)) as f64 / valid.len().max(1) as f64;
        let share = f64::from((d - near) / (far - near).max(1e-6));
        colors::map(&SEQUENTIAL, 1.0 - 0.5 * (share.clamp(0.0, 1.0) + rank))
    };
    ColorImage { width: depth.width, height: depth.height, pixels: depth.depth.iter().map(color).collect() }
}
