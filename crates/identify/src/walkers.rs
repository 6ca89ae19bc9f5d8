//! Draws from a distribution of known density: an ensemble of walkers (J. Goodman, J. Weare,
//! "Ensemble samplers with affine invariance", 2010).

use trocar_core::Random;

/// Largest stretch of a move.
const STRETCH: f64 = 2.0;

/// The last places of the walkers of an ensemble that began at `starts`, kept every `thin` rounds
/// after `warm` rounds until `rounds` are over.
pub(crate) fn walk(
    starts: &[Vec<f64>],
    [warm, rounds, thin]: [usize; 3],
    random: Random,
    log_density: impl Fn(&[f64]) -> f64,
) -> Vec<Vec<f64>> {
    let (mut places, count) = (starts.to_vec(), starts.len());
    let mut logs: Vec<f64> = places.iter().map(|p| log_density(p)).collect();
    let mut kept = Vec::new();
    let half = count / 2;
    for round in 0..rounds {
        for k in 0..count {
            let draw = random.stream((round * count + k) as u64);
            // A walker moves along the line to one of the other half.
            let (first, others) = if k < half { (half, count - half) } else { (0, half) };
            let other = first + ((draw.uniform(0) * others as f64) as usize).min(others - 1);
            let root = 1.0 / STRETCH.sqrt() + draw.uniform(1) * (STRETCH.sqrt() - 1.0 / STRETCH.sqrt());
            let stretch = root * root;
            let place: Vec<f64> =
                places[k].iter().zip(&places[other]).map(|(own, other)| other + stretch * (own - other)).collect();
            let log = log_density(&place);
            let odds = (place.len() as f64 - 1.0) * stretch.ln() + log - logs[k];
            if draw.uniform(2).ln() < odds {
                (places[k], logs[k]) = (place, log);
            }
        }
        if round >= warm && (round - warm) % thin == 0 {
            kept.extend(places.iter().cloned());
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slanted_normal_distribution_is_drawn() {
        let random = Random::from_keys(&[5]);
        let starts: Vec<Vec<f64>> = (0..24).map(|i| (0..2).map(|k| random.stream(k).normal(i)).collect()).collect();
        // x of deviation 1, y = 3 x + 0.1 normal.
        let log = |p: &[f64]| -0.5 * (p[0] * p[0] + (p[1] - 3.0 * p[0]) * (p[1] - 3.0 * p[0]) / 0.01);
        let kept = walk(&starts, [200, 1200, 5], random.stream(9), log);
        let mean = |f: &dyn Fn(&Vec<f64>) -> f64| kept.iter().map(f).sum::<f64>() / kept.len() as f64;
        assert!(mean(&|p| p[0]).abs() < 0.15, "{}", mean(&|p| p[0]));
        assert!((mean(&|p| p[0] * p[0]) - 1.0).abs() < 0.25);
        let apart = mean(&|p| (p[1] - 3.0 * p[0]).powi(2)).sqrt();
        assert!((apart - 0.1).abs() < 0.02, "{apart}");
    }
}
