//! `trocar render`: what a camera sees of a specimen, of a scene or of an episode, as a picture or as a moving picture of the scripted grasp-lift or of the episode.

pub(crate) mod colors;
mod play;
mod rendered;
mod script;

pub(crate) use colors::{averaged, label_color, shown};
pub use rendered::{Rendered, Seen};
pub use script::ScriptedLift;

use play::Play;
use rendered::seen;

use crate::moving::Moving;
use crate::phantoms::scene_specimen;
use crate::replayed::Replayed;
use crate::{Error, Result};
use glam::DVec3;
use std::path::{Path, PathBuf};
use trocar_camera::ColorImage;
use trocar_core::Progress;
use trocar_render::{Picture, RenderSettings};
use trocar_scene::Scene;
use trocar_sensors::{CameraRig, DepthNoise, OUTSIDE, SensorNoise};
use trocar_specimen::Specimen;
use trocar_task::{EPISODE_FILE, Episode, EpisodeFile};

/// Steps of depth in the files of depth [m].
const DEPTH_STEP: f64 = 1e-4;

/// Most frames a second of moving pictures, by what they are: a frame each control period or each second, third... of them. At 30 periods a second a WebP shows every second.
const WEBP_HZ: u32 = 15;
const MP4_HZ: u32 = 60;

/// Height of moving pictures of cameras that see more [px].
const MOVING_HEIGHT: usize = 360;

/// What is to be rendered, and how.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// Specimen folder, scene file or built-in scene; or an episode's folder or file.
    pub source: String,
    /// Name of the camera; the specimen's or the scene's first if left out.
    pub camera: Option<String>,
    /// Width and height [px]; the camera's own if left out.
    pub size: Option<[usize; 2]>,
    /// Paths a pixel; direct light alone if left out.
    pub samples: Option<u32>,
    /// Write depth, too.
    pub depth: bool,
    /// Write labels, too.
    pub labels: bool,
    /// Seconds into the scripted grasp-lift, whose start is shown if left out, or into the episode, whose end is.
    pub at: Option<f64>,
    /// Add the noise of the sensors.
    pub noise: bool,
    /// Cut the organs open by an upright plane through their middle that faces the camera.
    pub cut_away: bool,
    /// Worker threads of the simulation, 0 for all.
    pub threads: usize,
    /// Folder in which a scene's phantom is recorded and reconstructed; what is there is used again.
    pub phantoms: PathBuf,
    /// Specimen folder of an episode, where it is no longer where the scene says.
    pub specimen: Option<PathBuf>,
}

