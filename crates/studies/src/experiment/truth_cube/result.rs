//! The figures of the study.

use super::cube::{self, Kind, Law};
use super::data::Beads;
use crate::statistics::median;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// By strain, in percent as the table writes it.
pub type ByStrain = BTreeMap<String, f64>;

/// The beads of the inner layers by one model of the cube.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CubeRow {
    /// Kind of the elements: tetrahedra (`linear`, `corrected`, `patches`, `quadratic`) or
    /// `lattice` in static equilibrium; `linear, stepped` and `lattice, stepped` by the solver of
    /// the cell.
    pub elements: String,
    /// Edge of the cells, which are six tetrahedra or a hexahedron each (mm).
    pub cell_mm: f64,
    /// Nodes.
    pub nodes: usize,
    /// Law of the material.
    pub law: String,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Median distance between a bead and where it was seen (mm).
    pub median_mm: ByStrain,
    /// Root of the mean square of these distances (mm).
    pub rms_mm: ByStrain,
    /// Median distance between a bead and where quadratic tetrahedra in cells of 10 mm put it, by
    /// the same law and ratio: the error of the mesh, without that of the measurement (mm). Empty
    /// for other laws than stable neo-Hookean.
    pub mesh_mm: ByStrain,
}

/// A guess without a model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GuessRow {
    /// `interpolation`, `rigid`, `affine`.
    pub guess: String,
    /// Median distance (mm).
    pub median_mm: ByStrain,
    /// Root of the mean square (mm).
    pub rms_mm: ByStrain,
}

/// The figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct TruthCubeResult {
    /// Median distance of the beads of the inner layers from where they were seen, by the row of
    /// the study's choice: one mesh and one Poisson's ratio for all strains (mm).
    pub median_bead_error_mm: ByStrain,
    /// The same if each column of beads is straight between its ends (mm).
    pub interpolation_error_mm: ByStrain,
    /// Noise of the measurement: distance of the outer beads from a smooth motion of their layers,
    /// root of the mean square (mm).
    pub noise_mm: ByStrain,
    /// The choice.
    pub chosen: CubeRow,
    /// Where the choice puts the beads of the inner layers, for the page: by strain.
    #[serde(skip)]
    pub predicted: Vec<Vec<DVec3>>,
    /// All models.
    pub rows: Vec<CubeRow>,
    /// The guesses.
    pub guesses: Vec<GuessRow>,
}

/// Median and root of the mean square (mm) of distances (m).
pub(super) fn figures(mut errors: Vec<f64>) -> [f64; 2] {
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    [1e3 * median(&mut errors), 1e3 * rms]
}

impl TruthCubeResult {
    /// From the rows of all models, of which one is chosen.
    pub(super) fn of(beads: &Beads, rows: Vec<CubeRow>, chosen: CubeRow, predicted: Vec<Vec<DVec3>>) -> Self {
        let mut guesses: Vec<GuessRow> = Vec::new();
        let mut noise_mm = ByStrain::new();
        for strain in &beads.strains {
            noise_mm.insert(strain.percent.clone(), 1e3 * cube::noise(beads, strain));
            for (k, (name, places)) in cube::guesses(beads, strain).into_iter().enumerate() {
                if guesses.len() == k {
                    let guess = name.to_owned();
                    guesses.push(GuessRow { guess, median_mm: ByStrain::new(), rms_mm: ByStrain::new() });
                }
                let [median, rms] = figures(cube::distances(&places, strain));
                guesses[k].median_mm.insert(strain.percent.clone(), median);
                guesses[k].rms_mm.insert(strain.percent.clone(), rms);
            }
        }
        Self {
            median_bead_error_mm: chosen.median_mm.clone(),
            interpolation_error_mm: guesses[0].median_mm.clone(),
            noise_mm,
            chosen,
            predicted,
            rows,
            guesses,
        }
    }
}

impl Kind {
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Corrected => "corrected",
            Self::Patches => "patches",
            Self::Quadratic => "quadratic",
        }
    }
}

impl Law {
    pub fn name(self) -> &'static str {
        use trocar_tissue::ConstitutiveModel as Model;
        match self {
            Self::Finite(Model::StableNeoHookean) => "stable-neo-hookean",
            Self::Finite(Model::StVenantKirchhoff) => "st-venant-kirchhoff",
            Self::Finite(Model::Corotated) => "corotated",
            Self::Linear => "linear-elasticity",
            Self::Rotated => "rotated-linear",
        }
    }

    /// The law of a lattice, if it has it.
    pub fn of_lattice(self) -> Option<trocar_lattice::Law> {
        use trocar_tissue::ConstitutiveModel as Model;
        match self {
            Self::Finite(Model::StableNeoHookean) => Some(trocar_lattice::Law::StableNeoHookean),
            Self::Rotated => Some(trocar_lattice::Law::Corotated),
            Self::Finite(Model::StVenantKirchhoff | Model::Corotated) | Self::Linear => None,
        }
    }
}
