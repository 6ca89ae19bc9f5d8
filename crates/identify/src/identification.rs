//! Identification: rounds of simulated lifts, each nearer to the measured ones.

use crate::emulator::Prediction;
use crate::left_open::left_open;
use crate::likelihood::Likelihood;
use crate::lone_organ::{LoneOrgan, Pace};
use crate::observation::Observation;
use crate::pull_error::pull_errors;
use crate::quantile::normal_quantile;
use crate::surrogate::{Point, Surrogate};
use crate::walkers::walk;
use crate::{Error, Result};
use rayon::prelude::*;
use trocar_core::{Progress, Random};
use trocar_geometry::Skin;
use trocar_specimen::{Parameter, Posterior, Prior};

/// Cells of the finer mesh over those of the coarse one.
pub const FINER: f64 = 0.75;

/// Simulated values a parameter: of the first round, from the prior, with the coarse mesh alone,
/// and of each further round, of which one in so many has the finer mesh too.
const FIRST: usize = 14;
const FURTHER: [(usize, usize); 5] = [(4, 3), (4, 3), (4, 3), (4, 2), (4, 2)];

/// Draws among which those are chosen whose simulations tell most.
const CANDIDATES: usize = 200;

/// Walkers, and rounds of a walk: before draws are kept, in all, and between kept ones; of the last
/// walk, and of those that choose what is simulated next.
const WALKERS: usize = 32;
const WALK: [usize; 3] = [250, 650, 8];
const SEARCH: [usize; 3] = [150, 350, 8];

/// Fewest landmarks of all lifts.
const LEAST_LANDMARKS: usize = 6;

/// What to identify, from what.
#[derive(Clone, Debug)]
pub struct Identification {
    /// The organ alone, in the coarse mesh in which it is simulated most often.
    pub organ: LoneOrgan,
    /// The organ in a finer mesh, with cells [`FINER`] times as long. Identified values are for it.
    pub finer: LoneOrgan,
    /// The lifts.
    pub lifts: Vec<Observation>,
    /// The parameters with their ranges.
    pub priors: Vec<Prior>,
    /// Seed of all draws.
    pub seed: u64,
    /// Name of the recording, for the posterior.
    pub recording: String,
    /// Simulations in parallel; 0 for one a core. The result does not depend on it.
    pub threads: usize,
}

/// What was identified.
#[derive(Clone, Debug)]
pub struct Identified {
    /// The posterior.
    pub posterior: Posterior,
    /// The values that explain the lifts best, of all simulated ones.
    pub best: Vec<(Parameter, f64)>,
    /// Landmark error of these values over the lifts (m).
    pub rmse: f64,
    /// Error of the model over the lift: median of the posterior.
    pub model_error: f64,
    /// Simulated values, and those of them that diverged.
    pub simulated: usize,
    /// See `simulated`.
    pub diverged: usize,
}

impl Identification {
    /// Values of scores.
    pub fn values(&self, scores: &[f64]) -> Vec<(Parameter, f64)> {
        self.priors.iter().zip(scores).map(|(p, score)| (p.name, p.name.value(p.range, *score))).collect()
    }

    /// Identifies.
    ///
    /// # Errors
    /// Too few landmarks, an organ that cannot be simulated, an interruption.
    pub fn run(&self, progress: &dyn Progress) -> Result<Identified> {
        let landmarks: usize = self.lifts.iter().map(|l| l.landmarks.len()).sum();
        if landmarks < LEAST_LANDMARKS {
            return Err(Error::Lifts(format!(
                "the lifts have {landmarks} landmarks that are seen; there must be at least {LEAST_LANDMARKS}"
            )));
        }
        let count = |(count, each): &(usize, usize)| {
            let coarse = count * self.priors.len();
            coarse + coarse / each
        };
        let total = FIRST * self.priors.len() + FURTHER.iter().map(count).sum::<usize>();
        progress.begin("simulated lifts", (total * self.lifts.len()) as u64);
        let result = self.rounds(progress);
        progress.end();
        result
    }

