//! Deforming scenes: filmed grasp-lifts beside the same lifts simulated, at rest and under load.
//!
//! Support and tissue of a simulated lift are identified from the other half of the lifts. True
//! silhouettes are those of the phantom's surfaces: the anatomy's, and the lifted organ's as it
//! equilibrates in the phantom's own solver.

use super::measure::{Sides, SimilarityPictures, SimilarityRow, grown, labelled, measure};
use super::scenery::{Illumination, Scenery, silhouettes};
use crate::experiment::lifts::{identified, organ_of};
use crate::{Error, Result};
use glam::DVec3;
use serde::Serialize;
use std::path::Path;
use trocar_camera::metrics::iou;
use trocar_camera::{Camera, Mask};
use trocar_core::{Pose, Progress};
use trocar_geometry::TriMesh;
use trocar_geometry::io::{Unit, read_surface};
use trocar_identify::{Grip, LoneOrgan, Pace, SeenLift};
use trocar_phantom::{LiftOptions, LiftsTruth, RecordOptions, Sensor};
use trocar_reconstruct::{Reconstruction, Settings};
use trocar_recording::Recording;
use trocar_workflow::measure::measure_recording;
use trocar_workflow::phantoms::recorded;
use trocar_workflow::{check_interrupted, reconstruct_recording};

/// The phantom, and the organ that is lifted.
const PHANTOM: &str = "phantom-a";
const ORGAN: &str = "appendix";

/// How far the wrong camera is beside the recording camera (m): the paper's other camera.
const WRONG: DVec3 = DVec3::new(7.9e-3, 4.6e-3, 0.0);

/// Whether the organ is lifted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Moment {
    /// Before the lift.
    Rest,
    /// At its peak.
    Load,
}

/// Figures of one moment of one lift.
#[derive(Clone, Debug, Serialize)]
pub struct DeformingRow {
    /// The lift.
    pub lift: usize,
    /// When.
    pub moment: Moment,
    /// How far the grasped place is carried (mm).
    pub displacement_mm: f64,
    /// IoU of the silhouette of the lifted organ.
    pub lifted_iou: f64,
    /// The same of the organ as it was reconstructed, which is not lifted.
    pub static_iou: f64,
    /// Mean IoU of all organs through a camera 7.9 mm and 4.6 mm beside the recording's.
    pub wrong_camera_iou: f64,
    /// Silhouettes and picture through the recording camera.
    #[serde(flatten)]
    pub similarity: SimilarityRow,
}

/// A phantom's lifts that are compared.
struct Lifted<'a> {
    recording: &'a Recording,
    made: &'a Reconstruction,
    /// The reconstruction as it was recorded.
    rest: Scenery,
    truth: Truth,
    samples: u32,
}

/// The true surfaces.
struct Truth {
    /// Of all organs, in the specimen's order.
    surfaces: Vec<TriMesh>,
    /// The lifted one among them.
    lifted: usize,
    /// Its surface under load, for each lift.
    loaded: Vec<TriMesh>,
}

/// Compares `lifts` lifts of the phantom, recorded into a folder of `output`.
pub(super) fn deforming(
    (lifts, seed, samples): (usize, u64, u32),
    output: &Path,
    progress: &dyn Progress,
) -> Result<Vec<(DeformingRow, SimilarityPictures)>> {
    let folder = output.join(format!("{PHANTOM}-lifts"));
    let lifts = LiftOptions { count: lifts, ..LiftOptions::default() };
    let options = RecordOptions { frames: 181, seed, sensor: Sensor::Stereo, lifts };
    recorded(PHANTOM, &options, &folder.join("recording"), progress)?;
    let recording = Recording::open(&folder.join("recording"))?;
    let made =
        reconstruct_recording(&folder.join("recording"), &Settings::default(), &folder.join("specimen"), progress)?
            .reconstruction;
    let appendix = LoneOrgan::of(&made.specimen, ORGAN)?;
    let seen: Vec<(usize, SeenLift)> = measure_recording(&recording, progress)?
        .lifts
        .into_iter()
        .enumerate()
        .filter_map(|(number, lift)| Some((number, SeenLift::of(lift.ok()?, &appendix)?)))
        .collect();
    let folds = [identified(0, &appendix, &seen, progress)?, identified(1, &appendix, &seen, progress)?];
    let truth = Truth::read(&made, &folder.join("recording").join("truth"))?;
    let rest = Scenery::new(&made, Illumination::Lamp { beside: 0.0 })?;
    let compared = Lifted { recording: &recording, made: &made, rest, truth, samples };
    let mut rows = Vec::new();
    for fold in &folds {
        let organ = organ_of(fold, &appendix);
        for (number, lift) in seen.iter().filter(|(number, _)| fold.judged.iter().any(|j| j.lift == *number)) {
            check_interrupted(progress)?;
            rows.extend(compared.rows((*number, lift), &organ, &folder, progress)?);
        }
    }
    rows.sort_by_key(|(row, _)| row.lift);
    Ok(rows)
}

