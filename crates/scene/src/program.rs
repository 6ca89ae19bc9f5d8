//! A task ready to be judged: its expressions checked against the scene.

use crate::expression::{Checker, Condition, Hints, Measure, Mistake, Needs, Number, Tree, channel_names, parse};
use crate::{Definition, Gates, InstrumentKind, Part, Result, Scene, ScriptStep, Side, StageOrder};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Most entries of a list of a task; stages and aborts have fewer.
const MAX_ENTRIES: usize = 64;
/// Most bytes of a hint.
const MAX_HINT: usize = 1000;

/// The context of a task's expressions. With it and the gates alone, channels can be evaluated
/// again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TaskContext {
    /// Stages and aborts.
    pub definition: Definition,
    /// The task's organ.
    pub organ: String,
    /// The scene's arms with what they hold, left first.
    pub arms: Vec<(Side, InstrumentKind)>,
    /// The task's constants.
    #[serde(default)]
    pub constants: BTreeMap<String, f64>,
    /// Names of the scene's cameras.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<String>,
}

/// A mistake in a task: the field after `task.`, and what is wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskMistake {
    /// Such as `stage[1].when`.
    pub field: String,
    /// The rest of the message: ", column 8: ...".
    pub reason: String,
}

/// A task ready to be judged.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// The stages.
    pub stages: Vec<StageProgram>,
    /// What ends an episode as failed.
    pub aborts: Vec<AbortProgram>,
    /// The steps of the scripted baseline.
    pub script: Vec<ScriptProgram>,
    /// In which order stages pass.
    pub order: StageOrder,
    /// Gates, as `gates.lift_mm`, and constants, as `constants.aside_mm`, with their values.
    pub constants: Vec<(String, f64)>,
    /// Measures in addition to the channels.
    pub measures: Vec<Measure>,
    /// The task is about an organ.
    pub needs_organ: bool,
    /// It names a channel of a grasper.
    pub needs_grasper: bool,
    /// It names a channel of a cutter.
    pub needs_cutter: bool,
    /// It names distances from targets.
    pub needs_targets: bool,
}

/// A stage.
#[derive(Clone, Debug, PartialEq)]
pub struct StageProgram {
    /// Its name.
    pub name: String,
    /// Its part of the score.
    pub share: f64,
    /// When it passes.
    pub when: Condition,
    /// The same as it is written.
    pub text: String,
    /// How far it is before.
    pub progress: Number,
    /// Counters of `for` and of `then` in its condition.
    pub timers: usize,
    /// See [`timers`](Self::timers).
    pub marks: usize,
    /// It needs the grasper to hold the task's organ.
    pub needs_grasp: bool,
    /// What is said where it did not pass.
    pub hint: Vec<HintPart>,
}

/// What ends an episode as failed.
#[derive(Clone, Debug, PartialEq)]
pub struct AbortProgram {
    /// Its name.
    pub name: String,
    /// When.
    pub when: Condition,
    /// As of stages.
    pub timers: usize,
    /// As of stages.
    pub marks: usize,
}

/// A step of the scripted baseline.
#[derive(Clone, Debug, PartialEq)]
pub struct ScriptProgram {
    /// The arm that does it.
    pub arm: Side,
    /// What.
    pub action: ScriptAction,
    /// How long a move or a wait takes (s).
    pub seconds: Option<f64>,
    /// What ends it.
    pub until: Option<Condition>,
    /// As of stages.
    pub timers: usize,
    /// As of stages.
    pub marks: usize,
}

/// What a step of a script does.
#[derive(Clone, Debug, PartialEq)]
pub enum ScriptAction {
    /// Takes hold of a part of an organ.
    Grasp(Part),
    /// Moves the tip (mm, cell).
    Move([f64; 3]),
    /// Opens the jaws and draws back.
    Release,
    /// Stays.
    Wait,
}

/// A part of a hint.
#[derive(Clone, Debug, PartialEq)]
pub enum HintPart {
    /// As it is.
    Text(String),
    /// A number, with so many decimals or as many as it has.
    Value(Number, Option<usize>),
}

impl Gates {
    /// Names and values, in order.
    pub fn named(&self) -> [(&'static str, f64); 7] {
        let Self { grasp_from, grasp_to, lift_mm, lift_s, positioning_mm, cut_open, cut_closed } = *self;
        [
            ("grasp_from", grasp_from),
            ("grasp_to", grasp_to),
            ("lift_mm", lift_mm),
            ("lift_s", lift_s),
            ("positioning_mm", positioning_mm),
            ("cut_open", cut_open),
            ("cut_closed", cut_closed),
        ]
    }
}

impl Scene {
    /// The context of the expressions of the scene's task.
    ///
    /// # Errors
    /// A task without stages.
    pub fn task_context(&self) -> Result<TaskContext> {
        Ok(TaskContext {
            definition: self.task.definition()?,
            organ: self.task.organ.clone(),
            arms: self.tools().iter().map(|tool| (tool.arm.name, tool.instrument.kind)).collect(),
            constants: self.task.constants.clone(),
            cameras: self.cameras.iter().map(|camera| camera.name.clone()).collect(),
        })
    }

