//! The file: a line of JSON, then records compressed as one LZ4 frame, then xxh3 of all before it.
//!
//! A record is a byte and its contents, little-endian:
//!
//! - 1, meshes: the cube (lowest corner and step, four f64); for each organ the numbers of vertices
//!   and triangles (u32), the vertices' colours (3 bytes each) and the triangles (three u32 each).
//!   They hold until the next such record, which comes at the start, after a cut, and when
//!   something leaves the cube.
//! - 2, a frame: time (s) and score as f64; the state as f32; for each arm its links' poses, its
//!   gripper's pose and the angle of its jaws as f32 (a pose is seven numbers, scalar of the
//!   quaternion first); for each organ three 16-bit numbers a vertex as differences from the frame
//!   before, or from 0 after meshes, folded so that small ones of either sign are small (0, -1, 1,
//!   -2 as 0, 1, 2, 3), all low bytes before all high bytes.

use super::quantise::{Grid, read_differences, write_differences};
use crate::{Error, Result};
use glam::{DQuat, DVec3};
use lz4_flex::frame::{FrameDecoder, FrameEncoder};
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};
use std::path::Path;
use std::sync::Arc;
use trocar_camera::Camera;
use trocar_cell::Gripper;
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_sensors::{ArmPosture, Skins};
use xxhash_rust::xxh3::xxh3_64;

const FORMAT: &str = "trocar-surfaces";
const VERSION: u32 = 1;
/// Largest file (bytes), longest header line, most vertices or triangles of an organ, and most
/// organs, arms, links and numbers of a state.
const MAX_BYTES: u64 = 1 << 32;
const MAX_HEADER: usize = 1 << 20;
const MAX_VERTICES: u32 = 1 << 22;
const MAX_NAMES: usize = 1000;
/// Kinds of records.
const MESHES: u8 = 1;
const FRAME: u8 = 2;
/// Numbers of a pose.
const POSE: usize = 7;

/// The content of the first line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SurfacesHeader {
    /// Version of the program.
    pub program: String,
    /// Seed of the episode.
    pub seed: u64,
    /// Hash of its state before the first step: that of its episode file.
    pub start_hash: String,
    /// Control period (s).
    pub period_s: f64,
    /// Frames: one more than steps.
    pub frames: usize,
    /// The task's instruction, in words.
    pub prompt: String,
    /// Number of the task's stages.
    pub stages: usize,
    /// Names of the organs.
    pub organs: Vec<String>,
    /// The arms, left first.
    pub arms: Vec<RecordedArm>,
    /// The cameras. They do not move during an episode.
    pub cameras: Vec<RecordedCamera>,
    /// Names of the numbers of a state.
    pub state_names: Vec<String>,
    /// The numbers of actions, by action space.
    pub actions: Vec<ActionLimits>,
}

/// An arm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordedArm {
    /// Its side.
    pub name: String,
    /// Its model, such as `fr3`, or `ideal`.
    pub model: String,
    /// Number of its links' poses.
    pub links: usize,
}

/// A camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordedCamera {
    /// Its name.
    pub name: String,
    /// Its pose in the cell.
    pub pose: Pose,
    /// Its lens and native size.
    pub model: Camera,
    /// Width and height of the pictures that policies get (px).
    pub policy_size_px: [u32; 2],
}

/// The numbers of an action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActionLimits {
    /// `pivots` or `tip`.
    pub space: String,
    /// Their names.
    pub names: Vec<String>,
    /// Least values.
    pub low: Vec<f64>,
    /// Greatest values.
    pub high: Vec<f64>,
}

#[derive(Serialize, Deserialize)]
struct Line {
    format: String,
    version: u32,
    #[serde(flatten)]
    header: SurfacesHeader,
}

