//! `trocar simulate`: a scripted grasp-lift as an episode, of a specimen alone or in a scene's
//! cell.

use crate::lift_result::{FinishedLift, LiftResult};
use crate::phantoms::scene_specimen;
use crate::reconstruct::{REPORT, refuse_overlap, refuse_scene_overlap};
use crate::recorder::Recorder;
use crate::specimen_scene::{free_scene, grasp_lift, task_organ};
use crate::{Error, Result, check_interrupted, pages};
use std::path::Path;
use std::time::Instant;
use trocar_core::Progress;
use trocar_scene::{GraspDesignName, InstrumentKind, Scene, ScheduleName};
use trocar_sensors::CameraRig;
use trocar_specimen::{Specimen, StagedFolder};
use trocar_task::policy::{AfterHold, Script, Scripted};
use trocar_task::{Channels, Episode, Policy, RESULT_FILE, run_watched};

/// Range of the closing force of jaws (N), as in scenes.
const JAW_FORCE_RANGE_N: std::ops::RangeInclusive<f64> = 0.01..=40.0;

/// The lift gate as a share of the jaws' lift.
const LIFT_GATE_SHARE: f64 = 0.8;

/// Settings of a scripted grasp-lift.
#[derive(Clone, Debug)]
pub struct Lift {
    /// The motion script.
    pub script: Script,
    /// The organ. By default that of the scene's task, the appendix, or the first organ.
    pub organ: Option<String>,
    /// Grasp design; by default the scene's.
    pub design: Option<GraspDesignName>,
    /// Closing force of the grasper's jaws (N); by default the scene's.
    pub jaw_force: Option<f64>,
    /// Solver settings of the tissue; by default the scene's.
    pub schedule: Option<ScheduleName>,
    /// Worker threads, 0 for all.
    pub threads: usize,
}

impl Default for Lift {
    fn default() -> Self {
        let script = Script { after: AfterHold::Lower, ..Script::default() };
        Self { script, organ: None, design: None, jaw_force: None, schedule: None, threads: 0 }
    }
}

/// A scripted policy that records the phase of each action.
struct Phased {
    inner: Scripted,
    phases: Vec<&'static str>,
}

impl Policy for Phased {
    fn name(&self) -> &str {
        self.inner.name()
    }

    fn begin(&mut self, episode: &Episode, seed: u64) -> trocar_task::Result<()> {
        self.phases.clear();
        self.inner.begin(episode, seed)
    }

    fn act(&mut self, episode: &Episode) -> trocar_task::Result<Vec<trocar_cell::Action>> {
        let chunk = self.inner.act(episode)?;
        // A chunk ends with its phase.
        self.phases.resize(self.phases.len() + chunk.len(), self.inner.phase());
        Ok(chunk)
    }

    fn finished(&self) -> bool {
        self.inner.finished()
    }
}

impl Lift {
    /// Runs the lift on the specimen in the folder `specimen`, with ideal arms and no cell, and
    /// writes the folder `output`.
    ///
    /// # Errors
    /// One line that names the file, organ or option; `output` then stays unchanged.
    pub fn run_specimen(&self, specimen: &Path, output: &Path, progress: &dyn Progress) -> Result<LiftResult> {
        refuse_overlap(specimen, output)?;
        let read = Specimen::read(specimen)?;
        Ok(self.write_specimen(&read, specimen, None, output, progress)?.result)
    }

    /// Runs the lift in the cell of a scene, which is a file or the name of a built-in scene, and
    /// writes the folder `output`. The scene's phantom is made in the folder `phantoms`.
    ///
    /// # Errors
    /// As [`run_specimen`](Self::run_specimen).
    pub fn run_scene(
        &self,
        scene: &str,
        phantoms: &Path,
        output: &Path,
        progress: &dyn Progress,
    ) -> Result<LiftResult> {
        let mut read = Scene::read(scene)?;
        refuse_scene_overlap(scene, output)?;
        self.script.check()?;
        let staged = StagedFolder::create(output, RESULT_FILE)?;
        let specimen = scene_specimen(&read, phantoms, progress)?;
        let own = specimen.organs.iter().any(|o| o.name == read.task.organ).then(|| read.task.organ.clone());
        let organ = task_organ(&specimen, self.organ.as_deref().or(own.as_deref()))?.to_owned();
        let task = grasp_lift(&organ);
        read.variation = trocar_scene::Variation::default();
        read.task = trocar_scene::Task { grasp: read.task.grasp, sever: read.task.sever, ..task };
        let lifted = self.lift(read, &specimen, output, progress)?;
        write(staged, &specimen, &lifted, None, progress)?;
        Ok(lifted.result)
    }

