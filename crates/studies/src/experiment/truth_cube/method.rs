//! How a model of the cube is made and solved.

use super::cube::{Cube, Kind, Law};
use super::data::Strain;
use super::lattice::LatticeCube;
use super::stepped::SteppedCube;
use crate::Result;
use glam::DVec3;

/// Elements and solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Method {
    /// Tetrahedra in static equilibrium.
    Tetrahedra(Kind),
    /// A lattice of hexahedra in static equilibrium.
    Lattice,
    /// Linear tetrahedra, stepped by the solver of the cell until they rest.
    SteppedTetrahedra,
    /// The same with the lattice backend.
    SteppedLattice,
}

/// A model of the cube, for any compression.
pub(super) struct Model<'a> {
    /// Edge of a cell (mm).
    pub cell_mm: f64,
    /// Number of nodes.
    pub nodes: usize,
    predict: Predict<'a>,
}

/// Places of the inner beads (m).
type Predict<'a> = Box<dyn Fn(&Strain) -> Result<Vec<DVec3>> + 'a>;

impl Method {
    /// The model with `cells` cells of tetrahedra across the cube, or as many layers of a
    /// lattice's.
    ///
    /// # Errors
    /// A law that the elements do not have.
    pub fn model<'a>(self, cube: &'a Cube<'a>, cells: usize, law: Law, poisson_ratio: f64) -> Result<Model<'a>> {
        let cell_mm = 80.0 / cells as f64;
        Ok(match self {
            Self::Tetrahedra(kind) => {
                let elements = cube.elements(kind, cells, law, poisson_ratio);
                let nodes = elements.rest().len();
                Model { cell_mm, nodes, predict: Box::new(move |strain| cube.predict(&elements, law, strain)) }
            }
            Self::Lattice => {
                let lattice = LatticeCube::new(cube, cells, law, poisson_ratio)?;
                let (cell_mm, nodes) = (1e3 * lattice.cell(), lattice.nodes());
                Model { cell_mm, nodes, predict: Box::new(move |strain| lattice.predict(strain)) }
            }
            Self::SteppedTetrahedra | Self::SteppedLattice => {
                let stepped = if self == Self::SteppedLattice {
                    SteppedCube::of_lattice(cube, cells, poisson_ratio)?
                } else {
                    SteppedCube::of_tetrahedra(cube, cells, poisson_ratio)?
                };
                let (cell_mm, nodes) = (stepped.cell().map_or(cell_mm, |cell| 1e3 * cell), stepped.nodes());
                Model { cell_mm, nodes, predict: Box::new(move |strain| stepped.predict(strain)) }
            }
        })
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Tetrahedra(kind) => kind.name(),
            Self::Lattice => "lattice",
            Self::SteppedTetrahedra => "linear, stepped",
            Self::SteppedLattice => "lattice, stepped",
        }
    }
}

impl Model<'_> {
    /// Where the beads of the inner layers are under a compression (m).
    ///
    /// # Errors
    /// An equilibrium that is not found.
    pub fn predict(&self, strain: &Strain) -> Result<Vec<DVec3>> {
        (self.predict)(strain)
    }
}
