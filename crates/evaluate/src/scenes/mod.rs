//! The scenes that benchmarks, experiments and tests step: the same ones, built in one place.
//!
//! [`Organs`] are read from a mesh file or made by ourselves. A [`Scene`] is a model of them with patches of nodes that are carried along a path: [`Scene::sag`],
//! [`Scene::drag`], [`Scene::shake`], [`Scene::moving`], [`Scene::tube`], [`Scene::fall`]. [`Run`] steps it by a schedule, [`OracleRun`] by the oracle.

mod error_norms;
mod laparoscopic;
mod organs;
mod run;
mod scene;
mod shapes;
mod solvers;

pub use error_norms::{mean_error, rms_error};
pub(crate) use laparoscopic::{LaparoscopicScene, view as endoscope_view};
pub use organs::{Organ, Organs};
pub use run::{OracleRun, Run};
pub(crate) use run::{grasps, rest_positions, tools};
pub use scene::{Motion, Patch, SCENES, Scene, material};
pub(crate) use shapes::ellipsoid;
pub use solvers::{SOLVERS, iterations_of, one_substep, solver_named};

/// Length of a frame [s].
pub const FRAME: f64 = 1.0 / 60.0;
