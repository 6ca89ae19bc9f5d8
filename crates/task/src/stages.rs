//! The stages of each task, as pure functions of the channels: nothing but rows and gates decides
//! (SPEC, stage gates).
//!
//! Stages pass in their order and stay passed. All of the resection's stages after the lift need
//! tissue in the grasper: without it there is no "tissue between grasp and base".

use crate::{Channels, Error, Result};
use serde::{Deserialize, Serialize};
use trocar_scene::{Gates, TaskName};

/// Largest distance of a blade tip from its target for port-reach (mm) ...
pub const REACH_MM: f64 = 2.0;
/// ... for this long (s).
pub const REACH_S: f64 = 0.2;
/// grasp-lift: the grasp holds for this long after the lift has passed (s) (SPEC, held) ...
pub const HELD_S: f64 = 1.0;
/// ... with at least this follow ratio ...
pub const HELD_FOLLOW: f64 = 0.80;
/// ... and less slip than this (mm).
pub const HELD_SLIP_MM: f64 = 3.0;

/// Progress towards what is approached is counted from this far (mm).
const FAR_MM: f64 = 60.0;

/// Rounding of times (s).
const TICK: f64 = 1e-6;

/// A stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// The grasper holds the organ within the gate's coordinates.
    Grasp,
    /// The held tissue has risen for long enough.
    Lift,
    /// The cutter's tip is near the tissue between grasp and base.
    Positioning,
    /// Tissue is in the cutter's mouth.
    JawOnTissue,
    /// The cutter, opened wide, has closed with tissue in its mouth all the while.
    Cut,
    /// The lifted tissue is held.
    Held,
    /// The blade tips are at their first targets.
    Reach1,
    /// At their second.
    Reach2,
    /// At their third.
    Reach3,
}

impl Stage {
    /// The stages of a task, in order.
    pub fn of(task: TaskName) -> &'static [Self] {
        match task {
            TaskName::AppendixResection => &[Self::Grasp, Self::Lift, Self::Positioning, Self::JawOnTissue, Self::Cut],
            TaskName::GraspLift => &[Self::Grasp, Self::Lift, Self::Held],
            TaskName::PortReach => &[Self::Reach1, Self::Reach2, Self::Reach3],
        }
    }

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Grasp => "grasp",
            Self::Lift => "lift",
            Self::Positioning => "positioning",
            Self::JawOnTissue => "jaw-on-tissue",
            Self::Cut => "cut",
            Self::Held => "held",
            Self::Reach1 => "reach-1",
            Self::Reach2 => "reach-2",
            Self::Reach3 => "reach-3",
        }
    }
}

/// One stage's part of [`Progress`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageProgress {
    /// Which.
    pub stage: Stage,
    /// Passed, and so for good.
    pub passed: bool,
    /// When (s).
    pub time_s: Option<f64>,
    /// How far it is, 0 to 1: 1 once passed, 0 before its turn.
    pub share: f64,
}

/// How far a task is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Stages passed; also the place of the one that is next.
    pub stage: usize,
    /// All stages, in order.
    pub stages: Vec<StageProgress>,
}

impl Progress {
    /// All stages are passed.
    pub fn passed(&self) -> bool {
        self.stage == self.stages.len()
    }

    /// Mean share of all stages, 0 to 1.
    pub fn score(&self) -> f64 {
        self.stages.iter().map(|s| s.share).sum::<f64>() / self.stages.len().max(1) as f64
    }

    /// Name of the next stage; `done` after the last.
    pub fn name(&self) -> &'static str {
        self.stages.get(self.stage).map_or("done", |s| s.stage.name())
    }
}

/// Grasp: attached with the organ coordinate in the gate's range, its ends included.
pub fn grasp(c: &Channels, gates: &Gates) -> bool {
    c.task.grasped > 0.0 && (gates.grasp_from..=gates.grasp_to).contains(&c.task.grasp_s)
}

/// Lift: held tissue is up by the gate's height or more. (For how long is the tracker's to count.)
pub fn lifted(c: &Channels, gates: &Gates) -> bool {
    c.task.grasped > 0.0 && c.task.lift_mm >= gates.lift_mm
}

/// Positioning: the cutter's tip is within the gate's distance, while tissue is held.
pub fn positioned(c: &Channels, gates: &Gates) -> bool {
    c.task.grasped > 0.0 && c.task.position_mm <= gates.positioning_mm
}

/// Jaw on tissue: tissue is in the cutter's mouth, while tissue is held.
pub fn on_tissue(c: &Channels) -> bool {
    c.task.grasped > 0.0 && c.task.cut_mouth > 0.0
}

/// Held: lifted, followed and not slipped.
pub fn held(c: &Channels, gates: &Gates) -> bool {
    lifted(c, gates) && c.task.follow >= HELD_FOLLOW && c.task.slip_mm < HELD_SLIP_MM
}

/// The machine that goes through a task's stages, row by row. Plain data.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracker {
    gates: Gates,
    progress: Progress,
    /// Since when the present stage's condition has held without a break (s).
    since: Option<f64>,
    /// The cutter has been open beyond the gate, and tissue in its mouth ever since.
    armed: bool,
}

impl Tracker {
    /// At the beginning of `task`.
    pub fn new(task: TaskName, gates: &Gates) -> Self {
        let stages = Stage::of(task).iter().map(|stage| StageProgress {
            stage: *stage,
            passed: false,
            time_s: None,
            share: 0.0,
        });
        let progress = Progress { stage: 0, stages: stages.collect() };
        Self { gates: *gates, progress, since: None, armed: false }
    }

    /// The progress after all of `rows`.
    pub fn of(task: TaskName, gates: &Gates, rows: &[Channels]) -> Progress {
        let mut tracker = Self::new(task, gates);
        rows.iter().for_each(|c| tracker.update(c));
        tracker.progress
    }

