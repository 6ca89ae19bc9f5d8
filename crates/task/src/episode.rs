//! An episode: a scene's cell from a seeded start to an end, with observations, scores and events.

use crate::bodies::bodies_of;
use crate::facts::Facts;
use crate::measure::Subject;
use crate::measures::Measures;
use crate::stages::Tracker;
use crate::start::{starts, targets};
use crate::supply::{OneSpecimen, SpecimenSupply};
use crate::{Channels, End, Error, Observation, Progress, Result, Summary, specimen_hash};
use std::sync::Arc;
use trocar_cell::{Action, Cell, CellEvent, CellState, Settling};
use trocar_scene::{Drawn, EpisodeRandom, Imaging, Program, Scene, TaskName};
use trocar_specimen::Specimen;
use xxhash_rust::xxh3::Xxh3;

/// How long organs settle under gravity before any episode begins (s): all phantoms are at rest
/// within it.
pub const SETTLE_S: f64 = 1.0;

/// The result of a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// The row: privileged, for scores and `info`.
    pub channels: Channels,
    /// How far the task is.
    pub progress: Progress,
    /// How the episode ended, with its last step.
    pub end: Option<End>,
    /// What happened.
    pub events: Vec<CellEvent>,
}

/// An episode's whole state. Steps after a restore are the same to the bit.
#[derive(Clone, Debug)]
pub struct EpisodeState {
    task: TaskName,
    /// See [`key`].
    key: u64,
    cell: CellState,
    drawn: Drawn,
    now: Now,
}

/// The state of an episode besides the cell.
#[derive(Clone, Debug)]
struct Now {
    seed: u64,
    subject: Subject,
    tracker: Tracker,
    rows: Vec<Channels>,
    events: Vec<(f64, CellEvent)>,
    end: Option<End>,
}

/// The scene and specimen that a cell was built from, and its settled tissue.
#[derive(Clone)]
struct Built {
    /// See [`foundation`].
    scene: Scene,
    specimen: Arc<Specimen>,
    specimen_hash: u64,
    settled: CellState,
    settling: Settling,
}

/// An episode of a scene's task.
///
/// ```
/// use trocar_task::{Episode, policy, run};
/// # let (mut scene, specimen) = (trocar_testing::tube::resection(), trocar_testing::tube::meshed(trocar_testing::tube::ONE_END, 4e-3));
/// # scene.task.episode_s = 0.5;
///
/// let mut episode = Episode::new(&scene, &specimen, 1)?;
/// let mut scripted = policy::named("scripted")?;
/// let recording = run(&mut episode, scripted.as_mut(), 0, &mut |_| true)?;
/// println!("{} of {} stages", episode.progress().stage, episode.progress().stages.len());
/// assert_eq!(episode.end().map(|end| end.name()), Some("time-out"));
/// assert_eq!(recording.channels.len(), 15, "a row for every control period");
/// # Ok::<(), trocar_task::Error>(())
/// ```
pub struct Episode {
    scene: Scene,
    program: Arc<Program>,
    supply: Box<dyn SpecimenSupply>,
    /// See [`key`].
    key: u64,
    threads: usize,
    built: Built,
    cell: Cell,
    /// The drawn values of this episode, and the scene with them.
    drawn: Drawn,
    arranged: Scene,
    now: Now,
}

impl Episode {
    /// The episodes of `scene` around `specimen`, stepped by `threads` threads (0: as many as the
    /// machine has; results do not depend on them). Builds the models and lets the organs settle
    /// once; the episode stands at the start of seed 0.
    ///
    /// # Errors
    /// A scene without the task's organ or instruments, one that cannot be built, or one whose
    /// episodes have different specimens: see [`with_specimens`](Self::with_specimens).
    pub fn new(scene: &Scene, specimen: &Specimen, threads: usize) -> Result<Self> {
        let count = scene.specimens().len();
        if count > 1 {
            let name = &scene.name;
            let why = format!("scene '{name}': its episodes draw from {count} specimens, but one was given");
            return Err(Error::Option(why));
        }
        Self::with_specimens(scene, Box::new(OneSpecimen(Arc::new(specimen.clone()))), threads)
    }

