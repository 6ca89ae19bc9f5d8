//! Episode files: the actions of an episode, with which anyone can replay it and compare every
//! step.
//!
//! One line of JSON (scene text and hash, what was drawn, specimen hash, seed, program), then for
//! every step the action's numbers and the state's hash after it as little-endian binary, then xxh3
//! of all before it.

use crate::storage::write_whole;
use crate::{End, Episode, Error, OneSpecimen, Result, specimen_hash};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;
use trocar_cell::{Action, ActionSpace};
use trocar_scene::{ArmModel, CollisionMesh, Drawn, Scene, Source, Variation};
use trocar_specimen::{Specimen, parse_toml};
use xxhash_rust::xxh3::xxh3_64;

const FORMAT: &str = "trocar-episode";
/// Version 1 has no drawn values; the hashes of version 2 are of the text of an arm's state;
/// version 3 is of contact of vertices alone, without instruments against solids; rules of version
/// 4 switch contact off; the force guard of version 5 sees no torque; tissue of version 6 has no
/// limit of stretch; jaws of version 7 hold what one blade presses.
const VERSION: u32 = 8;

/// The first bytes of every episode file.
const START: &[u8] = b"{\"format\":\"trocar-episode\"";

/// What a file is that does not begin so.
const NO_EPISODE: &str = "is no episode file; name the folder of an episode, or its episode.trocar";

/// What is wrong with a file that does not exist.
const NO_FILE: &str = "no such file; name the folder of an episode, or its episode.trocar";

/// Largest file (bytes): a million steps.
const MAX_BYTES: u64 = 100 << 20;
/// Longest header line (bytes).
const MAX_HEADER: usize = 4 << 20;
/// Numbers of an arm in an action.
const NUMBERS: usize = 5;

/// The header of an episode file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Version of the program.
    pub program: String,
    /// The scene as TOML, every value in it, with the specimen that was drawn and nothing that
    /// varies.
    pub scene: String,
    /// The drawn values of the episode, as TOML: a replay draws nothing.
    #[serde(default)]
    pub drawn: String,
    /// The folder that paths in the scene start from.
    pub folder: String,
    /// See [`scene_hash`]; hexadecimal, as all hashes here.
    pub scene_hash: String,
    /// See [`specimen_hash`](crate::specimen_hash).
    pub specimen_hash: String,
    /// The episode's seed.
    pub seed: u64,
    /// Name of the policy.
    pub policy: String,
    /// Arms: an action has five numbers each.
    pub arms: usize,
    /// Hash of the state before the first step.
    pub start_hash: String,
    /// How it ended.
    pub end: Option<End>,
}

#[derive(Serialize, Deserialize)]
struct Line {
    format: String,
    version: u32,
    steps: usize,
    #[serde(flatten)]
    header: Header,
}

/// An episode as it is kept.
#[derive(Clone, Debug, PartialEq)]
pub struct EpisodeFile {
    /// The scene, specimen and seed of the episode.
    pub header: Header,
    /// Actions, each with the state's hash after it.
    pub steps: Vec<(Action, u64)>,
}

/// The result of a replay.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Every step gave the recorded state.
    pub same: bool,
    /// Steps of the file.
    pub steps: usize,
    /// The first step that differs, counted from 1; 0 for the start.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_difference: Option<usize>,
    /// The difference, in a sentence.
    pub said: String,
    /// Program that recorded it.
    pub recorded_by: String,
    /// This program.
    pub replayed_by: String,
}

/// The hash by which replays identify a scene: [`Scene::hash`] over the specimen's hash, the arms'
/// model files and the organs' collision surfaces.
///
/// # Errors
/// A file that cannot be read.
pub fn scene_hash(scene: &Scene, specimen: u64) -> Result<u64> {
    let mut contents = vec![specimen];
    for arm in &scene.arms {
        if let Some(ArmModel::Urdf(file) | ArmModel::Mjcf(file)) = arm.source() {
            let path = scene.resolve(file);
            let bytes = std::fs::read(&path).map_err(|source| Error::Io { path, source })?;
            contents.push(xxh3_64(&bytes));
        }
    }
    for organ in scene.organs.values() {
        if let CollisionMesh::File(file) = &organ.surfaces.collision {
            let path = scene.resolve(file);
            let bytes = std::fs::read(&path).map_err(|source| Error::Io { path, source })?;
            contents.push(xxh3_64(&bytes));
        }
    }
    Ok(scene.hash(&contents)?)
}

/// The scene as an episode file keeps it: with the specimen of that episode, and without what
/// varies between episodes. The drawn values are applied to it.
fn recorded(scene: &Scene, drawn: &Drawn) -> Scene {
    Scene { specimen: drawn.specimen.clone(), variation: Variation::default(), ..scene.clone() }
}

/// The same with the task's stages written out: a replay does not depend on the program's built-in
/// tasks. Files that were written before tasks were files do not have them.
fn written_out(scene: &Scene) -> Result<Scene> {
    Ok(Scene { task: scene.task.written_out()?, ..scene.clone() })
}

