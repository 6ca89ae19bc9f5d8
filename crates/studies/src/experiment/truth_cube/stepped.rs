//! The cube by the solver that a cell steps: compressed frame by frame, and brought to rest.

use super::cube::{Cube, DENSITY, Kind, Law, YOUNG_MODULUS};
use super::data::Strain;
use super::lattice::LatticeCube;
use crate::experiment::block::block;
use crate::scenes::FRAME;
use crate::{Error, Result};
use glam::DVec3;
use trocar_core::Pose;
use trocar_geometry::TetMesh;
use trocar_tissue::{
    Backend, BodyDescription, ConstitutiveModel, Grasp, LatticeSettings, Material, Model, ModelBuilder, SolverSettings,
    State, Stepper, ToolMotion,
};
use trocar_tissue_reference::statics::Elements;

/// Shear viscosity (Pa s): it brings the cube to rest, and does not act there.
const VISCOSITY: f64 = 50.0;

/// Frames in which the outer layers go their way, and in which the cube comes to rest.
const MOVING_FRAMES: usize = 30;
const RESTING_FRAMES: usize = 60;

/// The cube as a model of the cell's tissue.
pub(super) struct SteppedCube<'a> {
    cube: &'a Cube<'a>,
    model: Model,
    points: Points<'a>,
    /// Nodes in the outer layers, and where they rest (m).
    held: Vec<(u32, DVec3)>,
}

/// How the motion of the nodes moves the beads.
enum Points<'a> {
    Tetrahedra(Elements),
    Lattice(Box<LatticeCube<'a>>),
}

impl<'a> SteppedCube<'a> {
    /// Linear tetrahedra.
    pub fn of_tetrahedra(cube: &'a Cube<'a>, cells: usize, poisson_ratio: f64) -> Result<Self> {
        let law = Law::Finite(ConstitutiveModel::StableNeoHookean);
        let elements = cube.elements(Kind::Linear, cells, law, poisson_ratio);
        let mesh = elements.mesh().clone();
        Self::of(cube, &mesh, poisson_ratio, Backend::Tetrahedra, Points::Tetrahedra(elements))
    }

    /// A lattice. The solver sees it through a mesh whose nodes are those of the lattice in the
    /// cube, and the points where its edges pass through the cube's sides. So the springs that hold
    /// these nodes determine the lattice's own.
    ///
    /// # Errors
    /// Refuses a lattice of which the cube's middle is no node: the solver's grid has a node there.
    pub fn of_lattice(cube: &'a Cube<'a>, cells: usize, poisson_ratio: f64) -> Result<Self> {
        let law = Law::Finite(ConstitutiveModel::StableNeoHookean);
        let lattice = LatticeCube::new(cube, cells, law, poisson_ratio)?;
        let parts = lattice.planes.along.each_ref().map(|planes| planes.len() - 1);
        if parts.iter().any(|parts| parts % 2 == 1) {
            return Err(Error::Mismatch(format!("a lattice of {parts:?} cells has no node in the cube's middle")));
        }
        let mut mesh = block(DVec3::ZERO, DVec3::from(parts.map(|n| n as f64)), parts);
        for vertex in &mut mesh.vertices {
            *vertex = lattice.planes.place(vertex.to_array().map(|n| n.round() as usize));
        }
        let settings = LatticeSettings { cell: lattice.cell(), ..LatticeSettings::default() };
        Self::of(cube, &mesh, poisson_ratio, Backend::Lattice(settings), Points::Lattice(Box::new(lattice)))
    }

    fn of(
        cube: &'a Cube<'a>,
        mesh: &TetMesh,
        poisson_ratio: f64,
        backend: Backend,
        points: Points<'a>,
    ) -> Result<Self> {
        let material = Material {
            model: ConstitutiveModel::StableNeoHookean,
            young_modulus: YOUNG_MODULUS,
            poisson_ratio,
            density: DENSITY,
            viscosity: VISCOSITY,
        };
        let mut builder = ModelBuilder::new().backend(backend);
        let name = "cube".to_owned();
        builder.body(BodyDescription { name, mesh, material, pinned: Vec::new(), supports: Vec::new() })?;
        let nodes = mesh.vertices.iter().enumerate();
        let held = nodes.filter(|(_, p)| cube.end_of(**p).is_some()).map(|(i, p)| (i as u32, *p)).collect();
        Ok(Self { cube, model: builder.build()?, points, held })
    }

