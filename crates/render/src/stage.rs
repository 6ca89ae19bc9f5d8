//! A stage: shapes, bodies and lights, and the queries of rays on it.

mod model;
mod queries;
mod surface;
mod vertex;

pub use model::{BodyId, ShapeId, Stage};
pub(crate) use model::{BodyView, StageHit, rotation_of};
pub(crate) use queries::BundleCandidates;
pub use queries::RayHit;
pub(crate) use surface::{Surface, Surfaces, turned};
