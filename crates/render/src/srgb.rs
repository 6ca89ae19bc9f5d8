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

/// Steps of linear light in which [`START`] finds its way.
const STEPS: usize = 4096;

/// The least linear light that each value shows, by the formula in [`by_formula`].
static LEAST: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|value| {
        // The bits of numbers from 0 to 1 are in their order.
        let (mut low, mut high) = (0, 1.0_f32.to_bits());
        while low < high {
            let middle = low + (high - low) / 2;
            if usize::from(by_formula(f32::from_bits(middle))) < value {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        f32::from_bits(low)
    })
});

/// The value at the beginning of each step.
static START: LazyLock<Vec<u8>> = LazyLock::new(|| (0..=STEPS).map(|i| by_formula(i as f32 / STEPS as f32)).collect());

/// The 8-bit sRGB colour nearest to linear light; values outside 0 to 1 are clipped. By table: the power is slow.
pub fn from_linear(light: [f32; 3]) -> [u8; 3] {
    let (start, least) = (&*START, &*LEAST);
    light.map(|l| {
        // What is no number is black.
        let l = if l > 0.0 { l.min(1.0) } else { 0.0 };
        let mut value = start[(l * STEPS as f32) as usize];
        while value < 255 && l >= least[usize::from(value) + 1] {
            value += 1;
        }
        value
    })
}

fn by_formula(l: f32) -> u8 {
    let s = if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 };
    (s * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_comes_back() {
        for c in 0..=255 {
            assert_eq!(from_linear(to_linear([c; 3])), [c; 3]);
        }
        for i in 0..200_000 {
            let l = i as f32 / 180_000.0 - 0.05;
            assert_eq!(from_linear([l; 3]), [by_formula(l.clamp(0.0, 1.0)); 3], "{l}");
        }
        assert_eq!(from_linear([f32::NAN, f32::INFINITY, f32::NEG_INFINITY]), [0, 255, 0]);
        assert!((to_linear([188; 3])[0] - 0.5).abs() < 0.005, "sRGB 188 is half the light");
    }
}
