//! The scene: everything that a cell is built from.

use crate::{
    Arm, CellCamera, Error, Frame, GravityError, Imaging, Instrument, InstrumentKind, OrganOverride, Port, Result,
    Safety, Side, Source, SpecimenSource, Start, Task, Tissue, Variation,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;
use xxhash_rust::xxh3::Xxh3;

/// A Trocar scene: the whole two-arm cell. The cell frame is right-handed with z up; its origin is
/// midway between the arms' bases on their mounting plane, x runs from the left base to the right,
/// y towards the phantom.
///
/// ```
/// use trocar_scene::Scene;
///
/// let mut scene = Scene::builtin("cell-a")?;
/// assert_eq!(scene.tools().len(), 2);
/// scene.task.episode_s = 10.0;
/// scene.validate()?;
/// // The file that `trocar episode` takes.
/// let text = scene.to_toml()?;
/// assert_eq!(Scene::parse(&text, "mine.toml", "".as_ref())?, scene);
/// # Ok::<(), trocar_scene::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Name of the scene: lower-case letters, digits, `-` and `_`.
    pub name: String,
    /// What it shows, for people.
    #[serde(default)]
    pub description: String,
    /// The specimen.
    pub specimen: SpecimenSource,
    /// Pose of the specimen, which is that of its recording camera, in the cell frame.
    #[serde(default = "placement")]
    pub placement: Frame,
    /// Changes to organs of the specimen, by name.
    #[serde(default, rename = "organ")]
    pub organs: BTreeMap<String, OrganOverride>,
    /// Solver and contact of the tissue.
    #[serde(default)]
    pub tissue: Tissue,
    /// How often things happen.
    #[serde(default)]
    pub rates: Rates,
    /// The arms, one or two; the paper's two if left out.
    #[serde(default = "arms", rename = "arm")]
    pub arms: Vec<Arm>,
    /// The ports; the paper's two if left out.
    #[serde(default = "ports", rename = "port")]
    pub ports: Vec<Port>,
    /// The instruments; the paper's two if left out.
    #[serde(default = "instruments", rename = "instrument")]
    pub instruments: Vec<Instrument>,
    /// Errors of the controllers' model.
    #[serde(default)]
    pub gravity_error: GravityError,
    /// The cameras; the paper's three if left out.
    #[serde(default = "CellCamera::paper", rename = "camera")]
    pub cameras: Vec<CellCamera>,
    /// Factors on what pictures are made with.
    #[serde(default)]
    pub imaging: Imaging,
    /// The task of an episode.
    #[serde(default)]
    pub task: Task,
    /// Safety limits.
    #[serde(default)]
    pub safety: Safety,
    /// How episodes differ by their seed; not at all if left out.
    #[serde(default)]
    pub variation: Variation,
    /// The folder that paths in the scene start from; not in the file.
    #[serde(skip)]
    pub folder: PathBuf,
    /// The file that it was read from, for messages.
    #[serde(skip)]
    pub origin: Origin,
}

/// The file that a scene was read from. It is no part of the scene, so all are equal.
#[derive(Clone, Debug, Default)]
pub struct Origin(pub Option<String>);

impl PartialEq for Origin {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// An arm of a scene with its instrument and its port.
#[derive(Clone, Copy, Debug)]
pub struct Tool<'a> {
    /// The arm.
    pub arm: &'a Arm,
    /// The port it works through; `None` for an ideal arm that moves freely.
    pub port: Option<&'a Port>,
    /// The instrument it holds.
    pub instrument: &'a Instrument,
}

/// How often things happen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Rates {
    /// Actions and observations a second (Hz).
    pub control_hz: u32,
    /// Steps of the arms a second (Hz); a multiple of `control_hz`.
    pub physics_hz: u32,
    /// Time from an action to the arms (ms), to the nearest physics step.
    #[serde(skip_serializing_if = "no_delay")]
    pub control_delay_ms: f64,
}

/// A scene without a delay is written as before there were delays.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn no_delay(ms: &f64) -> bool {
    *ms == 0.0
}

impl Default for Rates {
    fn default() -> Self {
        Self { control_hz: 30, physics_hz: 480, control_delay_ms: 0.0 }
    }
}

impl Rates {
    /// Steps of the arms an action.
    pub fn substeps(&self) -> u32 {
        self.physics_hz / self.control_hz.max(1)
    }
}

/// The recording camera looks straight down, its image's top away from the arms, such that the
/// middle of phantom A's appendix lies below the ports' midpoint. The phantom's bed, 150 mm below
/// the camera, is at z = 0.02.
fn placement() -> Frame {
    Frame { position_m: [-0.012, 0.48, 0.17], rotation_wxyz: [0.0, 1.0, 0.0, 0.0] }
}