    fn rounds(&self, progress: &dyn Progress) -> Result<Identified> {
        let random = Random::from_keys(&[self.seed, 401]);
        let mut likelihood = Likelihood::of(&self.lifts);
        let bound = [&self.organ, &self.finer].map(|organ| self.lifts.iter().map(|l| l.bound(organ)).collect());
        let mut points: Vec<Point> = Vec::new();
        let mut asked = self.spread(random.stream(1));
        let (mut simulated, mut diverged, mut draws) = (0, 0, Vec::new());
        for round in 0..=FURTHER.len() {
            simulated += asked.len();
            let each = if round == 0 { usize::MAX } else { FURTHER[round - 1].1 };
            let found = self.simulate(&asked, each, &bound, progress)?;
            diverged += found.iter().filter(|p| p.is_none()).count();
            points.extend(found.into_iter().flatten());
            if points.len() < 2 * self.priors.len() {
                return Err(Error::Lifts(format!("{diverged} of {simulated} simulated lifts diverged")));
            }
            let best = self.best(&points, &likelihood)?;
            let organ = self.organ.with(|organ| Posterior::apply(&self.values(&best.scores), organ));
            if let Some(rows) = pull_errors(&organ, &self.lifts, &bound[0], progress)? {
                likelihood.with_pull_errors(&rows);
            }
            let surrogate =
                Surrogate::through(&points).ok_or_else(|| Error::Lifts("all simulated lifts are alike".to_owned()))?;
            let walk = |rounds: [usize; 3], log: &dyn Fn(&Prediction, f64) -> f64| {
                let starts = self.starts(&points, &likelihood, random.stream(10 + round as u64));
                self.explore(&starts, &surrogate, rounds, random.stream(10 + round as u64), log)
            };
            if let Some((count, _)) = FURTHER.get(round) {
                let open = walk(SEARCH, &|predicted, error| likelihood.in_question(predicted, error));
                asked = self.next(&open, &surrogate, count * self.priors.len(), random.stream(20 + round as u64));
            } else {
                draws = walk(WALK, &|predicted, error| likelihood.log(predicted, error));
            }
        }
        self.conclude(&points, &likelihood, &draws, [simulated, diverged])
    }

    /// Points that cover the prior evenly: a Latin hypercube.
    fn spread(&self, random: Random) -> Vec<Vec<f64>> {
        let count = FIRST * self.priors.len();
        let mut points = vec![vec![0.0; self.priors.len()]; count];
        for k in 0..self.priors.len() {
            let own = random.stream(k as u64);
            let mut order: Vec<usize> = (0..count).collect();
            order.sort_by_key(|i| own.bits(*i as u64));
            for (i, rank) in order.into_iter().enumerate() {
                let share = (rank as f64 + own.stream(1).uniform(i as u64)) / count as f64;
                points[i][k] = normal_quantile(share);
            }
        }
        points
    }

    /// The points of the next round: half of them as drawn, half of them those that tell most.
    fn next(&self, draws: &[Vec<f64>], surrogate: &Surrogate, count: usize, random: Random) -> Vec<Vec<f64>> {
        let one = |i: usize| ((random.uniform(i as u64) * draws.len() as f64) as usize).min(draws.len() - 1);
        let drawn = |i: usize| draws[one(i)][..self.priors.len()].to_vec();
        let (half, candidates) = (count / 2, (0..CANDIDATES).map(drawn).collect::<Vec<_>>());
        let told = surrogate.most_uncertain(&candidates[half..], count - half);
        // In turns, so that those as drawn are simulated with the finer mesh.
        let mut told = told.into_iter().map(|k| candidates[half + k].clone());
        let turns = candidates[..half].iter().flat_map(|drawn| told.next().into_iter().chain([drawn.clone()]));
        let mut points: Vec<Vec<f64>> = turns.collect();
        points.extend(told);
        points
    }

    /// The numbers of all lifts at these scores, and one in `each` with the finer mesh too; `None`
    /// where a lift diverged.
    fn simulate(
        &self,
        asked: &[Vec<f64>],
        each: usize,
        [coarse, finer]: &[Vec<Skin>; 2],
        progress: &dyn Progress,
    ) -> Result<Vec<Option<Point>>> {
        let one = |(k, scores): (usize, &Vec<f64>)| -> Result<Option<Point>> {
            let Some(numbers) = self.simulate_one(&self.organ, scores, coarse, progress)? else { return Ok(None) };
            let mut point = Point { scores: scores.clone(), coarse: numbers, finer: None };
            if (k + 1) % each == 0 {
                point.finer = self.simulate_one(&self.finer, scores, finer, progress)?;
            }
            Ok(Some(point))
        };
        // A pool of one thread would let a caller's pool begin other work meanwhile.
        if self.threads == 1 {
            return asked.iter().enumerate().map(one).collect();
        }
        let pool = trocar_core::thread_pool(self.threads).map_err(Error::Lifts)?;
        pool.install(|| asked.par_iter().enumerate().map(one).collect())
    }

    fn simulate_one(
        &self,
        organ: &LoneOrgan,
        scores: &[f64],
        bound: &[Skin],
        progress: &dyn Progress,
    ) -> Result<Option<Vec<f64>>> {
        let values = self.values(scores);
        let organ = organ.with(|organ| Posterior::apply(&values, organ));
        let pulls: Vec<_> = self.lifts.iter().map(|lift| lift.pull).collect();
        let lifted = organ.lift(&pulls, Pace::QUICK, progress)?;
        progress.advance(self.lifts.len() as u64);
        let mut numbers = Vec::new();
        for ((lift, lifted), bound) in self.lifts.iter().zip(&lifted).zip(bound) {
            let Some(lifted) = lifted else { return Ok(None) };
            numbers.extend(lift.predicted(&organ, lifted, bound));
        }
        Ok(Some(numbers))
    }

