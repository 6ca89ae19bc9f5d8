//! The potential of one lattice in a substep without its contacts, and the factor that
//! preconditions it.

use super::terms::Term;
use crate::body::EmbeddingData;
use glam::{DMat3, DVec3};
use trocar_lattice::Flow;
use trocar_sparse::{BlockMatrix, Cholesky, Level};

/// Shifts of the diagonal that are tried, over its mean, if rounding makes the matrix singular.
const SHIFTS: [f64; 3] = [0.0, 1e-8, 1e-4];

/// A lattice in a substep.
pub(super) struct Lattice<'a> {
    /// Its number in the island.
    pub member: usize,
    pub embedding: &'a EmbeddingData,
    pub system: &'a mut LatticeSystem,
    /// Length of the substep (s).
    pub h: f64,
    /// Where the nodes would be without forces (m).
    pub predictor: &'a [DVec3],
    /// Forces on the nodes (N); none without loads.
    pub loads: &'a [DVec3],
    /// Shear viscosity (Pa s).
    pub viscosity: f64,
    /// Where the nodes begin (m).
    pub start: &'a [DVec3],
}

/// Matrix and factor of a lattice. The factor never outlives a frame.
pub(super) struct LatticeSystem {
    matrix: BlockMatrix,
    cholesky: Cholesky<f64>,
    numbers: Vec<f64>,
    factorised: bool,
    flow: Flow,
    /// Whether `flow` is that of the substep.
    flows: bool,
    /// Of a body that begins where it began before, elasticity and viscosity are known there.
    known: Option<Known>,
    /// Mass of the lattice (kg).
    mass: f64,
}

/// Elastic energy (J) and its gradient (N), with inertia, viscosity, pins and loads, and the least
/// volume of a cell over its rest volume.
#[derive(Clone, Debug)]
pub(super) struct Elastic {
    pub energy: f64,
    pub gradient: Vec<DVec3>,
    pub least_ratio: f64,
}

/// An elastic part without inertia and loads where a substep began, and all that it depends on.
struct Known {
    h: f64,
    start: Vec<DVec3>,
    elastic: Elastic,
}

impl LatticeSystem {
    /// For a lattice.
    pub fn new(embedding: &EmbeddingData) -> Self {
        let matrix = embedding.body.stiffness_pattern();
        Self {
            cholesky: Cholesky::new(&matrix),
            numbers: vec![0.0; 3 * matrix.len()],
            matrix,
            factorised: false,
            flow: Flow::default(),
            flows: false,
            known: None,
            mass: embedding.body.masses().iter().sum(),
        }
    }

    /// Begins a substep: viscosity is no longer that of the last one.
    pub fn begin_substep(&mut self) {
        self.flows = false;
    }

    /// The next preconditioning makes a new factor.
    pub fn forget_factor(&mut self) {
        self.factorised = false;
    }

    /// Whether there is a factor.
    pub fn has_factor(&self) -> bool {
        self.factorised
    }
}

