//! One policy through one episode, kept as a file of actions, channels and figures.

use crate::replay::{EpisodeFile, Header};
use crate::storage::{ChannelsInfo, Column, write_channels};
use crate::{Channels, Episode, Error, Policy, Result, Step, Summary};
use serde::Serialize;
use std::path::Path;
use trocar_cell::{Action, CellEvent};

/// Names of the files in an episode's folder.
pub const EPISODE_FILE: &str = "episode.trocar";
/// See [`EPISODE_FILE`].
pub const CHANNELS_FILE: &str = "channels.parquet";
/// See [`EPISODE_FILE`]; it makes a folder an episode's.
pub const RESULT_FILE: &str = "result.json";

/// A finished episode.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Actions and hashes.
    pub file: EpisodeFile,
    /// The description of the channels.
    pub info: ChannelsInfo,
    /// The rows.
    pub channels: Vec<Channels>,
    /// Additional columns beside the rows, none at first.
    pub beside: Vec<Column>,
    /// The events, with times (s).
    pub events: Vec<(f64, CellEvent)>,
    /// The figures.
    pub summary: Summary,
}

/// The actions of an episode while it runs, each with the state's hash after it.
#[derive(Clone, Debug)]
pub struct Kept {
    header: Header,
    steps: Vec<(Action, u64)>,
}

impl Kept {
    /// Of `episode`, which stands at its start, by the policy of that name.
    ///
    /// # Errors
    /// A model file that cannot be read.
    pub fn begin(episode: &Episode, policy: &str) -> Result<Self> {
        Ok(Self { header: Header::of(episode, policy)?, steps: Vec::new() })
    }

    /// Adds an action that was done, with the hash of the state after it.
    pub fn add(&mut self, action: Action, hash: u64) {
        self.steps.push((action, hash));
    }

    /// The actions so far.
    pub fn steps(&self) -> &[(Action, u64)] {
        &self.steps
    }

    /// Renames the policy, because another one may take over during the episode.
    pub fn rename(&mut self, policy: &str) {
        policy.clone_into(&mut self.header.policy);
    }

    /// The recording, with `episode` after the last action.
    ///
    /// # Errors
    /// A task that cannot be written out.
    pub fn finish(mut self, episode: &Episode) -> Result<Recording> {
        self.header.end = episode.end().cloned();
        let scene = episode.scene();
        let info = ChannelsInfo {
            scene: scene.name.clone(),
            task: scene.task.name,
            gates: scene.task.gates,
            context: Some(scene.task_context()?),
            rcm_threshold_mm: scene.safety.rcm_threshold_mm,
            rcm_abort_mm: Some(scene.safety.rcm_abort_mm),
            arms: episode.cell().arms().iter().map(|(side, _)| side.name().to_owned()).collect(),
            policy: self.header.policy.clone(),
            seed: episode.seed(),
        };
        Ok(Recording {
            file: EpisodeFile { header: self.header, steps: self.steps },
            info,
            channels: episode.rows().to_vec(),
            beside: Vec::new(),
            events: episode.events().to_vec(),
            summary: episode.summary(),
        })
    }
}

/// The content of `result.json`.
#[derive(Clone, Debug, Serialize)]
pub struct EpisodeResult {
    /// Name of the scene.
    pub scene: String,
    /// Name of the task.
    pub task: String,
    /// Name of the policy.
    pub policy: String,
    /// The seed.
    pub seed: u64,
    /// Hash of the final state, hexadecimal.
    pub state_hash: String,
    /// The figures.
    #[serde(flatten)]
    pub summary: Summary,
    /// The events.
    pub events: Vec<TimedEvent>,
}

/// Something that happened, and when.
#[derive(Clone, Debug, Serialize)]
pub struct TimedEvent {
    /// Time at the end of its control period (s).
    pub time_s: f64,
    /// What.
    #[serde(flatten)]
    pub event: CellEvent,
}

/// Resets `episode` to `seed` and lets `policy` go through it. `watch` sees every step and returns
/// false to stop.
///
/// # Errors
/// A reset or a first look that fails, or [`trocar_cell::Error::Interrupted`] when `watch` stops
/// it. A policy that fails on the way ends the episode, which is a result.
pub fn run(
    episode: &mut Episode,
    policy: &mut dyn Policy,
    seed: u64,
    watch: &mut dyn FnMut(&Step) -> bool,
) -> Result<Recording> {
    run_watched(episode, policy, seed, &mut |_, step| step.is_none_or(&mut *watch))
}

/// The same with a `watch` that sees the episode, first at its start and then with every step.
///
/// # Errors
/// As [`run`].
pub fn run_watched(
    episode: &mut Episode,
    policy: &mut dyn Policy,
    seed: u64,
    watch: &mut dyn FnMut(&Episode, Option<&Step>) -> bool,
) -> Result<Recording> {
    episode.reset(seed)?;
    let mut kept = Kept::begin(episode, policy.name())?;
    policy.begin(episode, seed)?;
    if !watch(episode, None) {
        return Err(trocar_cell::Error::Interrupted.into());
    }
    while episode.end().is_none() {
        let chunk = match policy.act(episode) {
            Ok(chunk) if chunk.is_empty() && policy.finished() => {
                episode.finish();
                break;
            }
            Ok(chunk) if chunk.is_empty() => {
                episode.fail("it gave no action");
                break;
            }
            Ok(chunk) => chunk,
            Err(why) => {
                episode.fail(&why.to_string());
                break;
            }
        };
        for action in chunk {
            match episode.step(&action) {
                Ok(step) => {
                    kept.add(action, episode.state_hash());
                    if !watch(episode, Some(&step)) {
                        return Err(trocar_cell::Error::Interrupted.into());
                    }
                    if step.end.is_some() {
                        break;
                    }
                }
                Err(why @ Error::Cell(trocar_cell::Error::Action { .. })) => {
                    episode.fail(&why.to_string());
                    break;
                }
                Err(other) => return Err(other),
            }
        }
    }
    kept.finish(episode)
}

impl Recording {
    /// The result as it is written.
    pub fn result(&self) -> EpisodeResult {
        let events = self.events.iter().map(|(time_s, event)| TimedEvent { time_s: *time_s, event: event.clone() });
        let last = self.file.steps.last().map(|(_, hash)| format!("{hash:016x}"));
        EpisodeResult {
            scene: self.info.scene.clone(),
            task: self.info.task.name().to_owned(),
            policy: self.info.policy.clone(),
            seed: self.info.seed,
            state_hash: last.unwrap_or_else(|| self.file.header.start_hash.clone()),
            summary: self.summary.clone(),
            events: events.collect(),
        }
    }

    /// Writes the three files into a folder that is there; the result last.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_into(&self, folder: &Path) -> Result<()> {
        self.file.write(&folder.join(EPISODE_FILE))?;
        write_channels(&folder.join(CHANNELS_FILE), &self.info, &self.channels, &self.beside)?;
        let path = folder.join(RESULT_FILE);
        let invalid = |e: serde_json::Error| Error::Invalid { path: path.clone(), reason: format!("{e}") };
        let text = serde_json::to_vec_pretty(&self.result()).map_err(invalid)?;
        crate::storage::write_whole(&path, &text)
    }
}
