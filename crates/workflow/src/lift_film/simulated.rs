//! The simulated lift through the recording's camera.

use super::moment::Moment;
use super::panel::{Panel, Seen};
use crate::{Error, Result};
use glam::DVec3;
use std::sync::Arc;
use trocar_camera::{Camera, ColorImage};
use trocar_core::{Pose, Progress};
use trocar_geometry::{Skin, TriMesh};
use trocar_identify::{Grip, Lifted, LoneOrgan, Pace, SeenLift};
use trocar_render::{Picture, RenderSettings};
use trocar_sensors::CameraRig;
use trocar_specimen::Specimen;

/// The rig's name of the recording's camera.
const CAMERA: &str = "recording";

/// What reproduces a lift.
#[derive(Clone, Copy)]
pub struct Simulated<'a> {
    /// The specimen, which was reconstructed from the recording.
    pub specimen: &'a Specimen,
    /// Its organ alone, with the support and the tissue of the simulated lift.
    pub organ: &'a LoneOrgan,
    /// The measured lift, aligned with the organ.
    pub seen: &'a SeenLift,
    /// What is held.
    pub grip: Grip,
}

impl Simulated<'_> {
    /// Why the specimen cannot be shown beside the pictures of a camera.
    pub fn not_shown(specimen: &Specimen, camera: &Camera) -> Option<&'static str> {
        match &specimen.camera {
            None => Some("the specimen has no camera"),
            Some(own) if own != camera => Some("the specimen is from another camera than the recording"),
            Some(_) => None,
        }
    }
}

/// The simulated lift at the moments of a film.
pub(super) struct SimulatedView {
    rig: CameraRig,
    /// Camera to the rig's world.
    pose: Pose,
    /// The organs' meshes with their positions in that world.
    shown: Vec<(Arc<TriMesh>, Vec<DVec3>)>,
    /// Which of them is lifted, and where its vertices are at each moment (m, in the camera's
    /// frame).
    lifted: usize,
    surfaces: Vec<Vec<DVec3>>,
    moments: Vec<Moment>,
    size: [usize; 2],
    /// Whether the rig has these meshes.
    begun: bool,
}

impl SimulatedView {
    /// Simulates the lift, and keeps the frames `frames` with the `shares` of the way gone in them.
    pub fn new(made: &Simulated<'_>, (frames, shares): (&[usize], &[f64]), progress: &dyn Progress) -> Result<Self> {
        let Simulated { specimen, organ, seen, grip } = *made;
        let stages = organ.lift_at(&seen.pull(grip), Pace::SLOW, shares, progress)?;
        let stages = stages.ok_or_else(|| Error::Mismatch("the simulated lift of the film diverged".to_owned()))?;
        let surface = organ.bind(organ.organ().surface.vertices.clone());
        let mut marked = seen.landmarks.clone();
        marked.push(organ.front_at(seen.grasp_s));
        let marks = organ.bind(marked);
        let rig = CameraRig::from_specimen(specimen)?;
        let size = rig.size(CAMERA)?;
        let (_, pose) = rig.model(CAMERA, size)?;
        let place = |o: &trocar_specimen::Organ| {
            let positions: Vec<DVec3> = o.surface.vertices.iter().map(|p| pose.transform(*p)).collect();
            (Arc::new(TriMesh { vertices: positions.clone(), ..o.surface.clone() }), positions)
        };
        let name = &organ.organ().name;
        let lifted = specimen.organs.iter().position(|o| o.name == *name);
        Ok(Self {
            shown: specimen.organs.iter().map(place).collect(),
            lifted: lifted.ok_or_else(|| Error::Mismatch(format!("the specimen has no organ '{name}'")))?,
            surfaces: stages.iter().map(|now| organ.places_of(now, &surface)).collect(),
            moments: moments(made, &marks, &stages, frames),
            rig,
            pose,
            size,
            begun: false,
        })
    }

    /// The lift at each moment.
    pub fn moments(&self) -> &[Moment] {
        &self.moments
    }

    /// Its panel at moment `k`, beside the measured one.
    pub fn panel(&mut self, panel: &Panel, k: usize, measured: &Moment) -> Result<ColorImage> {
        let seen = self.picture(k)?.clone();
        panel.simulated(Seen { color: &seen.color, depth: &seen.depth }, &self.moments[k], measured)
    }

    /// The picture at moment `k`, in the size of the camera.
    pub fn picture(&mut self, k: usize) -> Result<&Picture> {
        self.shown[self.lifted].1 = self.surfaces[k].iter().map(|p| self.pose.transform(*p)).collect();
        self.rig.show(&self.shown, !self.begun, &[])?;
        self.begun = true;
        Ok(self.rig.render_still(CAMERA, self.size, &RenderSettings::Smooth)?)
    }

    /// The label of the lifted organ.
    #[cfg(test)]
    pub fn label(&self) -> u16 {
        self.rig.labels()[self.lifted].0
    }
}

/// The lift at each stage; the first is at rest.
fn moments(made: &Simulated<'_>, marks: &Skin, stages: &[Lifted], frames: &[usize]) -> Vec<Moment> {
    let Some(rest) = stages.first() else { return Vec::new() };
    let moment = |(now, frame): (&Lifted, &usize)| Moment::simulated((made.seen, made.organ, marks), rest, now, *frame);
    stages.iter().zip(frames).map(moment).collect()
}
