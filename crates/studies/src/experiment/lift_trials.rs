//! What the grasp experiments share: the appendix in the whole cell or alone, and lifts of it.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_scene::{GraspDesignName, OrganOverride, PinEnd, PinRule, Scene, SpecimenSource};
use trocar_specimen::{End, Pins, Specimen};
use trocar_task::policy::{Script, Scripted};
use trocar_task::{Episode, Recording, run};
use trocar_workflow::specimen_scene::{free_scene, grasp_lift};
use trocar_workflow::{Lift, phantoms};
use xxhash_rust::xxh3::Xxh3;

/// The organ of these experiments.
const ORGAN: &str = "appendix";

/// The scene of the whole cell.
const CELL: &str = "cell-a";

/// In what the appendix is lifted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Condition {
    /// The paper's cell: all organs, which touch each other, and dynamic arms in ports.
    Cell,
    /// The appendix alone, lifted by an ideal arm without a port.
    Appendix,
}

impl Condition {
    /// Its name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cell => "cell",
            Self::Appendix => "appendix",
        }
    }
}

/// Where the appendix comes from.
#[derive(Clone, Debug)]
pub struct AppendixSource {
    /// A specimen folder; phantom A, recorded and reconstructed, when `None`.
    pub specimen: Option<PathBuf>,
    /// How the phantom is filmed.
    pub record: RecordOptions,
}

/// A specimen with an appendix, and its folder.
pub(super) struct Whole {
    pub specimen: Specimen,
    pub folder: PathBuf,
}

impl AppendixSource {
    /// The specimen; a phantom is made in the folder `output`.
    pub(super) fn read(&self, output: &Path, progress: &dyn Progress) -> Result<Whole> {
        let (specimen, folder) = match &self.specimen {
            Some(folder) => (Specimen::read(folder)?, folder.clone()),
            None => {
                let folder = output.join("phantom-a");
                (phantoms::specimen("phantom-a", &self.record, &folder, progress)?, folder.join("specimen"))
            }
        };
        if !specimen.organs.iter().any(|o| o.name == ORGAN) {
            let names = specimen.organs.iter().map(|o| o.name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(Error::Mismatch(format!("the specimen has no organ '{ORGAN}'; it has {names}")));
        }
        Ok(Whole { specimen, folder })
    }
}

impl Whole {
    /// The specimen of a condition: all of it, or the appendix alone.
    pub fn specimen(&self, condition: Condition) -> Specimen {
        let mut specimen = self.specimen.clone();
        if condition == Condition::Appendix {
            specimen.organs.retain(|o| o.name == ORGAN);
        }
        specimen
    }

    /// The scene of a condition.
    pub fn scene(&self, condition: Condition) -> Result<Scene> {
        let mut scene = match condition {
            Condition::Appendix => free_scene(&self.specimen(condition), &self.folder, ORGAN, false)?,
            Condition::Cell => Scene::builtin(CELL)?,
        };
        let folder = std::path::absolute(&self.folder).unwrap_or_else(|_| self.folder.clone());
        scene.specimen = SpecimenSource { path: Some(folder.display().to_string()), phantom: None, seed: 1 };
        scene.task = grasp_lift(ORGAN);
        Ok(scene)
    }

    /// Nodes and elements of the appendix.
    pub fn size(&self) -> (usize, usize) {
        let organ = self.specimen.organs.iter().find(|o| o.name == ORGAN);
        organ.map_or((0, 0), |o| (o.body.vertices.len(), o.body.tets.len()))
    }

    /// All of the specimen that a trial depends on, in a few words.
    pub fn fingerprint(&self) -> String {
        let mut hasher = Xxh3::new();
        hasher.update(&trocar_task::specimen_hash(&self.specimen).to_le_bytes());
        format!("{:016x}", hasher.digest())
    }
}

/// The appendix's part of a scene, to be changed.
pub(super) fn appendix(scene: &mut Scene) -> &mut OrganOverride {
    scene.organs.entry(ORGAN.to_owned()).or_default()
}

/// Pins the end of the appendix as the scene, or else the specimen, has it, and the lowest `share` of the nodes
/// of all the rest. An organ that is not pinned at an end stays as it is.
pub(super) fn pin_end_and_band(scene: &mut Scene, specimen: &Specimen, share: f64) {
    let own = specimen.organs.iter().find(|o| o.name == ORGAN).map(|o| o.pins);
    let (end, length) = match (&appendix(scene).pins, own) {
        (Some(PinRule::End { end, length, .. }), _) => (*end, *length),
        (None, Some(Pins::End { end, length, .. })) => {
            (if end == End::Base { PinEnd::Base } else { PinEnd::Tip }, length)
        }
        _ => return,
    };
    let band_length = if share > 0.0 { 1.0 - length } else { 0.0 };
    appendix(scene).pins = Some(PinRule::End { end, length, band_length, band_share: share });
}

/// One lift of the appendix.
#[derive(Clone, Debug)]
pub(super) struct LiftTrial {
    pub condition: Condition,
    pub script: Script,
    pub design: GraspDesignName,
    /// Force of the jaws (N).
    pub jaw_force: f64,
}

impl LiftTrial {
    /// Lifts the appendix of `specimen` in `scene`.
    ///
    /// # Errors
    /// An option out of range, a scene that cannot be built, an interruption.
    pub fn run(&self, scene: &Scene, specimen: &Specimen, progress: &dyn Progress) -> Result<Recording> {
        let lift =
            Lift { script: self.script, design: Some(self.design), jaw_force: Some(self.jaw_force), ..Lift::default() };
        let scene = lift.arrange(scene.clone())?;
        let mut episode = Episode::new(&scene, specimen, 1)?;
        let mut policy = Scripted::following(self.script);
        let mut stopped = false;
        let recording = run(&mut episode, &mut policy, 0, &mut |_| {
            stopped = progress.interrupted();
            !stopped
        });
        if stopped { Err(Error::Interrupted) } else { Ok(recording?) }
    }
}

/// The design's name.
pub(crate) fn design_name(design: GraspDesignName) -> &'static str {
    match design {
        GraspDesignName::Friction => "friction",
        GraspDesignName::RestPose => "rest-pose",
        GraspDesignName::LivePose => "live-pose",
        GraspDesignName::Compliant => "compliant",
    }
}

/// What ended a recording, if it diverged.
pub(super) fn divergence(recording: &Recording) -> Option<String> {
    recording.summary.diverged.then(|| recording.summary.why.clone().unwrap_or_else(|| "diverged".to_owned()))
}

/// Largest pull of held nodes at any instrument (N).
pub(super) fn peak_constraint(recording: &Recording) -> f64 {
    recording.summary.arms.iter().map(|a| a.peak_constraint_n).fold(0.0, f64::max)
}
