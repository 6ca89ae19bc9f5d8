//! Bounding volume hierarchy with eight children per node and eight triangles per leaf. obvhs
//! builds it; it is refitted when the triangles move. A ray is tested against eight boxes or eight
//! triangles at a time.
//!
//! No operation is fused and lanes never interact, so every instruction set gives the same bits.

mod beam;
mod block;
mod boxes;
mod build;
mod node;
mod ray;
#[cfg(test)]
mod tests;
mod triangles;

pub(crate) use beam::Beam;
pub(crate) use boxes::{BoxTree, Stack, Stacks, Visitor};
pub(crate) use node::{Bounds, ROOT};
pub(crate) use ray::Ray;
pub(crate) use triangles::TriangleTree;
