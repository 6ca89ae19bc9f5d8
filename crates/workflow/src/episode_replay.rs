//! Replays of episodes, one control period at a time, for pictures.

use crate::Result;
use trocar_sensors::CameraRig;
use trocar_task::{Episode, EpisodeFile};

/// The replay of an episode. It continues after a difference from the recorded states, as long as
/// the actions can be executed.
pub struct EpisodeReplay<'a> {
    episode: &'a mut Episode,
    file: &'a EpisodeFile,
    next: usize,
    difference: Option<String>,
}

impl<'a> EpisodeReplay<'a> {
    /// Resets `episode`, which has the file's scene, to the start of the recorded episode with what
    /// was drawn for it.
    ///
    /// # Errors
    /// A reset that fails.
    pub fn begin(episode: &'a mut Episode, file: &'a EpisodeFile) -> Result<Self> {
        episode.reset_with(file.header.seed, file.drawn()?)?;
        let same = format!("{:016x}", episode.state_hash()) == file.header.start_hash;
        let difference = (!same).then(|| "the start is another one".to_owned());
        Ok(Self { episode, file, next: 0, difference })
    }

    /// The cameras of the episode, with what was drawn for it.
    ///
    /// # Errors
    /// A camera without a lens.
    pub fn camera_rig(&self) -> Result<CameraRig> {
        let episode = &self.episode;
        Ok(CameraRig::new(episode.arranged_scene(), episode.specimen(), episode.cell())?)
    }

    /// Executes the next step. Returns false at the end, or if the step cannot be executed.
    pub fn advance(&mut self) -> bool {
        let Some((action, hash)) = self.file.steps.get(self.next) else { return false };
        let number = self.next + 1;
        if let Err(why) = self.episode.step(action) {
            self.difference.get_or_insert_with(|| format!("step {number} cannot be executed: {why}"));
            return false;
        }
        if self.difference.is_none() && self.episode.state_hash() != *hash {
            let time = self.episode.time();
            self.difference = Some(format!("step {number} ({time:.3} s) gives another state"));
        }
        self.next = number;
        true
    }

    /// Number of steps of the file.
    pub fn steps(&self) -> usize {
        self.file.steps.len()
    }

    /// Number of executed steps.
    pub fn steps_done(&self) -> usize {
        self.next
    }

    /// The first difference from the recorded episode; `None` while all states are equal.
    pub fn difference(&self) -> Option<&str> {
        self.difference.as_deref()
    }

    /// The episode in its present state.
    pub fn episode(&self) -> &Episode {
        self.episode
    }
}