impl Truth {
    fn read(made: &Reconstruction, folder: &Path) -> Result<Self> {
        let organs = &made.specimen.organs;
        let read = |o: &trocar_specimen::Organ| Ok(read_surface(&folder.join(format!("{}.ply", o.name)), Unit::Metre)?);
        let surfaces = organs.iter().map(read).collect::<Result<_>>()?;
        let (Some(lifted), Some(lifts)) = (organs.iter().position(|o| o.name == ORGAN), LiftsTruth::read(folder)?)
        else {
            return Err(Error::Mismatch(format!("{}: has no lifts of the {ORGAN}", folder.display())));
        };
        let last = |(number, lift): (usize, &trocar_phantom::LiftTruth)| {
            lift.surfaces(folder, number)?
                .pop()
                .ok_or_else(|| Error::Mismatch(format!("{}: lift {number} has no surface", folder.display())))
        };
        let loaded = lifts.lifts.iter().enumerate().map(last).collect::<Result<_>>()?;
        Ok(Self { surfaces, lifted, loaded })
    }

    /// Labels of the organs through the camera: index + 1.
    fn labels(&self, camera: &Camera, lift: Option<usize>) -> Result<Vec<u16>> {
        let mut surfaces = self.surfaces.clone();
        if let Some(loaded) = lift.and_then(|lift| self.loaded.get(lift)) {
            surfaces[self.lifted] = loaded.clone();
        }
        Ok(silhouettes(&surfaces, camera, &Pose::IDENTITY)?.labels)
    }
}

