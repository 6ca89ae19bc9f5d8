//! A stage: shapes, bodies and lights, and the queries of rays on it.

mod model;
mod queries;

pub use model::{BodyId, ShapeId, Stage};
pub(crate) use model::{BodyView, StageHit, Surface, rotation_of};
pub(crate) use queries::BundleCandidates;
pub use queries::RayHit;
