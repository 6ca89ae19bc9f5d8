//! A simulated episode as a film.

use crate::{Error, RecordedEpisode, Result};
use glam::DVec3;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use trocar_camera::{Camera, Mask};
use trocar_core::{Pose, Silent};
use trocar_measure::Film;
use trocar_recording::RgbdFrame;
use trocar_render::{Picture, RenderSettings};
use trocar_sensors::is_tool;

/// What is done with a picture and the names of its labels.
type Show<'a> = dyn FnMut(&[(u16, String)], &Picture) -> Result<()> + 'a;

/// An episode through one of its scene's cameras, a frame per control period.
pub(crate) struct EpisodeFilm {
    folder: PathBuf,
    specimen: Option<PathBuf>,
    phantoms: PathBuf,
    camera: String,
    size: [usize; 2],
    model: Camera,
    pose: Pose,
    /// Number of frames.
    pub frames: usize,
    /// Frames in a second.
    pub rate_hz: f64,
    /// The organ of the episode's task.
    pub organ: String,
}

impl EpisodeFilm {
    /// Of the episode in `folder` through `camera`, by default the scene's first.
    pub fn open(folder: &Path, specimen: Option<&Path>, phantoms: &Path, camera: Option<&str>) -> Result<Self> {
        let mut episode = RecordedEpisode::open(folder, specimen, phantoms, &Silent)?;
        let organ = episode.scene().task.organ.clone();
        let frames = episode.file.steps.len() + 1;
        let rate_hz = 1.0 / episode.header().period_s;
        let rig = episode.rig()?;
        let first = rig.cameras().first().map(|name| (*name).to_owned());
        let camera = camera.map(str::to_owned).or(first).ok_or_else(|| {
            Error::Mismatch(format!("{}: its scene has no camera, through which it could be seen", folder.display()))
        })?;
        let size = rig.size(&camera)?;
        let (model, pose) = rig.model(&camera, size)?;
        Ok(Self {
            folder: folder.to_owned(),
            specimen: specimen.map(Path::to_owned),
            phantoms: phantoms.to_owned(),
            camera,
            size,
            model,
            pose,
            frames,
            rate_hz,
            organ,
        })
    }

    /// The pixels that show the organ of the task in a frame.
    pub fn organ_mask(&mut self, frame: usize) -> Result<Mask> {
        let mut mask = Mask::new(self.size[0], self.size[1]);
        let organ = self.organ.clone();
        self.show(frame..=frame, &mut |labels, picture| {
            let label = labels.iter().find(|(_, name)| *name == organ).map(|(label, _)| *label);
            mask.set.iter_mut().zip(&picture.labels).for_each(|(set, l)| *set = Some(*l) == label);
            Ok(())
        })?;
        Ok(mask)
    }

    /// Shows pictures with the names of their labels.
    fn show(&self, frames: RangeInclusive<usize>, show: &mut Show<'_>) -> Result<()> {
        let settings = RenderSettings::preview();
        let mut episode = RecordedEpisode::open(&self.folder, self.specimen.as_deref(), &self.phantoms, &Silent)?;
        for index in 0..=*frames.end() {
            if frames.contains(&index) {
                let labels = episode.rig()?.labels().to_vec();
                show(&labels, episode.picture(&self.camera, self.size, &settings)?)?;
            }
            if !episode.advance()? {
                break;
            }
        }
        Ok(())
    }
}

impl Film for EpisodeFilm {
    fn camera(&self) -> Camera {
        self.model
    }

    fn up(&self) -> DVec3 {
        self.pose.rotation.inverse() * DVec3::Z
    }

    fn play(
        &mut self,
        frames: RangeInclusive<usize>,
        show: &mut dyn FnMut(usize, RgbdFrame) -> trocar_measure::Result<()>,
    ) -> trocar_measure::Result<()> {
        let mut index = *frames.start();
        let mut stopped = None;
        let shown = self.show(frames, &mut |_, picture| {
            let set = picture.labels.iter().map(|label| is_tool(*label)).collect();
            let instruments = Mask { width: picture.color.width, height: picture.color.height, set };
            let frame = RgbdFrame { color: picture.color.clone(), depth: picture.depth.clone(), instruments };
            index += 1;
            show(index - 1, frame).map_err(|error| {
                stopped = Some(error);
                Error::Interrupted
            })
        });
        match (stopped, shown) {
            (Some(error), _) => Err(error),
            (None, Err(error)) => Err(trocar_measure::Error::Film(error.to_string())),
            (None, Ok(())) => Ok(()),
        }
    }
}