fn arms() -> Vec<Arm> {
    let start = Start { tilt_deg: 18.3, azimuth_deg: 180.0, ..Start::default() };
    vec![Arm::paper(Side::Left, -0.45, "grasper", Start::default()), Arm::paper(Side::Right, 0.45, "cutter", start)]
}

fn ports() -> Vec<Port> {
    vec![Port::paper(Side::Left.name(), [-0.045, 0.46, 0.16]), Port::paper(Side::Right.name(), [0.045, 0.46, 0.16])]
}

fn instruments() -> Vec<Instrument> {
    vec![Instrument::of(InstrumentKind::Grasper), Instrument::of(InstrumentKind::Cutter)]
}

impl Scene {
    /// The paper's cell around a specimen, with every default; paths start from the working
    /// directory.
    pub fn new(name: &str, specimen: SpecimenSource) -> Self {
        Self {
            name: name.to_owned(),
            description: String::new(),
            specimen,
            placement: placement(),
            organs: BTreeMap::new(),
            tissue: Tissue::default(),
            rates: Rates::default(),
            arms: arms(),
            ports: ports(),
            instruments: instruments(),
            gravity_error: GravityError::default(),
            cameras: CellCamera::paper(),
            imaging: Imaging::default(),
            task: Task::default(),
            safety: Safety::default(),
            variation: Variation::default(),
            folder: PathBuf::new(),
            origin: Origin::default(),
        }
    }

    /// The scene in messages: its file, or its name if it was not read from a file.
    pub fn label(&self) -> String {
        self.origin.0.clone().unwrap_or_else(|| format!("scene '{}'", self.name))
    }

    /// A path of the scene as the system understands it: relative ones start from the scene file's
    /// folder.
    pub fn resolve(&self, path: &str) -> PathBuf {
        self.folder.join(path)
    }

    /// The port of that name.
    pub fn port(&self, name: &str) -> Option<&Port> {
        self.ports.iter().find(|p| p.name == name)
    }

    /// The instrument of that name.
    pub fn instrument(&self, name: &str) -> Option<&Instrument> {
        self.instruments.iter().find(|i| i.name == name)
    }

    /// The arms with what they hold, the left one first. A checked scene has a tool for every arm.
    pub fn tools(&self) -> Vec<Tool<'_>> {
        let mut all = Vec::new();
        for arm in &self.arms {
            let port = arm.port.as_deref().map(|name| self.port(name));
            // A port that is named and missing is a mistake, and not an arm without a port.
            if let (None | Some(Some(_)), Some(instrument)) = (port, self.instrument(&arm.instrument)) {
                all.push(Tool { arm, port: port.flatten(), instrument });
            }
        }
        all.sort_by_key(|tool| tool.arm.name);
        all
    }

    /// The first arm, the left one before the right one, whose instrument is of that kind.
    pub fn arm_with(&self, kind: InstrumentKind) -> Option<&Arm> {
        self.tools().into_iter().find(|tool| tool.instrument.kind == kind).map(|tool| tool.arm)
    }

    /// The arm that grasps: see [`PinEnd::Far`](crate::PinEnd::Far).
    pub fn grasping_arm(&self) -> Option<&Arm> {
        self.arm_with(InstrumentKind::Grasper)
    }

    /// The scene as TOML with every value, in a fixed order: the same scene always gives the same
    /// text.
    ///
    /// # Errors
    /// When a value has no place in TOML; none that a file could hold.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(|e| Error::Write(e.to_string()))
    }

    /// The hash by which replays identify the scene: xxh3 of its canonical form and of `contents`,
    /// the hashes of everything that it names by path or as a phantom (the specimen, then the arms'
    /// model files in order). The description and the specimen folder's path do not count: a
    /// description may change and a folder may move.
    ///
    /// # Errors
    /// As [`to_toml`](Self::to_toml).
    pub fn hash(&self, contents: &[u64]) -> Result<u64> {
        let mut scene = self.clone();
        scene.description.clear();
        if let Some(Source::Folder(_)) = self.specimen.source() {
            scene.specimen = SpecimenSource { seed: 0, ..SpecimenSource::folder("") };
        }
        // Organs of others are in the specimen's contents.
        scene.specimen.swapped.clear();
        let mut hash = Xxh3::new();
        hash.update(scene.to_toml()?.as_bytes());
        for content in contents {
            hash.update(&content.to_le_bytes());
        }
        Ok(hash.digest())
    }
}