/// One moment of an episode.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceFrame {
    /// Simulated time (s).
    pub time_s: f64,
    /// How far the task is, from 0 to 1.
    pub score: f64,
    /// The observation of a policy.
    pub state: Vec<f32>,
    /// The arms.
    pub arms: Vec<ArmPosture>,
    /// The organs: their meshes, and the positions of the vertices (m).
    pub organs: Vec<(Arc<TriMesh>, Vec<DVec3>)>,
    /// The meshes are not those of the frame before.
    pub other_meshes: bool,
}

/// Writes records.
pub(super) struct Encoder {
    out: FrameEncoder<Vec<u8>>,
    grid: Option<Grid>,
    /// Numbers of the last frame, by organ.
    before: Vec<Vec<[u16; 3]>>,
    frames: usize,
}

fn failed(e: impl std::fmt::Display) -> Error {
    Error::Format(format!("surfaces cannot be compressed: {e}"))
}

impl Encoder {
    pub fn new() -> Self {
        Self { out: FrameEncoder::new(Vec::new()), grid: None, before: Vec::new(), frames: 0 }
    }

    /// Adds a frame. `same_meshes`: those of the frame before.
    pub fn add(
        &mut self,
        (time_s, score, state): (f64, f64, &[f64]),
        arms: &[ArmPosture],
        skins: &Skins,
        same_meshes: bool,
    ) -> Result<()> {
        let organs = skins.organs();
        let numbers = |grid: Grid, before: &[Vec<[u16; 3]>]| -> Option<Vec<Vec<[u16; 3]>>> {
            let of = |(k, organ): (usize, &trocar_sensors::SkinnedOrgan)| {
                let point = |(i, p): (usize, &DVec3)| {
                    // A position that is lost stays where it was.
                    let last = || before.get(k).and_then(|b| b.get(i)).copied().unwrap_or_default();
                    if p.is_finite() { grid.numbers(*p) } else { Some(last()) }
                };
                organ.positions().iter().enumerate().map(point).collect()
            };
            organs.iter().enumerate().map(of).collect()
        };
        let mut raw = Vec::new();
        let kept = self.grid.filter(|_| same_meshes).and_then(|grid| numbers(grid, &self.before));
        let now = match kept {
            Some(now) => now,
            None => {
                let grid = Grid::around(organs.iter().flat_map(|o| o.positions()));
                let grid = grid.ok_or_else(|| failed("no position is finite"))?;
                self.grid = Some(grid);
                self.before = vec![Vec::new(); organs.len()];
                raw.push(MESHES);
                grid.low.to_array().iter().chain([&grid.step]).for_each(|v| raw.extend(v.to_le_bytes()));
                for organ in organs {
                    let mesh = organ.mesh();
                    raw.extend((mesh.vertices.len() as u32).to_le_bytes());
                    raw.extend((mesh.triangles.len() as u32).to_le_bytes());
                    raw.extend(mesh.colors.as_flattened());
                    mesh.triangles.as_flattened().iter().for_each(|v| raw.extend(v.to_le_bytes()));
                }
                numbers(grid, &[]).ok_or_else(|| failed("a position is not in its cube"))?
            }
        };
        raw.push(FRAME);
        raw.extend(time_s.to_le_bytes());
        raw.extend(score.to_le_bytes());
        state.iter().for_each(|v| raw.extend((*v as f32).to_le_bytes()));
        for arm in arms {
            for pose in arm.links.iter().chain([&arm.gripper.pose]) {
                let (r, t) = (pose.rotation, pose.translation);
                [r.w, r.x, r.y, r.z, t.x, t.y, t.z].iter().for_each(|v| raw.extend((*v as f32).to_le_bytes()));
            }
            raw.extend((arm.gripper.jaw_angle as f32).to_le_bytes());
        }
        for (now, before) in now.iter().zip(&mut self.before) {
            write_differences(now, before, &mut raw);
        }
        self.frames += 1;
        self.out.write_all(&raw).map_err(failed)
    }