    /// The same with the specimens of `supply`: each episode has the one that is drawn for it.
    ///
    /// # Errors
    /// As [`new`](Self::new); a specimen that `supply` does not have.
    pub fn with_specimens(scene: &Scene, supply: Box<dyn SpecimenSupply>, threads: usize) -> Result<Self> {
        Self::begun(scene, supply, threads, 0, scene.draw(0))
    }

    /// The same, at the start of the episode of `seed` with `drawn`.
    ///
    /// # Errors
    /// As [`with_specimens`](Self::with_specimens).
    pub fn begun(
        scene: &Scene,
        mut supply: Box<dyn SpecimenSupply>,
        threads: usize,
        seed: u64,
        drawn: Drawn,
    ) -> Result<Self> {
        let specimen = supply.get(&drawn.specimen)?;
        let drawn = scene.with_tissue_drawn(drawn, seed, &specimen)?;
        let arranged = scene.with_drawn(&drawn, &specimen);
        let key = key(scene, specimen_hash(&specimen))?;
        let (cell, built) = Built::new(foundation(scene, &arranged), specimen, threads)?;
        let program = Arc::new(scene.program()?);
        let task = &scene.task;
        let now = Now {
            seed,
            subject: Subject::new(&cell, &task.organ, &task.gates, Vec::new(), Measures::default()),
            tracker: Tracker::new(Arc::clone(&program)),
            rows: Vec::new(),
            events: Vec::new(),
            end: None,
        };
        let mut made = Self { scene: scene.clone(), program, supply, key, threads, built, cell, drawn, arranged, now };
        made.check()?;
        made.reset_with(seed, made.drawn.clone())?;
        Ok(made)
    }

    /// An episode of its own in the same state, with the specimens of `supply`. It goes on with the
    /// same bits, and costs little beside beginning another: organs are not built or settled again.
    ///
    /// # Errors
    /// Threads that the system refuses.
    pub fn try_clone(&self, supply: Box<dyn SpecimenSupply>) -> Result<Self> {
        Ok(Self {
            scene: self.scene.clone(),
            program: Arc::clone(&self.program),
            supply,
            key: self.key,
            threads: self.threads,
            built: self.built.clone(),
            cell: self.cell.try_clone()?,
            drawn: self.drawn.clone(),
            arranged: self.arranged.clone(),
            now: self.now.clone(),
        })
    }

    fn check(&self) -> Result<()> {
        let task = &self.scene.task;
        let (subject, program) = (&self.now.subject, &self.program);
        let missing = |what: &str| {
            Err(Error::Option(format!("scene '{}': task {} needs {what}", self.scene.name, task.name.name())))
        };
        if program.needs_organ && subject.bodies(&self.cell).is_empty() {
            let known: Vec<&str> = self.cell.world().model.bodies().iter().map(|b| b.name()).collect();
            return missing(&format!("organ '{}'; the specimen has {}", task.organ, known.join(", ")));
        }
        for organ in program.organs() {
            if bodies_of(&self.cell, organ).is_empty() {
                let known: Vec<&str> = self.cell.world().model.bodies().iter().map(|b| b.name()).collect();
                return missing(&format!("organ '{organ}'; the specimen has {}", known.join(", ")));
            }
        }
        if program.needs_grasper && subject.grasper.is_none() {
            return missing("a grasper");
        }
        if program.needs_cutter && subject.cutter.is_none() {
            return missing("a cutter");
        }
        Ok(())
    }

    /// Begins the episode of `seed`, with what the scene's variation draws for it. The same seed
    /// gives the same bits, whatever was before. It takes milliseconds where only starts and
    /// cameras are drawn. Other differences need a new cell that settles first, which takes
    /// seconds.
    ///
    /// # Errors
    /// A start that an arm does not reach; a cell that cannot be built so; a specimen that is not
    /// there.
    pub fn reset(&mut self, seed: u64) -> Result<Observation> {
        self.reset_with(seed, self.scene.draw(seed))
    }