    /// How far the task is.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// Takes the next row.
    pub fn update(&mut self, c: &Channels) {
        while let Some(stage) = self.progress.stages.get(self.progress.stage).map(|s| s.stage) {
            let passed = self.test(stage, c);
            let share = if passed { 1.0 } else { self.share(stage, c) };
            let now = &mut self.progress.stages[self.progress.stage];
            (now.passed, now.share) = (passed, share);
            if !passed {
                return;
            }
            now.time_s = Some(c.time_s);
            self.progress.stage += 1;
            self.since = None;
        }
    }

    /// Whether `condition` has held up to `now` (s) for `long` (s).
    fn lasted(&mut self, condition: bool, now: f64, long: f64) -> bool {
        self.since = condition.then(|| self.since.unwrap_or(now));
        self.since.is_some_and(|since| now - since >= long - TICK)
    }

    fn test(&mut self, stage: Stage, c: &Channels) -> bool {
        let gates = self.gates;
        match stage {
            Stage::Grasp => grasp(c, &gates),
            Stage::Lift => self.lasted(lifted(c, &gates), c.time_s, gates.lift_s),
            Stage::Positioning => positioned(c, &gates),
            Stage::JawOnTissue => on_tissue(c),
            Stage::Cut => self.cut(c),
            Stage::Held => self.lasted(held(c, &gates), c.time_s, HELD_S),
            Stage::Reach1 => self.lasted(c.task.reach_1_mm <= REACH_MM, c.time_s, REACH_S),
            Stage::Reach2 => self.lasted(c.task.reach_2_mm <= REACH_MM, c.time_s, REACH_S),
            Stage::Reach3 => self.lasted(c.task.reach_3_mm <= REACH_MM, c.time_s, REACH_S),
        }
    }

    /// Blades that were open beyond the gate with tissue between them have closed, and it was
    /// between them in every row until they did. Blades that are nearly closed have a mouth too
    /// thin to hold anything, so the last row does not count.
    fn cut(&mut self, c: &Channels) -> bool {
        let (gates, t) = (&self.gates, &c.task);
        if t.grasped <= 0.0 {
            self.armed = false;
        } else if t.cut_jaw < gates.cut_closed {
            return std::mem::take(&mut self.armed);
        } else if t.cut_mouth <= 0.0 {
            self.armed = false;
        } else if t.cut_jaw > gates.cut_open {
            self.armed = true;
        }
        false
    }

    /// How far a stage is that has not passed, 0 to 1.
    fn share(&self, stage: Stage, c: &Channels) -> f64 {
        let (t, gates) = (&c.task, &self.gates);
        let near = |d: f64, within: f64| (1.0 - (d - within).max(0.0) / FAR_MM).clamp(0.0, 1.0);
        let lasts = |long: f64| self.since.map_or(0.0, |since| ((c.time_s - since) / long.max(TICK)).clamp(0.0, 1.0));
        let share = match stage {
            Stage::Grasp => 0.9 * near(t.grasp_distance_mm, 0.0),
            Stage::Lift => 0.7 * (t.lift_mm / gates.lift_mm.max(TICK)).clamp(0.0, 1.0) + 0.3 * lasts(gates.lift_s),
            Stage::Positioning => near(t.position_mm, gates.positioning_mm),
            Stage::JawOnTissue => near(t.position_mm, 0.0),
            Stage::Cut if self.armed => {
                0.5 + 0.5 * (1.0 - (t.cut_jaw - gates.cut_closed) / (1.0 - gates.cut_closed)).clamp(0.0, 1.0)
            }
            Stage::Cut => 0.5 * t.cut_mouth * (t.cut_jaw / gates.cut_open.max(TICK)).clamp(0.0, 1.0),
            Stage::Held => lasts(HELD_S),
            Stage::Reach1 => near(t.reach_1_mm, REACH_MM),
            Stage::Reach2 => near(t.reach_2_mm, REACH_MM),
            Stage::Reach3 => near(t.reach_3_mm, REACH_MM),
        };
        // Only what has passed is 1.
        share.min(0.99)
    }

    /// The numbers of the state, for its hash.
    pub fn numbers(&self) -> Vec<f64> {
        let Self { gates: _, progress: Progress { stage, stages }, since, armed } = self;
        let mut all = vec![*stage as f64, since.unwrap_or(-1.0), f64::from(u8::from(*armed))];
        for StageProgress { stage: _, passed: _, time_s, share } in stages {
            all.extend([time_s.unwrap_or(-1.0), *share]);
        }
        all
    }
}

/// The gates' fields by name, for sweeps.
pub const GATE_NAMES: [&str; 7] =
    ["grasp_from", "grasp_to", "lift_mm", "lift_s", "positioning_mm", "cut_open", "cut_closed"];

/// `gates` with the field `name` set.
///
/// # Errors
/// A name that is none, or a value that is not finite.
pub fn with_gate(mut gates: Gates, name: &str, value: f64) -> Result<Gates> {
    if !value.is_finite() {
        return Err(Error::Option(format!("gate {name} = {value}; it must be finite")));
    }
    let field = match name {
        "grasp_from" => &mut gates.grasp_from,
        "grasp_to" => &mut gates.grasp_to,
        "lift_mm" => &mut gates.lift_mm,
        "lift_s" => &mut gates.lift_s,
        "positioning_mm" => &mut gates.positioning_mm,
        "cut_open" => &mut gates.cut_open,
        "cut_closed" => &mut gates.cut_closed,
        _ => {
            return Err(Error::Option(format!("no gate '{name}'; there are {}", GATE_NAMES.join(", "))));
        }
    };
    *field = value;
    Ok(gates)
}
