//! The grasps of sixteen instances: springs from embedded points to places that a tool carries, and
//! their part of the preconditioner.
//!
//! The shared factor does not contain the springs of a grasp, because every instance has others. In
//! each lane they are a term of low rank, three for each point, which is added to the factor's
//! inverse by the formula of Sherman, Morrison and Woodbury (Hager, "Updating the inverse of a
//! matrix", 1989). What this needs of the factor is one solve, done when the grasp begins.

use super::factor::Factor;
use super::topology::Topology;
use crate::registers::{BLOCK, Block, Mask, Reg, lanes, load, part_of, parts, splat, store, width};
use fearless_simd::{Level, Select, Simd, dispatch};
use glam::DVec3;
use trocar_core::Pose;
use trocar_lattice::EmbeddedPoint;

/// Greatest number of points of a grasp: one solve has a lane for each of their axes.
pub(super) const MAX_POINTS: usize = 5;

/// Axes of all points.
const MAX_RANK: usize = 3 * MAX_POINTS;

/// A spring of a grasp.
#[derive(Clone, Debug)]
pub(super) struct Spring {
    pub nodes: [u32; 8],
    pub weights: [f32; 8],
    /// Where the point rests (m).
    rest: DVec3,
    /// Where the point was when the grasp began (m).
    captured: DVec3,
    /// Stiffness over Young's modulus times the edge of a cell.
    pub stiffness: f32,
    /// Displacement of the point (cells) where the spring has no force.
    pub target: [f32; 3],
}

/// One instance's grasp.
#[derive(Clone, Debug)]
pub(super) struct LaneGrasp {
    pub springs: Vec<Spring>,
    /// The tool, in the organ's frame, when the grasp began.
    captured_at: Pose,
    /// Whether all targets are finite.
    sound: bool,
}

/// The grasps of a group.
pub(super) struct Grasps {
    pub lanes: [LaneGrasp; BLOCK],
    /// Axes of the points of the grasp that has most.
    rank: usize,
    /// Motion of the nodes under a unit force at each axis, with the stiffness of the factor: node
    /// by node, axis by axis.
    response: Vec<[Block<f32>; 3]>,
    /// Forces at the axes by the motions there without the grasp, column by column.
    pub resistance: Vec<[Block<f32>; MAX_RANK]>,
}

impl Grasps {
    /// None.
    pub fn new() -> Self {
        let lanes = std::array::from_fn(|_| LaneGrasp::none());
        Self { lanes, rank: 0, response: Vec::new(), resistance: Vec::new() }
    }

    /// Whether a lane has one.
    pub fn holds(&self, lane: usize) -> bool {
        !self.lanes[lane].springs.is_empty()
    }

    /// Whether a lane's tool is somewhere.
    pub fn is_sound(&self, lane: usize) -> bool {
        self.lanes[lane].sound
    }