    /// Begins the episode of `seed` with `drawn` instead of the values that the seed would draw.
    ///
    /// # Errors
    /// As [`reset`](Self::reset).
    pub fn reset_with(&mut self, seed: u64, drawn: Drawn) -> Result<Observation> {
        self.arrange(seed, drawn)?;
        let starts = starts(&self.arranged, &self.cell);
        self.cell.restart(&self.built.settled, &starts)?;
        let task = &self.scene.task;
        let targets = if self.program.needs_targets { targets(&self.cell, seed)? } else { Vec::new() };
        let recording = self.built.specimen.camera.as_ref();
        let measures = Measures::begin(&self.cell, &self.arranged, recording, &self.program.measures)?;
        self.now = Now {
            seed,
            subject: Subject::new(&self.cell, &task.organ, &task.gates, targets, measures),
            tracker: Tracker::new(Arc::clone(&self.program)),
            rows: Vec::new(),
            events: Vec::new(),
            end: None,
        };
        Ok(self.observe())
    }

    /// Makes the cell that of `drawn`. The episode stays as it was on an error.
    fn arrange(&mut self, seed: u64, drawn: Drawn) -> Result<()> {
        let specimen = if drawn.specimen == self.drawn.specimen {
            Arc::clone(&self.built.specimen)
        } else {
            self.supply.get(&drawn.specimen)?
        };
        let drawn = self.scene.with_tissue_drawn(drawn, seed, &specimen)?;
        let arranged = self.scene.with_drawn(&drawn, &specimen);
        let scene = foundation(&self.scene, &arranged);
        if scene != self.built.scene {
            (self.cell, self.built) = Built::new(scene, specimen, self.threads)?;
        }
        (self.drawn, self.arranged) = (drawn, arranged);
        Ok(())
    }

    /// Does one control period.
    ///
    /// # Errors
    /// An action that cannot be done: nothing has changed, and the caller may try another or
    /// [`fail`](Self::fail). An episode that has ended.
    pub fn step(&mut self, action: &Action) -> Result<Step> {
        self.step_watched(action, &mut |_| {})
    }

