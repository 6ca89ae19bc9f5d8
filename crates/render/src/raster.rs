//! Rasterisation: which triangle each pixel shows, without a ray per pixel.
//!
//! A shape is divided into clusters of neighbouring triangles. The picture is divided into bands of
//! rows. A band takes the clusters that it may show, moves their corners into the camera frame and
//! projects them, eight at a time, and keeps the triangles whose image covers the centre of a
//! pixel. A pixel is tested with its own ray (Olano and Greer 1997, "Triangle Scan Conversion using
//! 2D Homogeneous Coordinates"): the planes through the eye and the edges of the triangle give
//! coverage, the plane of the triangle gives depth. So distorted lenses and fisheyes are exact, and
//! nothing is clipped.
//!
//! No operation is fused and lanes never interact, so every instruction set gives the same bits. A
//! pixel shows the nearest triangle in whatever order triangles are drawn.

mod clusters;
mod triangle;
mod view;

pub(crate) use clusters::{Cluster, Clusters};
pub(crate) use triangle::{Eight, One};
pub(crate) use view::{NOTHING, Seen, View, Visibility};
