//! An episode in figures, computed from its channels and, where these do not say it, from its
//! events.

use crate::channels::{ArmChannels, TaskChannels};
use crate::facts::{Details, Facts};
use crate::stages::{HELD_FOLLOW, HELD_SLIP_MM};
use crate::warnings::Warnings;
use crate::why::why;
use crate::{Channels, End, Progress};
use serde::{Deserialize, Serialize};
use trocar_scene::Drawn;

/// An arm is loaded while its jaws hold tissue, or tissue does this much to its instrument (N).
pub const LOADED_N: f64 = 0.05;

/// Jaws are at the top of their lift within this share of it.
const TOP_SHARE: f64 = 0.05;

/// The greatest lag that is looked for (s), and the step of the search.
const MAX_LAG: f64 = 0.3;
const LAG_STEP: f64 = 1e-3;

/// One arm in figures.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ArmSummary {
    /// left or right.
    pub arm: String,
    /// Time under load (s). The next three are over this time; they are `None` without any.
    pub loaded_s: f64,
    /// RCM deviation under load, median over periods (mm).
    pub rcm_median_mm: Option<f64>,
    /// Its 95th percentile (mm).
    pub rcm_p95_mm: Option<f64>,
    /// The largest in any physics step under load (mm).
    pub rcm_max_mm: Option<f64>,
    /// The largest of the whole episode (mm).
    pub rcm_peak_mm: f64,
    /// Root mean square distance between commanded and measured tip at the same time, without load
    /// (mm). This and the next two are `None` if the arm was never without load.
    pub tracking_rms_mm: Option<f64>,
    /// The delay of the measured tip behind the commanded one that makes that distance least (ms).
    pub lag_ms: Option<f64>,
    /// The distance that is left then (mm).
    pub lagged_rms_mm: Option<f64>,
    /// Peak contact force (N).
    pub peak_contact_n: f64,
    /// Peak constraint force (N): the pull of what is held, no contact.
    pub peak_constraint_n: f64,
    /// Peak force with which tissue pushed the blades apart (N).
    pub peak_jaw_n: f64,
    /// Peak force of solids: the other instrument, the bed, tissue that cannot move (N).
    #[serde(default)]
    pub peak_solid_n: f64,
    /// Largest tilt (degrees).
    pub tilt_max_deg: f64,
    /// Periods at whose end its axis was inside an organ that its jaws did not hold.
    #[serde(default)]
    pub pierces: usize,
    /// Periods in which the force guard shortened its command.
    #[serde(default)]
    pub guarded: usize,
}

/// An episode in figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// All stages are passed.
    pub passed: bool,
    /// Stages passed.
    pub stage: usize,
    /// Name of the stage that was next; `done` after the last.
    pub next: String,
    /// Mean share of all stages, 0 to 1.
    pub score: f64,
    /// The stages with the times at which they passed.
    pub progress: Progress,
    /// How it ended; None while it runs.
    pub end: Option<End>,
    /// Simulated time (s).
    pub duration_s: f64,
    /// The grasper has held the organ at some time.
    pub attached: bool,
    /// Organ coordinate of the first grasp; None without any.
    pub grasp_at: Option<f64>,
    /// It held it at the end too.
    pub held_to_end: bool,
    /// Greatest rise of held tissue (mm). `None` without any grasp.
    pub lift_mm: Option<f64>,
    /// Slip at the top of the last grasp (mm): when its jaws were last within 5% of their greatest
    /// lift. `None` without any grasp, like the next.
    pub slip_mm: Option<f64>,
    /// Follow ratio (tissue lift over jaw lift) then.
    pub follow_ratio: Option<f64>,
    /// The jaws held the tissue then: it followed at least 0.80 of their lift and slipped less than
    /// 3 mm.
    #[serde(default)]
    pub held: bool,
    /// Times that tissue tore out of jaws.
    pub torn: usize,
    /// Times that a cutter closed through tissue.
    pub cuts: usize,
    /// Most inverted elements in any frame.
    pub inverted_peak: usize,
    /// Smallest element volume over its rest volume in any frame.
    pub min_volume_ratio: f64,
    /// Substeps in which held nodes could not follow the jaws.
    pub yielded_substeps: usize,
    /// The tissue diverged.
    pub diverged: bool,
    /// Largest node speed at any period's end (m/s).
    pub max_speed_m_s: f64,
    /// Largest RCM deviation of any arm (mm).
    pub rcm_peak_mm: f64,
    /// It never went beyond the scene's threshold (3 mm).
    pub rcm_within: bool,
    /// Counts of tissue beyond its limits.
    #[serde(flatten)]
    pub warnings: Warnings,
    /// The arms, left first.
    pub arms: Vec<ArmSummary>,
    /// Why not all stages passed, in one line.
    #[serde(default)]
    pub why: Option<String>,
    /// The jaw force that would carry the organ, if a grasp that presses has slipped.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub advice: Option<String>,
    /// The drawn values of the episode.
    #[serde(default)]
    pub drawn: Option<Drawn>,
    /// Figures that channels do not have.
    #[serde(default, flatten)]
    pub details: Details,
}