    /// The scene's task, ready to be judged.
    ///
    /// # Errors
    /// A task without stages; an expression that is wrong, as a checked scene has none.
    pub fn program(&self) -> Result<Program> {
        self.task_context()?.program(&self.task.gates).map_err(|TaskMistake { field, reason }| crate::Error::Invalid {
            file: format!("scene '{}'", self.name),
            reason: format!("task.{field}{reason}"),
        })
    }
}

impl Scene {
    /// Whether the scene's task is about an organ.
    pub fn needs_organ(&self) -> bool {
        self.program().is_ok_and(|program| program.needs_organ)
    }
}

impl TaskContext {
    /// The task, ready to be judged.
    ///
    /// # Errors
    /// The first mistake in its expressions.
    pub fn program(&self, gates: &Gates) -> std::result::Result<Program, TaskMistake> {
        self.program_with(gates, None)
    }

    /// The same; organs that expressions name must be among `organs`, where these are known.
    pub(crate) fn program_with(
        &self,
        gates: &Gates,
        organs: Option<&[&str]>,
    ) -> std::result::Result<Program, TaskMistake> {
        let Definition { stages, aborts, script, order, .. } = &self.definition;
        let constants: Vec<(String, f64)> = gates
            .named()
            .iter()
            .map(|(name, value)| (format!("gates.{name}"), *value))
            .chain(self.constants.iter().map(|(name, value)| (format!("constants.{name}"), *value)))
            .collect();
        for (list, length) in [("stage", stages.len()), ("abort", aborts.len()), ("script", script.len())] {
            if length > MAX_ENTRIES {
                let reason = format!(" has {length} entries; it must have at most {MAX_ENTRIES}");
                return Err(TaskMistake { field: list.to_owned(), reason });
            }
        }
        let names: Vec<String> = constants.iter().map(|(name, _)| name.clone()).collect();
        let mut checker = Checker {
            organ: &self.organ,
            organs,
            arms: &self.arms,
            cameras: &self.cameras,
            constants: &names,
            measures: Vec::new(),
            needs: Needs::default(),
            timers: Vec::new(),
            marks: 0,
            hints: Hints::No,
            in_progress: false,
        };
        let mut made = Vec::with_capacity(stages.len());
        for (k, stage) in stages.iter().enumerate() {
            (checker.timers, checker.marks) = (Vec::new(), 0);
            let at = |key: &str| format!("stage[{k}].{key}");
            let own = read(&at("when"), &stage.when, &mut |tree| checker.condition(tree))?;
            let timers = checker.timers.len();
            checker.in_progress = true;
            let progress = match &stage.progress {
                Some(text) => read(&at("progress"), text, &mut |tree| checker.plain(tree))?,
                None => checker.timers.first().map_or(Number::Literal(0.0), |t| Number::Lasted(Box::new(t.clone()))),
            };
            checker.in_progress = false;
            checker.hints = Hints::Yes;
            let default = format!("stage {} did not pass: {}", stage.name, stage.when).replace(['{', '}'], "");
            let hint = hint(&at("hint"), stage.hint.as_deref().unwrap_or(&default), &mut checker)?;
            checker.hints = Hints::No;
            made.push(StageProgram {
                name: stage.name.clone(),
                share: stage.share,
                needs_grasp: names_grasp(&own),
                when: own,
                text: stage.when.clone(),
                progress,
                timers,
                marks: checker.marks,
                hint,
            });
        }
        let mut ends = Vec::with_capacity(aborts.len());
        for (k, abort) in aborts.iter().enumerate() {
            (checker.timers, checker.marks) = (Vec::new(), 0);
            let when = read(&format!("abort[{k}].when"), &abort.when, &mut |tree| checker.condition(tree))?;
            let (timers, marks) = (checker.timers.len(), checker.marks);
            ends.push(AbortProgram { name: abort.name.clone(), when, timers, marks });
        }
        let mut steps = Vec::with_capacity(script.len());
        for (k, step) in script.iter().enumerate() {
            (checker.timers, checker.marks) = (Vec::new(), 0);
            steps.push(script_step(&format!("script[{k}]"), step, &mut checker)?);
        }
        let Needs { organ, grasper, cutter, targets } = checker.needs;
        Ok(Program {
            stages: made,
            aborts: ends,
            script: steps,
            order: *order,
            measures: checker.measures,
            constants,
            needs_organ: organ,
            needs_grasper: grasper,
            needs_cutter: cutter,
            needs_targets: targets,
        })
    }
}

impl Program {
    /// The organs that its measures and its script name.
    pub fn organs(&self) -> impl Iterator<Item = &str> {
        let measured = self.measures.iter().filter_map(Measure::organ);
        let grasped = self.script.iter().filter_map(|step| match &step.action {
            ScriptAction::Grasp(part) => Some(part.organ.as_str()),
            ScriptAction::Move(_) | ScriptAction::Release | ScriptAction::Wait => None,
        });
        measured.chain(grasped)
    }

