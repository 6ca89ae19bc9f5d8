//! The figures of a campaign: episodes of each policy that passed each stage, with intervals, and
//! comparisons of policies on the same seeds.

use crate::by::By;
use crate::curves::Curve;
use crate::drawn_result::VariationResult;
use crate::interval::Interval;
use crate::manifest::Manifest;
use crate::outcomes::distinct_outcomes;
use crate::store::EpisodeRecord;
use serde::Serialize;
use std::path::Path;
use trocar_core::median;
use trocar_task::{End, Warnings};

/// Number of episodes that passed a stage.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StageCount {
    /// The stage.
    pub stage: String,
    /// Episodes that passed it.
    pub passed: usize,
    /// Their share.
    pub interval: Interval,
    /// Median time at which it passed (s).
    pub median_s: Option<f64>,
}

/// Numbers of episodes by their end. The JSON keys are the values of an episode's `end`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct EndCounts {
    /// All stages passed.
    pub passed: usize,
    /// The scene's time was up.
    pub time_out: usize,
    /// The RCM deviation reached the limit at which hardware stops.
    pub rcm_abort: usize,
    /// Tissue or an arm diverged.
    pub diverged: usize,
    /// The policy failed.
    pub policy_error: usize,
    /// An abort condition of the task held.
    #[serde(skip_serializing_if = "is_zero")]
    pub aborted: usize,
    /// The policy finished before all stages passed.
    pub finished: usize,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl EndCounts {
    /// Counts episodes. One without an end counts as a time-out.
    fn of<'a>(ends: impl Iterator<Item = Option<&'a End>>) -> Self {
        let mut counts = Self::default();
        for end in ends {
            *match end {
                Some(End::Passed) => &mut counts.passed,
                Some(End::TimeOut) | None => &mut counts.time_out,
                Some(End::RcmAbort { .. }) => &mut counts.rcm_abort,
                Some(End::Diverged { .. }) => &mut counts.diverged,
                Some(End::PolicyError { .. }) => &mut counts.policy_error,
                Some(End::Aborted { .. }) => &mut counts.aborted,
                Some(End::Finished) => &mut counts.finished,
            } += 1;
        }
        counts
    }
}

/// The figures of a policy.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PolicyRow {
    /// Its name.
    pub policy: String,
    /// Stored episodes.
    pub episodes: usize,
    /// Episodes that differ from each other in any figure by more than can be measured.
    pub distinct_outcomes: usize,
    /// Episodes that passed all stages.
    pub passed: usize,
    /// Their share.
    pub interval: Interval,
    /// The stages in order.
    pub stages: Vec<StageCount>,
    /// Mean score, 0 to 1.
    pub mean_score: f64,
    /// Episodes by their end.
    pub ends: EndCounts,
    /// Episodes with a grasp of the organ.
    pub attached: usize,
    /// Episodes that held the organ to the end.
    pub held_to_end: usize,
    /// Median lift over episodes with a grasp (mm).
    pub lift_median_mm: Option<f64>,
    /// Median over episodes with a grasp of the median RCM deviation under load (mm).
    pub rcm_median_mm: Option<f64>,
    /// Largest RCM deviation of any episode (mm).
    pub rcm_max_mm: Option<f64>,
    /// Episodes with a grasp whose RCM deviation stayed within the scene's threshold.
    pub rcm_within: usize,
    /// Episodes with a grasp whose RCM deviation stayed within 5 mm.
    pub rcm_within_5_mm: usize,
    /// Organ coordinate of the first grasp: median, minimum, maximum.
    pub grasp_at: Option<[f64; 3]>,
    /// Median over episodes of the peak contact force (N).
    pub peak_contact_n: Option<f64>,
    /// Median over episodes of the peak constraint force (N).
    pub peak_constraint_n: Option<f64>,
    /// Median over episodes of the peak force with which tissue pushed blades apart (N).
    pub peak_jaw_n: Option<f64>,
    /// Median over episodes of the delay of the measured tip behind the commanded tip (ms).
    pub lag_ms: Option<f64>,
    /// Maximum number of inverted elements in any frame.
    pub inverted_peak: usize,
    /// What was beyond what tissue withstands.
    pub warnings: Warnings,
    /// Reason of the policy's first failure.
    pub policy_error: Option<String>,
}

/// Two policies on the same seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The first policy.
    pub a: String,
    /// The second policy.
    pub b: String,
    /// Number of seeds that both have.
    pub seeds: usize,
    /// Seeds on which only the first passed.
    pub only_a: usize,
    /// Seeds on which only the second passed.
    pub only_b: usize,
    /// Two-sided p-value of McNemar's exact test.
    pub p: f64,
    /// Mean difference of scores, first minus second.
    pub score_difference: f64,
}