impl Rendering {
    /// Makes the picture and writes it to `output`: `.png`, or `.webp` or `.mp4` for a moving one.
    ///
    /// # Errors
    /// One line that names the source, camera, option or file that is wrong.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<Rendered> {
        let extension = output.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        let wrong = |reason: &str| Err(Error::Mismatch(format!("{}: {reason}", output.display())));
        let moving = match extension.as_str() {
            "png" => None,
            "webp" => Some(WEBP_HZ),
            "mp4" => Some(MP4_HZ),
            _ => return wrong("pictures end in .png, moving ones in .webp or .mp4"),
        };
        if moving.is_some() && (self.depth || self.labels || self.at.is_some() || self.cut_away) {
            return wrong("--depth, --labels, --at and --cut-away are for pictures (.png)");
        }
        if let Some(at) = self.at.filter(|at| !(0.0..=600.0).contains(at)) {
            return Err(Error::Mismatch(format!("--at is {at}; 0 to 600 s")));
        }
        if let Some(samples) = self.samples.filter(|n| !(1..=65_536).contains(n)) {
            return Err(Error::Mismatch(format!("--samples is {samples}; 1 to 65536")));
        }
        if let Some(size) = self.size.filter(|size| moving.is_some() && size.iter().any(|n| n % 2 == 1)) {
            return Err(Error::Mismatch(format!("--size is {}x{}; moving pictures have even sides", size[0], size[1])));
        }
        let folder = Path::new(&self.source);
        let begin = || moving.map(|most| Ok::<_, Error>((most, Moving::begin(output, &extension)?))).transpose();
        if let Some(file) = episode_file(folder) {
            return self.episode(&file, begin()?, output, progress);
        }
        if self.specimen.is_some() {
            let reason = "--specimen is for episodes, whose specimen may have moved";
            return Err(Error::Mismatch(format!("{}: {reason}", self.source)));
        }
        if folder.join("result.json").is_file() {
            let reason = "a run keeps figures, no shapes; render its scene instead: trocar render SCENE --at SECONDS";
            return Err(Error::Mismatch(format!("{}: {reason}", self.source)));
        }
        if folder.is_dir() {
            if moving.is_some() || self.at.is_some() {
                return Err(Error::Mismatch(format!(
                    "{}: a specimen does not move; moving pictures and --at are for scenes and episodes",
                    self.source
                )));
            }
            return self.specimen(folder, output, progress);
        }
        let scene = Scene::read(&self.source)?;
        let film = begin()?;
        let specimen = scene_specimen(&scene, &self.phantoms, progress)?;
        let mut lift = ScriptedLift::new(&scene, &specimen, self.threads)?;
        let sight = CameraRig::new(&scene, &specimen, lift.cell())?;
        self.play(&mut lift, sight, (self.at.or(Some(0.0)), film), output, progress)
    }

    /// An episode, done again from its file.
    fn episode(
        &self,
        file: &Path,
        film: Option<(u32, Moving)>,
        output: &Path,
        progress: &dyn Progress,
    ) -> Result<Rendered> {
        let episode = EpisodeFile::read(file)?;
        let scene = episode.scene(self.specimen.as_deref())?;
        let specimen = match &self.specimen {
            Some(folder) => Specimen::read(folder)?,
            None => scene_specimen(&scene, &self.phantoms, progress)?,
        };
        if let Some(other) = episode.other(&scene, &specimen)? {
            let right = "--specimen names the folder of the one that was recorded";
            return Err(Error::Mismatch(format!("{}: {other}; {right}", file.display())));
        }
        let mut again = Episode::new(&scene, &specimen, self.threads)?;
        let mut again = Replayed::begin(&mut again, &episode)?;
        let sight = again.sight(&specimen)?;
        self.play(&mut again, sight, (self.at, film), output, progress)
    }

    /// What goes on in a cell: one picture of it after `at` seconds or at its end, or a moving one of all of it.
    fn play(
        &self,
        play: &mut dyn Play,
        sight: CameraRig,
        (at, film): (Option<f64>, Option<(u32, Moving)>),
        output: &Path,
        progress: &dyn Progress,
    ) -> Result<Rendered> {
        let sight = self.ready(sight);
        let camera = self.camera.clone().or_else(|| sight.cameras().first().map(|c| (*c).to_owned()));
        let camera = camera.unwrap_or_else(|| OUTSIDE.to_owned());
        match film {
            None => self.still(play, sight, (&camera, at), output, progress),
            Some(film) => self.moving(play, sight, &camera, film, output, progress),
        }
    }

    fn ready(&self, mut sight: CameraRig) -> CameraRig {
        if self.noise {
            sight.noise = SensorNoise { color: Some([0.015, 0.003]), depth: Some(DepthNoise::default()), seed: 1 };
        }
        sight
    }

    fn settings(&self) -> RenderSettings {
        self.samples.map_or_else(RenderSettings::preview, RenderSettings::path)
    }

    /// Direct light is seen at twice the size and averaged: it has one ray a pixel, and edges would be stairs.
    fn finer(&self) -> usize {
        if self.samples.is_none() && !self.noise { 2 } else { 1 }
    }

    fn specimen(&self, folder: &Path, output: &Path, progress: &dyn Progress) -> Result<Rendered> {
        let specimen = Specimen::read(folder)?;
        let mut sight = self.ready(CameraRig::from_specimen(&specimen)?);
        let camera = self.camera.clone().or_else(|| sight.cameras().first().map(|c| (*c).to_owned()));
        let camera = camera.unwrap_or_else(|| OUTSIDE.to_owned());
        let size = self.size.map_or_else(|| sight.size(&camera), Ok)?;
        self.cut(&mut sight, &camera, size, &specimen_points(&specimen))?;
        let clock = std::time::Instant::now();
        let color = averaged(
            &sight.render_still(&camera, size.map(|n| n * self.finer()), &self.settings())?.color,
            self.finer(),
        );
        let picture = sight.render_still(&camera, size, &RenderSettings::Preview { shadows: false })?.clone();
        let render_s = clock.elapsed().as_secs_f64();
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        self.write(&sight, &camera, &color, &picture, output, (0.0, render_s))
    }

    fn cut(&self, sight: &mut CameraRig, camera: &str, size: [usize; 2], points: &[DVec3]) -> Result<()> {
        if self.cut_away {
            let (_, pose) = sight.model(camera, size)?;
            let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
            let towards = pose.translation - middle;
            sight.set_section(Some((middle, DVec3::new(towards.x, towards.y, 0.0))));
        }
        Ok(())
    }

    fn still(
        &self,
        play: &mut dyn Play,
        mut sight: CameraRig,
        (camera, at): (&str, Option<f64>),
        output: &Path,
        progress: &dyn Progress,
    ) -> Result<Rendered> {
        let own = sight.size(camera)?;
        let size = self.size.unwrap_or(own);
        play::until(play, at, progress)?;
        let world = play.cell().world();
        let points: Vec<DVec3> =
            (0..world.model.bodies().len()).flat_map(|b| world.state.positions(&world.model, b)).collect();
        self.cut(&mut sight, camera, size, &points)?;
        let clock = std::time::Instant::now();
        let finer = self.finer();
        let (color, picture) = play::stage(progress, "picture", 1, || {
            let fine = sight.render(play.cell(), camera, size.map(|n| n * finer), &self.settings())?;
            let color = averaged(&fine.color, finer);
            Ok((color, sight.render(play.cell(), camera, size, &RenderSettings::Preview { shadows: false })?.clone()))
        })?;
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        let render_s = clock.elapsed().as_secs_f64();
        let made = self.write(&sight, camera, &color, &picture, output, (play.cell().time(), render_s))?;
        Ok(Rendered { differs: play.differs(), ..made })
    }

    fn moving(
        &self,
        play: &mut dyn Play,
        mut sight: CameraRig,
        camera: &str,
        (most, mut film): (u32, Moving),
        output: &Path,
        progress: &dyn Progress,
    ) -> Result<Rendered> {
        let [width, height] = sight.size(camera)?;
        let small = |n: usize| if height > MOVING_HEIGHT { n * MOVING_HEIGHT / height } else { n };
        let even = |n: usize| n & !1;
        let size = self.size.unwrap_or([even(small(width)), even(small(height))]);
        let hz = frame_rate(play.cell().period(), most);
        let (mut frames, mut render_s) = (0_u32, 0.0);
        let mut picture = Picture::new(size[0], size[1]);
        play::stage(progress, "film", play.periods().unwrap_or(1) as u64, || {
            loop {
                if progress.interrupted() {
                    return Err(Error::Interrupted);
                }
                if play.cell().time() >= f64::from(frames) / f64::from(hz) - 1e-9 {
                    let clock = std::time::Instant::now();
                    let finer = self.finer();
                    let fine = sight.render(play.cell(), camera, size.map(|n| n * finer), &self.settings())?;
                    film.add(averaged(&fine.color, finer), 1000.0 * f64::from(frames) / f64::from(hz), hz)?;
                    picture.labels.clone_from(&fine.labels);
                    render_s += clock.elapsed().as_secs_f64();
                    frames += 1;
                }
                if !play.advance()? {
                    return Ok(());
                }
                progress.advance(1);
            }
        })?;
        film.finish(output)?;
        let files = vec![output.display().to_string()];
        let (time_s, samples) = (play.cell().time(), self.samples.unwrap_or(0));
        let seen = seen(&sight, &picture.labels);
        let (triangles, frames) = (sight.triangles(), frames as usize);
        let [width, height] = size;
        Ok(Rendered {
            camera: camera.to_owned(),
            width,
            height,
            time_s,
            frames,
            samples,
            triangles,
            render_s,
            seen,
            files,
            differs: play.differs(),
        })
    }

    fn write(
        &self,
        sight: &CameraRig,
        camera: &str,
        color: &ColorImage,
        picture: &Picture,
        output: &Path,
        (time_s, render_s): (f64, f64),
    ) -> Result<Rendered> {
        let stem = output.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let beside = |what: &str| output.with_file_name(format!("{stem}-{what}.png"));
        let mut files = vec![output.to_owned()];
        color.write_png(output)?;
        if self.depth {
            files.extend([beside("depth"), beside("depth-shown")]);
            picture.depth.write_png(&files[files.len() - 2], DEPTH_STEP)?;
            shown(&picture.depth).write_png(&files[files.len() - 1])?;
        }
        if self.labels {
            files.push(beside("labels"));
            let pixels = picture.labels.iter().map(|l| label_color(*l)).collect();
            let image = ColorImage { pixels, ..picture.color };
            image.write_png(&files[files.len() - 1])?;
        }
        Ok(Rendered {
            camera: camera.to_owned(),
            width: color.width,
            height: color.height,
            time_s,
            frames: 1,
            samples: self.samples.unwrap_or(0),
            triangles: sight.triangles(),
            render_s,
            seen: seen(sight, &picture.labels),
            files: files.iter().map(|f| f.display().to_string()).collect(),
            differs: None,
        })
    }
}

/// The episode file that `source` is or that is in the folder `source`.
fn episode_file(source: &Path) -> Option<PathBuf> {
    let inside = source.join(EPISODE_FILE);
    let named = source.extension().is_some_and(|e| e == "trocar");
    if inside.is_file() { Some(inside) } else { (named && !source.is_dir()).then(|| source.to_owned()) }
}

/// The highest rate of frames, at most `most` a second, that shows whole control periods of `period` seconds.
fn frame_rate(period: f64, most: u32) -> u32 {
    let control = (1.0 / period).round().max(1.0) as u32;
    (1..=control).filter(|k| control.is_multiple_of(*k)).map(|k| control / k).find(|hz| *hz <= most).unwrap_or(1)
}

fn specimen_points(specimen: &Specimen) -> Vec<DVec3> {
    specimen.organs.iter().flat_map(|o| o.body.vertices.iter().copied()).collect()
}