    /// Bytes of the responses.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.response[..]) + size_of_val(&self.resistance[..])
    }

    /// Begins a grasp: springs of `stiffness` each, over Young's modulus times the edge of a cell,
    /// from points that are displaced by `at(point)` (m) to a tool at `tool` in the organ's frame.
    pub fn begin(
        &mut self,
        lane: usize,
        (level, topology, factor): (Level, &Topology, &Factor),
        (points, stiffness): (&[EmbeddedPoint], f32),
        tool: Pose,
        at: impl Fn(&EmbeddedPoint) -> DVec3,
    ) {
        self.end(lane);
        let spring = |point: &EmbeddedPoint| {
            let nodes = topology.nodes_of(point);
            let rest: DVec3 =
                nodes.iter().zip(&point.weights).map(|(node, weight)| *weight * topology.rest[*node as usize]).sum();
            let displacement = at(point);
            Spring {
                nodes,
                weights: point.weights.map(|w| w as f32),
                rest,
                captured: rest + displacement,
                stiffness,
                target: (displacement / topology.cell).as_vec3().to_array(),
            }
        };
        let springs: Vec<Spring> = points.iter().map(spring).collect();
        self.grow(3 * springs.len(), topology.len());
        self.respond(lane, level, topology.len(), factor, &springs);
        self.lanes[lane] = LaneGrasp { springs, captured_at: tool, sound: true };
    }

    /// Makes room for the responses of `rank` axes.
    fn grow(&mut self, rank: usize, count: usize) {
        if rank <= self.rank {
            return;
        }
        let mut response = vec![[Block([0.0; BLOCK]); 3]; rank * count];
        if self.rank > 0 {
            for (to, from) in response.chunks_exact_mut(rank).zip(self.response.chunks_exact(self.rank)) {
                to[..self.rank].copy_from_slice(from);
            }
        }
        self.response = response;
        self.resistance.resize(rank, [Block([0.0; BLOCK]); MAX_RANK]);
        self.rank = rank;
    }

    /// Solves for the responses to forces at the springs' points.
    fn respond(&mut self, lane: usize, level: Level, count: usize, factor: &Factor, springs: &[Spring]) {
        // Each axis takes a lane.
        let mut x = vec![[Block([0.0; BLOCK]); 3]; count + 1];
        for (p, spring) in springs.iter().enumerate() {
            for (node, weight) in spring.nodes.iter().zip(&spring.weights) {
                (0..3).for_each(|k| x[*node as usize][k].0[3 * p + k] += *weight);
            }
        }
        dispatch!(level, simd => solve_parts(simd, factor, &mut x));
        let rank = 3 * springs.len();
        for (to, x) in self.response.chunks_exact_mut(self.rank).zip(&x) {
            for (axis, to) in to[..rank].iter_mut().enumerate() {
                (0..3).for_each(|k| to[k].0[lane] = x[k].0[axis]);
            }
        }
        let mut matrix = vec![vec![0.0f64; rank]; rank];
        for (p, spring) in springs.iter().enumerate() {
            for (node, weight) in spring.nodes.iter().zip(&spring.weights) {
                for (axis, column) in matrix.iter_mut().enumerate() {
                    for k in 0..3 {
                        column[3 * p + k] += f64::from(*weight) * f64::from(x[*node as usize][k].0[axis]);
                    }
                }
            }
            (0..3).for_each(|k| matrix[3 * p + k][3 * p + k] += 1.0 / f64::from(spring.stiffness));
        }
        invert(&mut matrix);
        for (to, column) in self.resistance.iter_mut().zip(&matrix) {
            for (to, number) in to.iter_mut().zip(column) {
                to.0[lane] = *number as f32;
            }
        }
    }

    /// Ends a lane's grasp.
    pub fn end(&mut self, lane: usize) {
        self.lanes[lane] = LaneGrasp::none();
        let blocks = self.response.as_flattened_mut().iter_mut().chain(self.resistance.as_flattened_mut());
        blocks.for_each(|block| block.0[lane] = 0.0);
    }

    /// Carries a lane's targets to where a tool in the organ's frame takes them; `cell` is the edge
    /// of a cell (m).
    pub fn carry(&mut self, lane: usize, tool: &Pose, cell: f64) {
        let grasp = &mut self.lanes[lane];
        let turn = tool.rotation * grasp.captured_at.rotation.inverse();
        grasp.sound = true;
        for spring in &mut grasp.springs {
            let arm = spring.captured - grasp.captured_at.translation;
            let place = spring.captured + (turn * arm - arm) + (tool.translation - grasp.captured_at.translation);
            let target = ((place - spring.rest) / cell).as_vec3();
            grasp.sound &= target.is_finite();
            spring.target = target.to_array();
        }
    }

    /// Force of a lane's springs on the tissue over Young's modulus times the square of the edge of
    /// a cell, at the displacements `u` (cells).
    pub fn force(&self, lane: usize, u: &[[Block<f32>; 3]]) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for spring in &self.lanes[lane].springs {
            for k in 0..3 {
                sum[k] -= f64::from(spring.stiffness * off(spring, u, lane, k));
            }
        }
        sum
    }

    /// Adds the springs' gradient in the lanes of a part.
    #[inline(always)]
    pub fn add_gradient<S: Simd>(
        &self,
        _simd: S,
        u: &[[Block<f32>; 3]],
        gradient: &mut [[Block<f32>; 3]],
        part: usize,
    ) {
        for lane in part * width::<S>()..(part + 1) * width::<S>() {
            let grasp = &self.lanes[lane];
            if !grasp.sound {
                continue;
            }
            for spring in &grasp.springs {
                for k in 0..3 {
                    let force = spring.stiffness * off(spring, u, lane, k);
                    for c in 0..8 {
                        gradient[spring.nodes[c] as usize][k].0[lane] += spring.weights[c] * force;
                    }
                }
            }
        }
    }

    /// Makes what the factor alone solved the solution with the springs.
    #[inline(always)]
    pub fn correct<S: Simd>(&self, simd: S, x: &mut [[Block<f32>; 3]], part: usize) {
        if self.rank == 0 {
            return;
        }
        let mut motion = [Block([0.0f32; BLOCK]); MAX_RANK];
        let mut held = 0u16;
        for lane in part * width::<S>()..(part + 1) * width::<S>() {
            held |= u16::from(self.holds(lane)) << lane;
            for (p, spring) in self.lanes[lane].springs.iter().enumerate() {
                for c in 0..8 {
                    for k in 0..3 {
                        motion[3 * p + k].0[lane] += spring.weights[c] * x[spring.nodes[c] as usize][k].0[lane];
                    }
                }
            }
        }
        let mut force = [splat(simd, 0.0); MAX_RANK];
        for (column, motion) in self.resistance.iter().zip(&motion) {
            let motion = load(simd, motion, part);
            for r in 0..self.rank {
                force[r] += load(simd, &column[r], part) * motion;
            }
        }
        // Lanes without a grasp keep every bit.
        let held: Mask<S> = lanes(simd, part_of::<S>(held, part));
        for (x, response) in x.iter_mut().zip(self.response.chunks_exact(self.rank)) {
            let mut by = [splat(simd, 0.0); 3];
            for (response, force) in response.iter().zip(&force) {
                for k in 0..3 {
                    by[k] += load(simd, &response[k], part) * *force;
                }
            }
            for k in 0..3 {
                let at: Reg<S> = load(simd, &x[k], part);
                store::<S>(held.select(at - by[k], at), &mut x[k], part);
            }
        }
    }
}