    /// Draws scores of the parameters and of the model's error from the product of the prior and
    /// the likelihood whose logarithm is `log`, with the surrogate in place of simulations.
    fn explore(
        &self,
        starts: &[Vec<f64>],
        surrogate: &Surrogate,
        rounds: [usize; 3],
        random: Random,
        log: &dyn Fn(&Prediction, f64) -> f64,
    ) -> Vec<Vec<f64>> {
        let log = |scores: &[f64]| {
            let (parameters, error) = scores.split_at(self.priors.len());
            let prior: f64 = -0.5 * scores.iter().map(|s| s * s).sum::<f64>();
            prior + log(&surrogate.at(parameters), error[0])
        };
        walk(starts, rounds, random, log)
    }

    /// Where walkers begin: at the best simulated points.
    fn starts(&self, points: &[Point], likelihood: &Likelihood, random: Random) -> Vec<Vec<f64>> {
        let mut ranked: Vec<(f64, &Point)> = points.iter().map(|p| (self.log_at(p, likelihood), p)).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let start = |k: usize| -> Vec<f64> {
            let own = random.stream(1000 + k as u64);
            let (_, point) = ranked[k % ranked.len().min(WALKERS / 2)];
            let jitter = |d: usize| 0.1 * own.normal(d as u64);
            let scores = point.scores.iter().enumerate().map(|(d, s)| s + jitter(d));
            scores.chain([0.3 * own.normal(99)]).collect()
        };
        (0..WALKERS).map(start).collect()
    }

    /// Logarithm of the posterior at a simulated point with the likeliest error of the model.
    fn log_at(&self, point: &Point, likelihood: &Likelihood) -> f64 {
        let exact = Prediction { mean: point.numbers().to_vec(), variance: 0.0 };
        let of = |error: f64| -0.5 * error * error + likelihood.log(&exact, error);
        let most = (-8..=20).map(|k| of(0.25 * f64::from(k))).fold(f64::NEG_INFINITY, f64::max);
        most - 0.5 * point.scores.iter().map(|s| s * s).sum::<f64>()
    }

    /// The likeliest point, of those that were simulated with the finer mesh if there are any.
    fn best<'a>(&self, points: &'a [Point], likelihood: &Likelihood) -> Result<&'a Point> {
        let rank = |p: &&Point| (p.finer.is_some(), self.log_at(p, likelihood));
        let ranked = points.iter().map(|p| (rank(&p), p));
        let best = ranked.max_by(|((fine, a), _), ((other, b), _)| fine.cmp(other).then(a.total_cmp(b)));
        best.map(|(_, point)| point).ok_or_else(|| Error::Lifts("no simulated lift is left".to_owned()))
    }

    fn conclude(
        &self,
        points: &[Point],
        likelihood: &Likelihood,
        draws: &[Vec<f64>],
        [simulated, diverged]: [usize; 2],
    ) -> Result<Identified> {
        let count = draws.len() as f64;
        let parameters = 0..self.priors.len();
        let mean: Vec<f64> = parameters.clone().map(|k| draws.iter().map(|d| d[k]).sum::<f64>() / count).collect();
        let product = |i: usize, j: usize| draws.iter().map(|d| (d[i] - mean[i]) * (d[j] - mean[j])).sum::<f64>();
        let mut covariance: Vec<Vec<f64>> =
            parameters.clone().map(|i| parameters.clone().map(|j| product(i, j) / count).collect()).collect();
        for k in parameters {
            let open = left_open(&self.priors[k], mean[k]);
            covariance[k][k] += open * open;
        }
        let best = self.best(points, likelihood)?;
        let rmse = self.rmse(best.numbers());
        let mut posterior = Posterior {
            recording: self.recording.clone(),
            lifts: self.lifts.iter().map(|l| l.number).collect(),
            landmark_rmse_mm: 1e3 * rmse,
            covariance,
            mean,
            parameters: self.priors.clone(),
        };
        posterior.summarise();
        let errors: Vec<f64> = draws.iter().map(|d| Likelihood::model_error(d[self.priors.len()])).collect();
        Ok(Identified {
            posterior,
            best: self.values(&best.scores),
            rmse,
            model_error: trocar_core::median(errors).unwrap_or(f64::NAN),
            simulated,
            diverged,
        })
    }

    /// Root mean square of the lifts' landmark errors (m).
    fn rmse(&self, numbers: &[f64]) -> f64 {
        let mut next = 0;
        let squares = self.lifts.iter().map(|lift| {
            let own = &numbers[next..];
            next += lift.measured().len();
            lift.rmse(own).powi(2)
        });
        (squares.sum::<f64>() / self.lifts.len().max(1) as f64).sqrt()
    }
}
