//! Energy, forces and stiffness of a body's tissue, for solvers that add terms of their own: what
//! `trocar-tissue` builds its lattice solver on.

use crate::Body;
use crate::element::{Blocks, Wanted};
use crate::flow::Flow;
use crate::potential::{Potential, add_blocks};
use fearless_simd::{Level, Simd, dispatch};
use glam::{DMat3, DVec3};
use trocar_sparse::BlockMatrix;

/// Green's strain (its Frobenius norm) up to which a hexahedron's stiffness is that at rest. In an
/// episode of two arms 0.04 to 0.25 need the same number of steps, 0.5 needs half as many again.
const MAX_TURNED_STRAIN: f64 = 0.15;

/// The stiffness of every hexahedron at rest.
#[derive(Clone, Debug)]
pub struct RestStiffness {
    blocks: Vec<Blocks>,
}

impl Body {
    /// Elastic and viscous energy (J) with the nodes at `x` (m), and the least ratio of volumes;
    /// adds the energy's gradient (N).
    ///
    /// All work is done on the calling thread.
    pub fn add_elastic(&self, x: &[DVec3], flow: &Flow, gradient: &mut [DVec3]) -> (f64, f64) {
        dispatch!(Level::new(), simd => self.add_elastic_in(simd, x, flow, gradient))
    }

    #[inline(always)]
    fn add_elastic_in<S: Simd>(&self, simd: S, x: &[DVec3], flow: &Flow, gradient: &mut [DVec3]) -> (f64, f64) {
        let (mut energy, mut least) = (0.0, f64::INFINITY);
        for (i, hex) in self.lattice().hexahedra().iter().enumerate() {
            let before = flow.before.get(i).map(|before| (flow, before));
            let (part, forces, ratio) = self.element(i).forces(simd, &self.corners(i, x), before);
            energy += part;
            least = least.min(ratio);
            for k in 0..8 {
                gradient[hex.nodes[k] as usize] += forces[k];
            }
        }
        (energy, least)
    }

    /// A matrix with a block for each pair of nodes that a hexahedron joins.
    pub fn stiffness_pattern(&self) -> BlockMatrix {
        Potential::pattern(self)
    }

    /// The stiffness of every hexahedron at rest, without viscosity.
    pub fn rest_stiffness(&self) -> RestStiffness {
        let rest = self.lattice().nodes();
        let stiffness = |i| self.element(i).evaluate(&self.corners(i, rest), Wanted::Projected).hessian;
        let count = self.lattice().hexahedra().len();
        RestStiffness { blocks: (0..count).map(|i| stiffness(i).map_or([DMat3::ZERO; 36], |blocks| *blocks)).collect() }
    }

    /// Adds the stiffness of every hexahedron at `x` (m), and that of viscosity: an approximation
    /// that is always positive semidefinite. Where strain is small it is that at rest, turned with
    /// the hexahedron. Elsewhere it is the projected second derivative: tissue between jaws resists
    /// a hundred times more than at rest.
    pub fn add_turned_stiffness(&self, rest: &RestStiffness, x: &[DVec3], flow: &Flow, matrix: &mut BlockMatrix) {
        for (i, (hex, blocks)) in self.lattice().hexahedra().iter().zip(&rest.blocks).enumerate() {
            let (element, corners) = (self.element(i), self.corners(i, x));
            let strained = element.strain(&corners) > MAX_TURNED_STRAIN;
            let projected = || element.evaluate(&corners, Wanted::Projected).hessian;
            let mut stiffness = if let Some(blocks) = strained.then(projected).flatten() {
                *blocks
            } else {
                let turn = element.rotation(&corners);
                let back = turn.transpose();
                blocks.map(|block| turn * block * back)
            };
            if !flow.before.is_empty() {
                element.add_viscous(&corners, flow, &mut stiffness);
            }
            add_blocks(hex.nodes, &stiffness, &mut |a, b, block| matrix.add(a, b, block));
        }
    }

    /// Adds the second derivative at `x` (m), projected to be positive semidefinite at each
    /// integration point, and that of viscosity.
    pub fn add_projected_stiffness(&self, x: &[DVec3], flow: &Flow, matrix: &mut BlockMatrix) {
        for (i, hex) in self.lattice().hexahedra().iter().enumerate() {
            let (element, corners) = (self.element(i), self.corners(i, x));
            let Some(mut blocks) = element.evaluate(&corners, Wanted::Projected).hessian else { continue };
            if !flow.before.is_empty() {
                element.add_viscous(&corners, flow, &mut blocks);
            }
            add_blocks(hex.nodes, &blocks, &mut |a, b, block| matrix.add(a, b, block));
        }
    }
}

impl Flow {
    /// Begins a step of `h` (s) of a body of shear viscosity `viscosity` (Pa s), whose nodes are at
    /// `x` (m).
    pub fn begin(&mut self, body: &Body, viscosity: f64, h: f64, x: &[DVec3]) {
        self.stiffness = viscosity / h;
        self.before.clear();
        if viscosity > 0.0 {
            dispatch!(Level::new(), simd => self.begin_in(simd, body, x));
        }
    }

    #[inline(always)]
    fn begin_in<S: Simd>(&mut self, simd: S, body: &Body, x: &[DVec3]) {
        for hex in 0..body.lattice().hexahedra().len() {
            self.before.push(body.element(hex).green(simd, &body.corners(hex, x)));
        }
    }
}
