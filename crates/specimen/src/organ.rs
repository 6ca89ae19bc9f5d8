//! One organ: meshes, material, pins.

use crate::{Posterior, Threads};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use trocar_geometry::{TetMesh, TriMesh};

/// Constitutive model by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MaterialModel {
    /// Stable neo-Hookean (Smith, De Goes, Kim 2018); the default.
    #[default]
    StableNeoHookean,
    /// St. Venant-Kirchhoff, the paper's.
    StVenantKirchhoff,
    /// Fixed corotated (Stomakhin and others 2012).
    Corotated,
}

/// Material of an organ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Constitutive model.
    #[serde(default)]
    pub model: MaterialModel,
    /// Young's modulus (Pa).
    pub young_modulus_pa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Density (kg/m3).
    pub density_kg_m3: f64,
}

impl Default for Material {
    /// 12 kPa, 0.45, 1200 kg/m3: the paper's appendix in the bimanual cell.
    fn default() -> Self {
        Self { model: MaterialModel::default(), young_modulus_pa: 12e3, poisson_ratio: 0.45, density_kg_m3: 1200.0 }
    }
}

/// One of the two ends of a tubular organ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum End {
    /// Organ coordinate s = 0.
    Base,
    /// Organ coordinate s = 1.
    Tip,
}

/// Which nodes of an organ are fixed at their recorded positions, in place of the mesentery and
/// ligaments that the camera does not see.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "rule", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Pins {
    /// None.
    None,
    /// The lowest `share` of the nodes by height.
    Band {
        /// Share of all nodes, in [0, 1].
        share: f64,
    },
    /// One end, and a band along the part next to it.
    End {
        /// Which end.
        end: End,
        /// Distance from that end, in the organ coordinate, within which every node is pinned.
        length: f64,
        /// Length of the part next to the end, in the organ coordinate, in which the lowest nodes
        /// are pinned too.
        #[serde(default)]
        band_length: f64,
        /// Share of that part's nodes, lowest first.
        #[serde(default)]
        band_share: f64,
    },
}

impl Default for Pins {
    /// The paper's share of pinned nodes (section IV-B, about 42%).
    fn default() -> Self {
        Self::Band { share: 0.42 }
    }
}

/// Measurements of an organ at its reconstruction; kept in `specimen.toml` for people and reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OrganFacts {
    /// Nodes of the tetrahedral mesh.
    pub nodes: usize,
    /// Tetrahedra.
    pub tets: usize,
    /// Whether the surface is closed.
    pub watertight: bool,
    /// Tetrahedra with volume at or below 0.
    pub inverted: usize,
    /// Smallest dihedral angle (degrees).
    pub min_dihedral_deg: f64,
    /// Median over elements of the smallest dihedral angle (degrees).
    pub median_dihedral_deg: f64,
    /// Median edge length (mm).
    pub median_edge_mm: f64,
    /// Volume (cm3).
    pub volume_cm3: f64,
    /// Median absolute depth error of the surface against its depth images (mm); recordings only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_error_median_mm: Option<f64>,
    /// Median signed depth error, surface minus measured (mm); recordings only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_error_signed_mm: Option<f64>,
    /// Share of the organ's mask pixels on which the error was measured; recordings only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covered: Option<f64>,
}

/// One organ of a specimen with its meshes.
#[derive(Clone, Debug)]
pub struct Organ {
    /// Name, and stem of its files: lower-case letters, digits, `-` and `_`.
    pub name: String,
    /// Tetrahedral mesh in the recording frame (m).
    pub body: TetMesh,
    /// Closed surface with vertex colours in the recording frame (m).
    pub surface: TriMesh,
    /// Material.
    pub material: Material,
    /// Pins.
    pub pins: Pins,
    /// Threads that hold it besides, if there are any.
    pub threads: Option<Threads>,
    /// What lifts tell about it.
    pub posterior: Option<Posterior>,
    /// A point nearer to the organ's base (s = 0) than to its tip (m).
    pub base: DVec3,
    /// Measurements.
    pub facts: OrganFacts,
}

/// Checks the name of an organ: 1 to 64 lower-case letters, digits, `-` and `_`, starting with a
/// letter or digit.
///
/// # Errors
/// The reason, in one line.
pub fn check_name(name: &str) -> Result<(), String> {
    let legal = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
    if name.is_empty() || name.len() > 64 || !name.chars().all(legal) || name.starts_with(['-', '_']) {
        return Err(format!(
            "'{name}' is not an organ name; it must have 1 to 64 lower-case letters, digits, '-' and '_', and start with a letter or digit"
        ));
    }
    Ok(())
}

impl Material {
    /// Checks the ranges in which the models are defined.
    ///
    /// # Errors
    /// "field is value; what would be right".
    pub fn validate(&self) -> Result<(), String> {
        if !(1.0..=1e9).contains(&self.young_modulus_pa) {
            return Err(format!(
                "young_modulus_pa is {}; it must be in [1, 1e9] Pa (soft tissue: about 1e4)",
                self.young_modulus_pa
            ));
        }
        if !(0.0..=0.4999).contains(&self.poisson_ratio) {
            return Err(format!(
                "poisson_ratio is {}; it must be in [0, 0.4999] (soft tissue: about 0.45)",
                self.poisson_ratio
            ));
        }
        if !(1.0..=30_000.0).contains(&self.density_kg_m3) {
            return Err(format!(
                "density_kg_m3 is {}; it must be in [1, 30000] kg/m3 (soft tissue: about 1050)",
                self.density_kg_m3
            ));
        }
        Ok(())
    }
}

impl Pins {
    /// Checks that shares and organ coordinates are in [0, 1].
    ///
    /// # Errors
    /// "field is value; what would be right".
    pub fn validate(&self) -> Result<(), String> {
        let fields: &[(&str, f64)] = match *self {
            Self::None => &[],
            Self::Band { share } => &[("share", share)],
            Self::End { length, band_length, band_share, .. } => {
                &[("length", length), ("band_length", band_length), ("band_share", band_share)]
            }
        };
        match fields.iter().find(|(_, v)| !(0.0..=1.0).contains(v)) {
            Some((name, v)) => Err(format!("{name} is {v}; it must be in [0, 1]")),
            None => Ok(()),
        }
    }
}
