//! The figures of the study.

use super::condition::{AS_WRITTEN, TOGETHER};
use crate::trials::Resumed;
use serde::{Deserialize, Serialize};
use trocar_campaign::{Bin, Curve, Interval, Share};
use trocar_task::{Summary, Warnings};

/// The episodes of a controller at a condition.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PolicyOutcome {
    /// The controller.
    pub policy: String,
    /// Its episodes.
    pub episodes: usize,
    /// Those that passed all stages.
    pub passed: usize,
    /// Mean score, 0 to 1.
    pub mean_score: f64,
    /// Episodes that diverged.
    pub diverged: usize,
    /// Largest number of inverted elements in any frame.
    pub inverted_peak: usize,
    /// What was beyond what tissue withstands.
    pub warnings: Warnings,
    /// Episodes that could not begin, such as with a start out of reach.
    pub refused: usize,
    /// Why the first episode did not pass.
    pub why: Option<String>,
}

impl PolicyOutcome {
    pub(super) fn new(policy: &str) -> Self {
        Self { policy: policy.to_owned(), ..Self::default() }
    }

    pub(super) fn add(&mut self, s: &Summary) {
        let before = self.mean_score * self.episodes as f64;
        self.episodes += 1;
        self.mean_score = (before + s.score) / self.episodes as f64;
        self.passed += usize::from(s.passed);
        self.diverged += usize::from(s.diverged);
        self.inverted_peak = self.inverted_peak.max(s.inverted_peak);
        self.warnings = [self.warnings, s.warnings].into_iter().sum();
        if !s.passed && self.why.is_none() {
            self.why = s.why.clone().or_else(|| s.end.as_ref().map(ToString::to_string));
        }
    }

    pub(super) fn add_refused(&mut self, why: &str) {
        self.mean_score *= self.episodes as f64 / (self.episodes + 1) as f64;
        self.episodes += 1;
        self.refused += 1;
        self.why.get_or_insert_with(|| format!("could not begin: {why}"));
    }
}

/// All controllers at a condition.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobustnessRow {
    /// The factor; `as written` and `together` are no factors.
    pub factor: String,
    /// The factor with its unit.
    pub label: String,
    /// The value in words.
    pub value: String,
    /// The value as a number.
    pub number: Option<f64>,
    /// The values are even in the logarithm.
    pub log: bool,
    /// The controllers.
    pub policies: Vec<PolicyOutcome>,
}

/// Figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct RobustnessResult {
    /// The scene.
    pub scene: String,
    /// The set whose ranges are covered.
    pub variation: &'static str,
    /// Episodes of each controller at each value.
    pub episodes: usize,
    /// Episodes of each controller with all factors together.
    pub together: usize,
    /// Number of the first unseen episode.
    pub seed: u64,
    /// The conditions.
    pub rows: Vec<RobustnessRow>,
    /// Conditions of an earlier run.
    pub resumed: Resumed,
}

impl RobustnessResult {
    /// The scene as it is written.
    pub(super) fn as_written(&self) -> Option<&RobustnessRow> {
        self.rows.iter().find(|row| row.factor == AS_WRITTEN)
    }

    /// All factors together, of seen and of unseen episodes.
    pub(super) fn together(&self) -> impl Iterator<Item = &RobustnessRow> {
        self.rows.iter().filter(|row| row.factor == TOGETHER)
    }

    /// Success over each factor, in the order of the rows.
    pub(super) fn curves(&self) -> Vec<Curve> {
        let mut curves: Vec<Curve> = Vec::new();
        for row in self.rows.iter().filter(|row| ![AS_WRITTEN, TOGETHER].contains(&row.factor.as_str())) {
            let share = |p: &PolicyOutcome| Share {
                policy: p.policy.clone(),
                episodes: p.episodes,
                passed: p.passed,
                interval: Interval::wilson(p.passed, p.episodes),
            };
            let bin = Bin {
                value: row.value.clone(),
                numbers: row.number.map(|n| [n; 3]),
                policies: row.policies.iter().map(share).collect(),
            };
            match curves.iter_mut().find(|curve| curve.name == row.factor) {
                Some(curve) => curve.bins.push(bin),
                None => curves.push(Curve {
                    name: row.factor.clone(),
                    label: row.label.clone(),
                    choice: true,
                    log: row.log,
                    bins: vec![bin],
                }),
            }
        }
        curves
    }
}
