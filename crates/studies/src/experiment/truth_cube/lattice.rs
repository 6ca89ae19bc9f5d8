//! The cube by a lattice of hexahedra.
//!
//! The cells are whole fractions of the distance between the two outer layers of beads, so that the
//! lattice's own nodes lie in both layers and are fixed there, without springs. The four sides of
//! the cube need not coincide with the grid: they pass through the outermost cells, of which at
//! least half is tissue.

use super::cube::{Cube, DENSITY, Law, YOUNG_MODULUS};
use super::data::Strain;
use crate::{Error, Result};
use glam::DVec3;
use trocar_lattice::{
    Body, BodyDescription, BodyState, Conditions, EmbeddedPoint, Lattice, LatticeOptions, Material, Newton, Precision,
};

/// Steps in which a layer goes its way.
const PARTS: usize = 4;

/// Coordinates that differ by less are of one plane (m).
const PLANE: f64 = 1e-9;

/// The cube as a lattice.
pub(super) struct LatticeCube<'a> {
    cube: &'a Cube<'a>,
    body: Body,
    /// What divides the cube.
    pub planes: Planes,
    /// The beads of the inner layers.
    beads: Vec<EmbeddedPoint>,
}

/// The planes along each axis that divide the cube as its lattice does: those of the grid, and the
/// cube's sides in the place of the planes outside of it.
pub(super) struct Planes {
    pub along: [Vec<f64>; 3],
}

impl<'a> LatticeCube<'a> {
    /// With as many layers of cells as tetrahedra in `cells` cells across the cube have.
    pub fn new(cube: &'a Cube<'a>, cells: usize, law: Law, poisson_ratio: f64) -> Result<Self> {
        let Some(law) = law.of_lattice() else {
            return Err(Error::Mismatch(format!("a lattice has no law {}", law.name())));
        };
        let mesh = cube.mesh(cells);
        let cell = cube.height() / cube.layers(cells) as f64;
        let lattice = Lattice::of_mesh(&mesh, &LatticeOptions::new(cell)).map_err(refused)?;
        let nodes = lattice.nodes();
        let fixed = (0..nodes.len() as u32).filter(|i| cube.end_of(nodes[*i as usize]).is_some()).collect();
        let planes = Planes::of(&lattice);
        let beads = lattice.embed(&cube.rest().collect::<Vec<_>>()).map_err(refused)?;
        let material = Material { law, young_modulus: YOUNG_MODULUS, poisson_ratio, density: DENSITY };
        let name = "cube".to_owned();
        let body = Body::new(BodyDescription { name, lattice, material, pins: Vec::new(), fixed }).map_err(refused)?;
        Ok(Self { cube, body, planes, beads })
    }

    /// Edge of a cell (m).
    pub fn cell(&self) -> f64 {
        self.body.lattice().cell()
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.body.lattice().nodes().len()
    }

    /// Where the beads of the inner layers are under a compression (m).
    pub fn predict(&self, strain: &Strain) -> Result<Vec<DVec3>> {
        let columns = self.cube.columns(strain);
        // A node outside of the cube goes where the planes inside it and of its side lead it.
        let motion = |p: &DVec3| -> DVec3 {
            self.planes.shares(*p).map(|(at, share)| share * columns.at(self.planes.place(at))).into_iter().sum()
        };
        let way: Vec<DVec3> = self.body.lattice().nodes().iter().map(motion).collect();
        let mut state = BodyState::new(&self.body);
        let mut newton = Newton::new(&self.body, Precision::default()).map_err(refused)?;
        for _ in 0..PARTS {
            // Columns that stay straight are a start in which nothing is inside out.
            state.positions.iter_mut().zip(&way).for_each(|(x, way)| *x += *way / PARTS as f64);
            newton.settle(&self.body, &Conditions::default(), &mut state).map_err(refused)?;
        }
        Ok(self.beads.iter().map(|bead| bead.interpolate(&state.positions)).collect())
    }
}

impl Planes {
    fn of(lattice: &Lattice) -> Self {
        let (low, high) = lattice.mesh().bounds().unwrap_or((DVec3::ZERO, DVec3::ZERO));
        let along = [0, 1, 2].map(|axis| {
            let clamped = |p: &DVec3| p[axis].clamp(low[axis], high[axis]);
            let mut planes: Vec<f64> = lattice.nodes().iter().map(clamped).collect();
            planes.sort_by(f64::total_cmp);
            planes.dedup_by(|a, b| (*a - *b).abs() < PLANE);
            planes
        });
        Self { along }
    }

    /// The place of a node (m).
    pub fn place(&self, at: [usize; 3]) -> DVec3 {
        DVec3::new(self.along[0][at[0]], self.along[1][at[1]], self.along[2][at[2]])
    }

    /// Trilinear weights of the eight nodes around a point (m), which extrapolate outside.
    pub fn shares(&self, p: DVec3) -> [([usize; 3], f64); 8] {
        let sides = [0, 1, 2].map(|axis| {
            let planes = &self.along[axis];
            let after = planes.partition_point(|plane| *plane <= p[axis]).clamp(1, planes.len() - 1);
            (after - 1, (p[axis] - planes[after - 1]) / (planes[after] - planes[after - 1]))
        });
        std::array::from_fn(|corner| {
            let upper = [corner & 1, corner >> 1 & 1, corner >> 2];
            let share = |axis: usize| if upper[axis] == 1 { sides[axis].1 } else { 1.0 - sides[axis].1 };
            ([0, 1, 2].map(|axis| sides[axis].0 + upper[axis]), share(0) * share(1) * share(2))
        })
    }
}

fn refused(error: trocar_lattice::Error) -> Error {
    Error::Study(error.into())
}