    /// The gate or constant `name`, with or without its table.
    pub fn constant(&self, name: &str) -> Option<usize> {
        let is = |full: &str| full == name || full.split_once('.').is_some_and(|(_, own)| own == name);
        self.constants.iter().position(|(full, _)| is(full))
    }
}

/// The expression `text` of `field` as `meaning` takes it.
fn read<T>(
    field: &str,
    text: &str,
    meaning: &mut dyn FnMut(&Tree) -> std::result::Result<T, Mistake>,
) -> std::result::Result<T, TaskMistake> {
    parse(text).and_then(|tree| meaning(&tree)).map_err(|mistake| placed(field, text, 0, &mistake))
}

/// The mistake with its column in `text`, of which the expression begins at byte `from`.
fn placed(field: &str, text: &str, from: usize, mistake: &Mistake) -> TaskMistake {
    let at = (from + mistake.at).min(text.len());
    let column = 1 + text.char_indices().take_while(|(k, _)| *k < at).count();
    TaskMistake { field: field.to_owned(), reason: format!(", column {column}: {}", mistake.reason) }
}

/// A step of the script.
fn script_step(
    field: &str,
    step: &ScriptStep,
    checker: &mut Checker<'_>,
) -> std::result::Result<ScriptProgram, TaskMistake> {
    let wrong = |key: &str, reason: String| TaskMistake { field: format!("{field}{key}"), reason };
    if !checker.arms.iter().any(|(side, _)| *side == step.arm) {
        return Err(wrong(".arm", format!(" is '{}', an arm that the scene does not have", step.arm.name())));
    }
    let action = match (&step.grasp, step.move_mm, step.release) {
        (Some(text), None, false) => {
            let part = read(&format!("{field}.grasp"), text, &mut |tree| checker.part(tree))?;
            ScriptAction::Grasp(part)
        }
        (None, Some(by), false) => {
            if let Some(k) = by.iter().position(|x| !(-200.0..=200.0).contains(x)) {
                return Err(wrong(&format!(".move_mm[{k}]"), format!(" is {}; it must be in [-200, 200] mm", by[k])));
            }
            ScriptAction::Move(by)
        }
        (None, None, true) => ScriptAction::Release,
        (None, None, false) => ScriptAction::Wait,
        _ => return Err(wrong("", " has more than one of grasp, move_mm and release; one step does one".to_owned())),
    };
    if let Some(time) = step.time_s.filter(|t| !(0.03..=600.0).contains(t)) {
        return Err(wrong(".time_s", format!(" is {time}; it must be in [0.03, 600] s")));
    }
    let until = match &step.until {
        Some(text) => Some(read(&format!("{field}.until"), text, &mut |tree| checker.condition(tree))?),
        None => None,
    };
    let (timers, marks) = (checker.timers.len(), checker.marks);
    Ok(ScriptProgram { arm: step.arm, action, seconds: step.time_s, until, timers, marks })
}

/// Whether a condition needs the grasper to hold the task's organ.
fn names_grasp(condition: &Condition) -> bool {
    let grasped = channel_names().iter().position(|n| n == "grasped");
    match condition {
        Condition::Flag(Number::Channel(place)) => Some(*place) == grasped,
        Condition::All(all) => all.iter().any(names_grasp),
        Condition::Lasts { what, .. } => names_grasp(what),
        Condition::Sequence { last, .. } => names_grasp(last),
        _ => false,
    }
}

/// The parts of a hint.
fn hint(field: &str, text: &str, checker: &mut Checker<'_>) -> std::result::Result<Vec<HintPart>, TaskMistake> {
    let wrong = |at: usize, reason: &str| placed(field, text, 0, &Mistake::new(at, reason));
    if text.len() > MAX_HINT {
        return Err(wrong(0, &format!("has {} bytes; at most {MAX_HINT}", text.len())));
    }
    let mut parts = Vec::new();
    let mut from = 0;
    while let Some(open) = text[from..].find('{').map(|k| from + k) {
        let close = text[open..].find('}').map(|k| open + k);
        let close = close.ok_or_else(|| wrong(open, "the bracket is not closed"))?;
        parts.push(HintPart::Text(text[from..open].to_owned()));
        let inner = &text[open + 1..close];
        if inner == "organ" {
            parts.push(HintPart::Text(checker.organ.to_owned()));
        } else {
            let (number, decimals) = match inner.split_once(":.") {
                Some((number, digits)) => match digits.parse::<usize>() {
                    Ok(digits) if digits <= 6 => (number, Some(digits)),
                    _ => return Err(wrong(open, "the decimals are written as :.0 to :.6")),
                },
                None => (inner, None),
            };
            let made = parse(number).and_then(|tree| checker.any(&tree));
            let made = made.map_err(|mistake| placed(field, text, open + 1, &mistake))?;
            parts.push(HintPart::Value(made, decimals));
        }
        from = close + 1;
    }
    parts.push(HintPart::Text(text[from..].to_owned()));
    Ok(parts)
}
