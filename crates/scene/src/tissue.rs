//! How the tissue of a scene is stepped: backend, solver, contact, and the ground under the organs.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How tissue is stepped, by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ScheduleName {
    /// The quasi-Newton method to a tolerance.
    #[default]
    Fast,
    /// Vertex Block Descent, 8 substeps of 10 sweeps from the inertial predictor.
    Paper,
    /// The same with the adaptive start.
    Adaptive,
}

/// What of tissue touches instruments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ToolContactKind {
    /// The vertices of its surface: an instrument that is thinner than triangles are wide can pass
    /// between them.
    Vertices,
    /// Its vertices, edges and triangles.
    #[default]
    Surface,
}

/// Solver and contact of the tissue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Tissue {
    /// The model of the tissue: tetrahedra, or a lattice of hexahedra around each organ.
    #[serde(skip_serializing_if = "is_tetrahedra")]
    pub backend: BackendName,
    /// Edge of the lattice's cells (mm); 4 mm if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cell_mm: Option<f64>,
    /// Law of a lattice's tissue: stable-neo-hookean (if left out) or corotated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub law: Option<LatticeLaw>,
    /// Schedule: fast (the default solver), paper or adaptive (Vertex Block Descent).
    pub schedule: ScheduleName,
    /// Whether tetrahedra are softer than their organ by what its mesh is too stiff, so that the
    /// organ deflects as its material says.
    pub mesh_correction: bool,
    /// Distance at which contact between organs is looked for (mm).
    pub contact_offset_mm: f64,
    /// What of tissue touches instruments: vertices or surface.
    pub tool_contact: ToolContactKind,
    /// Distance at which tissue rests on the tips of instruments (mm).
    pub tip_rest_offset_mm: f64,
    /// Coulomb friction of tissue on tissue and of instruments on tissue.
    pub friction: f64,
    /// Pull at which tissue tears out of a compliant grasp (N).
    pub tear_force_n: f64,
    /// Pairs without contact: two organs, or an organ and `field`, the ground under the organs.
    pub filtered_pairs: Vec<[String; 2]>,
    /// The ground under the organs.
    pub support: Support,
}

impl Tissue {
    /// The same tissue on another backend, without the settings that only the other one has.
    #[must_use]
    pub fn on(self, backend: BackendName) -> Self {
        match backend {
            BackendName::Tetrahedra => Self { backend, cell_mm: None, law: None, ..self },
            BackendName::Lattice => Self { backend, schedule: ScheduleName::Fast, ..self },
        }
    }
}

impl Default for Tissue {
    /// The paper's figures (section IV-C).
    fn default() -> Self {
        Self {
            backend: BackendName::Tetrahedra,
            cell_mm: None,
            law: None,
            schedule: ScheduleName::Fast,
            mesh_correction: true,
            contact_offset_mm: 1.5,
            tool_contact: ToolContactKind::Surface,
            tip_rest_offset_mm: 1.5,
            friction: 0.6,
            // A wall of 1 mm (two layers of 0.5) over the 5 mm of the blades, at a strength of 1
            // MPa.
            tear_force_n: 5.0,
            filtered_pairs: Vec::new(),
            support: Support::default(),
        }
    }
}

/// The model of the tissue of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BackendName {
    /// The tetrahedra of the organs.
    #[default]
    Tetrahedra,
    /// A regular lattice of hexahedra around each organ, in which its nodes are embedded.
    Lattice,
}

impl BackendName {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Tetrahedra, Self::Lattice];

    /// Its name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tetrahedra => "tetrahedra",
            Self::Lattice => "lattice",
        }
    }

    /// The backend of that name; `tets` for short.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|backend| backend.name() == name).or((name == "tets").then_some(Self::Tetrahedra))
    }
}

/// A scene on tetrahedra is written as before there were others.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_tetrahedra(backend: &BackendName) -> bool {
    *backend == BackendName::Tetrahedra
}

/// Laws of tissue on a lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LatticeLaw {
    /// Rotated linear elasticity.
    Corotated,
    /// Stable neo-Hookean.
    #[default]
    StableNeoHookean,
}

/// The ground under the organs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Support {
    /// Its kind: imprint or none.
    pub kind: SupportKind,
    /// Coulomb friction of tissue on it.
    pub friction: f64,
}

impl Default for Support {
    fn default() -> Self {
        Self { kind: SupportKind::Imprint, friction: 0.6 }
    }
}

/// Kinds of support.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SupportKind {
    /// A surface under each organ that has its imprint.
    #[default]
    Imprint,
    /// None: only pins hold the organs.
    None,
}
