//! Ray-traced camera images of meshes.
//!
//! [`render`] sees a [`Stage`] (shapes that deform, bodies with poses, lights) through an [`RayGenerator`] (any camera model): colour, metric
//! depth, labels and normals in one pass, quickly ([`RenderSettings::Preview`]) or by path tracing ([`RenderSettings::Path`]).
//! [`phong::PhongScene`] draws the plain pictures of recordings and reports: one light, wireframes, double precision.
//! All of it is deterministic for any number of threads.

mod error;
mod film;
mod light;
mod material;
mod microfacet;
mod path;
pub mod phong;
mod picture;
mod preview;
pub mod random;
mod rays;
pub mod srgb;
mod stage;
mod tree;

pub use error::{Error, Result};
pub use film::{Film, Noise};
pub use light::Light;
pub use material::{Appearance, SurfaceKind};
pub use picture::{Picture, RenderSettings, render, render_into};
pub use rays::RayGenerator;
pub use stage::{BodyId, RayHit, ShapeId, Stage};