impl Header {
    /// Of an episode that stands at its start.
    ///
    /// # Errors
    /// As [`scene_hash`].
    pub fn of(episode: &Episode, policy: &str) -> Result<Self> {
        let scene = written_out(&recorded(episode.scene(), episode.drawn()))?;
        let folder = std::path::absolute(&scene.folder).unwrap_or_else(|_| scene.folder.clone());
        Ok(Self {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            scene: scene.to_toml()?,
            drawn: episode.drawn().to_toml()?,
            folder: folder.display().to_string(),
            scene_hash: hex(scene_hash(&scene, episode.specimen_hash())?),
            specimen_hash: hex(episode.specimen_hash()),
            seed: episode.seed(),
            policy: policy.to_owned(),
            arms: episode.cell().arms().len(),
            start_hash: hex(episode.state_hash()),
            end: None,
        })
    }
}

fn hex(hash: u64) -> String {
    format!("{hash:016x}")
}

impl EpisodeFile {
    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let line =
            Line { format: FORMAT.to_owned(), version: VERSION, steps: self.steps.len(), header: self.header.clone() };
        let invalid = |reason: String| Error::Invalid { path: path.to_owned(), reason };
        let mut bytes = serde_json::to_vec(&line).map_err(|e| invalid(format!("cannot be written: {e}")))?;
        bytes.push(b'\n');
        for (k, (action, hash)) in self.steps.iter().enumerate() {
            if action.numbers.len() != NUMBERS * self.header.arms {
                return Err(invalid(format!("step {} has {} numbers", k + 1, action.numbers.len())));
            }
            bytes.push(match action.space {
                ActionSpace::Pivots => 0,
                ActionSpace::Tip => 1,
            });
            action.numbers.iter().for_each(|n| bytes.extend(n.to_le_bytes()));
            bytes.extend(hash.to_le_bytes());
        }
        let sum = xxh3_64(&bytes);
        bytes.extend(sum.to_le_bytes());
        write_whole(path, &bytes)
    }

    /// Reads a file and checks that it is whole.
    ///
    /// # Errors
    /// Names the file and what is wrong with it.
    pub fn read(path: &Path) -> Result<Self> {
        let io = |source: std::io::Error| {
            if source.kind() == std::io::ErrorKind::NotFound {
                return Error::Invalid { path: path.to_owned(), reason: NO_FILE.to_owned() };
            }
            Error::Io { path: path.to_owned(), source }
        };
        let length = std::fs::metadata(path).map_err(io)?.len();
        if length > MAX_BYTES {
            let reason = format!("has {length} bytes; at most {MAX_BYTES} are read");
            return Err(Error::Invalid { path: path.to_owned(), reason });
        }
        let bytes = std::fs::read(path).map_err(io)?;
        Self::parse(&bytes).map_err(|reason| Error::Invalid { path: path.to_owned(), reason })
    }

    /// Reads the bytes of a file; says what is wrong with them.
    ///
    /// # Errors
    /// A sentence without the file's name.
    pub fn parse(bytes: &[u8]) -> std::result::Result<Self, String> {
        let end = bytes.iter().take(MAX_HEADER).position(|b| *b == b'\n');
        let end = end.ok_or(NO_EPISODE)?;
        let line: Line = serde_json::from_slice(&bytes[..end]).map_err(|e| {
            if bytes.starts_with(START) { format!("its header is damaged: {e}") } else { NO_EPISODE.to_owned() }
        })?;
        if line.format != FORMAT || line.version != VERSION {
            let (format, version) = (&line.format, line.version);
            return Err(format!("is {format:.60} version {version}; {FORMAT} version {VERSION} is read"));
        }
        if !(1..=2).contains(&line.header.arms) {
            return Err(format!("its header says {} arms; 1 or 2", line.header.arms));
        }
        let size = 1 + 8 * NUMBERS * line.header.arms + 8;
        let body = &bytes[end + 1..];
        let wanted = line.steps.checked_mul(size).and_then(|n| n.checked_add(8));
        if wanted != Some(body.len()) {
            let (steps, has) = (line.steps, body.len());
            return Err(format!(
                "{steps} steps of {size} bytes and a checksum of 8 should follow its header; {has} bytes do"
            ));
        }
        let (steps, sum) = body.split_at(body.len() - 8);
        if xxh3_64(&bytes[..bytes.len() - 8]).to_le_bytes() != sum {
            return Err("was changed after it was written: its checksum does not fit".to_owned());
        }
        let steps = steps.chunks_exact(size).enumerate().map(|(k, step)| {
            let space = match step[0] {
                0 => ActionSpace::Pivots,
                1 => ActionSpace::Tip,
                other => return Err(format!("step {}: its action space is {other}; 0 (pivots) or 1 (tip)", k + 1)),
            };
            let words = step[1..].chunks_exact(8).map(|w| u64::from_le_bytes(std::array::from_fn(|i| w[i])));
            let words: Vec<u64> = words.collect();
            let (numbers, hash) = words.split_at(words.len() - 1);
            Ok((Action { space, numbers: numbers.iter().map(|w| f64::from_bits(*w)).collect() }, hash[0]))
        });
        Ok(Self { steps: steps.collect::<std::result::Result<_, _>>()?, header: line.header })
    }

    /// The scene, whose specimen is looked for in the folder `specimen` if one is given.
    ///
    /// # Errors
    /// A scene that cannot be; a specimen that is not there.
    pub fn scene(&self, specimen: Option<&Path>) -> Result<Scene> {
        let mut scene: Scene =
            parse_toml(&self.header.scene).map_err(|e| Error::Option(format!("the episode's scene: {e}")))?;
        scene.folder = self.header.folder.clone().into();
        if let (Some(folder), Some(Source::Folder(_))) = (specimen, scene.specimen.source()) {
            let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
            scene.specimen.path = Some(folder.display().to_string());
        }
        scene.validate()?;
        Ok(scene)
    }

    /// The drawn values of the episode.
    ///
    /// # Errors
    /// A table that cannot be read.
    pub fn drawn(&self) -> Result<Drawn> {
        parse_toml(&self.header.drawn).map_err(|e| Error::Option(format!("what was drawn for the episode: {e}")))
    }

    /// Whether specimen, scene or an arm's model are others than the recorded ones, in a sentence;
    /// `None` where they are the same.
    ///
    /// # Errors
    /// A model file that cannot be read, a damaged header.
    pub fn other(&self, scene: &Scene, specimen: &Specimen) -> Result<Option<String>> {
        let header = &self.header;
        let found = specimen_hash(specimen);
        if hex(found) != header.specimen_hash {
            let said = format!("the specimen is another one: {}, not {}", hex(found), header.specimen_hash);
            return Ok(Some(said));
        }
        let scene = recorded(scene, &self.drawn()?);
        if hex(scene_hash(&scene, found)?) == header.scene_hash {
            return Ok(None);
        }
        let found = hex(scene_hash(&written_out(&scene)?, found)?);
        Ok((found != header.scene_hash)
            .then(|| format!("the scene or an arm's model is another one: {found}, not {}", header.scene_hash)))
    }

    /// The episode at its start, with `scene` of [`scene`](Self::scene).
    ///
    /// # Errors
    /// An episode that cannot be built.
    pub fn begin(&self, scene: &Scene, specimen: &Specimen, threads: usize) -> Result<Episode> {
        let supply = Box::new(OneSpecimen(Arc::new(specimen.clone())));
        Episode::begun(scene, supply, threads, self.header.seed, self.drawn()?)
    }

    /// Replays the episode with `specimen` and compares every step. A difference is a verdict, not
    /// an error. `watch` is asked before each step and returns false to stop.
    ///
    /// # Errors
    /// An episode that cannot be built; [`trocar_cell::Error::Interrupted`] when `watch` stops it.
    pub fn verify(
        &self,
        scene: &Scene,
        specimen: &Specimen,
        threads: usize,
        watch: &mut dyn FnMut() -> bool,
    ) -> Result<Verdict> {
        let header = &self.header;
        let differs = |at: Option<usize>, said: String| Verdict {
            same: false,
            steps: self.steps.len(),
            first_difference: at,
            said,
            recorded_by: header.program.clone(),
            replayed_by: env!("CARGO_PKG_VERSION").to_owned(),
        };
        if let Some(said) = self.other(scene, specimen)? {
            return Ok(differs(None, said));
        }
        let mut episode = self.begin(scene, specimen, threads)?;
        let start = hex(episode.state_hash());
        if start != header.start_hash {
            return Ok(differs(Some(0), format!("the start is another one: {start}, not {}", header.start_hash)));
        }
        for (k, (action, hash)) in self.steps.iter().enumerate() {
            if !watch() {
                return Err(trocar_cell::Error::Interrupted.into());
            }
            if let Err(why) = episode.step(action) {
                return Ok(differs(Some(k + 1), format!("step {} cannot be done: {why}", k + 1)));
            }
            let now = episode.state_hash();
            if now != *hash {
                let (time, number) = (episode.time(), k + 1);
                let said = format!("step {number} ({time:.3} s) gives {}, not {}", hex(now), hex(*hash));
                return Ok(differs(Some(number), said));
            }
        }
        // The actions do not contain an end that the policy chose.
        if let Some(end) = &header.end {
            episode.end_again(end);
        }
        if header.end.as_ref() != episode.end() {
            let name = |end: Option<&End>| end.map_or("no end", End::name);
            let said = format!("it ends with {}, not {}", name(episode.end()), name(header.end.as_ref()));
            return Ok(differs(Some(self.steps.len()), said));
        }
        let said = format!("all {} steps give the recorded states", self.steps.len());
        Ok(Verdict { same: true, ..differs(None, said) })
    }
}