impl Lifted<'_> {
    /// The rows of a lift. `organ` has the tissue and the support of the simulated one.
    fn rows(
        &self,
        (number, seen): (usize, &SeenLift),
        organ: &LoneOrgan,
        folder: &Path,
        progress: &dyn Progress,
    ) -> Result<Vec<(DeformingRow, SimilarityPictures)>> {
        let lifted = self.truth.lifted;
        let skin = organ.bind(self.rest.vertices(lifted).to_vec());
        let stages = organ.lift_at(&seen.pull(Grip::Place), Pace::SLOW, &[0.0, 1.0], progress)?;
        let stages = stages.ok_or_else(|| Error::Mismatch(format!("the simulated lift {number} diverged")))?;
        let info = &seen.lift.info;
        let moments = [(Moment::Rest, info.rest), (Moment::Load, seen.lift.peak)];
        let row = |((moment, frame), stage): ((Moment, usize), &trocar_identify::Lifted)| {
            let scenery = self.rest.with(lifted, organ.places_of(stage, &skin));
            let displacement_mm = match moment {
                Moment::Rest => 0.0,
                Moment::Load => 1e3 * seen.displacement.length(),
            };
            self.row((number, moment, displacement_mm), frame, &scenery, folder)
        };
        moments.into_iter().zip(&stages).map(row).collect()
    }

    fn row(
        &self,
        (lift, moment, displacement_mm): (usize, Moment, f64),
        frame: usize,
        scenery: &Scenery,
        folder: &Path,
    ) -> Result<(DeformingRow, SimilarityPictures)> {
        let filmed = self.recording.frame(frame)?;
        let next = (frame + 1 < self.recording.len()).then(|| self.recording.frame(frame + 1)).transpose()?;
        let (load, name) = match moment {
            Moment::Rest => (None, "rest"),
            Moment::Load => (Some(lift), "load"),
        };
        let camera = scenery.camera;
        let covered = grown(&filmed.instruments);
        let organs = &self.made.specimen.organs;
        // Nobody can see what instruments hide, so these pixels count for neither side.
        let masks = |labels: &[u16]| -> Vec<Mask> {
            let open: Vec<u16> =
                labels.iter().zip(&covered.set).map(|(l, hidden)| if *hidden { 0 } else { *l }).collect();
            (0..organs.len()).map(|k| labelled(&open, k, camera.width, camera.height)).collect()
        };
        let truth = masks(&self.truth.labels(&camera, load)?);
        let shown = masks(&scenery.labels(&camera)?);
        let wrong = masks(&scenery.labels_from(&camera, &Pose { translation: WRONG, ..Pose::IDENTITY })?);
        let still = masks(&self.rest.labels(&camera)?);
        let lifted = self.truth.lifted;
        let of = |masks: &[Mask]| Ok::<f64, Error>(iou(&truth[lifted], &masks[lifted])?.unwrap_or(0.0));
        let mut beside = 0.0;
        for (truth, wrong) in truth.iter().zip(&wrong) {
            beside += iou(truth, wrong)?.unwrap_or(0.0) / organs.len() as f64;
        }
        let rendered = scenery.picture(&camera, self.samples)?;
        let (lifted_iou, static_iou) = (of(&shown)?, of(&still)?);
        let (similarity, pictures) = measure(&Sides {
            specimen: format!("{PHANTOM}, lift {lift}"),
            note: "masks: the truth, without what instruments hide; light: a lamp at the lens".to_owned(),
            organs: organs.iter().map(|o| o.name.clone()).zip(truth).zip(shown).map(|((n, t), s)| (n, t, s)).collect(),
            real: &filmed.color,
            rendered: &rendered,
            covered: &filmed.instruments,
            second: next.as_ref().map(|next| (&next.color, &next.instruments)),
            composite: None,
        })?;
        rendered.write_png(&folder.join(format!("lift-{lift}-{name}-rendered.png")))?;
        filmed.color.write_png(&folder.join(format!("lift-{lift}-{name}-filmed.png")))?;
        let row = DeformingRow {
            lift,
            moment,
            displacement_mm,
            lifted_iou,
            static_iou,
            wrong_camera_iou: beside,
            similarity,
        };
        Ok((row, pictures))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_core::Silent;

    /// The "simulated" organ is the reconstruction moved to where the "true" one is: only its
    /// silhouette at rest is wrong.
    #[test]
    fn silhouettes_follow_the_lifted_organ() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("recording");
        let options = RecordOptions { frames: 2, ..RecordOptions::default() };
        recorded(PHANTOM, &options, &folder, &Silent).unwrap();
        let settings = Settings::default();
        let made =
            reconstruct_recording(&folder, &settings, &dir.path().join("specimen"), &Silent).unwrap().reconstruction;
        let recording = Recording::open(&folder).unwrap();

        let beside = DVec3::new(8e-3, 0.0, 0.0);
        let moved = |vertices: &[DVec3]| vertices.iter().map(|p| *p + beside).collect::<Vec<_>>();
        let lifted = made.specimen.organs.iter().position(|o| o.name == ORGAN).unwrap();
        let of = |name: &str| read_surface(&folder.join("truth").join(format!("{name}.ply")), Unit::Metre).unwrap();
        let surfaces: Vec<TriMesh> = made.specimen.organs.iter().map(|o| of(&o.name)).collect();
        let mut loaded = surfaces[lifted].clone();
        loaded.vertices = moved(&loaded.vertices);
        let rest = Scenery::new(&made, Illumination::Lamp { beside: 0.0 }).unwrap();
        let simulated = rest.with(lifted, moved(rest.vertices(lifted)));
        let truth = Truth { surfaces, lifted, loaded: vec![loaded] };
        let compared = Lifted { recording: &recording, made: &made, rest: rest.clone(), truth, samples: 1 };
        let row = |moment, scenery: &Scenery| compared.row((0, moment, 8.0), 0, scenery, dir.path()).unwrap().0;

        let (still, load) = (row(Moment::Rest, &rest), row(Moment::Load, &simulated));
        let ious = [still.lifted_iou, still.static_iou, load.lifted_iou, load.static_iou, load.wrong_camera_iou];
        assert!(ious[0] > 0.9 && ious[1] == ious[0], "at rest: {ious:?}");
        assert!(ious[2] > 0.9 && ious[3] < 0.7, "under load: {ious:?}");
        assert!(ious[4] < 0.6, "the wrong camera: {ious:?}");
    }
}
