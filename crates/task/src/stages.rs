//! The stages of a task as functions of the channels: nothing but rows, gates and constants decides
//! (`docs/guides/tasks.md`).
//!
//! Stages stay passed. They pass in their order, unless the task says any.

use crate::judge::{Context, Memory};
use crate::{Channels, Error, Result};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use trocar_scene::{Program, StageOrder};

/// A grasp has held with at least this follow ratio at the top of the lift (`docs/glossary.md`,
/// held) ...
pub const HELD_FOLLOW: f64 = 0.80;
/// ... and less slip than this (mm).
pub const HELD_SLIP_MM: f64 = 3.0;

/// One stage's part of [`Progress`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageProgress {
    /// Its name.
    pub stage: String,
    /// Passed, and so for good.
    pub passed: bool,
    /// When (s).
    pub time_s: Option<f64>,
    /// How far it is, 0 to 1: 1 once passed, 0 before its turn.
    pub share: f64,
    /// Its part of the score, relative to the others'.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub weight: f64,
}

fn one() -> f64 {
    1.0
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

/// How far a task is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Stages passed; where they pass in their order, also the place of the one that is next.
    pub stage: usize,
    /// All stages, in order.
    pub stages: Vec<StageProgress>,
}

impl Progress {
    /// All stages are passed.
    pub fn passed(&self) -> bool {
        self.stage == self.stages.len()
    }

    /// Weighted mean share of all stages, 0 to 1.
    pub fn score(&self) -> f64 {
        let weights = self.stages.iter().map(|s| s.weight).sum::<f64>();
        let sum = self.stages.iter().map(|s| s.weight * s.share).sum::<f64>();
        if weights > 0.0 { sum / weights } else { 0.0 }
    }

    /// The place of the first stage that has not passed.
    pub fn next(&self) -> Option<usize> {
        self.stages.iter().position(|s| !s.passed)
    }

    /// Name of the next stage; `done` after the last.
    pub fn name(&self) -> &str {
        self.next().map_or("done", |k| &self.stages[k].stage)
    }
}

/// The machine that goes through a task's stages, row by row. Plain data.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracker {
    program: Arc<Program>,
    progress: Progress,
    /// The memory of each stage's condition, and then of each abort's.
    memories: Vec<Memory>,
}

impl Tracker {
    /// At the beginning of a task.
    pub fn new(program: Arc<Program>) -> Self {
        let stages = program.stages.iter().map(|stage| StageProgress {
            stage: stage.name.clone(),
            passed: false,
            time_s: None,
            share: 0.0,
            weight: stage.share,
        });
        let progress = Progress { stage: 0, stages: stages.collect() };
        let stages = program.stages.iter().map(|s| Memory::new(s.timers, s.marks));
        let aborts = program.aborts.iter().map(|a| Memory::new(a.timers, a.marks));
        let memories = stages.chain(aborts).collect();
        Self { program, progress, memories }
    }

    /// The progress after all of `rows`.
    pub fn of(program: Arc<Program>, rows: &[Channels]) -> Progress {
        let mut tracker = Self::new(program);
        rows.iter().for_each(|c| tracker.update(c));
        tracker.progress
    }

    /// How far the task is.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// The task.
    pub fn program(&self) -> &Arc<Program> {
        &self.program
    }

    /// Takes the next row.
    pub fn update(&mut self, row: &Channels) {
        for k in 0..self.program.stages.len() {
            if !self.progress.stages[k].passed && !self.judge(k, row) && self.program.order == StageOrder::Listed {
                return;
            }
        }
    }

    /// Whether the stage at `place`, which has not passed, passes in this row.
    fn judge(&mut self, place: usize, row: &Channels) -> bool {
        let (stage, memory) = (&self.program.stages[place], &mut self.memories[place]);
        let context = Context { row, rows: &[], constants: &self.program.constants };
        let passed = context.holds(&stage.when, memory);
        // Only what has passed is 1.
        let share = if passed { 1.0 } else { part(context.value(&stage.progress, memory)) };
        let now = &mut self.progress.stages[place];
        (now.passed, now.share) = (passed, share);
        if passed {
            now.time_s = Some(row.time_s);
            self.progress.stage += 1;
            *memory = Memory::new(stage.timers, stage.marks);
        }
        passed
    }

    /// Name of the first abort that holds in this row; to be asked once a row.
    pub fn aborted(&mut self, row: &Channels) -> Option<String> {
        let context = Context { row, rows: &[], constants: &self.program.constants };
        let memories = &mut self.memories[self.program.stages.len()..];
        let all: Vec<bool> = self
            .program
            .aborts
            .iter()
            .zip(memories)
            .map(|(abort, memory)| context.holds(&abort.when, memory))
            .collect();
        all.iter().position(|holds| *holds).map(|k| self.program.aborts[k].name.clone())
    }

    /// The numbers of the state, for its hash: stages passed, what the conditions at hand remember
    /// (at least one timer and one mark), and the stages.
    pub fn numbers(&self) -> Vec<f64> {
        let Self { program, progress: Progress { stage, stages }, memories } = self;
        let mut all = vec![*stage as f64];
        let listed = program.order == StageOrder::Listed;
        let open = |k: usize| k >= stages.len() || if listed { k == *stage } else { !stages[k].passed };
        let open: Vec<&Memory> = memories.iter().enumerate().filter(|(k, _)| open(*k)).map(|(_, m)| m).collect();
        let since: Vec<f64> = open.iter().flat_map(|m| &m.since).map(|t| t.unwrap_or(-1.0)).collect();
        let armed: Vec<f64> = open.iter().flat_map(|m| &m.armed).map(|a| f64::from(u8::from(*a))).collect();
        all.extend(if since.is_empty() { vec![-1.0] } else { since });
        all.extend(if armed.is_empty() { vec![0.0] } else { armed });
        for StageProgress { stage: _, passed: _, time_s, share, weight: _ } in stages {
            all.extend([time_s.unwrap_or(-1.0), *share]);
        }
        all
    }
}

/// The part of a progress that counts before its stage has passed.
fn part(progress: f64) -> f64 {
    if progress.is_nan() { 0.0 } else { progress.clamp(0.0, 0.99) }
}

/// Sets the gate or constant `name` of `program`.
///
/// # Errors
/// A name that is none, or a value that is not finite.
pub fn set_gate(program: &mut Program, name: &str, value: f64) -> Result<()> {
    if !value.is_finite() {
        return Err(Error::Option(format!("gate {name} = {value}; it must be finite")));
    }
    let Some(place) = program.constant(name) else {
        let known: Vec<&str> =
            program.constants.iter().map(|(n, _)| n.split_once('.').map_or("", |(_, own)| own)).collect();
        return Err(Error::Option(format!("no gate '{name:.60}'; there are {}", known.join(", "))));
    };
    program.constants[place].1 = value;
    Ok(())
}