    /// The bytes of the file.
    pub fn finish(self, header: SurfacesHeader) -> Result<Vec<u8>> {
        let header = SurfacesHeader { frames: self.frames, ..header };
        let line = Line { format: FORMAT.to_owned(), version: VERSION, header };
        let mut bytes = serde_json::to_vec(&line).map_err(failed)?;
        bytes.push(b'\n');
        bytes.extend(self.out.finish().map_err(failed)?);
        let sum = xxh3_64(&bytes);
        bytes.extend(sum.to_le_bytes());
        Ok(bytes)
    }
}

/// Reads the bytes of a file.
///
/// # Errors
/// Names the file: too large, unreadable.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    let length = std::fs::metadata(path).map_err(io)?.len();
    if length > MAX_BYTES {
        let reason = format!("has {length} bytes; at most {MAX_BYTES} are read");
        return Err(Error::Mismatch(format!("{}: {reason}", path.display())));
    }
    std::fs::read(path).map_err(io)
}

/// Reads frames one after the other.
pub(super) struct Decoder {
    pub header: SurfacesHeader,
    body: FrameDecoder<std::io::Cursor<Vec<u8>>>,
    grid: Option<Grid>,
    meshes: Vec<Arc<TriMesh>>,
    before: Vec<Vec<[u16; 3]>>,
    read: usize,
}

type Said<T> = std::result::Result<T, String>;

impl Decoder {
    /// Checks the bytes of a file; says what is wrong with them.
    pub fn new(bytes: Vec<u8>) -> Said<Self> {
        let end = bytes.iter().take(MAX_HEADER).position(|b| *b == b'\n');
        let end = end.ok_or("is no file of surfaces: it has no header line")?;
        let line: Line = serde_json::from_slice(&bytes[..end]).map_err(|e| format!("its header is damaged: {e}"))?;
        if line.format != FORMAT || line.version != VERSION {
            let (format, version) = (&line.format, line.version);
            return Err(format!("is {format:.60} version {version}; {FORMAT} version {VERSION} is read"));
        }
        let last = bytes.len().checked_sub(8).filter(|last| *last > end).ok_or("ends after its header")?;
        if xxh3_64(&bytes[..last]).to_le_bytes() != bytes[last..] {
            return Err("was changed after it was written: its checksum does not fit".to_owned());
        }
        let header = line.header;
        let links = header.arms.iter().map(|a| a.links).max().unwrap_or(0);
        let counts = [header.organs.len(), header.arms.len(), links, header.state_names.len()];
        if counts.iter().any(|n| *n > MAX_NAMES) || header.period_s.is_nan() || header.period_s <= 0.0 {
            return Err("its header is damaged: it has too many names, or no control period".to_owned());
        }
        let mut body = std::io::Cursor::new(bytes);
        body.set_position(end as u64 + 1);
        let body = FrameDecoder::new(body);
        Ok(Self { header, body, grid: None, meshes: Vec::new(), before: Vec::new(), read: 0 })
    }

    /// The next frame; `None` after the last.
    pub fn next(&mut self) -> Said<Option<SurfaceFrame>> {
        if self.read == self.header.frames {
            return Ok(None);
        }
        let mut kind = self.bytes(1)?[0];
        let other_meshes = kind == MESHES;
        if other_meshes {
            self.read_meshes()?;
            kind = self.bytes(1)?[0];
        }
        let Some(grid) = self.grid.filter(|_| kind == FRAME) else {
            return Err(format!("frame {} is damaged: a record is of kind {kind}", self.read));
        };
        let times = self.doubles(2)?;
        let state = self.floats(self.header.state_names.len())?;
        let mut arms = Vec::new();
        for k in 0..self.header.arms.len() {
            let count = self.header.arms[k].links + 1;
            let numbers = self.floats(POSE * count + 1)?;
            let mut poses: Vec<Pose> = numbers.chunks_exact(POSE).map(pose).collect();
            let (Some(jaws), Some(last)) = (numbers.last(), poses.pop()) else {
                return Err(format!("frame {} is damaged: an arm has no pose", self.read));
            };
            arms.push(ArmPosture { links: poses, gripper: Gripper { pose: last, jaw_angle: f64::from(*jaws) } });
        }
        let mut organs = Vec::new();
        for k in 0..self.meshes.len() {
            let differences = self.bytes(6 * self.before[k].len())?;
            read_differences(&differences, &mut self.before[k]);
            let positions = self.before[k].iter().map(|n| grid.point(*n)).collect();
            organs.push((Arc::clone(&self.meshes[k]), positions));
        }
        self.read += 1;
        Ok(Some(SurfaceFrame { time_s: times[0], score: times[1], state, arms, organs, other_meshes }))
    }

