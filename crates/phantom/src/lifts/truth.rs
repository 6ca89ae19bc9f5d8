//! The known truth of filmed lifts: `truth/lifts.toml`, and per lift the surfaces of its equilibria
//! and the tracks of the centreline.
//!
//! ```text
//! truth/lifts.toml                tissue, supports, lifts
//! truth/lift-0/key-00.ply         the organ's surface at each equilibrium (m)
//! truth/lift-0/centreline.csv     frame, place along the organ, centreline, front above it (m)
//! ```

use super::support::HiddenSupport;
use crate::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use trocar_geometry::TriMesh;
use trocar_geometry::io::{Unit, read_surface, write_ply};
use trocar_specimen::{Threads, read_toml};

/// The file that lists the lifts, within the folder `truth/`.
pub const LIFTS_FILE: &str = "lifts.toml";

/// What is known about the lifts of a phantom.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LiftsTruth {
    /// The lifted organ.
    pub organ: String,
    /// Its length (m).
    pub length_m: f64,
    /// The material model.
    pub model: String,
    /// Young's modulus (Pa).
    pub young_modulus_pa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Density (kg/m3).
    pub density_kg_m3: f64,
    /// Cell of the mesh (m), and its nodes and elements.
    pub cell_m: f64,
    /// Number of nodes.
    pub nodes: usize,
    /// Number of tetrahedra.
    pub tets: usize,
    /// What holds the organ besides its bed.
    pub support: HiddenSupport,
    /// The threads of the support.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub threads: Option<Threads>,
    /// The lifts, in the order of the recording.
    #[serde(default, rename = "lift")]
    pub lifts: Vec<LiftTruth>,
}

/// What is known about one lift.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LiftTruth {
    /// Frame before the grasp.
    pub rest: usize,
    /// First frame of the lift.
    pub first: usize,
    /// Last frame of the lift.
    pub last: usize,
    /// Organ coordinate of the grasp.
    pub grasp_s: f64,
    /// Where the jaws hold the tissue at rest, in the camera frame (m).
    pub grasp_m: [f64; 3],
    /// Displacement of the held tissue at the end (m).
    pub displacement_m: [f64; 3],
    /// Share of the displacement at each equilibrium, from 0 to 1.
    pub keys: Vec<f64>,
    /// Share of the displacement in each frame from `rest` to `last`. Between equilibria, points
    /// move on straight lines.
    pub progress: Vec<f64>,
}

impl LiftsTruth {
    /// Reads the truth in the folder `truth`; `None` if it has no lifts.
    ///
    /// # Errors
    /// Names the file and the field that is wrong.
    pub fn read(truth: &Path) -> Result<Option<Self>> {
        let path = truth.join(LIFTS_FILE);
        if !path.is_file() {
            return Ok(None);
        }
        let read: Self = read_toml(&path).map_err(trocar_recording::Error::from)?;
        for (i, lift) in read.lifts.iter().enumerate() {
            let frames = lift.last.checked_sub(lift.rest).map(|n| n + 1);
            let rises = lift.keys.len() > 1 && lift.keys.windows(2).all(|k| k[0] < k[1]);
            let reason = if frames != Some(lift.progress.len()) {
                "progress has another number of values than there are frames from rest to last"
            } else if !rises {
                "keys does not rise; it must have at least two numbers, each above the one before"
            } else {
                continue;
            };
            return Err(Error::Option(format!("{}: lift[{i}].{reason}", path.display())));
        }
        Ok(Some(read))
    }
}

impl LiftTruth {
    /// The surfaces of the lift with this number at its equilibria.
    ///
    /// # Errors
    /// Names the file that is missing or broken.
    pub fn surfaces(&self, truth: &Path, number: usize) -> Result<Vec<TriMesh>> {
        (0..self.keys.len()).map(|k| Ok(read_surface(&key_file(truth, number, k), Unit::Metre)?)).collect()
    }

    /// The two equilibria around a frame, and the share of the way from the first to the second.
    pub fn between(&self, frame: usize) -> (usize, usize, f64) {
        let share = frame.checked_sub(self.rest).and_then(|k| self.progress.get(k)).copied().unwrap_or(0.0);
        let after = self.keys.iter().position(|key| *key >= share).unwrap_or(self.keys.len() - 1).max(1);
        let (a, b) = (self.keys[after - 1], self.keys[after]);
        (after - 1, after, ((share - a) / (b - a)).clamp(0.0, 1.0))
    }
}

fn key_file(truth: &Path, number: usize, key: usize) -> PathBuf {
    truth.join(format!("lift-{number}")).join(format!("key-{key:02}.ply"))
}

/// Writes the surface of an equilibrium.
pub(super) fn write_key(truth: &Path, number: usize, key: usize, surface: &TriMesh) -> Result<()> {
    Ok(write_ply(&key_file(truth, number, key), surface)?)
}

/// The track of one frame: places along the organ (m), centreline and front (m).
pub(super) struct TrackRow {
    pub frame: usize,
    pub along: f64,
    pub centre: DVec3,
    pub front: DVec3,
}

/// Writes the tracks of a lift.
pub(super) fn write_tracks(truth: &Path, number: usize, rows: &[TrackRow]) -> Result<()> {
    let path = truth.join(format!("lift-{number}")).join("centreline.csv");
    let mut text = String::from("frame,along_m,x_m,y_m,z_m,front_x_m,front_y_m,front_z_m\n");
    for TrackRow { frame, along, centre: c, front: f } in rows {
        text.push_str(&format!(
            "{frame},{along:.4},{:.7},{:.7},{:.7},{:.7},{:.7},{:.7}\n",
            c.x, c.y, c.z, f.x, f.y, f.z
        ));
    }
    std::fs::write(&path, text).map_err(io(&path))
}

/// Writes `lifts.toml`.
pub(super) fn write(truth: &Path, lifts: &LiftsTruth) -> Result<()> {
    let path = truth.join(LIFTS_FILE);
    let text = toml::to_string(lifts).map_err(|e| Error::Option(format!("{}: {e}", path.display())))?;
    std::fs::write(&path, text).map_err(io(&path))
}

/// Makes the folder of a lift.
pub(super) fn make_folder(truth: &Path, number: usize) -> Result<()> {
    let path = truth.join(format!("lift-{number}"));
    std::fs::create_dir_all(&path).map_err(io(&path))
}

fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Error {
    let path = path.to_owned();
    move |source| trocar_recording::Error::Io { path, source }.into()
}
