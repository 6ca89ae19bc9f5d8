//! Filming a phantom.

use crate::anatomy::Anatomy;
use crate::film::{RATE_HZ, Take, shoot};
use crate::plan::{Organ, Plan};
use crate::sensor::Sensor;
use crate::still::{Fineness, Still};
use crate::{Error, Result, instruments, noise, sensor};
use rayon::prelude::*;
use std::path::Path;
use trocar_camera::Camera;
use trocar_core::Progress;
use trocar_geometry::io::write_ply;
use trocar_recording::{InstrumentRule, OrganInfo, RecordingInfo, RecordingWriter};

/// File names hold six digits.
const MAX_FRAMES: usize = 1_000_000;
/// Unit of the truth's depth image [m].
const TRUTH_DEPTH_SCALE: f64 = 0.0001;

/// How a phantom is filmed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordOptions {
    /// Frames to record at 30 Hz (paper: 60 s).
    pub frames: usize,
    /// Seed of the anatomy, of the instruments' motion and of the noise: the same seed gives the same files.
    pub seed: u64,
    /// What kind of noise depth has.
    pub sensor: Sensor,
}

impl Default for RecordOptions {
    /// The paper's 60 s, seed 1, plain noise.
    fn default() -> Self {
        Self { frames: 1800, seed: 1, sensor: Sensor::Plain }
    }
}

/// Records the phantom `name` (one of [`NAMES`](crate::NAMES)) into the folder `dir`, with its truth under `truth/`: the
/// picture without instruments and noise, and the organs' surfaces in the camera's frame, in metres.
///
/// The organs' masks are the truth too: the pixels in which the picture without instruments shows the organ. On an organ's
/// mask `truth/depth.png` is therefore that organ's own front, in 0.1 mm; where another organ lies on top, the mask is the
/// other's.
///
/// # Errors
/// An unknown name, no frames, a folder that cannot be written, or an interruption; nothing is left behind then.
pub fn record(name: &str, options: &RecordOptions, dir: &Path, progress: &dyn Progress) -> Result<()> {
    let plan = Plan::named(name)?;
    record_with(plan, options, &Camera::d405(), plan.fineness, dir, progress)
}

/// [`record`] with a camera and a fineness of one's choice.
pub(crate) fn record_with(
    plan: &Plan,
    options: &RecordOptions,
    camera: &Camera,
    fineness: Fineness,
    dir: &Path,
    progress: &dyn Progress,
) -> Result<()> {
    let RecordOptions { frames, seed, sensor } = *options;
    if frames == 0 || frames > MAX_FRAMES {
        return Err(Error::Option(format!("frames is {frames}; a recording has 1 to {MAX_FRAMES} frames")));
    }
    if dir.join("recording.toml").exists() && !dir.join("truth").is_dir() {
        return Err(Error::Option(format!(
            "{}: a recording that no phantom made lies there, so it is not overwritten; name a new folder",
            dir.display()
        )));
    }
    progress.begin("anatomy", 1);
    if progress.interrupted() {
        return Err(Error::Interrupted);
    }
    let anatomy = Anatomy::new(plan, seed);
    let info = info(plan, options, camera, &anatomy);
    let writer = RecordingWriter::create(dir, &info)?;
    let still = Still::new(plan, &anatomy, camera, fineness);
    for (index, organ) in anatomy.organs.iter().enumerate() {
        writer.organ_mask(organ.name, &still.organ_mask(index))?;
    }
    write_truth(&writer.folder().join("truth"), &anatomy, &still)?;
    progress.advance(1);
    progress.end();

    progress.begin("frames", frames as u64);
    let instruments = instruments::pair(&plan.reach, std::f64::consts::TAU * noise::unit(noise::key(&[seed, 3])));
    let take = Take { instruments: &instruments, camera, sensor, seed };
    (0..frames).into_par_iter().try_for_each(|index| {
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        let shot = shoot(&still, &take, index);
        writer.frame(index, &shot.color, &shot.depth, Some(&shot.instruments))?;
        progress.advance(1);
        Ok(())
    })?;
    progress.end();
    Ok(writer.finish()?)
}

/// What [`record`] writes into `recording.toml` for these options.
///
/// # Errors
/// An unknown name.
pub fn describe(name: &str, options: &RecordOptions) -> Result<RecordingInfo> {
    let plan = Plan::named(name)?;
    Ok(info(plan, options, &Camera::d405(), &Anatomy::new(plan, options.seed)))
}

/// Contents of `recording.toml`.
fn info(plan: &Plan, options: &RecordOptions, camera: &Camera, anatomy: &Anatomy) -> RecordingInfo {
    let seed = options.seed;
    let noise = if options.sensor == Sensor::Stereo { ", stereo noise" } else { "" };
    let pixel = |p| camera.project(p).map(|q| [(q.x * 10.0).round() / 10.0, (q.y * 10.0).round() / 10.0]);
    let organ = |o: &Organ| OrganInfo {
        name: o.name.to_owned(),
        polygon: Vec::new(),
        points: Vec::new(),
        points_outside: Vec::new(),
        base_px: pixel(o.body.base()),
        material: o.material(plan),
        pins: o.pins(),
    };
    RecordingInfo {
        name: plan.name.to_owned(),
        rate_hz: Some(RATE_HZ),
        depth_scale_m: Some(sensor::DEPTH_SCALE),
        up: [0.0, 0.0, -1.0],
        depth_offset_px: [0.0; 2],
        depth_max_m: None,
        instruments: InstrumentRule::Masks,
        note: format!("synthetic, seed {seed}{noise}; the truth is in truth/; materials are the paper's"),
        source: None,
        camera: Some(*camera),
        depth_camera: None,
        depth_to_color: None,
        followed: Vec::new(),
        organs: anatomy.organs.iter().map(organ).collect(),
    }
}

fn write_truth(dir: &Path, anatomy: &Anatomy, still: &Still) -> Result<()> {
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| trocar_recording::Error::Io { path, source }
    };
    std::fs::create_dir_all(dir).map_err(io(dir))?;
    still.frame.color.write_png(&dir.join("color.png"))?;
    still.frame.depth.write_png(&dir.join("depth.png"), TRUTH_DEPTH_SCALE)?;
    for (organ, surface) in anatomy.organs.iter().zip(&still.surfaces) {
        write_ply(&dir.join(format!("{}.ply", organ.name)), surface)?;
    }
    let path = dir.join("truth.toml");
    let text = format!(
        "# What the camera would see without instruments and noise. Surfaces: camera frame, metres.\n\
         color = \"color.png\"\ndepth = \"depth.png\"\ndepth_scale_m = {TRUTH_DEPTH_SCALE}\n"
    );
    std::fs::write(&path, text).map_err(io(&path))?;
    Ok(())
}
