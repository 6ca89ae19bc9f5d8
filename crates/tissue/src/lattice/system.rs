//! The potential of one lattice in a substep without its contacts, and the factor that
//! preconditions it.

use super::terms::Term;
use crate::body::{Embedding, EmbeddingData};
use glam::{DMat3, DVec3};
use trocar_lattice::Flow;
use trocar_sparse::{BlockMatrix, Cholesky, Level};

/// Shifts of the diagonal that are tried, over its mean, if rounding makes the matrix singular.
const SHIFTS: [f64; 3] = [0.0, 1e-8, 1e-4];

/// A lattice in a substep.
pub(super) struct Lattice<'a> {
    /// Its number in the island.
    pub member: usize,
    pub embedding: Embedding,
    pub system: &'a mut LatticeSystem,
    /// Length of the substep (s).
    pub h: f64,
    /// Where the nodes would be without forces (m).
    pub predictor: Vec<DVec3>,
    /// Forces on the nodes (N).
    pub loads: Vec<DVec3>,
    /// Mass (kg), and shear viscosity (Pa s).
    pub mass: f64,
    pub viscosity: f64,
    /// Where the nodes begin (m).
    pub start: Vec<DVec3>,
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
    /// The elastic part where the last substep began: of a body at rest nothing else is needed.
    known: Option<Known>,
}

/// Elastic energy (J) and its gradient (N), with inertia, viscosity, pins and loads, and the least
/// volume of a cell over its rest volume.
#[derive(Clone, Debug)]
pub(super) struct Elastic {
    pub energy: f64,
    pub gradient: Vec<DVec3>,
    pub least_ratio: f64,
}

/// An elastic part and all that it depends on.
struct Known {
    h: f64,
    start: Vec<DVec3>,
    predictor: Vec<DVec3>,
    loads: Vec<DVec3>,
    x: Vec<DVec3>,
    elastic: Elastic,
}

impl LatticeSystem {
    /// For a lattice.
    pub fn new(embedding: &EmbeddingData) -> Self {
        let matrix = embedding.body.stiffness_pattern();
        let rest = embedding.body.lattice().nodes();
        let cholesky = Cholesky::new(&matrix, rest);
        Self {
            matrix,
            cholesky,
            numbers: vec![0.0; 3 * rest.len()],
            factorised: false,
            flow: Flow::default(),
            flows: false,
            known: None,
        }
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
    /// Begins a substep whose search starts at `x`.
    pub fn begin_substep(&mut self, x: &[DVec3]) {
        self.system.flows = false;
        let known = self.system.known.as_ref().is_some_and(|known| {
            known.h == self.h
                && known.start == self.start
                && known.predictor == self.predictor
                && known.loads == self.loads
                && known.x == x
        });
        if !known {
            self.flow();
            let elastic = self.elastic(x);
            let (start, predictor, loads) = (self.start.clone(), self.predictor.clone(), self.loads.clone());
            self.system.known = Some(Known { h: self.h, start, predictor, loads, x: x.to_vec(), elastic });
        }
    }

    /// The elastic part where the search starts, at `x`.
    pub fn first_elastic(&self, x: &[DVec3]) -> Elastic {
        self.system.known.as_ref().map_or_else(|| self.elastic(x), |known| known.elastic.clone())
    }

    /// Makes the viscosity that of the substep.
    fn flow(&mut self) {
        if !std::mem::replace(&mut self.system.flows, true) {
            self.system.flow.begin(&self.embedding.body, self.viscosity, self.h, &self.start);
        }
    }

    /// The elastic part at `x`.
    pub fn elastic(&self, x: &[DVec3]) -> Elastic {
        let mut gradient = vec![DVec3::ZERO; x.len()];
        let (energy, least_ratio) = self.evaluate(x, &mut gradient);
        Elastic { energy, gradient, least_ratio }
    }

    /// Energy at `x` (J), and the least ratio of volumes; adds the energy's gradient (N).
    fn evaluate(&self, x: &[DVec3], gradient: &mut [DVec3]) -> (f64, f64) {
        let lattice = &self.embedding.body;
        let (mut energy, least) = lattice.add_elastic(x, &self.system.flow, gradient);
        for pin in lattice.pins() {
            let away = pin.point.interpolate(x) - pin.target;
            energy += 0.5 * pin.stiffness * away.length_squared();
            pin.point.spread(pin.stiffness * away, gradient);
        }
        for (i, mass) in lattice.masses().iter().enumerate() {
            let away = x[i] - self.predictor[i];
            let force = (mass / (self.h * self.h)) * away;
            energy += 0.5 * force.dot(away) - self.loads[i].dot(away);
            gradient[i] += force - self.loads[i];
        }
        (energy, least)
    }

    /// Turns a vector over the nodes into the solution of the matrix.
    pub fn precondition(&mut self, terms: &[Term], x: &[&[DVec3]], projected: bool, vector: &mut [DVec3]) {
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

    fn factorise(&mut self, terms: &[Term], x: &[&[DVec3]], projected: bool) {
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
