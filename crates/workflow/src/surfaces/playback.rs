//! A kept episode frame by frame, for pictures after the fact.

use super::SURFACES_FILE;
use super::format::{Decoder, SurfaceFrame, SurfacesHeader, read_bytes};
use super::recorder::SurfaceRecorder;
use crate::episode_replay::EpisodeReplay;
use crate::phantoms::scene_specimen;
use crate::{Error, Result, check_interrupted};
use std::path::{Path, PathBuf};
use trocar_core::Progress;
use trocar_render::{Picture, RenderSettings};
use trocar_scene::{Frame as SceneFrame, Imaging, Scene, View};
use trocar_sensors::{ArmPosture, CameraRig, DrawnCell};
use trocar_specimen::Specimen;
use trocar_task::{EPISODE_FILE, EpisodeFile, specimen_hash};

/// A recorded episode: its actions, and its appearance at the start and after every step.
pub struct RecordedEpisode {
    /// Its actions.
    pub file: EpisodeFile,
    /// The difference from the time of recording, in a sentence.
    pub note: Option<String>,
    path: PathBuf,
    scene: Scene,
    /// Of the scene as it is written.
    plain: Imaging,
    specimen: Specimen,
    frames: Decoder,
    now: SurfaceFrame,
    /// Made with the first picture.
    rig: Option<CameraRig>,
}

impl RecordedEpisode {
    /// Opens the episode in `folder`. One without surfaces is replayed, and every step compared
    /// with the recorded one. Its specimen is that of its scene, or the one in the folder
    /// `specimen`.
    ///
    /// # Errors
    /// Names the file: one that is missing or damaged, surfaces of another episode, an episode
    /// without surfaces whose replay differs.
    pub fn open(folder: &Path, specimen: Option<&Path>, phantoms: &Path, progress: &dyn Progress) -> Result<Self> {
        let file = EpisodeFile::read(&folder.join(EPISODE_FILE))?;
        let written = file.scene(specimen)?;
        let specimen = match specimen {
            Some(folder) => Specimen::read(folder)?,
            None => scene_specimen(&written, phantoms, progress)?,
        };
        let path = folder.join(SURFACES_FILE);
        let bytes = if path.is_file() {
            read_bytes(&path)?
        } else {
            replayed(&file, &written, &specimen, progress).map_err(|why| match why {
                Error::Interrupted => why,
                why => Error::Mismatch(format!(
                    "{}: has no {SURFACES_FILE} and cannot be replayed: {why}; record it again with --surfaces",
                    folder.display()
                )),
            })?
        };
        let wrong = |reason: String| Error::Mismatch(format!("{}: {reason}", path.display()));
        let mut frames = Decoder::new(bytes).map_err(wrong)?;
        let SurfacesHeader { seed, start_hash, frames: count, .. } = &frames.header;
        if (*seed, start_hash) != (file.header.seed, &file.header.start_hash) {
            return Err(wrong(format!("is of another episode than the {EPISODE_FILE} beside it")));
        }
        if *count != file.steps.len() + 1 {
            return Err(wrong(format!("has {count} frames for {} steps; one more is needed", file.steps.len())));
        }
        let now = frames.next().map_err(wrong)?.unwrap_or_default();
        let drawn = file.drawn()?;
        let mut scene = written.with_drawn(&drawn, &specimen);
        // With another specimen, objects that are placed beside it would move.
        for camera in &mut scene.cameras {
            if let Some(recorded) = frames.header.cameras.iter().find(|c| c.name == camera.name) {
                let SceneFrame { position_m, rotation_wxyz } = SceneFrame::of(&recorded.pose);
                camera.view = View::Pose { position_m, rotation_wxyz };
            }
        }
        let organs: Vec<&String> = specimen.organs.iter().map(|o| &o.name).collect();
        if !organs.iter().copied().eq(&frames.header.organs) {
            return Err(wrong(format!(
                "its organs are {}; those of the specimen are others",
                frames.header.organs.join(", ")
            )));
        }
        let found = format!("{:016x}", specimen_hash(&specimen));
        let note = (found != file.header.specimen_hash).then(|| {
            "the specimen is not the recorded one: the organs are drawn as they were, the field below them is not"
                .to_owned()
        });
        let plain = written.imaging;
        Ok(Self { file, note, path, scene, plain, specimen, frames, now, rig: None })
    }

    /// Makes pictures with the light, exposure, gloss and tint of the scene as it is written,
    /// instead of those that were drawn for the episode.
    #[must_use]
    pub fn in_plain_light(mut self) -> Self {
        (self.scene.imaging, self.rig) = (self.plain, None);
        self
    }

    /// The header of the recording.
    pub fn header(&self) -> &SurfacesHeader {
        &self.frames.header
    }

    /// The scene with what was drawn for the episode.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The cell as meshes and poses, the arms as they are now.
    ///
    /// # Errors
    /// Shapes that cannot be read.
    pub fn drawn_cell(&self) -> Result<DrawnCell> {
        Ok(DrawnCell::without_cell(&self.scene, &self.specimen, &self.arms())?)
    }

    /// Model and posture of each arm now.
    fn arms(&self) -> Vec<(String, ArmPosture)> {
        let models = self.frames.header.arms.iter().map(|a| a.model.clone());
        models.zip(self.now.arms.iter().cloned()).collect()
    }

    /// The present frame.
    pub fn now(&self) -> &SurfaceFrame {
        &self.now
    }

    /// Goes to the next frame. Returns false at the last.
    ///
    /// # Errors
    /// A damaged file.
    pub fn advance(&mut self) -> Result<bool> {
        let damaged = |reason: String| Error::Mismatch(format!("{}: {reason}", self.path.display()));
        let Some(next) = self.frames.next().map_err(damaged)? else { return Ok(false) };
        self.now = next;
        if let Some(rig) = &mut self.rig {
            rig.show(&self.now.organs, self.now.other_meshes, &self.now.arms)?;
        }
        Ok(true)
    }

    /// The present frame through `camera`, of `size` (width and height, px).
    ///
    /// # Errors
    /// A camera that the scene does not have, a size out of range.
    pub fn picture(&mut self, camera: &str, size: [usize; 2], settings: &RenderSettings) -> Result<&Picture> {
        Ok(self.rig()?.render_still(camera, size, settings)?)
    }

    /// The cameras, which show the present frame.
    ///
    /// # Errors
    /// Shapes or cameras that cannot be read.
    pub fn rig(&mut self) -> Result<&mut CameraRig> {
        let rig = match self.rig.take() {
            Some(rig) => rig,
            None => {
                let mut rig = CameraRig::without_cell(&self.scene, &self.specimen, &self.arms())?;
                rig.show(&self.now.organs, true, &self.now.arms)?;
                rig
            }
        };
        Ok(self.rig.insert(rig))
    }
}

/// The surfaces of an episode by its replay, every step of which gives the recorded state.
fn replayed(file: &EpisodeFile, scene: &Scene, specimen: &Specimen, progress: &dyn Progress) -> Result<Vec<u8>> {
    if let Some(other) = file.other(scene, specimen)? {
        return Err(Error::Mismatch(other));
    }
    let mut episode = file.begin(scene, specimen, 0)?;
    let mut replay = EpisodeReplay::begin(&mut episode, file)?;
    let mut recorder = SurfaceRecorder::begin(replay.episode())?;
    while replay.difference().is_none() && replay.advance() {
        check_interrupted(progress)?;
        recorder.record(replay.episode())?;
    }
    match replay.difference() {
        Some(difference) => Err(Error::Mismatch(difference.to_owned())),
        None => recorder.finish(),
    }
}
