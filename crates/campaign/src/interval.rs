//! A share of episodes with its 95% interval.

use serde::{Deserialize, Serialize};
use trocar_report::table::percent;

/// Half-width of a 95% interval in standard deviations.
const Z: f64 = 1.959_964;

/// A share with its 95% interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// The share.
    pub share: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// The share of `count` among `all` with its Wilson interval (E. B. Wilson, "Probable
    /// inference, the law of succession, and statistical inference", 1927).
    pub fn wilson(count: usize, all: usize) -> Self {
        if all == 0 {
            return Self { share: 0.0, low: 0.0, high: 1.0 };
        }
        let (n, p) = (all as f64, count as f64 / all as f64);
        let (z2, scale) = (Z * Z, 1.0 + Z * Z / n);
        let middle = (p + z2 / (2.0 * n)) / scale;
        let half = Z * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt() / scale;
        // Rounding would miss the exact ends at 0 and 1.
        let low = if count == 0 { 0.0 } else { (middle - half).max(0.0) };
        let high = if count == all { 1.0 } else { (middle + half).min(1.0) };
        Self { share: p, low, high }
    }

    /// The share and its interval in percent.
    pub(crate) fn in_percent(&self) -> String {
        let [share, low, high] = [self.share, self.low, self.high].map(|of| percent(of, 0));
        format!("{share} ({low}\u{2013}{high})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_wilsons() {
        // By hand from the formula: 15 of 15, and 5 of 10.
        let all = Interval::wilson(15, 15);
        assert!((all.low - 0.7961).abs() < 1e-4 && all.high == 1.0, "{all:?}");
        let half = Interval::wilson(5, 10);
        assert!((half.low - 0.2366).abs() < 1e-4 && (half.high - 0.7634).abs() < 1e-4, "{half:?}");
        assert_eq!(Interval::wilson(0, 0).high, 1.0);
        for n in 1..2000 {
            assert_eq!((Interval::wilson(n, n).high, Interval::wilson(0, n).low), (1.0, 0.0), "{n}");
        }
    }
}
