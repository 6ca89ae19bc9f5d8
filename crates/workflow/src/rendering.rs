//! `trocar render`: a picture of a specimen, a scene or an episode through a camera, or a video of
//! the scripted grasp-lift or of an episode.

mod playback;
mod rendered;
mod script;

pub use rendered::{Rendered, VisibleObject};
pub use script::ScriptedLift;

use crate::episode_replay::EpisodeReplay;
use crate::phantoms::{recorded_specimen, scene_specimen};
use crate::video::VideoWriter;
use crate::{Error, Result, check_interrupted};
use glam::DVec3;
use playback::Playback;
use rendered::visible_objects;
use std::path::{Path, PathBuf};
use trocar_camera::ColorImage;
use trocar_core::Progress;
use trocar_render::{Picture, RenderSettings};
use trocar_report::picture_colors::{label_color, shown};
use trocar_scene::Scene;
use trocar_sensors::{CameraNoise, CameraRig, DepthNoise, OUTSIDE};
use trocar_specimen::Specimen;
use trocar_task::{EPISODE_FILE, EpisodeFile};

/// Unit of depth in files of depth (m).
const DEPTH_STEP: f64 = 1e-4;

/// Maximum frame rates of videos (Hz). A video shows every control period, or every second, third
/// and so on; at 30 periods per second, a WebP shows every second.
const WEBP_HZ: u32 = 15;
const MP4_HZ: u32 = 60;

/// Default height of videos of larger cameras (px).
const MAX_VIDEO_HEIGHT: usize = 360;

/// Settings of a picture or video.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// Specimen folder, scene file, built-in scene, or the folder or file of an episode.
    pub source: String,
    /// Name of the camera; by default the first of the specimen or scene.
    pub camera: Option<String>,
    /// Width and height (px); by default those of the camera.
    pub size: Option<[usize; 2]>,
    /// Paths per pixel; `None` renders direct light only.
    pub samples: Option<u32>,
    /// Filters the noise of paths out.
    pub denoise: bool,
    /// Also write depth.
    pub depth: bool,
    /// Also write labels.
    pub labels: bool,
    /// Time in the scripted grasp-lift (s), by default its start, or in the episode, by default its
    /// end.
    pub at: Option<f64>,
    /// Add sensor noise.
    pub noise: bool,
    /// Cut the organs open along an upright plane through their middle that faces the camera.
    pub cut_away: bool,
    /// Worker threads of the simulation, 0 for all.
    pub threads: usize,
    /// Folder of made phantoms. The scene's phantom is made there once and reused.
    pub phantoms: PathBuf,
    /// Specimen folder of an episode, if it was moved from its place in the scene.
    pub specimen: Option<PathBuf>,
}

