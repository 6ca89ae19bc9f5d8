//! What the links of a description look like: meshes and simple shapes, each with its pose and colour. Only for pictures; no force knows of it.

use glam::DVec3;
use std::path::PathBuf;
use trocar_core::Pose;

/// A shape that a description shows of a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Visual {
    /// Name of the link or body that has it.
    pub link: String,
    /// Its shape.
    pub shape: VisualShape,
    /// Pose of the shape in the axes of the arm's link (of the base for what does not move).
    pub pose: Pose,
    /// sRGB, 0 to 1 each.
    pub color: [f64; 3],
}

/// A shape of a [`Visual`], about its own origin.
#[derive(Clone, Debug, PartialEq)]
pub enum VisualShape {
    /// A mesh file in metres, its vertices times `scale` along each axis.
    Mesh {
        /// The file, which nobody has looked for yet.
        file: PathBuf,
        /// Factors along x, y and z.
        scale: DVec3,
    },
    /// A box with these halves of its sides [m].
    Block(DVec3),
    /// A cylinder about z.
    Cylinder {
        /// Radius [m].
        radius: f64,
        /// Half its length [m].
        half: f64,
    },
    /// A cylinder about z with round ends.
    Capsule {
        /// Radius [m].
        radius: f64,
        /// Half its length without the ends [m].
        half: f64,
    },
    /// A ball with this radius [m].
    Ball(f64),
}

/// Colour of what has none.
pub(super) const PLAIN: [f64; 3] = [0.7; 3];

/// The first three of four numbers of a colour; `None` for what cannot be seen through its last.
pub(super) fn opaque([r, g, b, a]: [f64; 4]) -> Option<[f64; 3]> {
    (a > 0.0).then(|| [r, g, b].map(|c| c.clamp(0.0, 1.0)))
}