    /// The same with a `watch` that sees the cell after each tissue frame. The `watch` must not
    /// change the following steps.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn step_watched(&mut self, action: &Action, watch: &mut dyn FnMut(&mut Cell)) -> Result<Step> {
        if let Some(end) = &self.now.end {
            return Err(Error::Ended(end.to_string()));
        }
        let report = match self.cell.step_watched(action, watch) {
            Ok(report) => report,
            Err(refused @ trocar_cell::Error::Action { .. }) => return Err(refused.into()),
            // An arm's numbers are lost. The row is the last valid one with three changes: the time
            // advances, the episode diverged, and nothing happened.
            Err(lost) => {
                self.now.end = Some(End::Diverged { why: lost.to_string() });
                let mut channels = self.now.rows.last().copied().unwrap_or_default();
                channels.time_s += self.cell.period();
                let task = &mut channels.task;
                (task.diverged, task.cuts, task.torn, task.yielded) = (1.0, 0.0, 0.0, 0.0);
                (task.punctures, task.pierced) = (0.0, 0.0);
                (task.overstretched, task.folded) = (0.0, 0.0);
                task.activation_step_mm = 0.0;
                self.now.rows.push(channels);
                let (progress, end) = (self.progress().clone(), self.now.end.clone());
                return Ok(Step { channels, progress, end, events: Vec::new() });
            }
        };
        let channels = self.now.subject.channels(&self.cell, &report)?;
        let abort = report.arms.iter().find(|a| a.rcm_over_abort);
        // A period in which the instrument leaves the port, or loses the tissue, passes no stage.
        let mut aborted = None;
        if !channels.is_lost(Some(self.scene.safety.rcm_abort_mm)) {
            aborted = self.now.tracker.aborted(&channels);
            if aborted.is_none() {
                self.now.tracker.update(&channels);
            }
        }
        self.now.end = if let Some(why) = report.tissue.divergence {
            Some(End::Diverged { why: why.to_string() })
        } else if let Some(arm) = abort {
            Some(End::RcmAbort { arm: arm.side.name().to_owned(), deviation_mm: 1e3 * arm.rcm_peak })
        } else if let Some(name) = aborted {
            Some(End::Aborted { name })
        } else if self.now.tracker.progress().passed() && self.scene.task.stop_when_passed {
            Some(End::Passed)
        } else if report.time >= self.scene.task.episode_s - 0.5 * self.cell.period() {
            Some(if self.now.tracker.progress().passed() { End::Passed } else { End::TimeOut })
        } else {
            None
        };
        self.now.rows.push(channels);
        self.now.events.extend(report.events.iter().map(|e| (report.time, e.clone())));
        let (progress, end) = (self.progress().clone(), self.now.end.clone());
        Ok(Step { channels, progress, end, events: report.events })
    }

    /// Ends the episode because its policy has finished.
    pub fn finish(&mut self) {
        if self.now.end.is_none() {
            self.now.end = Some(if self.progress().passed() { End::Passed } else { End::Finished });
        }
    }

    /// Ends the episode because its policy failed.
    pub fn fail(&mut self, why: &str) {
        if self.now.end.is_none() {
            self.now.end = Some(End::PolicyError { why: why.to_owned() });
        }
    }

    /// Ends the episode as its policy had ended it with `end`, after the same actions; ends of the
    /// simulation come from the actions themselves.
    pub fn end_again(&mut self, end: &End) {
        match end {
            End::PolicyError { why } => self.fail(why),
            End::Passed | End::Finished => self.finish(),
            End::TimeOut | End::RcmAbort { .. } | End::Diverged { .. } | End::Aborted { .. } => {}
        }
    }

    /// The observation of the present state.
    pub fn observe(&self) -> Observation {
        Observation::of(&self.cell.observe(), self.cell.time(), self.progress())
    }

    /// The task as it is judged.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// How far the task is.
    pub fn progress(&self) -> &Progress {
        self.now.tracker.progress()
    }

    /// How the episode ended, if it has.
    pub fn end(&self) -> Option<&End> {
        self.now.end.as_ref()
    }

    /// The rows so far.
    pub fn rows(&self) -> &[Channels] {
        &self.now.rows
    }

    /// The events so far, with times (s).
    pub fn events(&self) -> &[(f64, CellEvent)] {
        &self.now.events
    }

    /// Simulated time since the start (s).
    pub fn time(&self) -> f64 {
        self.cell.time()
    }

    /// The seed.
    pub fn seed(&self) -> u64 {
        self.now.seed
    }

    /// The scene as it was given.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The scene with the drawn values of this episode, from which pictures are made.
    pub fn arranged_scene(&self) -> &Scene {
        &self.arranged
    }

    /// The drawn values of this episode.
    pub fn drawn(&self) -> &Drawn {
        &self.drawn
    }

    /// The specimen of this episode, as it was recorded.
    pub fn specimen(&self) -> &Specimen {
        &self.built.specimen
    }

    /// Hash of the specimen; see [`specimen_hash`].
    pub fn specimen_hash(&self) -> u64 {
        self.built.specimen_hash
    }

    /// The cell: privileged, for scripts and pictures.
    pub fn cell(&self) -> &Cell {
        &self.cell
    }

    /// Length of the most stretched edge of any organ now over that at rest: privileged. Takes a
    /// pass over all edges.
    pub fn max_stretch(&mut self) -> f64 {
        self.cell.max_stretch()
    }

    /// Places of the first grasper and of the first cutter among the arms.
    pub fn roles(&self) -> (Option<usize>, Option<usize>) {
        (self.now.subject.grasper, self.now.subject.cutter)
    }

    /// Bodies of the task's organ: one, or its pieces after a cut.
    pub fn bodies(&self) -> Vec<usize> {
        self.now.subject.bodies(&self.cell)
    }

    /// Targets of port-reach in the cell (m), three an arm; empty for other tasks.
    pub fn targets(&self) -> &[[glam::DVec3; 3]] {
        &self.now.subject.targets
    }

    /// Random numbers of this episode for `purpose`.
    pub fn random(&self, purpose: &str) -> EpisodeRandom {
        EpisodeRandom::new(self.now.seed, purpose)
    }

    /// The episode in figures so far.
    pub fn summary(&self) -> Summary {
        let arms: Vec<&str> = self.cell.arms().iter().map(|(side, _)| side.name()).collect();
        let safety = self.scene.safety.rcm_threshold_mm;
        let mut summary = Summary::of(&self.now.rows, self.progress(), self.end(), &arms, safety);
        summary.add_facts(&self.facts());
        summary.drawn = Some(self.drawn.clone());
        summary
    }

    fn facts(&self) -> Facts<'_> {
        let grasper = self.now.subject.grasper.and_then(|k| self.arranged.tools().get(k).map(|t| t.instrument));
        let bodies = self.bodies();
        Facts {
            task: &self.scene.task,
            program: &self.program,
            grasper: self.now.subject.grasper.map(|k| self.cell.arms()[k].0),
            jaw_force_n: grasper.map_or(0.0, |i| i.jaw_force_n),
            settling: self.built.settling,
            inverted_rest: self.specimen().organs.iter().map(|o| o.body.inverted()).sum(),
            pin_drift_mm: 1e3 * self.cell.pin_drift(),
            organ_weight_n: self.cell.weight(&bodies),
            events: &self.now.events,
            rows: &self.now.rows,
            heights: self.heights(),
        }
    }

    /// Name and height of the centroid (m) of every body.
    fn heights(&self) -> Vec<(String, f64)> {
        let world = self.cell.world();
        let bodies = world.model.bodies().iter().enumerate();
        let heights = bodies.map(|(k, body)| {
            let nodes: Vec<u32> = (0..body.len() as u32).collect();
            (body.name().to_owned(), world.state.centroid(&world.model, k, &nodes).dot(world.up))
        });
        heights.collect()
    }

    /// The state as it is now.
    pub fn save(&self) -> EpisodeState {
        EpisodeState {
            task: self.scene.task.name,
            key: self.key,
            cell: self.cell.save(),
            drawn: self.drawn.clone(),
            now: self.now.clone(),
        }
    }

    /// Puts back a state that this episode, or another of the same scene and specimen, gave.
    ///
    /// # Errors
    /// A state of another scene or specimen; the episode stays as it was.
    pub fn restore(&mut self, state: &EpisodeState) -> Result<()> {
        let own = self.scene.task.name;
        if state.task != own {
            let (saved, own) = (state.task.name(), own.name());
            return Err(Error::Option(format!("state: is of the task {saved}; this episode has {own}")));
        }
        if state.key != self.key {
            return Err(Error::Option("state: is of another scene or specimen than this episode".to_owned()));
        }
        self.arrange(state.now.seed, state.drawn.clone())?;
        self.cell.restore(&state.cell)?;
        self.now = state.now.clone();
        Ok(())
    }

    /// Hash over every bit that the future depends on, but for the seed's random numbers: cell and
    /// stages.
    pub fn state_hash(&self) -> u64 {
        // The recorded rows and events, and the reason for the end, do not affect later steps.
        let Now { seed: _, subject: _, tracker, rows: _, events: _, end: _ } = &self.now;
        let mut hash = Xxh3::new();
        hash.update(&self.cell.hash().to_le_bytes());
        for number in tracker.numbers() {
            hash.update(&number.to_bits().to_le_bytes());
        }
        hash.digest()
    }
}