/// The figures of a campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CampaignResult {
    /// The scene.
    pub scene: String,
    /// The task.
    pub task: String,
    /// Number of the first episode in its split. Of seen episodes it is the seed.
    pub seed: u64,
    /// Stored episodes.
    pub episodes: usize,
    /// Episodes of the whole campaign.
    pub planned: usize,
    /// Episodes of all policies that passed.
    pub passed: usize,
    /// Sum over the policies of the episodes that differ from each other in any figure by more than
    /// can be measured: 0.01 mm, 0.001 N or one control period.
    pub distinct_outcomes: usize,
    /// What was beyond what tissue withstands.
    pub warnings: Warnings,
    /// How often a rule switched physics off: never, since none does. Results of earlier programs
    /// have other numbers here.
    pub suspensions: usize,
    /// The variation, and the drawn values.
    pub variation: VariationResult,
    /// Success by factor.
    pub by: Vec<Curve>,
    /// The policies in order.
    pub policies: Vec<PolicyRow>,
    /// The pairs of policies.
    pub comparisons: Vec<Comparison>,
    /// One hash over all final states. Equal hashes mean equal episodes.
    pub hash: String,
    /// Path of the report.
    pub report: String,
}

impl CampaignResult {
    /// The figures of the stored episodes `records`.
    pub(super) fn of(manifest: &Manifest, by: &[By], records: &[EpisodeRecord], folder: &Path) -> Self {
        let of = |name: &str| records.iter().filter(|k| k.name == name).collect::<Vec<_>>();
        // A policy without episodes has the stages of the others.
        let stages: Vec<&str> = records
            .first()
            .map_or_else(Vec::new, |k| k.summary.progress.stages.iter().map(|s| s.stage.as_str()).collect());
        let policies: Vec<PolicyRow> =
            manifest.policies.iter().map(|p| row(&p.name, &of(&p.name), &stages, manifest)).collect();
        let names: Vec<&str> = manifest.policies.iter().map(|p| p.name.as_str()).collect();
        let mut comparisons = Vec::new();
        for (k, a) in manifest.policies.iter().enumerate() {
            for b in &manifest.policies[k + 1..] {
                comparisons.extend(compare(&of(&a.name), &of(&b.name)));
            }
        }
        let mut hash = xxhash_rust::xxh3::Xxh3::new();
        for k in records {
            let end = k.summary.end.as_ref().map_or("", |e| e.name());
            hash.update(format!("{} {} {} {end}\n", k.name, k.index, k.state_hash).as_bytes());
        }
        Self {
            scene: manifest.scene.clone(),
            task: manifest.task.clone(),
            seed: manifest.seed,
            episodes: records.len(),
            planned: manifest.count(),
            passed: records.iter().filter(|k| k.summary.passed).count(),
            distinct_outcomes: policies.iter().map(|p| p.distinct_outcomes).sum(),
            warnings: policies.iter().map(|p| p.warnings).sum(),
            suspensions: 0,
            variation: VariationResult::of(manifest, records),
            by: by.iter().map(|by| Curve::of(by, &names, records)).collect(),
            policies,
            comparisons,
            hash: format!("{:016x}", hash.digest()),
            report: folder.join("report.html").display().to_string(),
        }
    }
}

