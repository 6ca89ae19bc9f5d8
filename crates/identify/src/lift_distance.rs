//! How far apart two organs' lifts are in deviations of their measurement: whether lifts can tell
//! the two apart, whatever is fitted to them.

use crate::Result;
use crate::likelihood::TRACKER;
use crate::lone_organ::{LoneOrgan, Pace};
use crate::observation::Observation;
use crate::pull_error::{PULL_ERRORS, pull_errors};
use glam::{DMat4, DVec4};
use trocar_core::Progress;
use trocar_geometry::Skin;

/// Mahalanobis distances of lifts from those of one organ. The covariance is that of the
/// measurement: the tracker's noise in each landmark, and the errors of the pulls.
pub struct LiftDistance {
    lifts: Vec<Observation>,
    bound: Vec<Skin>,
    /// The numbers of each lift (m), and how they change with a deviation of each error of its
    /// pull.
    numbers: Vec<Vec<f64>>,
    pulls: Vec<[Vec<f64>; PULL_ERRORS]>,
}

impl LiftDistance {
    /// Distances from the lifts of `organ` with the measured pulls of `lifts`. Measured forces are
    /// ignored. None if a lift diverges.
    ///
    /// # Errors
    /// An organ that cannot be simulated, an interruption.
    pub fn from(organ: &LoneOrgan, lifts: &[Observation], progress: &dyn Progress) -> Result<Option<Self>> {
        let lifts: Vec<Observation> = lifts.iter().map(|lift| Observation { force: None, ..lift.clone() }).collect();
        let bound: Vec<Skin> = lifts.iter().map(|lift| lift.bound(organ)).collect();
        let (Some(numbers), Some(rows)) =
            (lifted(organ, &lifts, &bound, progress)?, pull_errors(organ, &lifts, &bound, progress)?)
        else {
            return Ok(None);
        };
        let mut first = 0;
        let own = |(numbers, rows): (&Vec<f64>, &[Vec<f64>])| {
            let range = first..first + numbers.len();
            first = range.end;
            std::array::from_fn(|k| rows[k][range.clone()].to_vec())
        };
        let pulls = numbers.iter().zip(rows.chunks_exact(PULL_ERRORS)).map(own).collect();
        Ok(Some(Self { lifts, bound, numbers, pulls }))
    }

    /// The distance to the lifts of `other`, which has the same mesh, in deviations. None if one
    /// diverges.
    ///
    /// # Errors
    /// As [`from`](Self::from).
    pub fn to(&self, other: &LoneOrgan, progress: &dyn Progress) -> Result<Option<f64>> {
        let Some(others) = lifted(other, &self.lifts, &self.bound, progress)? else { return Ok(None) };
        let lifts = self.numbers.iter().zip(&others).zip(&self.pulls);
        let square = lifts.map(|((own, other), pulls)| {
            let off: Vec<f64> = own.iter().zip(other).map(|(own, other)| other - own).collect();
            squared(&off, pulls)
        });
        Ok(Some(square.sum::<f64>().max(0.0).sqrt()))
    }
}

/// The numbers of each lift of an organ; None if one diverges.
fn lifted(
    organ: &LoneOrgan,
    lifts: &[Observation],
    bound: &[Skin],
    progress: &dyn Progress,
) -> Result<Option<Vec<Vec<f64>>>> {
    let pulls: Vec<_> = lifts.iter().map(|lift| lift.pull).collect();
    let lifted = organ.lift(&pulls, Pace::QUICK, progress)?;
    let each = lifts.iter().zip(bound).zip(&lifted);
    Ok(each.map(|((lift, bound), lifted)| Some(lift.predicted(organ, lifted.as_ref()?, bound))).collect())
}

/// The square of a distance: off' K^-1 off with K = t^2 + P P', the tracker's noise t and the
/// errors of the pull P, by Woodbury's formula.
fn squared(off: &[f64], pulls: &[Vec<f64>; PULL_ERRORS]) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / (TRACKER * TRACKER);
    let along = DVec4::from_array(std::array::from_fn(|k| dot(&pulls[k], off)));
    let gram: [[f64; 4]; 4] = std::array::from_fn(|i| std::array::from_fn(|j| dot(&pulls[i], &pulls[j])));
    let inner = DMat4::IDENTITY + DMat4::from_cols_array_2d(&gram);
    dot(off, off) - along.dot(inner.inverse() * along)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dense::Factor;

    #[test]
    fn a_distance_is_that_of_the_full_covariance() {
        let wave = |k: usize, i: usize| 4e-4 * ((1.3 * k as f64 + 0.9) * (i as f64 + 0.4)).sin();
        let pulls: [Vec<f64>; 4] = std::array::from_fn(|k| (0..9).map(|i| wave(k, i)).collect());
        let off: Vec<f64> = (0..9).map(|i| wave(5, i) + 2e-4).collect();
        let element = |i: usize, j: usize| {
            let own = if i == j { TRACKER * TRACKER } else { 0.0 };
            own + pulls.iter().map(|pull| pull[i] * pull[j]).sum::<f64>()
        };
        let full = Factor::of(9, element).unwrap().distance(&mut off.clone());
        assert!((squared(&off, &pulls) - full).abs() < 1e-9 * full);
        // What an error of the pull could have done says little.
        let own = pulls[2].clone();
        assert!(squared(&own, &pulls) < 1.0 && squared(&own, &std::array::from_fn(|_| vec![0.0; 9])) > 1.0);
    }
}
