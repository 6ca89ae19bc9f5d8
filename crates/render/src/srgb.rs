//! The sRGB transfer function (IEC 61966-2-1). Light is summed linearly; images are stored in sRGB.

use std::sync::LazyLock;

static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let s = i as f32 / 255.0;
        if s <= 0.040_45 { s / 12.92 } else { ((s + 0.055) / 1.055).powf(2.4) }
    })
});

/// Linear light in [0, 1] of an 8-bit sRGB colour.
pub fn to_linear(color: [u8; 3]) -> [f32; 3] {
    color.map(|c| LINEAR[usize::from(c)])
}

/// Number of entries of the start table.
const STEPS: usize = 4096;

/// Least linear light that maps to each 8-bit value; the last is beyond all light.
static LEAST_LIGHT: LazyLock<[f32; 257]> = LazyLock::new(|| {
    std::array::from_fn(|value| {
        if value > 255 {
            return f32::INFINITY;
        }
        // The bit patterns of floats in [0, 1] are ordered like their values.
        let (mut low, mut high) = (0, 1.0_f32.to_bits());
        while low < high {
            let middle = low + (high - low) / 2;
            if usize::from(encode(f32::from_bits(middle))) < value {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        f32::from_bits(low)
    })
});

/// 8-bit value at the start of each table step.
static START: LazyLock<Vec<u8>> = LazyLock::new(|| (0..=STEPS).map(|i| encode(i as f32 / STEPS as f32)).collect());

/// The 8-bit sRGB colour nearest to linear light. Values outside [0, 1] are clipped.
pub fn from_linear(light: [f32; 3]) -> [u8; 3] {
    let encoder = Encoder::new();
    light.map(|l| encoder.encode(l))
}

/// Tables that avoid the slow power function.
#[derive(Clone, Copy)]
pub(crate) struct Encoder {
    start: &'static [u8],
    least: &'static [f32; 257],
}

impl Encoder {
    pub fn new() -> Self {
        Self { start: &START, least: &LEAST_LIGHT }
    }

    /// The 8-bit value of linear light, see [`from_linear`].
    #[inline(always)]
    pub fn encode(&self, l: f32) -> u8 {
        // NaN maps to black.
        let l = if l > 0.0 { l.min(1.0) } else { 0.0 };
        let value = self.start[(l * STEPS as f32) as usize];
        // A step of the table is shorter than the least distance between two values.
        value + u8::from(l >= self.least[usize::from(value) + 1])
    }
}

fn encode(l: f32) -> u8 {
    let s = if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 };
    (s * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_round_trip_is_exact() {
        for c in 0..=255 {
            assert_eq!(from_linear(to_linear([c; 3])), [c; 3]);
        }
        for i in 0..200_000 {
            let l = i as f32 / 180_000.0 - 0.05;
            assert_eq!(from_linear([l; 3]), [encode(l.clamp(0.0, 1.0)); 3], "{l}");
        }
        assert_eq!(from_linear([f32::NAN, f32::INFINITY, f32::NEG_INFINITY]), [0, 255, 0]);
        assert!((to_linear([188; 3])[0] - 0.5).abs() < 0.005, "sRGB 188 is half the light");
    }
}
