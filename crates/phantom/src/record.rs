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
use trocar_geometry::io::write_ply;
use trocar_progress::Progress;
use trocar_reconstruct::{OrganInfo, RecordingInfo, RecordingWriter};

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
    let info = describe(plan, seed, camera, &anatomy);
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

/// Contents of `recording.toml`.
fn describe(plan: &Plan, seed: u64, camera: &Camera, anatomy: &Anatomy) -> RecordingInfo {
    let pixel = |p| camera.project(p).map(|q| [(q.x * 10.0).round() / 10.0, (q.y * 10.0).round() / 10.0]);
    let organ = |o: &Organ| OrganInfo {
        name: o.name.to_owned(),
        polygon: Vec::new(),
        base_px: pixel(o.body.base()),
        material: o.material(plan),
        pins: o.pins(),
    };
    RecordingInfo {
        name: plan.name.to_owned(),
        rate_hz: RATE_HZ,
        depth_scale_m: sensor::DEPTH_SCALE,
        up: [0.0, 0.0, -1.0],
        depth_offset_px: [0.0; 2],
        depth_max_m: None,
        note: format!("synthetic, seed {seed}; the truth is in truth/; materials are the paper's"),
        camera: *camera,
        organs: anatomy.organs.iter().map(organ).collect(),
    }
}

fn write_truth(dir: &Path, anatomy: &Anatomy, still: &Still) -> Result<()> {
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| trocar_reconstruct::Error::Io { path, source }
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