    fn read_meshes(&mut self) -> Said<()> {
        let cube = self.doubles(4)?;
        let grid = Grid { low: DVec3::new(cube[0], cube[1], cube[2]), step: cube[3] };
        if !(grid.low.is_finite() && grid.step.is_finite() && grid.step > 0.0) {
            return Err(format!("frame {} is damaged: its cube is no cube", self.read));
        }
        (self.grid, self.meshes, self.before) = (Some(grid), Vec::new(), Vec::new());
        for k in 0..self.header.organs.len() {
            let [vertices, triangles] = [self.count()?, self.count()?];
            let colors = self.bytes(3 * vertices as usize)?;
            let indices = self.bytes(12 * triangles as usize)?;
            let indices: Vec<u32> =
                indices.chunks_exact(4).map(|b| u32::from_le_bytes(std::array::from_fn(|i| b[i]))).collect();
            if indices.iter().any(|v| *v >= vertices) {
                let name = &self.header.organs[k];
                return Err(format!("frame {} is damaged: organ '{name}' has a triangle without vertex", self.read));
            }
            self.meshes.push(Arc::new(TriMesh {
                vertices: vec![DVec3::ZERO; vertices as usize],
                triangles: indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
                colors: colors.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
            }));
            self.before.push(vec![[0; 3]; vertices as usize]);
        }
        Ok(())
    }

    fn count(&mut self) -> Said<u32> {
        let bytes = self.bytes(4)?;
        let count = u32::from_le_bytes(std::array::from_fn(|i| bytes[i]));
        if count > MAX_VERTICES {
            return Err(format!("frame {} is damaged: a mesh has {count} vertices or triangles", self.read));
        }
        Ok(count)
    }

    fn doubles(&mut self, count: usize) -> Said<Vec<f64>> {
        let bytes = self.bytes(8 * count)?;
        Ok(bytes.chunks_exact(8).map(|b| f64::from_le_bytes(std::array::from_fn(|i| b[i]))).collect())
    }

    fn floats(&mut self, count: usize) -> Said<Vec<f32>> {
        let bytes = self.bytes(4 * count)?;
        Ok(bytes.chunks_exact(4).map(|b| f32::from_le_bytes(std::array::from_fn(|i| b[i]))).collect())
    }

    fn bytes(&mut self, count: usize) -> Said<Vec<u8>> {
        let mut bytes = Vec::new();
        let read = self.body.by_ref().take(count as u64).read_to_end(&mut bytes);
        match read {
            Ok(n) if n == count => Ok(bytes),
            Ok(_) => Err(format!("ends in frame {} of {}", self.read, self.header.frames)),
            Err(e) => Err(format!("frame {} is damaged: {e}", self.read)),
        }
    }
}

/// A pose of seven numbers.
fn pose(numbers: &[f32]) -> Pose {
    let [w, x, y, z, right, up, ahead] =
        std::array::from_fn(|k| f64::from(numbers.get(k).copied().unwrap_or_default()));
    let rotation = DQuat::from_xyzw(x, y, z, w);
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    Pose { rotation, translation: DVec3::new(right, up, ahead) }
}