impl Summary {
    /// Of the rows of an episode that ended as `end` says; `threshold_mm` is the RCM deviation that
    /// it is scored against.
    pub fn of(rows: &[Channels], progress: &Progress, end: Option<&End>, arms: &[&str], threshold_mm: f64) -> Self {
        let tasks = || rows.iter().map(|c| &c.task);
        // An infinite value becomes a very large number: files have no infinity.
        let most = |f: fn(&Channels) -> f64| rows.iter().map(f).fold(0.0, f64::max).min(f64::MAX);
        let held = rows.iter().rfind(|c| c.task.grasped > 0.0).map(|c| c.task);
        let top = top_of_last_grasp(rows);
        let count = |f: fn(&TaskChannels) -> f64| tasks().map(f).sum::<f64>() as usize;
        let arms: Vec<ArmSummary> = arms.iter().map(|name| arm(name, rows)).collect();
        let rcm_peak_mm = arms.iter().map(|a| a.rcm_peak_mm).fold(0.0, f64::max);
        Self {
            // The last gate may fall in the very period in which an arm or the tissue is lost.
            passed: progress.passed() && matches!(end, None | Some(End::Passed)),
            stage: progress.stage,
            next: progress.name().to_owned(),
            score: progress.score(),
            progress: progress.clone(),
            end: end.cloned(),
            duration_s: rows.last().map_or(0.0, |c| c.time_s),
            attached: held.is_some(),
            grasp_at: tasks().find(|t| t.grasped > 0.0).map(|t| t.grasp_s),
            held_to_end: rows.last().is_some_and(|c| c.task.grasped > 0.0),
            lift_mm: held.is_some().then(|| most(|c| c.task.lift_mm)),
            slip_mm: top.map(|t| finite(t.slip_mm)),
            follow_ratio: top.map(|t| finite(t.follow)),
            held: top.is_some_and(|t| t.follow >= HELD_FOLLOW && t.slip_mm < HELD_SLIP_MM),
            torn: count(|t| t.torn),
            cuts: count(|t| t.cuts),
            inverted_peak: most(|c| c.task.inverted) as usize,
            min_volume_ratio: tasks().map(|t| t.min_volume).fold(1.0, f64::min).max(f64::MIN),
            yielded_substeps: count(|t| t.yielded),
            diverged: tasks().any(|t| t.diverged > 0.0) || matches!(end, Some(End::Diverged { .. })),
            max_speed_m_s: most(|c| c.task.max_speed_m_s),
            rcm_peak_mm,
            rcm_within: rcm_peak_mm <= threshold_mm,
            warnings: tasks().map(Warnings::of).sum(),
            arms,
            why: None,
            advice: None,
            drawn: None,
            details: Details::default(),
        }
    }

    /// Adds the figures that the channels do not have.
    pub(crate) fn add_facts(&mut self, facts: &Facts<'_>) {
        self.details = facts.details();
        self.why = why(facts.rows, facts, &self.progress, self.end.as_ref());
        let slipped = self.attached && !self.held && !self.diverged && self.torn == 0;
        self.advice = if slipped { facts.advice() } else { None };
    }

