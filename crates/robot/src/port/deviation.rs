//! Statistics of the RCM deviation of an episode (see the glossary).

use crate::{Error, Result};

/// Threshold of the RCM deviation in the evaluation of an episode (m).
pub const RCM_THRESHOLD: f64 = 3e-3;

/// RCM deviation at which the hardware stops (m).
pub const RCM_ABORT: f64 = 5e-3;

/// RCM deviations of all steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Deviation {
    values: Vec<f64>,
}

impl Deviation {
    /// Adds a deviation (m).
    ///
    /// # Errors
    /// One that is negative or not finite.
    pub fn add(&mut self, deviation: f64) -> Result<()> {
        if !(deviation.is_finite() && deviation >= 0.0) {
            return Err(Error::invalid(
                "RCM deviation",
                format!("is {deviation} m; it must be finite and not negative"),
            ));
        }
        self.values.push(deviation);
        Ok(())
    }

    /// Number of deviations.
    pub fn count(&self) -> usize {
        self.values.len()
    }

    /// The maximum (m), 0 without any.
    pub fn peak(&self) -> f64 {
        self.values.iter().copied().fold(0.0, f64::max)
    }

    /// The root mean square (m), 0 without any.
    pub fn rms(&self) -> f64 {
        let sum: f64 = self.values.iter().map(|v| v * v).sum();
        (sum / self.values.len().max(1) as f64).sqrt()
    }

    /// The quantile (m) of `share` in [0, 1], linear between neighbours as in NumPy (0.5 is the
    /// median); 0 without any.
    pub fn percentile(&self, share: f64) -> f64 {
        let mut sorted = self.values.clone();
        sorted.sort_by(f64::total_cmp);
        let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
        let place = crate::instrument::clamp_unit(share) * last as f64;
        let below = (place as usize).min(last);
        let above = (below + 1).min(last);
        sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_match_the_values() {
        let mut d = Deviation::default();
        assert_eq!((d.peak(), d.rms(), d.percentile(0.5)), (0.0, 0.0, 0.0));
        (0..=100).for_each(|k| d.add(f64::from(k) * 4e-5).unwrap());
        assert!((d.percentile(0.95) - 3.8e-3).abs() < 1e-12 && (d.percentile(0.5) - 2e-3).abs() < 1e-12);
        d.add(5e-3).unwrap();
        assert_eq!(d.count(), 102);
        assert!((d.peak() - 5e-3).abs() < 1e-15 && d.add(f64::NAN).is_err() && d.add(-1.0).is_err());
    }
}
