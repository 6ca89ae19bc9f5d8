//! The incremental potential of implicit Euler, and the potential energy in statics.
//!
//! E(x) = 1/(2 h^2) |x - y|_M^2 + elastic energy + springs - work of the loads, y = x_n + h v_n +
//! h^2 g. In statics gravity is a load instead. Masses are lumped to the nodes.

use crate::element::{Blocks, ElementResult, Wanted};
use crate::{Body, BodyState, Conditions, Spring};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use trocar_sparse::BlockMatrix;

/// The potential of one body.
pub(crate) struct Potential<'a> {
    body: &'a Body,
    conditions: Conditions<'a>,
    /// Length of the step (s) and the nodes' free flight y (m); none in statics.
    motion: Option<(f64, Vec<DVec3>)>,
}

/// Energy and gradient at some positions.
pub(crate) struct Value {
    /// (J).
    pub energy: f64,
    /// (N); 0 at fixed nodes.
    pub gradient: Vec<DVec3>,
}

impl<'a> Potential<'a> {
    pub fn new(body: &'a Body, conditions: Conditions<'a>, state: &BodyState, dt: Option<f64>) -> Self {
        let free_flight = |h: f64| {
            let pairs = state.positions.iter().zip(&state.velocities);
            (h, pairs.map(|(x, v)| *x + h * *v + h * h * conditions.gravity).collect())
        };
        Self { body, conditions, motion: dt.map(free_flight) }
    }

    /// Where nodes fly without forces (m).
    pub fn free_flight(&self) -> Option<&[DVec3]> {
        self.motion.as_ref().map(|(_, y)| &y[..])
    }

    /// Young's modulus times the volume (J).
    pub fn stiff_energy(&self) -> f64 {
        self.body.material().young_modulus * self.body.lattice().volume()
    }

    fn springs(&self) -> impl Iterator<Item = &Spring> {
        self.body.pins().iter().chain(self.conditions.springs)
    }

    fn elements(&self, x: &[DVec3], wanted: Wanted) -> Vec<ElementResult> {
        let evaluate = |hex| self.body.element(hex).evaluate(&self.body.corners(hex, x), wanted);
        (0..self.body.lattice().hexahedra().len()).into_par_iter().map(evaluate).collect()
    }

    /// Energy and gradient at `x`.
    pub fn evaluate(&self, x: &[DVec3]) -> Value {
        let mut value = Value { energy: 0.0, gradient: vec![DVec3::ZERO; x.len()] };
        // Summed in the order of the elements, for the same bits with any number of threads.
        let elements = self.elements(x, Wanted::Gradient);
        for (hex, element) in self.body.lattice().hexahedra().iter().zip(&elements) {
            value.energy += element.energy;
            for (node, gradient) in hex.nodes.iter().zip(&element.gradient) {
                value.gradient[*node as usize] += *gradient;
            }
        }
        for spring in self.springs() {
            let away = spring.point.interpolate(x) - spring.target;
            value.energy += 0.5 * spring.stiffness * away.length_squared();
            spring.point.spread(spring.stiffness * away, &mut value.gradient);
        }
        let rest = self.body.lattice().nodes();
        for load in self.conditions.loads {
            let moved = load.point.interpolate(x) - load.point.interpolate(rest);
            value.energy -= load.force.dot(moved);
            load.point.spread(-load.force, &mut value.gradient);
        }
        for (i, mass) in self.body.masses().iter().enumerate() {
            match &self.motion {
                Some((h, y)) => {
                    let away = (x[i] - y[i]) / (h * h);
                    value.energy += 0.5 * mass * away.dot(x[i] - y[i]);
                    value.gradient[i] += *mass * away;
                }
                None => {
                    value.energy -= mass * self.conditions.gravity.dot(x[i] - rest[i]);
                    value.gradient[i] -= *mass * self.conditions.gravity;
                }
            }
        }
        for (gradient, fixed) in value.gradient.iter_mut().zip(self.body.fixed()) {
            if *fixed {
                *gradient = DVec3::ZERO;
            }
        }
        value
    }

    /// A matrix with a block for each pair of nodes that an element joins.
    pub fn pattern(body: &Body) -> BlockMatrix {
        let pairs = |hex: &crate::Hexahedron| {
            let nodes = hex.nodes;
            (0..8).flat_map(move |a| (0..a).map(move |b| (nodes[a], nodes[b])))
        };
        BlockMatrix::new(body.masses().len(), body.lattice().hexahedra().iter().flat_map(pairs))
    }

    /// Writes the second derivative at `x`. Rows and columns of fixed nodes are those of a unit
    /// matrix times `Young's modulus x cell`.
    pub fn hessian(&self, x: &[DVec3], projected: bool, matrix: &mut BlockMatrix) {
        matrix.clear();
        let fixed = self.body.fixed();
        let mut add = |a: u32, b: u32, block: DMat3| {
            if !fixed[a as usize] && !fixed[b as usize] {
                matrix.add(a, b, block);
            }
        };
        let wanted = if projected { Wanted::Projected } else { Wanted::Exact };
        for (hex, element) in self.body.lattice().hexahedra().iter().zip(self.elements(x, wanted)) {
            if let Some(blocks) = &element.hessian {
                add_blocks(hex.nodes, blocks, &mut add);
            }
        }
        for spring in self.springs() {
            let weighted = spring.point.nodes.iter().zip(&spring.point.weights);
            for (a, wa) in weighted.clone() {
                for (b, wb) in weighted.clone() {
                    add(*a, *b, DMat3::from_diagonal(DVec3::splat(spring.stiffness * wa * wb)));
                }
            }
        }
        if let Some((h, _)) = &self.motion {
            for (i, mass) in self.body.masses().iter().enumerate() {
                add(i as u32, i as u32, DMat3::from_diagonal(DVec3::splat(mass / (h * h))));
            }
        }
        let unit = self.body.material().young_modulus * self.body.lattice().cell();
        for (i, _) in fixed.iter().enumerate().filter(|(_, fixed)| **fixed) {
            matrix.add(i as u32, i as u32, DMat3::from_diagonal(DVec3::splat(unit)));
        }
    }
}

/// Adds an element's blocks; the matrix keeps one of (a, b) and (b, a).
pub(crate) fn add_blocks(nodes: [u32; 8], blocks: &Blocks, add: &mut impl FnMut(u32, u32, DMat3)) {
    for a in 0..8 {
        for b in 0..=a {
            let block = blocks[a * (a + 1) / 2 + b];
            add(nodes[a], nodes[b], block);
            if a != b {
                add(nodes[b], nodes[a], block.transpose());
            }
        }
    }
}
