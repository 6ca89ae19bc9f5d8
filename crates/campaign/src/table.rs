//! A campaign in figures: how many episodes of each policy passed which stage, with intervals; policies compared on the same seeds.

use crate::plan::Plan;
use crate::store::Kept;
use serde::{Deserialize, Serialize};
use std::path::Path;
use trocar_task::End;
use trocar_workflow::{Error, Result};

/// Half-width of a 95% interval in standard deviations.
const Z: f64 = 1.959_964;

/// A share with its 95% interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// The share.
    pub share: f64,
    /// The least ...
    pub low: f64,
    /// ... and the most that it may be.
    pub high: f64,
}

impl Interval {
    /// Of `count` among `all`, by E. B. Wilson, "Probable inference, the law of succession, and statistical inference", 1927.
    pub fn wilson(count: usize, all: usize) -> Self {
        if all == 0 {
            return Self { share: 0.0, low: 0.0, high: 1.0 };
        }
        let (n, p) = (all as f64, count as f64 / all as f64);
        let (z2, scale) = (Z * Z, 1.0 + Z * Z / n);
        let middle = (p + z2 / (2.0 * n)) / scale;
        let half = Z * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt() / scale;
        // Of none the low end is 0 and of all the high end is 1, which rounding misses.
        let low = if count == 0 { 0.0 } else { (middle - half).max(0.0) };
        let high = if count == all { 1.0 } else { (middle + half).min(1.0) };
        Self { share: p, low, high }
    }
}

/// How many episodes passed a stage.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StageCount {
    /// The stage.
    pub stage: &'static str,
    /// Episodes.
    pub passed: usize,
    /// Their share.
    pub interval: Interval,
    /// When it passed, median [s].
    pub median_s: Option<f64>,
}

/// A policy in figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PolicyRow {
    /// Its name.
    pub policy: String,
    /// Episodes that are kept.
    pub episodes: usize,
    /// Those that passed all stages.
    pub passed: usize,
    /// Their share.
    pub interval: Interval,
    /// Stage by stage.
    pub stages: Vec<StageCount>,
    /// Mean score, 0 to 1.
    pub mean_score: f64,
    /// Episodes that ended for each reason, in the order of passed, time-out, rcm-abort, diverged, policy-error.
    pub ends: [usize; 5],
    /// Episodes in which the organ was attached, and those that held it to the end.
    pub attached: usize,
    /// See there.
    pub held_to_end: usize,
    /// Median lift of the attached [mm].
    pub lift_median_mm: Option<f64>,
    /// Median over the attached of the grasping arm's median RCM deviation under load [mm].
    pub rcm_median_mm: Option<f64>,
    /// Largest RCM deviation of any episode [mm].
    pub rcm_max_mm: Option<f64>,
    /// Attached episodes whose RCM deviation stayed within the scene's threshold, and within 5 mm.
    pub rcm_within: usize,
    /// See there.
    pub rcm_within_5_mm: usize,
    /// Median of the organ coordinate of the first grasp, with the least and greatest.
    pub grasp_at: Option<[f64; 3]>,
    /// Median over episodes of the peak contact force [N], and of the peak constraint force [N].
    pub peak_contact_n: Option<f64>,
    /// See there.
    pub peak_constraint_n: Option<f64>,
    /// And of the peak force with which tissue pushed blades apart [N].
    pub peak_jaw_n: Option<f64>,
    /// Median over episodes of the delay of the measured tip behind the commanded one [ms].
    pub lag_ms: Option<f64>,
    /// Most inverted elements.
    pub inverted_peak: usize,
    /// Suspensions of physics in all episodes: times that contact of an instrument was disabled.
    pub disabled_contacts: usize,
    /// Times that contact of blades that hold tissue was disabled.
    pub disabled_blades: usize,
    /// Times that an organ was relaxed outside of time.
    pub relaxed: usize,
    /// Why the policy failed, in the first episode that ended so.
    pub policy_error: Option<String>,
}

/// Two policies on the same seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The one.
    pub a: String,
    /// The other.
    pub b: String,
    /// Seeds that both have.
    pub seeds: usize,
    /// Only the one passed.
    pub only_a: usize,
    /// Only the other passed.
    pub only_b: usize,
    /// How likely a split as uneven is by chance alone: McNemar's exact test, both sides.
    pub p: f64,
    /// Mean of the difference of scores, a less b.
    pub score_difference: f64,
}

/// A campaign in figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CampaignResult {
    /// The scene.
    pub scene: String,
    /// The task.
    pub task: String,
    /// Seed of the first episode.
    pub seed: u64,
    /// Episodes that are kept.
    pub episodes: usize,
    /// Episodes that are to be in all.
    pub planned: usize,
    /// Those of all policies that passed.
    pub passed: usize,
    /// Policy by policy.
    pub policies: Vec<PolicyRow>,
    /// Pair by pair.
    pub comparisons: Vec<Comparison>,
    /// One hash over all final states: two campaigns with the same did the same.
    pub hash: String,
    /// The report.
    pub report: String,
}

