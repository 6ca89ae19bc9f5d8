//! The coarse half of the preconditioner: bodies that nothing holds, moved as a whole.
//!
//! A body's factor knows nothing of other bodies. Where tissue gives way, contacts with them are no stiffer than it is, and that does no harm; but as a whole a free body moves as if nothing
//! touched it, and goes too far by orders of magnitude. So its six rigid motions are taken out of what the factor solves, and get a matrix of their own with the body's inertia and all contacts as they
//! are: a two-level preconditioner (Toselli and Widlund 2005, Domain decomposition methods, chapter 3).

use super::Island;
use super::part::{QuasiNewtonSolver, add, position};
use crate::contact::Push;
use crate::integrator::Worker;
use glam::{DMat3, DVec3, Vec3A};

type Matrix = [[f64; 6]; 6];

/// Rigid motions of a body about its centre of mass: displacement, then rotation.
#[derive(Clone, Copy, Default)]
pub(super) struct Rigid {
    centre: Vec3A,
    /// Inertia and contacts over them; its Cholesky factor once complete.
    matrix: Matrix,
    /// Cholesky factor of the inertia alone [kg, kg m2].
    inertia: Matrix,
    /// Right-hand side.
    force: [f64; 6],
}

impl Rigid {
    /// Inertia of a free body over squared substeps.
    fn of(part: &QuasiNewtonSolver, h: f32) -> Self {
        let layout = &part.layout;
        let nodes = || part.x[..layout.free].iter().map(position).zip(&layout.masses);
        let (mass, moment) = nodes().fold((0.0f32, Vec3A::ZERO), |(m, sum), (x, mass)| (m + mass, sum + *mass * x));
        let centre = moment / mass;
        let mut rigid = Self { centre, ..Self::default() };
        let inertia = nodes().fold(DMat3::ZERO, |sum, (x, mass)| {
            let (r, m) = ((x - centre).as_dvec3(), f64::from(*mass));
            sum + m * (DMat3::from_diagonal(DVec3::splat(r.length_squared())) - outer(r))
        });
        for k in 0..3 {
            rigid.inertia[k][k] = f64::from(mass);
            for c in 0..3 {
                rigid.inertia[3 + k][3 + c] = inertia.col(c)[k];
            }
        }
        let rate = 1.0 / (f64::from(h) * f64::from(h));
        rigid.matrix = rigid.inertia.map(|row| row.map(|entry| rate * entry));
        rigid
    }

    /// Adds a contact of stiffness `push` with `normal`, whose offset changes by so much of what each of the body's vertices at `arms` moves.
    fn add(&mut self, push: &Push, normal: Vec3A, arms: impl Iterator<Item = (Vec3A, f32)>) {
        let (mut whole, mut arm) = (0.0, DVec3::ZERO);
        for (x, share) in arms {
            whole += f64::from(share);
            arm += f64::from(share) * (x - self.centre).as_dvec3();
        }
        let n = normal.as_dvec3();
        let (along, across) = (f64::from(push.along), f64::from(push.across));
        for (direction, stiffness) in [(n, along - across), (DVec3::X, across), (DVec3::Y, across), (DVec3::Z, across)]
        {
            let turn = arm.cross(direction);
            let row = [whole * direction, turn].map(|v| v.to_array());
            let row: [f64; 6] = std::array::from_fn(|k| row[k / 3][k % 3]);
            for (line, a) in self.matrix.iter_mut().zip(row) {
                line.iter_mut().zip(row).for_each(|(entry, b)| *entry += stiffness * a * b);
            }
        }
    }

    /// Factorises both matrices; false if one is not positive definite.
    fn factorise(&mut self) -> bool {
        factorise(&mut self.matrix) && factorise(&mut self.inertia)
    }

    /// Sum and moment of a force at each node.
    fn sum(&self, nodes: impl Iterator<Item = (Vec3A, Vec3A)>) -> [f64; 6] {
        let (mut sum, mut moment) = (DVec3::ZERO, DVec3::ZERO);
        for (x, force) in nodes {
            sum += force.as_dvec3();
            moment += (x - self.centre).as_dvec3().cross(force.as_dvec3());
        }
        [sum.x, sum.y, sum.z, moment.x, moment.y, moment.z]
    }

    /// What a rigid motion is at a node.
    fn motion(&self, by: [f64; 6]) -> impl Fn(Vec3A) -> Vec3A {
        let way = DVec3::new(by[0], by[1], by[2]).as_vec3a();
        let turn = DVec3::new(by[3], by[4], by[5]).as_vec3a();
        let centre = self.centre;
        move |x| way + turn.cross(x - centre)
    }
}

