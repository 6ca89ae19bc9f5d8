//! Trocar as a library: a simulator for laparoscopic robot policies.
//!
//! The crates of the project are modules here, from the tissue of single organs to campaigns of
//! policies. [`prelude`] has the types that most programs need. The program of the same name is the
//! package `trocar-cli`.
//!
//! A soft sphere falls for half a second, as any body does:
//!
//! ```
//! use trocar::prelude::*;
//!
//! struct Sphere;
//! impl SignedDistance for Sphere {
//!     fn distance(&self, p: DVec3) -> f64 {
//!         p.length() - 0.01
//!     }
//! }
//!
//! let bounds = (DVec3::splat(-0.01), DVec3::splat(0.01));
//! let mesh = LatticeMesher::uniform(0.005).mesh_shape(&Sphere, bounds)?;
//! let tissue = Material {
//!     model: ConstitutiveModel::StableNeoHookean,
//!     young_modulus: 12e3,
//!     poisson_ratio: 0.45,
//!     density: 1050.0,
//!     viscosity: 70.0,
//! };
//! let mut builder = ModelBuilder::new().gravity(DVec3::new(0.0, 0.0, -9.81));
//! builder.body(BodyDescription {
//!     name: "sphere".to_owned(),
//!     mesh: &mesh,
//!     material: tissue,
//!     pinned: Vec::new(),
//!     supports: Vec::new(),
//! })?;
//! let model = builder.build()?;
//! let mut state = State::new(&model);
//! let mut stepper = Stepper::new(&model, SolverSettings::default(), 1.0 / 60.0, 1)?;
//! for _ in 0..30 {
//!     stepper.step(&model, &mut state, &[]);
//! }
//! let fallen = -state.centroid(&model, 0, &[0]).z;
//! assert!((fallen - 0.5 * 9.81 * 0.5 * 0.5).abs() < 0.06);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use trocar_camera as camera;
#[cfg(feature = "campaign")]
pub use trocar_campaign as campaign;
pub use trocar_cell as cell;
pub use trocar_core as core;
pub use trocar_geometry as geometry;
#[cfg(feature = "reconstruct")]
pub use trocar_identify as identify;
pub use trocar_lattice as lattice;
#[cfg(feature = "reconstruct")]
pub use trocar_measure as measure;
#[cfg(feature = "reconstruct")]
pub use trocar_phantom as phantom;
#[cfg(feature = "reconstruct")]
pub use trocar_reconstruct as reconstruct;
#[cfg(feature = "reconstruct")]
pub use trocar_recording as recording;
#[cfg(feature = "campaign")]
pub use trocar_remote as remote;
#[cfg(feature = "sensors")]
pub use trocar_render as render;
pub use trocar_robot as robot;
pub use trocar_scene as scene;
#[cfg(feature = "reconstruct")]
pub use trocar_segment as segment;
#[cfg(feature = "sensors")]
pub use trocar_sensors as sensors;
pub use trocar_specimen as specimen;
pub use trocar_task as task;
pub use trocar_tissue as tissue;
#[cfg(feature = "view")]
pub use trocar_view as view;
#[cfg(feature = "reconstruct")]
pub use trocar_workflow as workflow;

/// The types that most programs need.
pub mod prelude {
    pub use glam::{DQuat, DVec3};
    pub use trocar_cell::{Action, Cell, CellReport, Setpoint};
    pub use trocar_core::{Pose, Progress, Silent};
    pub use trocar_geometry::{LatticeMesher, Mesher, SignedDistance, TetMesh, TriMesh};
    pub use trocar_scene::{Scene, TaskName};
    pub use trocar_specimen::Specimen;
    pub use trocar_task::policy::{Script, Scripted};
    pub use trocar_task::{Episode, Policy, Recording, Summary};
    pub use trocar_tissue::{
        BodyDescription, ConstitutiveModel, Material, Model, ModelBuilder, SolverSettings, State, StepReport, Stepper,
    };
}