impl Rendering {
    /// Renders a picture (`.png`, `.jpg`) or a video (`.webp`, `.mp4`) to `output`.
    ///
    /// # Errors
    /// One line that names the source, camera, option or file that is wrong.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<Rendered> {
        let extension = output.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        let wrong = |reason: &str| Err(Error::Mismatch(format!("{}: {reason}", output.display())));
        let max_hz = match extension.as_str() {
            "png" | "jpg" | "jpeg" => None,
            "webp" => Some(WEBP_HZ),
            "mp4" => Some(MP4_HZ),
            _ => return wrong("a picture must end in .png or .jpg, a video in .webp or .mp4"),
        };
        if max_hz.is_some() && (self.depth || self.labels || self.at.is_some() || self.cut_away) {
            return wrong("--depth, --labels, --at and --cut-away are only for pictures (.png, .jpg)");
        }
        if let Some(at) = self.at.filter(|at| !(0.0..=600.0).contains(at)) {
            return Err(Error::Mismatch(format!("--at is {at} s; it must be in [0, 600]")));
        }
        if let Some(samples) = self.samples.filter(|n| !(1..=65_536).contains(n)) {
            return Err(Error::Mismatch(format!("--samples is {samples}; it must be in [1, 65536]")));
        }
        if let Some(size) = self.size.filter(|size| max_hz.is_some() && size.iter().any(|n| n % 2 == 1)) {
            return Err(Error::Mismatch(format!(
                "--size is {}x{}; width and height of a video must be even",
                size[0], size[1]
            )));
        }
        let folder = Path::new(&self.source);
        let begin = || max_hz.map(|hz| Ok::<_, Error>((hz, VideoWriter::begin(output, &extension)?))).transpose();
        if let Some(file) = episode_file(folder) {
            return self.episode(&file, begin()?, output, progress);
        }
        if self.specimen.is_some() {
            let reason = "--specimen is only for episodes";
            return Err(Error::Mismatch(format!("{}: {reason}", self.source)));
        }
        if folder.join("result.json").is_file() {
            let reason = "this run has no episode file; render its scene instead: trocar render SCENE --at SECONDS";
            return Err(Error::Mismatch(format!("{}: {reason}", self.source)));
        }
        if folder.is_dir() {
            if max_hz.is_some() || self.at.is_some() {
                return Err(Error::Mismatch(format!(
                    "{}: a specimen does not move; videos and --at are only for scenes and episodes",
                    self.source
                )));
            }
            return self.specimen(folder, output, progress);
        }
        let scene = Scene::read(&self.source)?;
        self.check_camera(&scene)?;
        let video = begin()?;
        let specimen = scene_specimen(&scene, &self.phantoms, progress)?;
        let mut lift = ScriptedLift::new(&scene, &specimen, self.threads)?;
        let rig = CameraRig::new(&scene, &specimen, lift.cell())?;
        self.render(&mut lift, rig, (self.at.or(Some(0.0)), video), output, progress)
    }

    /// Renders an episode by replaying its file.
    fn episode(
        &self,
        file: &Path,
        video: Option<(u32, VideoWriter)>,
        output: &Path,
        progress: &dyn Progress,
    ) -> Result<Rendered> {
        let recorded = EpisodeFile::read(file)?;
        let scene = recorded.scene(self.specimen.as_deref())?;
        self.check_camera(&scene)?;
        let specimen = recorded_specimen(&scene, self.specimen.as_deref(), &self.phantoms, progress)?;
        if let Some(other) = recorded.other(&scene, &specimen)? {
            let right = "name the folder of the recorded specimen by --specimen";
            return Err(Error::Mismatch(format!("{}: {other}; {right}", file.display())));
        }
        let mut episode = recorded.begin(&scene, &specimen, self.threads)?;
        let mut replay = EpisodeReplay::begin(&mut episode, &recorded)?;
        let rig = replay.camera_rig()?;
        self.render(&mut replay, rig, (self.at, video), output, progress)
    }

    /// Renders a picture of `play` at the time `at` (s) or at its end, or a video of all of it.
    fn render(
        &self,
        play: &mut dyn Playback,
        rig: CameraRig,
        (at, video): (Option<f64>, Option<(u32, VideoWriter)>),
        output: &Path,
        progress: &dyn Progress,
    ) -> Result<Rendered> {
        let rig = self.with_noise(rig);
        let camera = self.camera.clone().or_else(|| rig.cameras().first().map(|c| (*c).to_owned()));
        let camera = camera.unwrap_or_else(|| OUTSIDE.to_owned());
        match video {
            None => self.still(play, rig, (&camera, at), output, progress),
            Some(video) => self.video(play, rig, &camera, video, output, progress),
        }
    }

    /// Checks that `scene` has the camera. Runs before its specimen and cell are built, which is
    /// slow.
    fn check_camera(&self, scene: &Scene) -> Result<()> {
        let mut known: Vec<&str> = scene.cameras.iter().map(|c| c.name.as_str()).collect();
        if !known.contains(&OUTSIDE) {
            known.push(OUTSIDE);
        }
        self.check_known(&known)
    }

    fn check_known(&self, known: &[&str]) -> Result<()> {
        match &self.camera {
            Some(name) if !known.contains(&name.as_str()) => Err(trocar_sensors::Error::UnknownCamera {
                name: name.chars().take(60).collect(),
                known: known.join(", "),
            }
            .into()),
            _ => Ok(()),
        }
    }

    fn with_noise(&self, mut rig: CameraRig) -> CameraRig {
        if self.noise {
            rig.noise = CameraNoise { color: Some([0.015, 0.003]), depth: Some(DepthNoise::default()), seed: 1 };
        }
        rig
    }

    fn settings(&self) -> RenderSettings {
        let of = if self.denoise { RenderSettings::denoised } else { RenderSettings::path };
        self.samples.map_or(RenderSettings::Smooth, of)
    }

    fn specimen(&self, folder: &Path, output: &Path, progress: &dyn Progress) -> Result<Rendered> {
        let specimen = Specimen::read(folder)?;
        let known: Vec<&str> = specimen.camera.map(|_| "recording").into_iter().chain([OUTSIDE]).collect();
        self.check_known(&known)?;
        let mut rig = self.with_noise(CameraRig::from_specimen(&specimen)?);
        let camera = self.camera.clone().or_else(|| rig.cameras().first().map(|c| (*c).to_owned()));
        let camera = camera.unwrap_or_else(|| OUTSIDE.to_owned());
        let size = self.size.map_or_else(|| rig.size(&camera), Ok)?;
        self.cut(&mut rig, &camera, size, &specimen_points(&specimen))?;
        let clock = std::time::Instant::now();
        let picture = rig.render_still(&camera, size, &self.settings())?.clone();
        let render_s = clock.elapsed().as_secs_f64();
        check_interrupted(progress)?;
        self.write(&rig, &camera, &picture, output, (0.0, render_s))
    }

    fn cut(&self, rig: &mut CameraRig, camera: &str, size: [usize; 2], points: &[DVec3]) -> Result<()> {
        if self.cut_away {
            let (_, pose) = rig.model(camera, size)?;
            let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
            let towards = pose.translation - middle;
            rig.set_section(Some((middle, DVec3::new(towards.x, towards.y, 0.0))));
        }
        Ok(())
    }

    fn still(
        &self,
        play: &mut dyn Playback,
        mut rig: CameraRig,
        (camera, at): (&str, Option<f64>),
        output: &Path,
        progress: &dyn Progress,
    ) -> Result<Rendered> {
        let own = rig.size(camera)?;
        let size = self.size.unwrap_or(own);
        playback::until(play, at, progress)?;
        let world = play.cell().world();
        let points: Vec<DVec3> =
            (0..world.model.bodies().len()).flat_map(|b| world.state.positions(&world.model, b)).collect();
        self.cut(&mut rig, camera, size, &points)?;
        let clock = std::time::Instant::now();
        let picture = playback::stage(progress, "picture", 1, || {
            Ok(rig.render(play.cell(), camera, size, &self.settings())?.clone())
        })?;
        check_interrupted(progress)?;
        let render_s = clock.elapsed().as_secs_f64();
        let made = self.write(&rig, camera, &picture, output, (play.cell().time(), render_s))?;
        Ok(Rendered { differs: play.difference(), ..made })
    }

    fn video(
        &self,
        play: &mut dyn Playback,
        mut rig: CameraRig,
        camera: &str,
        (max_hz, mut video): (u32, VideoWriter),
        output: &Path,
        progress: &dyn Progress,
    ) -> Result<Rendered> {
        let [width, height] = rig.size(camera)?;
        let small = |n: usize| if height > MAX_VIDEO_HEIGHT { n * MAX_VIDEO_HEIGHT / height } else { n };
        let even = |n: usize| n & !1;
        let size = self.size.unwrap_or([even(small(width)), even(small(height))]);
        let hz = frame_rate(play.cell().period(), max_hz);
        let (mut frames, mut render_s) = (0_u32, 0.0);
        let mut labels = vec![0; size[0] * size[1]];
        playback::stage(progress, "video", play.periods().unwrap_or(1) as u64, || {
            loop {
                check_interrupted(progress)?;
                if play.cell().time() >= f64::from(frames) / f64::from(hz) - 1e-9 {
                    let clock = std::time::Instant::now();
                    let picture = rig.render(play.cell(), camera, size, &self.settings())?;
                    video.add(picture.color.clone(), 1000.0 * f64::from(frames) / f64::from(hz), hz)?;
                    labels.clone_from(&picture.labels);
                    render_s += clock.elapsed().as_secs_f64();
                    frames += 1;
                }
                if !play.advance()? {
                    return Ok(());
                }
                progress.advance(1);
            }
        })?;
        video.finish(output)?;
        let files = vec![output.display().to_string()];
        let made = self.rendered(&rig, (camera, size), &labels, files, (play.cell().time(), render_s));
        Ok(Rendered { frames: frames as usize, differs: play.difference(), ..made })
    }

    fn write(
        &self,
        rig: &CameraRig,
        camera: &str,
        picture: &Picture,
        output: &Path,
        times: (f64, f64),
    ) -> Result<Rendered> {
        let stem = output.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let beside = |what: &str| output.with_file_name(format!("{stem}-{what}.png"));
        let mut files = vec![output.to_owned()];
        if output.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
            picture.color.write_png(output)?;
        } else {
            picture.color.write_jpeg(output)?;
        }
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
        let files = files.iter().map(|f| f.display().to_string()).collect();
        Ok(self.rendered(rig, (camera, [picture.color.width, picture.color.height]), &picture.labels, files, times))
    }

    /// The figures of one picture.
    fn rendered(
        &self,
        rig: &CameraRig,
        (camera, [width, height]): (&str, [usize; 2]),
        labels: &[u16],
        files: Vec<String>,
        (time_s, render_s): (f64, f64),
    ) -> Rendered {
        Rendered {
            camera: camera.to_owned(),
            width,
            height,
            time_s,
            frames: 1,
            samples: self.samples.unwrap_or(0),
            denoised: self.denoise,
            triangles: rig.triangles(),
            render_s,
            seen: visible_objects(rig, labels),
            files,
            differs: None,
        }
    }
}

/// The episode file `source`, or the one in the folder `source`.
fn episode_file(source: &Path) -> Option<PathBuf> {
    let inside = source.join(EPISODE_FILE);
    let named = source.extension().is_some_and(|e| e == "trocar");
    if inside.is_file() { Some(inside) } else { (named && !source.is_dir()).then(|| source.to_owned()) }
}

/// The highest frame rate up to `max_hz` at which frames are whole control periods of `period` (s)
/// apart.
fn frame_rate(period: f64, max_hz: u32) -> u32 {
    let control = (1.0 / period).round().max(1.0) as u32;
    (1..=control).filter(|k| control.is_multiple_of(*k)).map(|k| control / k).find(|hz| *hz <= max_hz).unwrap_or(1)
}

fn specimen_points(specimen: &Specimen) -> Vec<DVec3> {
    specimen.organs.iter().flat_map(|o| o.body.vertices.iter().copied()).collect()
}
