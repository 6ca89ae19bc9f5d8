//! Ray-traced camera images of meshes.
//!
//! [`render`] sees a [`Stage`] (shapes that deform, bodies with poses, lights) through an [`Eye`] (any camera model): colour, metric
//! depth, labels and normals in one pass, quickly ([`Settings::Preview`]) or by path tracing ([`Settings::Path`]).
//! [`Scene`] draws the plain pictures of recordings and reports: one light, wireframes, double precision.
//! All of it is deterministic for any number of threads.

mod error;
mod eye;
mod film;
mod light;
mod material;
mod microfacet;
mod path;
mod picture;
mod preview;
pub mod random;
mod scene;
mod shade;
pub mod srgb;
mod stage;
mod trace;
mod tree;

pub use error::{Error, Result};
pub use eye::Eye;
pub use film::{Film, Noise};
pub use light::Light;
pub use material::{Look, SurfaceKind};
pub use picture::{Picture, Settings, render, render_into};
pub use scene::{Frame, Instance, Scene, Shading, label_mask};
pub use stage::{BodyId, Meeting, ShapeId, Stage};
