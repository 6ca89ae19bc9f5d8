//! A specimen: organs in their recorded arrangement.

use crate::organ::Organ;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use trocar_camera::{Camera, ColorImage};
use trocar_core::Pose;

/// The origin of a specimen.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Name of the recording or surface file, without folders.
    pub source: String,
    /// Hash of the input, hexadecimal.
    pub input_hash: String,
    /// Version of the program.
    pub program: String,
    /// The settings, as `name = value` in a fixed order.
    #[serde(default)]
    pub settings: Vec<String>,
}

/// Organs in their recorded arrangement.
///
/// ```no_run
/// # fn main() -> trocar_specimen::Result<()> {
/// use std::path::Path;
/// use trocar_specimen::Specimen;
///
/// let mut specimen = Specimen::read(Path::new("specimen"))?;
/// specimen.organs[0].material.young_modulus_pa = 6e3;
/// specimen.write(Path::new("softer"))?;
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Specimen {
    /// Name.
    pub name: String,
    /// Unit vector against gravity in the recording frame.
    pub up: DVec3,
    /// From the recording frame to the cell frame; the identity until a scene places it.
    pub placement: Pose,
    /// The recording camera; `None` for a specimen from a ready surface.
    pub camera: Option<Camera>,
    /// The organs.
    pub organs: Vec<Organ>,
    /// The composite that the surfaces' colours come from.
    pub background: Option<ColorImage>,
    /// Origin.
    pub provenance: Provenance,
}
