//! A phantom recorded through the endoscope from the side: its true, wet surfaces and its
//! surroundings, ray traced in the endoscope's light, with the depth noise of a stereo camera.

use super::endoscope::endoscope_camera;
use super::measure::labelled;
use super::scenery::{BESIDE_LENS, surroundings};
use crate::Result;
use glam::DVec3;
use std::path::Path;
use trocar_camera::{ColorImage, DepthImage, DepthNoise, Mask};
use trocar_core::{Pose, Progress};
use trocar_geometry::io::{Unit, read_surface};
use trocar_reconstruct::truth::DEPTH_UNIT;
use trocar_recording::{InstrumentRule, OrganInfo, Recording, RecordingInfo, RecordingWriter};
use trocar_render::{Appearance, Film, Light, Noise, RayGenerator, RenderSettings, Stage, render};
use trocar_workflow::check_interrupted;

/// Width of the pictures (px).
const WIDTH: usize = 848;
/// Number of frames.
const FRAMES: u32 = 3;
/// Direction from the centre of the organs to the endoscope in the recording frame (up is -z): 40
/// degrees above the horizon.
const TOWARDS: DVec3 = DVec3::new(0.12, 0.76, -0.64);
/// Distance from the centre of the organs to the lens (m).
const DISTANCE: f64 = 0.12;
/// Minimum number of visible pixels of a reconstructed organ.
const MIN_PIXELS: usize = 600;

/// Records the phantom with the recording `from`, which includes the truth, into the folder `to`.
pub(super) fn record(from: &Path, to: &Path, samples: u32, progress: &dyn Progress) -> Result<()> {
    let filmed = Recording::open(from)?;
    let (camera, truth) = (filmed.camera(), from.join("truth"));
    let mut stage = Stage::new();
    let mut points = Vec::new();
    let mut masks = Vec::new();
    for (k, organ) in filmed.info.organs.iter().enumerate() {
        let mesh = read_surface(&truth.join(format!("{}.ply", organ.name)), Unit::Metre)?;
        stage.add_mesh(&mesh, k as u16 + 1, &Appearance::tissue([150, 60, 55]))?;
        points.extend(mesh.vertices);
        masks.push(Mask::read(&from.join("masks").join(format!("{}.png", organ.name)))?);
    }
    let photo = ColorImage::read(&truth.join("color.png"))?;
    let depth = DepthImage::read(&truth.join("depth.png"), DEPTH_UNIT)?;
    let around = surroundings(&photo, &depth, masks.iter(), &camera);
    stage.add_mesh(&around, filmed.info.organs.len() as u16 + 1, &Appearance::tissue([150, 100, 90]))?;

    let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let pose = Pose::look_at(middle + DISTANCE * TOWARDS.normalize(), middle, DVec3::NEG_Z);
    stage.lights.push(Light::endoscope(&pose, BESIDE_LENS, 1.25 * DISTANCE));
    let scope = endoscope_camera(WIDTH);
    let eye = RayGenerator::new(scope);
    let mut writer: Option<RecordingWriter> = None;
    progress.begin("oblique frames", u64::from(FRAMES));
    for frame in 0..FRAMES {
        if let Err(e) = check_interrupted(progress) {
            progress.end();
            return Err(e);
        }
        let settings = RenderSettings::Path { samples, bounces: 4, seed: frame, denoise: false };
        let noise = Noise { shot: 0.01, read: 0.004, seed: 5, frame };
        let film = Film { noise: Some(noise), ..Film::endoscope() };
        let picture = render(&mut stage, &eye, &pose, &settings, &film);
        if writer.is_none() {
            let masks: Vec<Mask> =
                (0..masks.len()).map(|k| labelled(&picture.labels, k, scope.width, scope.height)).collect();
            let shown = |(_, mask): &(&OrganInfo, &Mask)| mask.count() >= MIN_PIXELS;
            let organs: Vec<(&OrganInfo, &Mask)> = filmed.info.organs.iter().zip(&masks).filter(shown).collect();
            let started = RecordingWriter::create(to, &described(&filmed.info, &organs, &scope, &pose))?;
            for (organ, mask) in organs {
                started.organ_mask(&organ.name, mask)?;
            }
            writer = Some(started);
        }
        let noisy = DepthNoise::d405().apply(&picture.depth, Some(&picture.color), &scope, 11, u64::from(frame))?;
        if let Some(writer) = &writer {
            writer.frame(frame as usize, &picture.color, &noisy, None)?;
        }
        progress.advance(1);
    }
    progress.end();
    Ok(writer.map_or(Ok(()), RecordingWriter::finish)?)
}

fn described(
    filmed: &RecordingInfo,
    organs: &[(&OrganInfo, &Mask)],
    scope: &trocar_camera::Camera,
    pose: &Pose,
) -> RecordingInfo {
    let organ = |(organ, _): &(&OrganInfo, &Mask)| OrganInfo { base_px: None, ..(*organ).clone() };
    RecordingInfo {
        name: format!("{}-oblique", filmed.name),
        depth_scale_m: Some(1e-4),
        up: (pose.rotation.inverse() * DVec3::NEG_Z).to_array(),
        instruments: InstrumentRule::None,
        note: "ray traced through the endoscope from a phantom's true surfaces".into(),
        camera: Some(*scope),
        organs: organs.iter().map(organ).collect(),
        ..filmed.clone()
    }
}