/// The key by which a state belongs to an episode: the scene and, where it has only one, the
/// specimen. How long an episode may be does not matter.
fn key(scene: &Scene, specimen: u64) -> Result<u64> {
    let mut scene = scene.clone();
    scene.task.episode_s = 0.0;
    let specimen = if scene.specimens().len() > 1 { 0 } else { specimen };
    Ok(scene.hash(&[specimen])?)
}

/// The part of the `arranged` scene that the cell of an episode is built from. The starts are those
/// of `scene` as it is written, because the limits of an arm depend on the start that it is built
/// with; a reset puts the arms elsewhere. Cameras and light are no part of the cell.
fn foundation(scene: &Scene, arranged: &Scene) -> Scene {
    let mut part = arranged.clone();
    for (arm, own) in part.arms.iter_mut().zip(&scene.arms) {
        arm.start = own.start;
    }
    (part.cameras, part.imaging) = (Vec::new(), Imaging::default());
    part
}

impl Built {
    /// The cell of `scene` around `specimen`, settled.
    fn new(scene: Scene, specimen: Arc<Specimen>, threads: usize) -> Result<(Cell, Self)> {
        let mut cell = Cell::new(&scene, &specimen, threads)?;
        let settling = cell.settle(SETTLE_S)?;
        let settled = cell.save();
        let specimen_hash = specimen_hash(&specimen);
        Ok((cell, Self { scene, specimen, specimen_hash, settled, settling }))
    }
}
