//! The visual shapes of links: meshes and primitives with pose and colour, for rendering only.

use glam::DVec3;
use std::path::PathBuf;
use trocar_core::Pose;

/// A visual shape of a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Visual {
    /// Name of the link or body.
    pub link: String,
    /// The shape.
    pub shape: VisualShape,
    /// Pose of the shape in the axes of the arm's link, or of the base.
    pub pose: Pose,
    /// sRGB, each in [0, 1].
    pub color: [f64; 3],
}

/// A shape of a [`Visual`], about its own origin.
#[derive(Clone, Debug, PartialEq)]
pub enum VisualShape {
    /// A mesh file in metres, its vertices times `scale` along each axis.
    Mesh {
        /// The file. It need not exist.
        file: PathBuf,
        /// Factors along x, y and z.
        scale: DVec3,
    },
    /// A box with these half-extents (m).
    Block(DVec3),
    /// A cylinder about z.
    Cylinder {
        /// Radius (m).
        radius: f64,
        /// Half the length (m).
        half: f64,
    },
    /// A cylinder about z with hemispherical ends.
    Capsule {
        /// Radius (m).
        radius: f64,
        /// Half the length without the ends (m).
        half: f64,
    },
    /// A sphere with this radius (m).
    Ball(f64),
}

/// Colour of shapes without one.
pub(super) const DEFAULT_COLOR: [f64; 3] = [0.7; 3];

/// The red, green and blue of a colour; `None` for a fully transparent one.
pub(super) fn opaque([r, g, b, a]: [f64; 4]) -> Option<[f64; 3]> {
    (a > 0.0).then(|| [r, g, b].map(|c| c.clamp(0.0, 1.0)))
}
