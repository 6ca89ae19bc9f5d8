//! Positions as 16-bit numbers in a cube.

use glam::DVec3;

/// Largest number.
const MAX_NUMBER: f64 = u16::MAX as f64;
/// The cube exceeds the points that it is made for by this (m): lifted tissue stays inside.
const MARGIN: f64 = 0.15;

/// A cube of 65,536 steps along each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    /// Its lowest corner (m).
    pub low: DVec3,
    /// Its step (m). A position is off by at most half of it along each axis.
    pub step: f64,
}

impl Grid {
    /// A cube around finite `points` with a margin; `None` without any.
    pub fn around<'a>(points: impl Iterator<Item = &'a DVec3>) -> Option<Self> {
        let bounds = points.filter(|p| p.is_finite()).fold(None, |bounds: Option<(DVec3, DVec3)>, p| {
            Some(bounds.map_or((*p, *p), |(low, high)| (low.min(*p), high.max(*p))))
        });
        let (low, high) = bounds?;
        let edge = (high - low).max_element() + 2.0 * MARGIN;
        Some(Self { low: 0.5 * (low + high) - DVec3::splat(0.5 * edge), step: edge / MAX_NUMBER })
    }

    /// The numbers of a point; `None` outside of the cube.
    pub fn numbers(&self, p: DVec3) -> Option<[u16; 3]> {
        let scaled = ((p - self.low) / self.step).round();
        let inside = scaled.cmpge(DVec3::ZERO).all() && scaled.cmple(DVec3::splat(MAX_NUMBER)).all();
        inside.then(|| scaled.to_array().map(|v| v as u16))
    }

    /// The point of these numbers (m).
    pub fn point(&self, numbers: [u16; 3]) -> DVec3 {
        self.low + self.step * DVec3::from_array(numbers.map(f64::from))
    }
}

/// The numbers as differences from those before, small ones of either sign as small numbers, all
/// low bytes before all high bytes. `before` becomes `now`.
pub(super) fn write_differences(now: &[[u16; 3]], before: &mut Vec<[u16; 3]>, out: &mut Vec<u8>) {
    before.resize(now.len(), [0; 3]);
    let first = out.len();
    let count = 3 * now.len();
    out.resize(first + 2 * count, 0);
    let (low, high) = out[first..].split_at_mut(count);
    let pairs = now.as_flattened().iter().zip(before.as_flattened_mut());
    for ((now, before), (low, high)) in pairs.zip(low.iter_mut().zip(high)) {
        let difference = now.wrapping_sub(*before);
        let folded = (difference << 1) ^ (((difference as i16) >> 15) as u16);
        [*low, *high] = folded.to_le_bytes();
        *before = *now;
    }
}

/// Reads what [`write_differences`] wrote: `before` becomes the numbers.
pub(super) fn read_differences(bytes: &[u8], before: &mut [[u16; 3]]) {
    let (low, high) = bytes.split_at(bytes.len() / 2);
    for (number, (low, high)) in before.as_flattened_mut().iter_mut().zip(low.iter().zip(high)) {
        let folded = u16::from_le_bytes([*low, *high]);
        *number = number.wrapping_add((folded >> 1) ^ (folded & 1).wrapping_neg());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_off_by_at_most_half_a_step_and_outside_is_refused() {
        let points = [DVec3::new(-0.1, 0.4, 0.0), DVec3::new(0.12, 0.5, 0.06), DVec3::splat(f64::NAN)];
        let grid = Grid::around(points.iter()).unwrap();
        // 0.22 m of organs and the margins: 8 micrometres a step.
        assert!((grid.step - 0.52 / 65535.0).abs() < 1e-12);
        for k in 0..2000 {
            let t = f64::from(k) / 2000.0;
            let p = points[0].lerp(points[1], t) + 0.14 * DVec3::new((9.0 * t).sin(), (7.0 * t).cos(), (5.0 * t).sin());
            let back = grid.point(grid.numbers(p).unwrap());
            assert!((back - p).abs().max_element() <= 0.5 * grid.step * (1.0 + 1e-9), "{p} {back}");
        }
        assert!(grid.numbers(DVec3::new(0.5, 0.4, 0.0)).is_none() && grid.numbers(points[2]).is_none());
        assert!(Grid::around(points[2..].iter()).is_none());
    }

    #[test]
    fn differences_give_the_numbers_back() {
        let frames = [[[0, 1, 65535], [32768, 7, 9]], [[65535, 0, 0], [32767, 8, 9]], [[65535, 0, 0], [0, 0, 0]]];
        let (mut before, mut read) = (Vec::new(), vec![[0; 3]; 2]);
        for now in &frames {
            let mut bytes = Vec::new();
            write_differences(now, &mut before, &mut bytes);
            assert_eq!(bytes.len(), 12);
            read_differences(&bytes, &mut read);
            assert_eq!(read, now);
        }
        // A body at rest gives zeros, and small motions give zero high bytes.
        let mut bytes = Vec::new();
        write_differences(&[[65534, 1, 0], [0, 0, 0]], &mut before, &mut bytes);
        assert_eq!(bytes, [1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    }
}