    /// When the stage of that name passed (s).
    pub fn passed_at(&self, stage: &str) -> Option<f64> {
        self.progress.stages.iter().find(|s| s.stage == stage).and_then(|s| s.time_s)
    }
}

/// The task's channels at the top of the last grasp: the last row in which the jaws were within 5%
/// of the greatest lift that they had with it.
fn top_of_last_grasp(rows: &[Channels]) -> Option<TaskChannels> {
    let end = rows.iter().rposition(|c| c.task.grasped > 0.0)?;
    let start = rows[..end].iter().rposition(|c| c.task.grasped == 0.0).map_or(0, |k| k + 1);
    let grasp = &rows[start..=end];
    let most = grasp.iter().map(|c| c.task.jaw_lift_mm).fold(f64::NEG_INFINITY, f64::max);
    let top = grasp.iter().rfind(|c| c.task.jaw_lift_mm >= most - TOP_SHARE * most.abs());
    top.map(|c| c.task)
}

/// `x`, or a very large number if it is not one.
fn finite(x: f64) -> f64 {
    if x.is_nan() { f64::MAX } else { x.clamp(f64::MIN, f64::MAX) }
}

fn arm(name: &str, rows: &[Channels]) -> ArmSummary {
    let pick = |c: &Channels| if name == "right" { c.right } else { c.left };
    let all: Vec<ArmChannels> = rows.iter().map(pick).collect();
    let is_loaded = |a: &ArmChannels| a.attached > 0.0 || a.contact_n() + a.constraint_n() > LOADED_N;
    let loaded: Vec<&ArmChannels> = all.iter().filter(|a| is_loaded(a)).collect();
    let mut rcm: Vec<f64> = loaded.iter().map(|a| a.rcm_mm).collect();
    rcm.sort_by(f64::total_cmp);
    let most = |f: fn(&ArmChannels) -> f64| all.iter().map(f).fold(0.0, f64::max).min(f64::MAX);
    let period = rows.first().map_or(0.0, |c| c.time_s);
    let free = |k: usize| !is_loaded(&all[k]);
    let tracked = off_by(&all, 0.0, period, &free);
    let lag = tracked.map(|_| lag(&all, period, &free));
    let under_load = |value: f64| (!loaded.is_empty()).then(|| finite(value));
    ArmSummary {
        arm: name.to_owned(),
        loaded_s: loaded.len() as f64 * period,
        rcm_median_mm: under_load(quantile(&rcm, 0.5)),
        rcm_p95_mm: under_load(quantile(&rcm, 0.95)),
        rcm_max_mm: under_load(loaded.iter().map(|a| a.rcm_peak_mm).fold(0.0, f64::max)),
        rcm_peak_mm: most(|a| a.rcm_peak_mm),
        tracking_rms_mm: tracked.map(|m| finite(1e3 * m)),
        lag_ms: lag.map(|(lag, _)| 1e3 * lag),
        lagged_rms_mm: lag.map(|(_, rest)| finite(1e3 * rest)),
        peak_contact_n: most(ArmChannels::contact_n),
        peak_constraint_n: most(ArmChannels::constraint_n),
        peak_jaw_n: most(|a| a.jaw_force_n),
        peak_solid_n: most(|a| a.solid_n),
        tilt_max_deg: most(|a| a.tilt_deg),
        pierces: all.iter().filter(|a| a.pierces > 0.0).count(),
        guarded: all.iter().filter(|a| a.guarded > 0.0).count(),
    }
}

/// A quantile of sorted values, between neighbours by their weights; 0 of nothing.
pub(crate) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let at = share * last as f64;
    let k = (at as usize).min(last);
    let next = (k + 1).min(last);
    sorted[k] + (at - k as f64) * (sorted[next] - sorted[k])
}

