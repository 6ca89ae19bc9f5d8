//! Scenes for benchmarks, experiments and tests.
//!
//! [`Organs`] are read from a mesh file or procedural. A [`BenchScene`] is a model of them with
//! patches of nodes that move along a path: [`BenchScene::sag`], [`BenchScene::drag`],
//! [`BenchScene::shake`], [`BenchScene::moving`], [`BenchScene::tube`], [`BenchScene::fall`].
//! [`Run`] steps it by a solver, [`OracleRun`] by the oracle.

mod error_norms;
mod laparoscopic;
mod organs;
mod run;
mod scene;
mod shapes;

pub use error_norms::{mean_error, rms_error};
pub use laparoscopic::{LaparoscopicScene, view as endoscope_view};
pub use organs::{Organ, Organs};
pub(crate) use run::reference;
pub use run::{OracleRun, Run, grasps, rest_positions, tools};
pub(crate) use scene::GRAVITY;
pub use scene::{BenchScene, FRAME, Motion, Patch, SCENES, material};
pub use shapes::ellipsoid;
