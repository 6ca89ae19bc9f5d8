//! Meshers: tetrahedral bodies from surfaces and signed distances.

mod bcc;
mod blocks;
mod body;
#[cfg(test)]
mod bound;
mod cuts;
mod fill;
mod interface;
mod lattice;
mod octree;
mod points;
mod stencil;
mod tetgen;

pub use interface::Mesher;
pub use lattice::LatticeMesher;
pub use tetgen::TetgenMesher;
