//! Errors of positions relative to the displacement.

use glam::DVec3;

/// Root of the mean squared distance from `positions` to `truth`, over that from `rest` to `truth`.
pub fn rms_error(positions: &[DVec3], truth: &[DVec3], rest: &[DVec3]) -> f64 {
    ratio(positions, truth, rest, |d| d.length_squared()).sqrt()
}

/// Mean distance from `positions` to `truth`, over that from `rest` to `truth`.
pub fn mean_error(positions: &[DVec3], truth: &[DVec3], rest: &[DVec3]) -> f64 {
    ratio(positions, truth, rest, |d| d.length())
}

fn ratio(positions: &[DVec3], truth: &[DVec3], rest: &[DVec3], size: impl Fn(DVec3) -> f64) -> f64 {
    let sum = |from: &[DVec3]| from.iter().zip(truth).map(|(a, b)| size(*a - *b)).sum::<f64>();
    sum(positions) / sum(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_over_the_displacement() {
        let rest = [DVec3::ZERO, DVec3::ZERO];
        let truth = [DVec3::X, DVec3::X * 3.0];
        let off = [DVec3::X + DVec3::Y * 0.3, DVec3::X * 3.0 - DVec3::Y * 0.1];
        assert!((mean_error(&off, &truth, &rest) - 0.1).abs() < 1e-12);
        assert!((rms_error(&off, &truth, &rest) - (0.1_f64 / 10.0).sqrt()).abs() < 1e-12);
    }
}