    /// Edge of a cell (m), if it is not that of the tetrahedra.
    pub fn cell(&self) -> Option<f64> {
        match &self.points {
            Points::Tetrahedra(_) => None,
            Points::Lattice(lattice) => Some(lattice.cell()),
        }
    }

    /// Number of nodes of the elements.
    pub fn nodes(&self) -> usize {
        match &self.points {
            Points::Tetrahedra(elements) => elements.rest().len(),
            Points::Lattice(lattice) => lattice.nodes(),
        }
    }

    /// Where the beads of the inner layers are at rest under a compression (m).
    ///
    /// # Errors
    /// A run that diverges.
    pub fn predict(&self, strain: &Strain) -> Result<Vec<DVec3>> {
        let columns = self.cube.columns(strain);
        let model = &self.model;
        let (nodes, rest): (Vec<u32>, Vec<DVec3>) = self.held.iter().copied().unzip();
        let start = State::new(model).positions(model, 0);
        let (mut state, pose) = (State::new(model), Pose::IDENTITY);
        let mut stepper = Stepper::new(model, SolverSettings::FAST, FRAME, 1)?;
        for frame in 1..=MOVING_FRAMES + RESTING_FRAMES {
            let share = frame.min(MOVING_FRAMES) as f64 / MOVING_FRAMES as f64;
            let places: Vec<DVec3> = rest.iter().map(|p| *p + share * columns.at(*p)).collect();
            state.grasps = vec![Grasp::prescribe(model, 0, &nodes, &places, 0, &pose)];
            let report = stepper.step(model, &mut state, &[ToolMotion { from: pose, to: pose }]);
            if let Some(why) = report.divergence {
                return Err(Error::Study(format!("the stepped cube, frame {frame}: {why}").into()));
            }
        }
        let end = state.positions(model, 0);
        let moved: Vec<DVec3> = end.iter().zip(&start).map(|(x, rest)| *x - *rest).collect();
        Ok(self.cube.rest().map(|bead| bead + self.points.moved(bead, &moved)).collect())
    }
}

impl Points<'_> {
    /// The displacement of a point (m) by those of the nodes of the mesh.
    fn moved(&self, p: DVec3, of_nodes: &[DVec3]) -> DVec3 {
        match self {
            Self::Tetrahedra(elements) => elements.locate(p).of(of_nodes),
            Self::Lattice(lattice) => {
                let planes = &lattice.planes;
                let counts = planes.along.each_ref().map(Vec::len);
                let node = |[i, j, k]: [usize; 3]| (k * counts[1] + j) * counts[0] + i;
                planes.shares(p).map(|(at, share)| share * of_nodes[node(at)]).into_iter().sum()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::data::tests::rough_plates;
    use super::super::method::Method;
    use super::*;

    /// Brought to rest, the solver of the cell has the beads where the static equilibrium of the
    /// same elements has them: the lattice does not lock there either, and tetrahedra do.
    #[test]
    fn the_stepped_cube_rests_where_statics_put_it() {
        let beads = rough_plates();
        let (cube, strain) = (Cube::new(&beads), &beads.strains[0]);
        let law = Law::Finite(ConstitutiveModel::StableNeoHookean);
        let place = |method: Method| method.model(&cube, 5, law, 0.499).unwrap().predict(strain).unwrap();
        let judge = place(Method::Tetrahedra(Kind::Quadratic));
        let median = |places: &[DVec3]| {
            let mut off: Vec<f64> = places.iter().zip(&judge).map(|(a, b)| a.distance(*b)).collect();
            crate::statistics::median(&mut off)
        };
        let worst = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        for (stepped, resting, locks) in [
            (Method::SteppedTetrahedra, Method::Tetrahedra(Kind::Linear), true),
            (Method::SteppedLattice, Method::Lattice, false),
        ] {
            let name = stepped.name();
            let [stepped, resting] = [stepped, resting].map(place);
            let (off, error) = (worst(&stepped, &resting), median(&stepped));
            println!("{name}: {off:.1e} m from statics at most, {error:.1e} m from quadratic tetrahedra");
            assert!(off < 1e-6, "{name}: {off} m");
            assert!(if locks { error > 3e-4 } else { error < 2e-4 }, "{name}: {error} m");
        }
    }
}