impl PolicyRow {
    /// Suspensions of physics as `contacts/blades/relaxed`.
    pub fn suspensions(&self) -> String {
        format!("{}/{}/{}", self.disabled_contacts, self.disabled_blades, self.relaxed)
    }
}

impl CampaignResult {
    /// Of the episodes `kept` so far.
    pub(super) fn of(plan: &Plan, kept: &[Kept], folder: &Path) -> Self {
        let of = |name: &str| kept.iter().filter(|k| k.name == name).collect::<Vec<_>>();
        // A policy of which nothing is kept yet has the stages of the others.
        let stages: Vec<&'static str> =
            kept.first().map_or_else(Vec::new, |k| k.summary.progress.stages.iter().map(|s| s.stage.name()).collect());
        let policies = plan.policies.iter().map(|p| row(&p.name, &of(&p.name), &stages, plan)).collect();
        let mut comparisons = Vec::new();
        for (k, a) in plan.policies.iter().enumerate() {
            for b in &plan.policies[k + 1..] {
                comparisons.extend(compare(&of(&a.name), &of(&b.name)));
            }
        }
        let mut hash = xxhash_rust::xxh3::Xxh3::new();
        for k in kept {
            let end = k.summary.end.as_ref().map_or("", |e| e.name());
            hash.update(format!("{} {} {} {end}\n", k.name, k.index, k.state_hash).as_bytes());
        }
        Self {
            scene: plan.scene.clone(),
            task: plan.task.clone(),
            seed: plan.seed,
            episodes: kept.len(),
            planned: plan.count(),
            passed: kept.iter().filter(|k| k.summary.passed).count(),
            policies,
            comparisons,
            hash: format!("{:016x}", hash.digest()),
            report: folder.join("report.html").display().to_string(),
        }
    }
}

