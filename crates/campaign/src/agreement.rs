//! Whether two backends rank policies alike: ranks of policies on both, on the same seeds.

use crate::store::EpisodeRecord;
use crate::table::{Comparison, compare};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::Rng;
use serde::Serialize;
use trocar_scene::BackendName;

/// Times that episodes are drawn anew for the interval of Kendall's tau.
const BOOTSTRAP_DRAWS: usize = 2000;

/// Seed of these draws.
const BOOTSTRAP_SEED: u128 = 1;

/// Two backends beside each other. Policies are ranked by their mean score.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Agreement {
    /// The first backend.
    pub first: BackendName,
    /// The second backend.
    pub second: BackendName,
    /// Kendall's tau-b of the two rankings: 1 for the same order, -1 for the reverse. None if all
    /// policies have one score on a backend.
    pub kendall_tau: Option<f64>,
    /// Its 95% interval, by drawing the seeds of the episodes anew (percentile bootstrap).
    pub kendall_interval: Option<[f64; 2]>,
    /// Pearson's correlation of the mean scores. None if all are equal on a backend.
    pub pearson: Option<f64>,
    /// The largest difference between the scores of two policies on the first backend that the
    /// second one ranks the other way round (Li and others, "Evaluating real-world robot
    /// manipulation policies in simulation", 2024).
    pub max_rank_violation: f64,
    /// Each policy on both backends, by seed: `only_a` and `only_b` count seeds on which it passed
    /// on one alone.
    pub policies: Vec<Comparison>,
}

impl Agreement {
    /// Of the episodes of `policies` on two backends. Seeds that only one of them has are left out.
    pub(crate) fn of(
        policies: &[&str],
        (first, a): (BackendName, &[EpisodeRecord]),
        (second, b): (BackendName, &[EpisodeRecord]),
    ) -> Self {
        let (mut scores, mut compared) = (Vec::new(), Vec::new());
        for name in policies {
            let [one, two] =
                [a, b].map(|records| records.iter().filter(|r| r.name == *name).collect::<Vec<&EpisodeRecord>>());
            compared.extend(compare(&one, &two));
            let pairs = one.iter().filter_map(|x| Some((x, two.iter().find(|y| y.seed == x.seed)?)));
            scores.push(pairs.map(|(x, y)| [x.summary.score, y.summary.score]).collect::<Vec<_>>());
        }
        scores.retain(|of_policy| !of_policy.is_empty());
        let means: Vec<[f64; 2]> = scores.iter().map(|s| mean(s, 0..s.len())).collect();
        Self {
            first,
            second,
            kendall_tau: kendall_tau(&means),
            kendall_interval: interval(&scores),
            pearson: pearson(&means),
            max_rank_violation: max_rank_violation(&means),
            policies: compared,
        }
    }
}

/// The mean of the scores at some indices.
fn mean(scores: &[[f64; 2]], at: impl ExactSizeIterator<Item = usize>) -> [f64; 2] {
    let count = at.len() as f64;
    let sum = at.fold([0.0; 2], |sum, k| [sum[0] + scores[k][0], sum[1] + scores[k][1]]);
    sum.map(|sum| sum / count)
}

/// The pairs of items, as differences on both sides.
fn differences(means: &[[f64; 2]]) -> impl Iterator<Item = [f64; 2]> {
    (0..means.len()).flat_map(move |i| (0..i).map(move |j| [means[i][0] - means[j][0], means[i][1] - means[j][1]]))
}

/// Kendall's tau-b, which counts ties on one side only against the other side.
fn kendall_tau(means: &[[f64; 2]]) -> Option<f64> {
    let (mut sum, mut untied) = (0.0, [0.0; 2]);
    for [a, b] in differences(means) {
        let sign = |x: f64| if x == 0.0 { 0.0 } else { x.signum() };
        sum += sign(a) * sign(b);
        untied[0] += sign(a).abs();
        untied[1] += sign(b).abs();
    }
    let scale = (untied[0] * untied[1]).sqrt();
    (scale > 0.0).then(|| sum / scale)
}

/// The 95% interval of Kendall's tau. Each draw takes as many of the common seeds, with repeats;
/// policies keep their pairing by seed.
fn interval(scores: &[Vec<[f64; 2]>]) -> Option<[f64; 2]> {
    let episodes = scores.iter().map(Vec::len).min().filter(|n| *n > 1)?;
    let mut random = Pcg64Mcg::new(BOOTSTRAP_SEED);
    let mut taus = Vec::new();
    for _ in 0..BOOTSTRAP_DRAWS {
        let drawn: Vec<usize> = (0..episodes).map(|_| (random.next_u64() % episodes as u64) as usize).collect();
        let means: Vec<[f64; 2]> = scores.iter().map(|s| mean(s, drawn.iter().copied())).collect();
        taus.extend(kendall_tau(&means));
    }
    taus.sort_by(f64::total_cmp);
    let at = |share: f64| taus.get((share * taus.len().saturating_sub(1) as f64).round() as usize).copied();
    Some([at(0.025)?, at(0.975)?])
}

fn pearson(means: &[[f64; 2]]) -> Option<f64> {
    let middle = mean(means, 0..means.len());
    let (mut product, mut squares) = (0.0, [0.0; 2]);
    for [a, b] in means {
        let (a, b) = (a - middle[0], b - middle[1]);
        product += a * b;
        squares[0] += a * a;
        squares[1] += b * b;
    }
    let scale = (squares[0] * squares[1]).sqrt();
    (scale > 0.0).then(|| product / scale)
}

fn max_rank_violation(means: &[[f64; 2]]) -> f64 {
    let violation = |[a, b]: [f64; 2]| if a * b < 0.0 { a.abs() } else { 0.0 };
    differences(means).map(violation).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against values of scipy.stats.kendalltau (variant b) and numpy.corrcoef.
    #[test]
    fn ranks_are_correlated_as_in_scipy() {
        let means = [[0.9, 0.8], [0.9, 0.7], [0.5, 0.75], [0.2, 0.1], [0.0, 0.1]];
        assert!((kendall_tau(&means).unwrap() - 0.666_666_666_7).abs() < 1e-9);
        assert!((pearson(&means).unwrap() - 0.894_533_059_2).abs() < 1e-9);
        // 0.9 before 0.5 is ranked 0.7 after 0.75.
        assert!((max_rank_violation(&means) - 0.4).abs() < 1e-12);
        assert_eq!(kendall_tau(&[[1.0, 0.2], [1.0, 0.3]]), None);
        assert_eq!(pearson(&[[1.0, 0.2], [1.0, 0.3]]), None);
        assert_eq!(max_rank_violation(&[[1.0, 0.2], [1.0, 0.3]]), 0.0);
    }

    #[test]
    fn intervals_hold_the_value_and_shrink_with_episodes() {
        let scores = |episodes: usize| -> Vec<Vec<[f64; 2]>> {
            let noise = |k: usize, e: usize| 0.4 * ((7 * k + 13 * e) % 11) as f64 / 11.0;
            let of = |k: usize, e: usize| [0.1 * k as f64 + noise(k, e), 0.1 * k as f64 + noise(k + 5, e)];
            (0..6).map(|k| (0..episodes).map(|e| of(k, e)).collect()).collect()
        };
        let width = |episodes: usize| {
            let [low, high] = interval(&scores(episodes)).unwrap();
            assert!(low <= high && high <= 1.0);
            high - low
        };
        assert!(width(100) < width(5));
        assert_eq!(interval(&scores(1)), None);
    }
}
