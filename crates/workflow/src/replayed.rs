//! Episodes done again from their files, a control period at a time: for pictures.

use crate::Result;
use trocar_sensors::CameraRig;
use trocar_specimen::Specimen;
use trocar_task::{Episode, EpisodeFile};

/// An episode that is done again. It goes on for as long as its actions can be done, and says where it became another one.
pub struct Replayed<'a> {
    episode: &'a mut Episode,
    file: &'a EpisodeFile,
    next: usize,
    differs: Option<String>,
}

impl<'a> Replayed<'a> {
    /// Puts `episode`, which was made of the file's scene, to the file's start.
    ///
    /// # Errors
    /// A start that cannot be.
    pub fn begin(episode: &'a mut Episode, file: &'a EpisodeFile) -> Result<Self> {
        episode.reset(file.header.seed)?;
        let same = format!("{:016x}", episode.state_hash()) == file.header.start_hash;
        let differs = (!same).then(|| "the start is another one".to_owned());
        Ok(Self { episode, file, next: 0, differs })
    }

    /// What sees the episode: its specimen is where the seed has it.
    ///
    /// # Errors
    /// A camera without a lens.
    pub fn sight(&self, specimen: &Specimen) -> Result<CameraRig> {
        Ok(CameraRig::new(&self.episode.arranged_scene(), specimen, self.episode.cell())?)
    }

    /// Does the next step; false when there is none, or when it cannot be done, which is where an episode of another program would end.
    pub fn advance(&mut self) -> bool {
        let Some((action, hash)) = self.file.steps.get(self.next) else { return false };
        let number = self.next + 1;
        if let Err(why) = self.episode.step(action) {
            self.differs.get_or_insert_with(|| format!("step {number} cannot be done: {why}"));
            return false;
        }
        if self.differs.is_none() && self.episode.state_hash() != *hash {
            let time = self.episode.time();
            self.differs = Some(format!("step {number} ({time:.3} s) gives another state"));
        }
        self.next = number;
        true
    }

    /// Steps of the file.
    pub fn steps(&self) -> usize {
        self.file.steps.len()
    }

    /// Steps done so far.
    pub fn done(&self) -> usize {
        self.next
    }

    /// Where it first was another episode than the recorded one, and how; `None` while all states are the recorded ones.
    pub fn differs(&self) -> Option<&str> {
        self.differs.as_deref()
    }

    /// The episode.
    pub fn episode(&self) -> &Episode {
        self.episode
    }
}