fn row(name: &str, kept: &[&Kept], names: &[&'static str], plan: &Plan) -> PolicyRow {
    let all = kept.len();
    let stages = names.iter().enumerate().map(|(n, stage)| {
        let times: Vec<f64> = kept.iter().filter_map(|k| k.summary.progress.stages.get(n)?.time_s).collect();
        let passed = kept.iter().filter(|k| k.summary.progress.stages.get(n).is_some_and(|s| s.passed)).count();
        StageCount { stage, passed, interval: Interval::wilson(passed, all), median_s: median(times) }
    });
    let passed = kept.iter().filter(|k| k.summary.passed).count();
    let attached: Vec<&&Kept> = kept.iter().filter(|k| k.summary.attached).collect();
    let mut ends = [0; 5];
    for k in kept {
        match &k.summary.end {
            Some(End::Passed) => ends[0] += 1,
            Some(End::TimeOut | End::Finished) | None => ends[1] += 1,
            Some(End::RcmAbort { .. }) => ends[2] += 1,
            Some(End::Diverged { .. }) => ends[3] += 1,
            Some(End::PolicyError { .. }) => ends[4] += 1,
        }
    }
    let peak = |of: fn(&trocar_task::ArmSummary) -> f64| median(kept.iter().map(|k| k.peak(of)).collect());
    let policy_error = kept.iter().find_map(|k| match &k.summary.end {
        Some(End::PolicyError { why }) => Some(why.clone()),
        _ => None,
    });
    let places: Vec<f64> = kept.iter().filter_map(|k| k.summary.grasp_at).collect();
    PolicyRow {
        policy: name.to_owned(),
        episodes: all,
        passed,
        interval: Interval::wilson(passed, all),
        stages: stages.collect(),
        mean_score: kept.iter().map(|k| k.summary.score).sum::<f64>() / all.max(1) as f64,
        ends,
        attached: attached.len(),
        held_to_end: attached.iter().filter(|k| k.summary.held_to_end).count(),
        lift_median_mm: median(attached.iter().map(|k| k.summary.lift_mm).collect()),
        rcm_median_mm: median(attached.iter().filter_map(|k| k.loaded_rcm_mm()).collect()),
        rcm_max_mm: kept.iter().map(|k| k.summary.rcm_peak_mm).max_by(f64::total_cmp),
        rcm_within: attached.iter().filter(|k| k.summary.rcm_peak_mm <= plan.rcm_threshold_mm).count(),
        rcm_within_5_mm: attached.iter().filter(|k| k.summary.rcm_peak_mm <= 5.0).count(),
        grasp_at: median(places.clone()).map(|middle| {
            let (low, high) = places.iter().fold((1.0_f64, 0.0_f64), |(l, h), s| (l.min(*s), h.max(*s)));
            [middle, low, high]
        }),
        peak_contact_n: peak(|a| a.peak_contact_n),
        peak_constraint_n: peak(|a| a.peak_constraint_n),
        peak_jaw_n: peak(|a| a.peak_jaw_n),
        lag_ms: median(kept.iter().filter_map(|k| k.lag_ms()).collect()),
        inverted_peak: kept.iter().map(|k| k.summary.inverted_peak).max().unwrap_or(0),
        disabled_contacts: kept.iter().map(|k| k.summary.disabled_contacts).sum(),
        disabled_blades: kept.iter().map(|k| k.summary.disabled_blades).sum(),
        relaxed: kept.iter().map(|k| k.summary.relaxed).sum(),
        policy_error,
    }
}

fn compare(a: &[&Kept], b: &[&Kept]) -> Option<Comparison> {
    let pairs: Vec<(&Kept, &Kept)> =
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

/// Probability that fair coins fall at least as unevenly as `a` to `b`, on either side (McNemar's exact test).
fn mcnemar(a: usize, b: usize) -> f64 {
    let (n, few) = (a + b, a.min(b));
    // In logarithms: 2^-n is nothing for long campaigns.
    let mut log = -(n as f64) * std::f64::consts::LN_2;
    let mut tail = 0.0;
    for k in 0..=few {
        tail += log.exp();
        log += ((n - k) as f64).ln() - ((k + 1) as f64).ln();
    }
    (2.0 * tail).min(1.0)
}

/// The middle of some values; None of nothing.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    (n > 0).then(|| 0.5 * (values[(n - 1) / 2] + values[n / 2]))
}

/// One line an episode. After the hash come when each stage of the task passed [s], empty where it did not.
pub(super) fn csv(kept: &[Kept]) -> Result<String> {
    let format = |e: csv::Error| Error::Format(e.to_string());
    let stages = kept.first().map_or(&[][..], |k| &k.summary.progress.stages);
    let times: Vec<String> = stages.iter().map(|s| format!("{}_time_s", s.stage.name())).collect();
    let mut table = csv::Writer::from_writer(Vec::new());
    let head = [
        "policy",
        "episode",
        "seed",
        "passed",
        "stages",
        "score",
        "end",
        "why",
        "duration_s",
        "attached",
        "grasp_at",
        "held_to_end",
        "lift_mm",
        "slip_mm",
        "rcm_peak_mm",
        "rcm_loaded_median_mm",
        "lag_ms",
        "peak_contact_n",
        "peak_constraint_n",
        "peak_jaw_n",
        "inverted_peak",
        "disabled_contacts",
        "disabled_blades",
        "relaxed",
        "state_hash",
    ];
    table.write_record(head.into_iter().chain(times.iter().map(String::as_str))).map_err(format)?;
    let or_nothing = |x: Option<f64>| x.map_or(String::new(), |x| x.to_string());
    for k in kept {
        let s = &k.summary;
        let end = s.end.as_ref().map_or(String::new(), |e| e.name().to_owned());
        let why = if s.passed { None } else { s.why.clone().or_else(|| s.end.as_ref().map(ToString::to_string)) };
        let record = [
            k.name.clone(),
            k.index.to_string(),
            k.seed.to_string(),
            s.passed.to_string(),
            s.stage.to_string(),
            s.score.to_string(),
            end,
            why.unwrap_or_default(),
            s.duration_s.to_string(),
            s.attached.to_string(),
            or_nothing(s.grasp_at),
            s.held_to_end.to_string(),
            s.lift_mm.to_string(),
            s.slip_mm.to_string(),
            s.rcm_peak_mm.to_string(),
            or_nothing(k.loaded_rcm_mm()),
            or_nothing(k.lag_ms()),
            k.peak(|a| a.peak_contact_n).to_string(),
            k.peak(|a| a.peak_constraint_n).to_string(),
            k.peak(|a| a.peak_jaw_n).to_string(),
            s.inverted_peak.to_string(),
            s.disabled_contacts.to_string(),
            s.disabled_blades.to_string(),
            s.relaxed.to_string(),
            k.state_hash.clone(),
        ];
        let times = (0..times.len()).map(|n| or_nothing(s.progress.stages.get(n).and_then(|p| p.time_s)));
        table.write_record(record.into_iter().chain(times)).map_err(format)?;
    }
    let bytes = table.into_inner().map_err(|e| Error::Format(e.to_string()))?;
    String::from_utf8(bytes).map_err(|e| Error::Format(e.to_string()))
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
    fn medians() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0]), Some(2.5));
        assert_eq!(median(vec![]), None);
    }
}
