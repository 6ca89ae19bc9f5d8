//! A damped oscillation, measured in the same way in a recording and in a simulation.

use crate::{Error, Result};
use serde::Serialize;

/// Displacements (m) at equal steps of time, from the release on.
#[derive(Clone, Debug)]
pub(super) struct Track {
    /// Time between two (s).
    pub step: f64,
    pub places: Vec<f64>,
}

/// What is measured of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Swing {
    /// Displacement at rest (mm).
    pub settled_mm: f64,
    /// How far the first swing goes beyond that (mm).
    pub first_peak_mm: f64,
    /// Period of the first whole oscillation (s).
    pub period_s: f64,
    /// Damping ratio, from the decrement of the peaks on one side over two periods.
    pub damping: f64,
}

/// The end of a track in which it is at rest (s).
const REST_S: f64 = 0.5;

impl Track {
    /// Measures the oscillation.
    ///
    /// # Errors
    /// A track that swings less than three times.
    pub fn swing(&self) -> Result<Swing> {
        let resting = ((REST_S / self.step) as usize).clamp(1, self.places.len());
        let settled = self.places[self.places.len() - resting..].iter().sum::<f64>() / resting as f64;
        let off: Vec<f64> = self.places.iter().map(|d| d - settled).collect();
        let crossing = |k: &usize| (off[*k] < 0.0) != (off[k + 1] < 0.0);
        let crossings: Vec<usize> = (0..off.len() - 1).filter(crossing).take(6).collect();
        let [a, b, c, _, e, f] = crossings[..] else {
            return Err(Error::Mismatch("the beam swings less than three times".to_owned()));
        };
        let time = |k: usize| self.step * (k as f64 + off[k] / (off[k] - off[k + 1]));
        let peak = |from: usize, to: usize| peak(&off[from..=to + 1]);
        // The same side every second time.
        let (first, third) = (peak(a, b), peak(e, f));
        let decrement = 0.5 * (first / third).ln();
        Ok(Swing {
            settled_mm: 1e3 * settled,
            first_peak_mm: 1e3 * first,
            period_s: time(c) - time(a),
            damping: decrement / (std::f64::consts::TAU.powi(2) + decrement * decrement).sqrt(),
        })
    }
}

/// The largest distance from zero, between samples by a parabola.
fn peak(values: &[f64]) -> f64 {
    let k = (0..values.len()).max_by(|a, b| values[*a].abs().total_cmp(&values[*b].abs())).unwrap_or(0);
    let at = |k: usize| values[k].abs();
    if k == 0 || k + 1 == values.len() {
        return at(k);
    }
    let (before, here, after) = (at(k - 1), at(k), at(k + 1));
    let bend = before - 2.0 * here + after;
    if bend >= 0.0 { here } else { here - 0.125 * (after - before).powi(2) / bend }
}

impl Swing {
    /// The mean of several.
    pub(super) fn mean(swings: &[Self]) -> Self {
        let of = |value: fn(&Self) -> f64| swings.iter().map(value).sum::<f64>() / swings.len() as f64;
        Self {
            settled_mm: of(|s| s.settled_mm),
            first_peak_mm: of(|s| s.first_peak_mm),
            period_s: of(|s| s.period_s),
            damping: of(|s| s.damping),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damped_oscillation_is_measured() {
        let (settled, period, ratio, step) = (7e-3, 0.13, 0.06, 0.01);
        let omega = std::f64::consts::TAU / period;
        let rate = omega * ratio / (1.0f64 - ratio * ratio).sqrt();
        let at = |k: usize| {
            let t = step * k as f64;
            settled * (1.0 - (-rate * t).exp() * ((omega * t).cos() + rate / omega * (omega * t).sin()))
        };
        let track = Track { step, places: (0..400).map(at).collect() };
        let swing = track.swing().unwrap();
        assert!((swing.settled_mm / 7.0 - 1.0).abs() < 1e-4, "{swing:?}");
        assert!((swing.period_s / period - 1.0).abs() < 0.01, "{swing:?}");
        assert!((swing.damping / ratio - 1.0).abs() < 0.05, "{swing:?}");
        let overshoot = 7.0 * (-std::f64::consts::PI * ratio / (1.0f64 - ratio * ratio).sqrt()).exp();
        assert!((swing.first_peak_mm / overshoot - 1.0).abs() < 0.02, "{swing:?}, {overshoot}");
        assert!(Track { step, places: vec![1.0; 400] }.swing().is_err());
    }
}