    /// Runs the lift on `specimen`, which was read from `folder`. The page begins with `before`.
    pub(crate) fn write_specimen(
        &self,
        specimen: &Specimen,
        folder: &Path,
        before: Option<&str>,
        output: &Path,
        progress: &dyn Progress,
    ) -> Result<FinishedLift> {
        self.script.check()?;
        let staged = StagedFolder::create(output, RESULT_FILE)?;
        let organ = task_organ(specimen, self.organ.as_deref())?;
        let sever = matches!(self.script.after, AfterHold::Cut(_));
        let scene = free_scene(specimen, folder, organ, sever)?;
        let lifted = self.lift(scene, specimen, output, progress)?;
        write(staged, specimen, &lifted, before, progress)?;
        Ok(lifted)
    }

    /// The scene with the settings of this lift.
    ///
    /// # Errors
    /// A cut in a scene without a cutter, an option out of range.
    pub fn arrange(&self, mut scene: Scene) -> Result<Scene> {
        if let Some(force) = self.jaw_force {
            if !JAW_FORCE_RANGE_N.contains(&force) {
                let (low, high) = (JAW_FORCE_RANGE_N.start(), JAW_FORCE_RANGE_N.end());
                return Err(Error::Mismatch(format!("--jaw-force is {force} N; it must be in [{low}, {high}]")));
            }
            let grasper = scene.grasping_arm().map(|arm| arm.instrument.clone());
            scene.instruments.iter_mut().filter(|i| Some(&i.name) == grasper.as_ref()).for_each(|i| {
                i.jaw_force_n = force;
            });
        }
        if let Some(design) = self.design {
            scene.task.grasp = design;
        }
        if let Some(schedule) = self.schedule {
            scene.tissue.schedule = schedule;
        }
        if self.script.regrasp.is_some() {
            scene.task.first_grasp = Some(GraspDesignName::LivePose);
        }
        scene.task.gates.lift_mm = (1e3 * LIFT_GATE_SHARE * self.script.lift).max(0.1);
        if matches!(self.script.after, AfterHold::Cut(_)) {
            scene.task.sever = true;
            if scene.arm_with(InstrumentKind::Cutter).is_none() {
                return Err(Error::Mismatch(format!(
                    "scene '{}' has no cutter; --sever needs an arm with one",
                    scene.name
                )));
            }
        }
        scene.validate()?;
        Ok(scene)
    }

    fn lift(&self, scene: Scene, specimen: &Specimen, output: &Path, progress: &dyn Progress) -> Result<FinishedLift> {
        let scene = self.arrange(scene)?;
        let mut episode = Episode::new(&scene, specimen, self.threads)?;
        let mut recorder = Recorder::new(CameraRig::new(&scene, specimen, episode.cell())?);
        let mut policy = Phased { inner: Scripted::following(self.script), phases: Vec::new() };
        let periods = scene.task.episode_s / episode.cell().period();
        progress.begin("simulate", periods.round() as u64);
        let clock = Instant::now();
        let mut stopped = false;
        let recording = run_watched(&mut episode, &mut policy, 0, &mut |episode, step| {
            recorder.record(episode, step);
            progress.advance(1);
            stopped = progress.interrupted();
            !stopped
        });
        if stopped {
            return Err(Error::Interrupted);
        }
        let recording = recording?;
        let wall_s = (clock.elapsed() - recorder.spent()).as_secs_f64();
        progress.end();
        let pictures = recorder.finish(episode.cell())?;
        let episode = recording.result();
        let simulated_s = recording.summary.duration_s;
        let result = LiftResult {
            at: recording.summary.grasp_at.unwrap_or(self.script.at),
            approach_offset_mm: 1e3 * self.script.approach_offset,
            episode,
            simulated_s,
            wall_s,
            real_time_factor: simulated_s / wall_s.max(1e-9),
            report: output.join(REPORT).display().to_string(),
        };
        Ok(FinishedLift { result, recording, phases: policy.phases, pictures })
    }
}

/// Writes figures, episode file, channels as Parquet and CSV, and page.
fn write(
    staged: StagedFolder,
    specimen: &Specimen,
    lifted: &FinishedLift,
    before: Option<&str>,
    progress: &dyn Progress,
) -> Result<()> {
    let folder = staged.path();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).map_err(|source| Error::Io { path, source })
    };
    lifted.recording.write_into(folder)?;
    write(RESULT_FILE, &serde_json::to_vec_pretty(&lifted.result).map_err(|e| Error::Format(e.to_string()))?)?;
    let format = |e: csv::Error| Error::Format(e.to_string());
    let mut table = csv::Writer::from_writer(Vec::new());
    let names = std::iter::once("phase".to_owned()).chain(Channels::names());
    table.write_record(names).map_err(format)?;
    for (row, phase) in lifted.recording.channels.iter().zip(&lifted.phases) {
        let numbers = row.to_row().into_iter().map(|x| x.to_string());
        table.write_record(std::iter::once((*phase).to_owned()).chain(numbers)).map_err(format)?;
    }
    write("channels.csv", &table.into_inner().map_err(|e| Error::Format(e.to_string()))?)?;
    write(REPORT, pages::lift(specimen, lifted, before)?.as_bytes())?;
    check_interrupted(progress)?;
    Ok(staged.commit()?)
}