/// Root mean square distance (m) of the measured tips from those commanded `lag` (s) before, over
/// the rows `of`; `None` without any row.
fn off_by(all: &[ArmChannels], lag: f64, period: f64, of: &dyn Fn(usize) -> bool) -> Option<f64> {
    let tip = |a: &ArmChannels| glam::DVec3::new(a.tip_x_m, a.tip_y_m, a.tip_z_m);
    let commanded = |a: &ArmChannels| glam::DVec3::new(a.commanded_x_m, a.commanded_y_m, a.commanded_z_m);
    let back = if period > 0.0 { lag / period } else { 0.0 };
    // The same rows for every lag: lags must be comparable.
    let first = if period > 0.0 { (MAX_LAG / period).ceil() as usize } else { 0 };
    let (mut sum, mut count) = (0.0, 0_usize);
    for k in (first.max(1)..all.len()).filter(|k| of(*k)) {
        let at = (k as f64 - back).max(0.0);
        let (j, share) = (at as usize, at.fract());
        let then = commanded(&all[j]).lerp(commanded(&all[(j + 1).min(all.len() - 1)]), share);
        sum += tip(&all[k]).distance_squared(then);
        count += 1;
    }
    (count > 0).then(|| (sum / count as f64).sqrt())
}

/// The lag (s) with the least distance, and that distance (m).
fn lag(all: &[ArmChannels], period: f64, of: &dyn Fn(usize) -> bool) -> (f64, f64) {
    let steps = (MAX_LAG / LAG_STEP) as usize;
    let tried = (0..=steps).map(|k| k as f64 * LAG_STEP).filter_map(|lag| Some((lag, off_by(all, lag, period, of)?)));
    tried.fold((0.0, f64::INFINITY), |best, next| if next.1 < best.1 { next } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_is_found() {
        let rows: Vec<Channels> = (1..300)
            .map(|k| {
                let t = f64::from(k) / 30.0;
                let mut c = Channels { time_s: t, ..Channels::default() };
                c.left.commanded_x_m = 0.02 * (1.3 * t).sin();
                c.left.tip_x_m = 0.02 * (1.3 * (t - 0.08)).sin();
                c
            })
            .collect();
        let found = arm("left", &rows);
        assert!((found.lag_ms.unwrap() - 80.0).abs() <= 2.0, "{found:?}");
        assert!(found.lagged_rms_mm.unwrap() < 0.02 && found.tracking_rms_mm.unwrap() > 1.0);
        assert_eq!(found.loaded_s, 0.0);
    }

    #[test]
    fn what_was_not_measured_is_null() {
        let row = |k: u32| Channels { time_s: f64::from(k) / 30.0, ..Channels::default() };
        let rows: Vec<Channels> = (1..60).map(row).collect();
        let free = arm("left", &rows);
        assert_eq!((free.rcm_median_mm, free.rcm_p95_mm, free.rcm_max_mm), (None, None, None));
        assert_eq!(free.tracking_rms_mm, Some(0.0));
        let mut loaded = rows.clone();
        loaded.iter_mut().for_each(|c| c.left.attached = 1.0);
        let loaded = arm("left", &loaded);
        assert_eq!((loaded.rcm_median_mm, loaded.rcm_max_mm), (Some(0.0), Some(0.0)));
        assert_eq!((loaded.tracking_rms_mm, loaded.lag_ms, loaded.lagged_rms_mm), (None, None, None));
        let progress = Progress { stage: 0, stages: Vec::new() };
        let summary = Summary::of(&rows, &progress, None, &["left"], 3.0);
        assert_eq!((summary.lift_mm, summary.slip_mm, summary.follow_ratio), (None, None, None));
        let json = serde_json::to_value(&summary).unwrap();
        assert!(json["slip_mm"].is_null() && json["arms"][0]["rcm_median_mm"].is_null(), "{json}");
    }

    #[test]
    fn quantiles() {
        assert_eq!(quantile(&[], 0.5), 0.0);
        assert_eq!(quantile(&[1.0, 2.0, 3.0], 0.5), 2.0);
        assert_eq!(quantile(&[0.0, 10.0], 0.95), 9.5);
    }
}
