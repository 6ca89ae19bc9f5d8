//! The specimen and its folder.

use crate::{Organ, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::Path;
use trocar_camera::{Camera, ColorImage};
use trocar_geometry::Pose;

/// Where a specimen comes from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Name of the recording or surface file (no directories).
    pub source: String,
    /// Hash of the input, hexadecimal.
    pub input_hash: String,
    /// Version of the program.
    pub program: String,
    /// The settings used, `name = value` in a fixed order.
    #[serde(default)]
    pub settings: Vec<String>,
}

/// Organs in their recorded arrangement.
#[derive(Clone, Debug)]
pub struct Specimen {
    /// Name.
    pub name: String,
    /// Unit vector against gravity in the recording frame.
    pub up: DVec3,
    /// From the recording frame to the cell frame; identity until a scene places it.
    pub placement: Pose,
    /// The recording camera; `None` for a specimen from a ready surface.
    pub camera: Option<Camera>,
    /// The organs.
    pub organs: Vec<Organ>,
    /// The composite the surfaces were coloured from.
    pub background: Option<ColorImage>,
    /// Origin.
    pub provenance: Provenance,
}

impl Specimen {
    /// Writes the folder `dir`, which must not exist or be an earlier specimen folder (one with a `specimen.toml`), which is
    /// then replaced. Written beside it first and moved into place, so that a failure leaves nothing half-written.
    pub fn write(&self, dir: &Path) -> Result<()> {
        let _ = dir;
        todo!()
    }

    /// Reads and checks a specimen folder. Unknown keys are errors that name the nearest right key; meshes are checked.
    pub fn read(dir: &Path) -> Result<Self> {
        let _ = dir;
        todo!()
    }
}