impl Lattice<'_> {
    /// Mass (kg).
    pub fn mass(&self) -> f64 {
        self.system.mass
    }

    /// The elastic part where the search starts, at `x`.
    pub fn first_elastic(&mut self, x: &[DVec3]) -> Elastic {
        let mut first = if x == self.start {
            self.at_start()
        } else {
            self.flow();
            self.tissue(x)
        };
        self.add_inertia(x, &mut first);
        first
    }

    /// The elastic part without inertia and loads where the substep begins.
    fn at_start(&mut self) -> Elastic {
        let known = self.system.known.as_ref();
        if let Some(known) = known.filter(|known| known.h == self.h && known.start == self.start) {
            return known.elastic.clone();
        }
        self.flow();
        let elastic = self.tissue(self.start);
        self.system.known = Some(Known { h: self.h, start: self.start.to_vec(), elastic: elastic.clone() });
        elastic
    }

    /// Makes the viscosity that of the substep.
    fn flow(&mut self) {
        if !std::mem::replace(&mut self.system.flows, true) {
            self.system.flow.begin(&self.embedding.body, self.viscosity, self.h, self.start);
        }
    }

    /// The elastic part at `x`, once the search has moved the body.
    pub fn elastic(&self, x: &[DVec3]) -> Elastic {
        let mut elastic = self.tissue(x);
        self.add_inertia(x, &mut elastic);
        elastic
    }

    /// The same without inertia and loads.
    fn tissue(&self, x: &[DVec3]) -> Elastic {
        let lattice = &self.embedding.body;
        let mut gradient = vec![DVec3::ZERO; x.len()];
        let (mut energy, least_ratio) = lattice.add_elastic(x, &self.system.flow, &mut gradient);
        for pin in lattice.pins() {
            let away = pin.point.interpolate(x) - pin.target;
            energy += 0.5 * pin.stiffness * away.length_squared();
            pin.point.spread(pin.stiffness * away, &mut gradient);
        }
        Elastic { energy, gradient, least_ratio }
    }

    /// Adds inertia and loads.
    fn add_inertia(&self, x: &[DVec3], to: &mut Elastic) {
        let nodes = self.embedding.body.masses().iter().zip(x).zip(self.predictor).zip(&mut to.gradient);
        let mut loads = self.loads.iter();
        for (((mass, x), predictor), gradient) in nodes {
            let away = *x - *predictor;
            let force = (mass / (self.h * self.h)) * away;
            let load = loads.next().copied().unwrap_or(DVec3::ZERO);
            to.energy += 0.5 * force.dot(away) - load.dot(away);
            *gradient += force - load;
        }
    }

    /// Turns a vector over the nodes into the solution of the matrix.
    pub fn precondition(&mut self, terms: &[Term<'_>], x: &[&[DVec3]], projected: bool, vector: &mut [DVec3]) {
        self.flow();
        if !self.system.factorised {
            self.factorise(terms, x, projected);
        }
        let LatticeSystem { numbers, cholesky, .. } = &mut *self.system;
        for (numbers, v) in numbers.chunks_exact_mut(3).zip(vector.iter()) {
            v.write_to_slice(numbers);
        }
        cholesky.solve(Level::new(), numbers);
        for (numbers, v) in numbers.chunks_exact(3).zip(vector) {
            *v = DVec3::from_slice(numbers);
        }
    }

    fn factorise(&mut self, terms: &[Term<'_>], x: &[&[DVec3]], projected: bool) {
        let lattice = &self.embedding.body;
        let LatticeSystem { matrix, cholesky, factorised, flow, .. } = &mut *self.system;
        matrix.clear();
        if projected {
            lattice.add_projected_stiffness(x[self.member], flow, matrix);
        } else {
            lattice.add_turned_stiffness(&self.embedding.rest, x[self.member], flow, matrix);
        }
        for pin in lattice.pins() {
            for (a, wa) in pin.point.nodes.iter().zip(&pin.point.weights) {
                for (b, wb) in pin.point.nodes.iter().zip(&pin.point.weights) {
                    matrix.add(*a, *b, DMat3::from_diagonal(DVec3::splat(pin.stiffness * wa * wb)));
                }
            }
        }
        for term in terms {
            term.add_stiffness(x, self.member, |a, b, block| matrix.add(a, b, block));
        }
        for (i, mass) in lattice.masses().iter().enumerate() {
            matrix.add(i as u32, i as u32, DMat3::from_diagonal(DVec3::splat(mass / (self.h * self.h))));
        }
        let count = matrix.len();
        let trace = |i: usize| {
            let block = matrix.diagonal(i);
            block.x_axis.x + block.y_axis.y + block.z_axis.z
        };
        let mean = (0..count).map(trace).sum::<f64>() / (3 * count) as f64;
        let mut before = 0.0;
        for shift in SHIFTS {
            matrix.shift((shift - before) * mean);
            before = shift;
            let blocks = matrix.blocks().map(|(_, _, block)| block.to_cols_array_2d());
            *factorised = cholesky.factorise(Level::new(), blocks);
            if *factorised {
                return;
            }
        }
    }
}