/// Cholesky's factor in place of the lower triangle; false if the matrix is not positive definite.
fn factorise(m: &mut Matrix) -> bool {
    for j in 0..6 {
        for i in j..6 {
            let known: f64 = (0..j).map(|k| m[i][k] * m[j][k]).sum();
            let rest = m[i][j] - known;
            if i == j && (rest.is_nan() || rest <= 0.0) {
                return false;
            }
            m[i][j] = if i == j { rest.sqrt() } else { rest / m[j][j] };
        }
    }
    true
}

fn solve(m: &Matrix, mut x: [f64; 6]) -> [f64; 6] {
    for i in 0..6 {
        let known: f64 = (0..i).map(|k| m[i][k] * x[k]).sum();
        x[i] = (x[i] - known) / m[i][i];
    }
    for i in (0..6).rev() {
        let known: f64 = (i + 1..6).map(|k| m[k][i] * x[k]).sum();
        x[i] = (x[i] - known) / m[i][i];
    }
    x
}

fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

impl QuasiNewtonSolver {
    /// Whether nothing holds any node.
    pub fn is_free(&self) -> bool {
        self.layout.free == self.layout.nodes && !self.held.contains(&true)
    }

    /// Takes the rigid part out of the direction, which is a force still.
    pub(super) fn take_rigid(&mut self) {
        let Self { rigid: Some(rigid), x, direction, layout, .. } = self else { return };
        let nodes = x.iter().map(position).zip(direction[..layout.free].iter().map(position));
        rigid.force = rigid.sum(nodes);
        let accelerated = rigid.motion(solve(&rigid.inertia, rigid.force));
        for ((x, d), mass) in x.iter().zip(direction).zip(&layout.masses) {
            add(d, -*mass * accelerated(position(x)));
        }
    }

    /// Takes the rigid part out of the direction, now a way, and adds the one that the coarse half makes of the force.
    pub(super) fn add_rigid(&mut self) {
        let Self { rigid: Some(rigid), x, direction, layout, .. } = self else { return };
        let ways = direction[..layout.free].iter().map(position).zip(&layout.masses).map(|(d, mass)| *mass * d);
        let fine = solve(&rigid.inertia, rigid.sum(x.iter().map(position).zip(ways)));
        let coarse = solve(&rigid.matrix, rigid.force);
        let by = rigid.motion(std::array::from_fn(|k| coarse[k] - fine[k]));
        for (x, d) in x[..layout.free].iter().zip(direction) {
            add(d, by(position(x)));
        }
    }
}

impl Island<'_> {
    /// Makes the coarse half for the bodies and contacts as they are. Bodies that are alone do without: the history learns what little they need.
    pub(super) fn assemble_rigid(&mut self) {
        let h = self.h;
        let coupled = !self.pairs.is_empty();
        for part in self.all() {
            part.rigid = (coupled && part.active && part.is_free()).then(|| Rigid::of(part, h));
        }
        let Self { workers, pairs, .. } = self;
        for Worker { solver, .. } in workers.iter_mut() {
            let Some(mut rigid) = solver.rigid else { continue };
            for (touch, limit) in solver.contacts.touches().iter().zip(&solver.limits) {
                let x = solver.at(touch.vertex);
                if let Some(push) = touch.push_within(x, *limit) {
                    rigid.add(&push, touch.normal, [(x, 1.0)].into_iter());
                }
            }
            solver.rigid = Some(rigid);
        }
        for pair in pairs.list() {
            let free = |m: usize| workers[m].solver.rigid.is_some();
            if !free(pair.member) && !free(pair.other) {
                continue;
            }
            let offset = pair.offset(|m, vertex| workers[m].solver.at(vertex));
            let Some(push) = pair.push(offset) else { continue };
            let both = [pair.member, pair.other];
            for m in &both[..if pair.member == pair.other { 1 } else { 2 }] {
                let Some(mut rigid) = workers[*m].solver.rigid else { continue };
                let own = pair.shares().into_iter().filter(|(of, ..)| of == m);
                let arms = own.map(|(_, vertex, share)| (workers[*m].solver.at(vertex), share));
                rigid.add(&push, pair.touch.normal, arms);
                workers[*m].solver.rigid = Some(rigid);
            }
        }
        for part in self.parts() {
            part.rigid = part.rigid.take().and_then(|mut rigid| rigid.factorise().then_some(rigid));
        }
    }
}
