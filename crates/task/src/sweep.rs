//! Gate sweeps: stored channels judged again over thresholds, without simulating.
//!
//! An episode ends when it has passed all its stages at the scene's gates, so stricter gates see no
//! more of it than there was: a count at a stricter gate is what is shown, not what might have
//! been.

use crate::stages::{Tracker, set_gate};
use crate::storage::ChannelsInfo;
use crate::{Channels, Error, Result};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use trocar_scene::TaskName;

/// Steps of a range that says none.
const STEPS: f64 = 8.0;
/// Most values of one gate, and most combinations.
const MAX_VALUES: usize = 1000;
const MAX_COMBINATIONS: usize = 10_000;

/// One gate and the values that it takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GateRange {
    /// Name of the gate's field.
    pub gate: String,
    /// Its values.
    pub values: Vec<f64>,
}

impl GateRange {
    /// From `lift_mm=4..12` (nine values), `lift_mm=4..12:0.5` (by steps) or `lift_mm=4,8,12`.
    ///
    /// # Errors
    /// Says what is wrong with the text.
    pub fn parse(text: &str) -> Result<Self> {
        let wrong = |why: &str| {
            Error::Option(format!("--gate {text:.80}: {why}; such as lift_mm=4..12, lift_mm=4..12:0.5 or lift_mm=4,8"))
        };
        let (gate, values) = text.split_once('=').ok_or_else(|| wrong("has no '='"))?;
        let number = |t: &str| {
            let value: f64 = t.trim().parse().map_err(|_| wrong("has something that is no number"))?;
            if value.is_finite() { Ok(value) } else { Err(wrong("has a number that is not finite")) }
        };
        let values: Vec<f64> = match values.split_once("..") {
            None => values.split(',').map(number).collect::<Result<_>>()?,
            Some((low, rest)) => {
                let (high, step) = match rest.split_once(':') {
                    Some((high, step)) => (number(high)?, Some(number(step)?)),
                    None => (number(rest)?, None),
                };
                let low = number(low)?;
                let step = step.unwrap_or((high - low) / STEPS);
                if !(high > low && step > 0.0) {
                    return Err(wrong("must rise by steps above 0"));
                }
                let count = ((high - low) / step + 1e-9).floor() + 1.0;
                if count > MAX_VALUES as f64 {
                    return Err(wrong("has more than 1000 values"));
                }
                (0..count as usize).map(|k| low + step * k as f64).collect()
            }
        };
        if values.is_empty() || values.len() > MAX_VALUES {
            return Err(wrong("has no value, or more than 1000"));
        }
        Ok(Self { gate: gate.trim().to_owned(), values })
    }
}

/// Episodes judged at one combination of gates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SweepRow {
    /// The swept gates' values, in the order of the ranges.
    pub values: Vec<f64>,
    /// Episodes that pass everything.
    pub passed: usize,
    /// Episodes that pass each stage, in order.
    pub by_stage: Vec<usize>,
    /// Stages passed by each episode, in the order given.
    pub stages: Vec<usize>,
}

/// A sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sweep {
    /// The task.
    pub task: TaskName,
    /// Its stages.
    pub stages: Vec<String>,
    /// Episodes.
    pub episodes: usize,
    /// The gates that were swept; all others are each episode's own.
    pub gates: Vec<String>,
    /// One row a combination; the last gate varies fastest.
    pub rows: Vec<SweepRow>,
}

/// Judges `episodes` at every combination of `ranges`.
///
/// `watch` is asked before each combination and returns false to stop.
///
/// # Errors
/// No episodes, episodes of different tasks, a gate named twice, too many combinations;
/// [`trocar_cell::Error::Interrupted`] when `watch` stops it.
pub fn sweep(
    episodes: &[(ChannelsInfo, Vec<Channels>)],
    ranges: &[GateRange],
    watch: &mut dyn FnMut() -> bool,
) -> Result<Sweep> {
    if let Some((_, twice)) = ranges.iter().enumerate().find(|(k, r)| ranges[..*k].iter().any(|o| o.gate == r.gate)) {
        return Err(Error::Option(format!("gate {} is given twice; give all its values at once", twice.gate)));
    }
    let Some(task) = episodes.first().map(|(info, _)| info.task) else {
        return Err(Error::Option("no channels to sweep; name at least one channels.parquet".to_owned()));
    };
    if let Some((info, _)) = episodes.iter().find(|(info, _)| info.task != task) {
        let (a, b) = (task.name(), info.task.name());
        return Err(Error::Option(format!("channels of different tasks, {a} and {b}; sweep one task at a time")));
    }
    let count =
        ranges.iter().try_fold(1_usize, |n, r| n.checked_mul(r.values.len()).filter(|n| *n <= MAX_COMBINATIONS));
    let count =
        count.ok_or_else(|| Error::Option(format!("more than {MAX_COMBINATIONS} combinations; sweep fewer values")))?;
    let programs = episodes.iter().map(|(info, _)| info.program()).collect::<Result<Vec<_>>>()?;
    let stages: Vec<String> = programs[0].stages.iter().map(|s| s.name.clone()).collect();
    for (program, (info, _)) in programs.iter().zip(episodes) {
        if !program.stages.iter().map(|s| &s.name).eq(&stages) {
            let (task, policy, seed) = (info.task.name(), &info.policy, info.seed);
            let what = format!("episode {seed} by {policy} has other stages of {task} than the first");
            return Err(Error::Option(format!("{what}; sweep one task at a time")));
        }
    }
    for range in ranges {
        set_gate(&mut programs[0].clone(), &range.gate, range.values.first().copied().unwrap_or(f64::NAN))?;
    }
    let mut rows = Vec::with_capacity(count);
    for k in 0..count {
        if !watch() {
            return Err(trocar_cell::Error::Interrupted.into());
        }
        let mut rest = k;
        let mut values = vec![0.0; ranges.len()];
        for (value, range) in values.iter_mut().zip(ranges).rev() {
            *value = range.values[rest % range.values.len()];
            rest /= range.values.len();
        }
        let mut passed = Vec::with_capacity(episodes.len());
        for ((info, channels), program) in episodes.iter().zip(&programs) {
            let mut program = program.clone();
            for (range, value) in ranges.iter().zip(&values) {
                set_gate(&mut program, &range.gate, *value)?;
            }
            let sound = channels.iter().position(|c| c.is_lost(info.rcm_abort_mm)).unwrap_or(channels.len());
            passed.push(Tracker::of(Arc::new(program), &channels[..sound]).stage);
        }
        let by_stage = (1..=stages.len()).map(|n| passed.iter().filter(|p| **p >= n).count()).collect();
        let all = passed.iter().filter(|p| **p == stages.len()).count();
        rows.push(SweepRow { values, passed: all, by_stage, stages: passed });
    }
    let gates = ranges.iter().map(|r| r.gate.clone()).collect();
    Ok(Sweep { task, stages, episodes: episodes.len(), gates, rows })
}
