//! Straight lines through measured pairs.

use serde::{Deserialize, Serialize};

/// A regression line with its scatter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// y at x = 0.
    pub intercept: f64,
    /// Change of y per x.
    pub slope: f64,
    /// Coefficient of correlation.
    pub r: f64,
    /// Standard deviation of the residuals, with two degrees of freedom less than pairs.
    pub residual_sd: f64,
    /// Number of pairs.
    pub count: usize,
}

/// d50 over lift in the paper (section VII-A): 7.9 mm + 0.32 h, r 0.71, residual SD 4.1 mm, over
/// nine lifts.
pub const PAPER: Line = Line { intercept: 7.9, slope: 0.32, r: 0.71, residual_sd: 4.1, count: 9 };

impl Line {
    /// The least-squares line through pairs (x, y); `None` with fewer than three pairs or without
    /// spread of x.
    pub fn through(pairs: &[(f64, f64)]) -> Option<Self> {
        let n = pairs.len() as f64;
        if pairs.len() < 3 {
            return None;
        }
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
        let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
        let (xx, xy, yy) =
            (mean(&|p| (p.0 - x).powi(2)), mean(&|p| (p.0 - x) * (p.1 - y)), mean(&|p| (p.1 - y).powi(2)));
        if xx <= 0.0 {
            return None;
        }
        let slope = xy / xx;
        let intercept = y - slope * x;
        let squares: f64 = pairs.iter().map(|p| (p.1 - intercept - slope * p.0).powi(2)).sum();
        let r = if yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 };
        Some(Self { intercept, slope, r, residual_sd: (squares / (n - 2.0)).sqrt(), count: pairs.len() })
    }

    /// y at x.
    pub fn at(&self, x: f64) -> f64 {
        self.intercept + self.slope * x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_with_known_scatter_is_found() {
        let pairs: Vec<(f64, f64)> =
            (0..8).map(|i| (f64::from(i), 3.0 + 0.5 * f64::from(i) + if i % 2 == 0 { 0.3 } else { -0.3 })).collect();
        let line = Line::through(&pairs).unwrap();
        // Computed in Python from the definitions.
        assert!((line.slope - 0.471_428_571).abs() < 1e-8 && (line.intercept - 3.1).abs() < 1e-8, "{line:?}");
        assert!((line.r - 0.965_176_378).abs() < 1e-8 && (line.residual_sd - 0.338_061_702).abs() < 1e-8, "{line:?}");
        assert_eq!(Line::through(&pairs[..2]), None);
        assert_eq!(Line::through(&[(1.0, 1.0), (1.0, 2.0), (1.0, 3.0)]), None);
    }

    #[test]
    fn the_papers_line_has_its_values() {
        assert!((PAPER.at(15.7) - 12.924).abs() < 1e-9 && (PAPER.at(31.5) - 17.98).abs() < 1e-9);
    }
}