fn row(name: &str, records: &[&EpisodeRecord], names: &[&str], manifest: &Manifest) -> PolicyRow {
    let all = records.len();
    let stages = names.iter().enumerate().map(|(n, stage)| {
        let times: Vec<f64> = records.iter().filter_map(|k| k.summary.progress.stages.get(n)?.time_s).collect();
        let passed = records.iter().filter(|k| k.summary.progress.stages.get(n).is_some_and(|s| s.passed)).count();
        StageCount {
            stage: (*stage).to_owned(),
            passed,
            interval: Interval::wilson(passed, all),
            median_s: median(times),
        }
    });
    let passed = records.iter().filter(|k| k.summary.passed).count();
    let attached: Vec<&&EpisodeRecord> = records.iter().filter(|k| k.summary.attached).collect();
    let ends = EndCounts::of(records.iter().map(|k| k.summary.end.as_ref()));
    let peak = |of: fn(&trocar_task::ArmSummary) -> f64| median(records.iter().map(|k| k.peak(of)).collect::<Vec<_>>());
    let policy_error = records.iter().find_map(|k| match &k.summary.end {
        Some(End::PolicyError { why }) => Some(why.clone()),
        _ => None,
    });
    let places: Vec<f64> = records.iter().filter_map(|k| k.summary.grasp_at).collect();
    PolicyRow {
        policy: name.to_owned(),
        episodes: all,
        distinct_outcomes: distinct_outcomes(records, manifest.control_period_s),
        passed,
        interval: Interval::wilson(passed, all),
        stages: stages.collect(),
        mean_score: records.iter().map(|k| k.summary.score).sum::<f64>() / all.max(1) as f64,
        ends,
        attached: attached.len(),
        held_to_end: attached.iter().filter(|k| k.summary.held_to_end).count(),
        lift_median_mm: median(attached.iter().filter_map(|k| k.summary.lift_mm).collect::<Vec<_>>()),
        rcm_median_mm: median(attached.iter().filter_map(|k| k.loaded_rcm_mm()).collect::<Vec<_>>()),
        rcm_max_mm: records.iter().map(|k| k.summary.rcm_peak_mm).max_by(f64::total_cmp),
        rcm_within: attached.iter().filter(|k| k.summary.rcm_peak_mm <= manifest.rcm_threshold_mm).count(),
        rcm_within_5_mm: attached.iter().filter(|k| k.summary.rcm_peak_mm <= 5.0).count(),
        grasp_at: median(places.clone()).map(|middle| {
            let (low, high) = places.iter().fold((1.0_f64, 0.0_f64), |(l, h), s| (l.min(*s), h.max(*s)));
            [middle, low, high]
        }),
        peak_contact_n: peak(|a| a.peak_contact_n),
        peak_constraint_n: peak(|a| a.peak_constraint_n),
        peak_jaw_n: peak(|a| a.peak_jaw_n),
        lag_ms: median(records.iter().filter_map(|k| k.lag_ms()).collect::<Vec<_>>()),
        inverted_peak: records.iter().map(|k| k.summary.inverted_peak).max().unwrap_or(0),
        warnings: records.iter().map(|k| k.summary.warnings).sum(),
        policy_error,
    }
}

pub(crate) fn compare(a: &[&EpisodeRecord], b: &[&EpisodeRecord]) -> Option<Comparison> {
    let pairs: Vec<(&EpisodeRecord, &EpisodeRecord)> =
        a.iter().filter_map(|x| b.iter().find(|y| y.seed == x.seed).map(|y| (*x, *y))).collect();
    let (first, second) = pairs.first()?;
    let only_a = pairs.iter().filter(|(x, y)| x.summary.passed && !y.summary.passed).count();
    let only_b = pairs.iter().filter(|(x, y)| !x.summary.passed && y.summary.passed).count();
    let difference = pairs.iter().map(|(x, y)| x.summary.score - y.summary.score).sum::<f64>() / pairs.len() as f64;
    Some(Comparison {
        a: first.name.clone(),
        b: second.name.clone(),
        seeds: pairs.len(),
        only_a,
        only_b,
        p: mcnemar(only_a, only_b),
        score_difference: difference,
    })
}

/// Two-sided p-value of McNemar's exact test: probability that `a + b` fair coins split at least as
/// unevenly as `a` to `b`.
fn mcnemar(a: usize, b: usize) -> f64 {
    let (n, few) = (a + b, a.min(b));
    // In logarithms, because 2^-n underflows for long campaigns.
    let mut log = -(n as f64) * std::f64::consts::LN_2;
    let mut tail = 0.0;
    for k in 0..=few {
        tail += log.exp();
        log += ((n - k) as f64).ln() - ((k + 1) as f64).ln();
    }
    (2.0 * tail).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fair_split_is_likely_and_an_uneven_one_is_not() {
        assert_eq!(mcnemar(0, 0), 1.0);
        assert_eq!(mcnemar(3, 3), 1.0);
        // Two tails of ten heads: 2/1024.
        assert!((mcnemar(10, 0) - 2.0 / 1024.0).abs() < 1e-12);
        assert!((mcnemar(1, 9) - 2.0 * 11.0 / 1024.0).abs() < 1e-12);
        assert!(mcnemar(2000, 1000) < 1e-9);
    }

    #[test]
    fn ends_have_the_names_of_episodes_ends() {
        let why = || String::new();
        let ends = [
            End::Passed,
            End::TimeOut,
            End::RcmAbort { arm: why(), deviation_mm: 6.0 },
            End::Diverged { why: why() },
            End::PolicyError { why: why() },
            End::Aborted { name: why() },
            End::Finished,
        ];
        let json = serde_json::to_value(EndCounts::of(ends.iter().map(Some))).unwrap();
        assert_eq!(json.as_object().unwrap().len(), ends.len());
        assert!(ends.iter().all(|end| json[end.name()] == 1), "{json}");
    }
}
