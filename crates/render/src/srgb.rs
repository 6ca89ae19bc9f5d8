//! sRGB's transfer curve (IEC 61966-2-1): light is summed linearly, images are stored in sRGB.

use std::sync::LazyLock;

static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let s = i as f32 / 255.0;
        if s <= 0.040_45 { s / 12.92 } else { ((s + 0.055) / 1.055).powf(2.4) }
    })
});

/// Linear light, 0 to 1 a channel, of an 8-bit sRGB colour.
pub fn to_linear(color: [u8; 3]) -> [f32; 3] {
    color.map(|c| LINEAR[usize::from(c)])
}

/// The 8-bit sRGB colour nearest to linear light; values outside 0 to 1 are clipped.
pub fn from_linear(light: [f32; 3]) -> [u8; 3] {
    light.map(|l| {
        let l = l.clamp(0.0, 1.0);
        let s = if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 };
        (s * 255.0).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_comes_back() {
        for c in 0..=255 {
            assert_eq!(from_linear(to_linear([c; 3])), [c; 3]);
        }
        assert!((to_linear([188; 3])[0] - 0.5).abs() < 0.005, "sRGB 188 is half the light");
    }
}
