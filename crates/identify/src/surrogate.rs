//! What stands in for the simulation with the finer mesh: many simulations with a coarse mesh, and
//! a few of the difference between the two (M. C. Kennedy, A. O'Hagan, "Predicting the output from
//! a complex computer code when fast approximations are available", 2000).

use crate::emulator::{Emulator, Prediction};

/// A simulated point: its scores, and the numbers of all lifts with the coarse and with the finer
/// mesh.
#[derive(Clone, Debug)]
pub(crate) struct Point {
    pub scores: Vec<f64>,
    pub coarse: Vec<f64>,
    pub finer: Option<Vec<f64>>,
}

impl Point {
    /// The numbers of the finest mesh in which it was simulated.
    pub fn numbers(&self) -> &[f64] {
        self.finer.as_ref().unwrap_or(&self.coarse)
    }
}

/// Gaussian processes through the coarse numbers, and through the differences if there are any.
pub(crate) struct Surrogate {
    coarse: Emulator,
    difference: Option<Emulator>,
}

impl Surrogate {
    /// Through simulated points. None if there is no kernel with a factor.
    pub fn through(points: &[Point]) -> Option<Self> {
        let (at, coarse): (Vec<_>, Vec<_>) = points.iter().map(|p| (p.scores.clone(), p.coarse.clone())).unzip();
        let difference = |p: &Point| {
            let finer = p.finer.as_ref()?;
            let numbers = finer.iter().zip(&p.coarse).map(|(finer, coarse)| finer - coarse).collect::<Vec<f64>>();
            Some((p.scores.clone(), numbers))
        };
        let (both, differences): (Vec<_>, Vec<_>) = points.iter().filter_map(difference).unzip();
        let difference = if both.is_empty() { None } else { Some(Emulator::through(&both, &differences)?) };
        Some(Self { coarse: Emulator::through(&at, &coarse)?, difference })
    }

    /// What it foretells at a point.
    pub fn at(&self, scores: &[f64]) -> Prediction {
        let mut found = self.coarse.at(scores);
        if let Some(difference) = &self.difference {
            let other = difference.at(scores);
            found.mean.iter_mut().zip(&other.mean).for_each(|(mean, difference)| *mean += difference);
            found.variance += other.variance;
        }
        found
    }

    /// Those `count` of some candidates whose coarse simulations tell most.
    pub fn most_uncertain(&self, candidates: &[Vec<f64>], count: usize) -> Vec<usize> {
        self.coarse.most_uncertain(candidates, count)
    }
}
