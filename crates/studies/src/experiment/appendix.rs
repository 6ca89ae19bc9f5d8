//! Lifts of the appendix, in the whole cell or alone: what the grasp studies share.

use crate::names::{AppendixChoice, design_name};
use crate::{Error, Result};
use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use trocar_core::Progress;
use trocar_scene::{GraspDesignName, OrganOverride, PinEnd, PinRule, Scene, SpecimenSource, Variation};
use trocar_specimen::{End, Pins, Specimen};
use trocar_task::policy::{Script, Scripted};
use trocar_task::{Episode, Recording, run};
use trocar_workflow::Lift;
use trocar_workflow::specimen_scene::{free_scene, grasp_lift};
use xxhash_rust::xxh3::Xxh3;

/// The organ that is lifted.
const ORGAN: &str = "appendix";

/// The scene of the whole cell.
const CELL: &str = "cell-a";

/// Help text of `--output`.
pub(super) const FOLDER: &str = "Output folder of recording, specimen, trials and report. A finished recording in it \
                                 is used again, and so are finished trials with the same settings: an interrupted \
                                 run resumes.";

/// The surroundings of the appendix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Condition {
    /// The whole cell: all organs in contact, and dynamic arms in ports.
    Cell,
    /// The appendix alone, lifted by an ideal arm without a port.
    Appendix,
}

impl Condition {
    /// The name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cell => "cell",
            Self::Appendix => "appendix",
        }
    }

    /// The end of a title.
    pub fn title(self) -> &'static str {
        match self {
            Self::Cell => "in the whole cell",
            Self::Appendix => "with the appendix alone",
        }
    }

    /// A sentence without its full stop.
    pub fn described(self) -> &'static str {
        match self {
            Self::Cell => "The paper\u{2019}s cell: all organs in contact, and a dynamic arm in its port",
            Self::Appendix => "The appendix alone, lifted by an ideal arm without a port",
        }
    }
}

/// Values of `--condition`.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum ConditionName {
    /// The whole cell: organs in contact, and a dynamic arm in its port.
    Cell,
    /// The appendix alone, lifted by an ideal arm without a port.
    Appendix,
    /// Both, one after the other.
    Both,
}

impl ConditionName {
    pub(super) fn conditions(self) -> &'static [Condition] {
        match self {
            Self::Cell => &[Condition::Cell],
            Self::Appendix => &[Condition::Appendix],
            Self::Both => &[Condition::Cell, Condition::Appendix],
        }
    }
}

/// A specimen with an appendix, and its folder.
pub(super) struct Whole {
    specimen: Specimen,
    folder: PathBuf,
}

impl Whole {
    /// Reads the specimen; a phantom is made in the folder `output`.
    pub fn read(choice: &AppendixChoice, output: &Path, progress: &dyn Progress) -> Result<Self> {
        let (specimen, folder) = choice.read(output, progress)?;
        if !specimen.organs.iter().any(|o| o.name == ORGAN) {
            let names = specimen.organs.iter().map(|o| o.name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(Error::Mismatch(format!("the specimen has no organ '{ORGAN}'; it has {names}")));
        }
        Ok(Self { specimen, folder })
    }

    /// The specimen of a condition: all of it, or the appendix alone.
    pub fn specimen(&self, condition: Condition) -> Specimen {
        let mut specimen = self.specimen.clone();
        if condition == Condition::Appendix {
            specimen.organs.retain(|o| o.name == ORGAN);
        }
        specimen
    }

    pub fn scene(&self, condition: Condition) -> Result<Scene> {
        let mut scene = match condition {
            Condition::Appendix => free_scene(&self.specimen(condition), &self.folder, ORGAN, false)?,
            Condition::Cell => Scene::builtin(CELL)?,
        };
        let folder = std::path::absolute(&self.folder).unwrap_or_else(|_| self.folder.clone());
        scene.specimen = SpecimenSource::folder(&folder.display().to_string());
        scene.task = grasp_lift(ORGAN);
        scene.variation = Variation::default();
        Ok(scene)
    }

    /// Nodes and elements of the appendix.
    pub fn size(&self) -> (usize, usize) {
        let organ = self.specimen.organs.iter().find(|o| o.name == ORGAN);
        organ.map_or((0, 0), |o| (o.body.vertices.len(), o.body.tets.len()))
    }

    /// A hash of the specimen, for the settings of trials.
    pub fn fingerprint(&self) -> String {
        let mut hasher = Xxh3::new();
        hasher.update(&trocar_task::specimen_hash(&self.specimen).to_le_bytes());
        format!("{:016x}", hasher.digest())
    }
}

/// The settings of the appendix in a scene.
pub(super) fn appendix(scene: &mut Scene) -> &mut OrganOverride {
    scene.organs.entry(ORGAN.to_owned()).or_default()
}

/// Pins the end of the appendix as the scene, or else the specimen, says, and the lowest `share` of
/// all other nodes. Changes nothing if no end of the organ is pinned.
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
    /// Closing force of the jaws (N).
    pub jaw_force: f64,
}

impl LiftTrial {
    /// Lifts the appendix of `specimen` in `scene`.
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

    pub fn design_name(&self) -> String {
        design_name(self.design).to_owned()
    }
}

/// Why a recorded lift diverged; `None` if it did not.
pub(super) fn divergence(recording: &Recording) -> Option<String> {
    recording.summary.diverged.then(|| recording.summary.why.clone().unwrap_or_else(|| "diverged".to_owned()))
}

/// Largest force of held nodes on any instrument (N).
pub(super) fn peak_constraint(recording: &Recording) -> f64 {
    recording.summary.arms.iter().map(|a| a.peak_constraint_n).fold(0.0, f64::max)
}

/// The last column of a table of lifts: why the lift failed, slips and tears, `other`.
pub(super) fn remarks(
    divergence: Option<&String>,
    why: Option<&String>,
    (slipped, torn): (usize, bool),
    other: Option<String>,
) -> String {
    let slips = (slipped > 0).then(|| format!("slipped {slipped} times"));
    let torn = torn.then(|| "torn".to_owned());
    [divergence.or(why).cloned(), slips, torn, other].into_iter().flatten().collect::<Vec<_>>().join("; ")
}
