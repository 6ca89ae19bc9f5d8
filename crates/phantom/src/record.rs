//! Recording a phantom.

use crate::anatomy::Anatomy;
use crate::frame::{FrameSettings, RATE_HZ, record_frame};
use crate::lifts::{self, LiftOptions, Lifts};
use crate::sensor::Sensor;
use crate::spec::{Organ, PhantomSpec, Resolution};
use crate::static_view::StaticView;
use crate::{Error, Result, catalog, instruments, noise, sensor};
use rayon::prelude::*;
use std::path::Path;
use trocar_camera::Camera;
use trocar_core::Progress;
use trocar_geometry::io::write_ply;
use trocar_recording::{LiftInfo, OrganInfo, RecordingInfo, RecordingWriter};

/// File names have six digits.
const MAX_FRAMES: usize = 1_000_000;
/// Unit of the ground-truth depth image (m).
const TRUTH_DEPTH_SCALE: f64 = 0.0001;

/// Options of [`record`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordOptions {
    /// Number of frames at 30 Hz. The paper records 60 s.
    pub frames: usize,
    /// Seed of the anatomy, of the instruments' motion and of the noise. The same seed gives
    /// identical files.
    pub seed: u64,
    /// Model of the depth noise.
    pub sensor: Sensor,
    /// Grasp-lifts after these frames.
    pub lifts: LiftOptions,
}

impl Default for RecordOptions {
    /// The paper's 60 s, seed 1, plain noise, no lifts.
    fn default() -> Self {
        Self { frames: 1800, seed: 1, sensor: Sensor::Plain, lifts: LiftOptions::default() }
    }
}

/// Records the phantom `name` (one of [`NAMES`](crate::NAMES)) into the folder `dir`, with its
/// ground truth in `truth/`: the picture without instruments and noise, and the organs' surfaces in
/// the camera frame (m).
///
/// With `options.lifts`, the recording continues with grasp-lifts of the appendix. Their truth is
/// in `truth/lifts.toml`, see [`LiftsTruth`](crate::LiftsTruth).
///
/// The masks of the organs are ground truth too: the pixels that show the organ in the picture
/// without instruments. Within the mask of an organ, `truth/depth.png` is the depth of that organ's
/// surface in 0.1 mm. Where organs overlap, the pixel belongs to the mask of the front one.
///
/// # Errors
/// The name is unknown, the number of frames or lifts is out of range, the phantom has no appendix
/// to lift, the folder cannot be written, or the user interrupts. The folder is removed in these
/// cases.
pub fn record(name: &str, options: &RecordOptions, dir: &Path, progress: &dyn Progress) -> Result<()> {
    let spec = catalog::named(name)?;
    record_with(spec, options, &Camera::d405(), spec.resolution, dir, progress)
}

/// [`record`] with a given camera and resolution.
pub(crate) fn record_with(
    spec: &PhantomSpec,
    options: &RecordOptions,
    camera: &Camera,
    resolution: Resolution,
    dir: &Path,
    progress: &dyn Progress,
) -> Result<()> {
    let RecordOptions { frames, seed, sensor, lifts } = *options;
    if frames == 0 || frames > MAX_FRAMES {
        return Err(Error::Option(format!("frames is {frames}; must be in [1, {MAX_FRAMES}]")));
    }
    if dir.join("recording.toml").exists() && !dir.join("truth").is_dir() {
        return Err(Error::Option(format!(
            "{}: contains a recording that is not a phantom and is not overwritten; choose another folder",
            dir.display()
        )));
    }
    lifts::check(spec, &lifts)?;
    progress.begin("anatomy", 1);
    if progress.interrupted() {
        return Err(Error::Interrupted);
    }
    let anatomy = Anatomy::new(spec, seed);
    let still = StaticView::new(spec, &anatomy, camera, resolution);
    let lifts = Lifts::plan(spec, &lifts, &anatomy, &still.surfaces, (camera, seed, frames))?;
    let marked = lifts.as_ref().map(Lifts::info).unwrap_or_default();
    let writer = RecordingWriter::create(dir, &info(spec, options, camera, &anatomy, marked))?;
    for (index, organ) in anatomy.organs.iter().enumerate() {
        writer.organ_mask(organ.name, &still.organ_mask(index))?;
    }
    write_truth(&writer.folder().join("truth"), &anatomy, &still)?;
    progress.advance(1);
    progress.end();

    progress.begin("frames", frames as u64);
    let instruments = instruments::pair(&spec.reach, std::f64::consts::TAU * noise::unit(noise::key(&[seed, 3])));
    let take = FrameSettings { instruments: &instruments, camera, sensor, seed };
    (0..frames).into_par_iter().try_for_each(|index| {
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        let shot = record_frame(&still, &take, index);
        writer.frame(index, &shot.color, &shot.depth, Some(&shot.instruments))?;
        progress.advance(1);
        Ok(())
    })?;
    progress.end();
    if let Some(lifts) = lifts {
        lifts.film(&anatomy, resolution, take, &writer, progress)?;
    }
    Ok(writer.finish()?)
}

/// The contents of `recording.toml` that [`record`] writes for these options, without the lifts.
///
/// # Errors
/// The name is unknown.
pub fn describe(name: &str, options: &RecordOptions) -> Result<RecordingInfo> {
    let spec = catalog::named(name)?;
    Ok(info(spec, options, &Camera::d405(), &Anatomy::new(spec, options.seed), Vec::new()))
}

/// Contents of `recording.toml`.
fn info(
    spec: &PhantomSpec,
    options: &RecordOptions,
    camera: &Camera,
    anatomy: &Anatomy,
    lifts: Vec<LiftInfo>,
) -> RecordingInfo {
    let seed = options.seed;
    let noise = if options.sensor == Sensor::Stereo { ", stereo noise" } else { "" };
    let LiftOptions { count, support, cell } = options.lifts;
    let lifted = match count {
        0 => String::new(),
        _ => format!(", {count} lifts of tissue with cells of {} mm and support '{}'", 1e3 * cell, support.name()),
    };
    let pixel = |p| camera.project(p).map(|q| [(q.x * 10.0).round() / 10.0, (q.y * 10.0).round() / 10.0]);
    let organ = |o: &Organ| OrganInfo {
        name: o.name.to_owned(),
        base_px: pixel(o.body.base()),
        material: o.material(spec),
        pins: o.pins(),
        ..OrganInfo::default()
    };
    RecordingInfo {
        name: spec.name.to_owned(),
        rate_hz: Some(RATE_HZ),
        depth_scale_m: Some(sensor::DEPTH_SCALE),
        up: [0.0, 0.0, -1.0],
        note: format!("synthetic, seed {seed}{noise}{lifted}; the truth is in truth/; materials are the paper's"),
        camera: Some(*camera),
        organs: anatomy.organs.iter().map(organ).collect(),
        lifts,
        ..RecordingInfo::default()
    }
}

fn write_truth(dir: &Path, anatomy: &Anatomy, still: &StaticView) -> Result<()> {
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