impl LaneGrasp {
    fn none() -> Self {
        Self { springs: Vec::new(), captured_at: Pose::IDENTITY, sound: true }
    }
}

/// Inverts a symmetric positive definite matrix in place (Gauss and Jordan).
fn invert(matrix: &mut [Vec<f64>]) {
    let n = matrix.len();
    for p in 0..n {
        let pivot = 1.0 / matrix[p][p];
        matrix[p][p] = 1.0;
        matrix[p].iter_mut().for_each(|x| *x *= pivot);
        let row = matrix[p].clone();
        for (_, other) in matrix.iter_mut().enumerate().filter(|(i, _)| *i != p) {
            let by = std::mem::replace(&mut other[p], 0.0);
            other.iter_mut().zip(&row).for_each(|(x, r)| *x -= by * r);
        }
    }
}

/// How far a spring's point is from its target along an axis (cells).
#[inline(always)]
fn off(spring: &Spring, u: &[[Block<f32>; 3]], lane: usize, k: usize) -> f32 {
    let mut at = -spring.target[k];
    for c in 0..8 {
        at += spring.weights[c] * u[spring.nodes[c] as usize][k].0[lane];
    }
    at
}

#[inline(always)]
fn solve_parts<S: Simd>(simd: S, factor: &Factor, x: &mut [[Block<f32>; 3]]) {
    for part in 0..parts::<S>() {
        factor.solve(simd, x, part);
    }
}
