//! Camera images of triangle meshes, rasterised or ray traced.
//!
//! [`render`] renders a [`Stage`] (shapes that deform, bodies with poses, lights) through a
//! [`RayGenerator`] (any camera model). One pass gives colour, metric depth, labels and normals,
//! either with direct light only or by path tracing ([`RenderSettings::Path`]). Direct light is
//! rasterised ([`RenderSettings::Preview`], and [`RenderSettings::Smooth`] with smooth edges);
//! [`RenderSettings::Traced`] casts a ray per pixel and is its reference. [`phong::PhongScene`] is
//! a second, simpler renderer for phantoms and the figures of reports: one light, wireframes,
//! double precision.
//!
//! The result does not depend on the number of threads.
//!
//! ```
//! use glam::DVec3;
//! use trocar_camera::Camera;
//! use trocar_core::Pose;
//! use trocar_geometry::TriMesh;
//! use trocar_render::{Appearance, Film, Light, RayGenerator, RenderSettings, Stage, render};
//!
//! // A triangle 0.2 m in front of a camera, lit by a lamp beside the lens.
//! let corners = [[-0.1, -0.1, 0.2], [0.1, -0.1, 0.2], [0.0, 0.1, 0.2]];
//! let mesh = TriMesh {
//!     vertices: corners.map(DVec3::from).to_vec(),
//!     triangles: vec![[0, 1, 2]],
//!     colors: Vec::new(),
//! };
//! let mut stage = Stage::new();
//! stage.add_mesh(&mesh, 1, &Appearance::tissue([190, 90, 80]))?;
//! stage.lights.push(Light::endoscope(&Pose::IDENTITY, 0.0025, 0.2));
//! let rays = RayGenerator::new(Camera::centred(64, 48, 0.9));
//! let settings = RenderSettings::preview();
//! let picture = render(&mut stage, &rays, &Pose::IDENTITY, &settings, &Film::endoscope());
//! let centre = 24 * 64 + 32;
//! assert_eq!(picture.labels[centre], 1);
//! assert!((picture.depth.depth[centre] - 0.2).abs() < 1e-6);
//! # Ok::<(), trocar_render::Error>(())
//! ```

mod antialias;
mod background;
mod bvh;
mod deferred;
mod denoise;
mod direct;
mod error;
mod film;
mod lanes;
mod light;
mod material;
mod microfacet;
mod path;
pub mod phong;
mod picture;
mod preview;
pub mod random;
mod raster;
mod rays;
mod render;
mod samples;
mod shading_frame;
pub mod srgb;
mod stage;
mod visibility;

pub use error::{Error, Result};
pub use film::{Film, Noise};
pub use light::Light;
pub use material::{Appearance, SurfaceKind};
pub use picture::Picture;
pub use rays::RayGenerator;
pub use render::{RenderSettings, render, render_into};
pub use stage::{BodyId, RayHit, ShapeId, Stage};
