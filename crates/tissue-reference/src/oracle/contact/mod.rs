//! Contact with tools and between bodies, as the oracle sees it.
//!
//! Distances and normals are those of the present place, not of fixed planes. Some quantities have
//! no potential: friction's limits and planes, the touching features of the surface, and their
//! stiffness. They are fixed during a minimisation and then updated, until the forces of the true
//! law are in balance ([`super::rounds`]). Only the model's data are shared with the fast solvers:
//! stiffness of nodes, friction, and the shapes' distances.
//!
//! - Nodes of the surface touch shapes by their signed distance.
//! - With [`ToolContact::Surface`], edges and triangles touch axes of round shapes ([`features`]).
//! - Nodes of one body touch the nearest place of another's surface ([`surface`]), found among all
//!   its triangles, with the sign by winding.
//!
//! Bodies that fold onto themselves and tools' grips are left out. A tool that moves by more than
//! its radius in a step may come out on the wrong side: the step has no way, only an end.

mod features;
mod piece;
mod surface;
#[cfg(test)]
mod tests;
mod touch;

use super::state::{Stretches, TouchKey, Touched};
use glam::DVec3;
use piece::{Kind, Piece};
use surface::Surface;
use touch::{Grip, Touch};
use trocar_core::{Pose, Wrench};
use trocar_tissue::assembly::Stiffness;
use trocar_tissue::{BodyContact, Collider, Model, ToolContact, ToolForce, ToolMotion};

/// Features that are farther than this from a contact are left out until the next search (m).
const REACH: f64 = 2e-3;

/// Triangles that are farther than this from a vertex than the nearest one (m) are left out.
const BESIDE: f64 = 1e-3;

/// Contacts of round shapes are harder from this share of the depth at which tissue would reach
/// their axis.
const HARD_FROM: f64 = 0.5;

/// Length over which the smaller of two distances is rounded off at first and at last (m), and its
/// share in the next round.
const FIRST_BLUR: f64 = 3e-5;
const LAST_BLUR: f64 = 1e-7;
const BLUR_SHARE: f64 = 0.2;

/// The constant part of the contacts of some bodies.
pub struct Touching {
    colliders: Vec<Collider>,
    surfaces: Vec<Surface>,
    tool_contact: ToolContact,
    between: Option<Between>,
    /// Of the first node, among all nodes of the model.
    first: usize,
}

/// Contact between bodies.
struct Between {
    law: BodyContact,
    /// Young's modulus times a node's size (N/m).
    tissue: Vec<f64>,
    pairs: Vec<Apart>,
}

/// The nodes of a body and the surface of another.
struct Apart {
    one: usize,
    other: usize,
    /// Distance without force of each node of the surface (m).
    free: Vec<f64>,
}

impl Touching {
    /// Of some bodies of a model, which are numbered one after the other.
    pub fn new(model: &Model, bodies: std::ops::Range<usize>) -> Self {
        let all = model.bodies();
        let mut start = 0;
        let mut surfaces = Vec::new();
        for body in &all[bodies.clone()] {
            surfaces.push(Surface::of(body, start));
            start += body.len();
        }
        let rest: Vec<DVec3> = all[bodies.clone()].iter().flat_map(|b| b.rest_positions().iter().copied()).collect();
        let between = model.body_contact().filter(|_| bodies.len() > 1).map(|law| {
            let indices = || 0..bodies.len();
            let meet = |a: usize, b: usize| a != b && model.collides(bodies.start + a, bodies.start + b);
            let pairs = indices().flat_map(|a| indices().filter(move |b| meet(a, *b)).map(move |b| (a, b)));
            let apart = |(one, other)| Apart { one, other, free: free_at_rest(&surfaces, one, other, law, &rest) };
            let tissue = all[bodies.clone()].iter().flat_map(|b| (0..b.len()).map(|i| b.tissue_stiffness(i)));
            Between { law, tissue: tissue.collect(), pairs: pairs.map(apart).collect() }
        });
        Self {
            colliders: model.colliders().to_vec(),
            surfaces,
            tool_contact: model.tool_contact(),
            between,
            first: all[..bodies.start].iter().map(|b| b.len()).sum(),
        }
    }
}

/// Distances without force: the offset, or the signed distance at rest if that is less.
fn free_at_rest(surfaces: &[Surface], one: usize, other: usize, law: BodyContact, rest: &[DVec3]) -> Vec<f64> {
    let (low, high) = surfaces[other].bounds(rest);
    let free = |i: &usize| {
        let p = rest[*i];
        if p.clamp(low, high).distance(p) > law.offset {
            return law.offset;
        }
        let distance = surfaces[other].triangles.iter().map(|t| at_triangle(*i, *t).at(rest).distance);
        let distance = distance.fold(f64::INFINITY, f64::min);
        (if surfaces[other].surrounds(rest, p) { -distance } else { distance }).min(law.offset)
    };
    surfaces[one].nodes.iter().map(free).collect()
}

/// The distance of a node from a triangle.
fn at_triangle<'a>(i: usize, [a, b, c]: [usize; 3]) -> Piece<'a> {
    Piece { nodes: [i, a, b, c], count: 4, kind: Kind::Triangle }
}

/// The contacts of one step.
pub struct Contacts<'a> {
    of: &'a Touching,
    /// Stiffness of nodes against tools (N/m).
    stiffness: &'a [f64],
    fixed: &'a [bool],
    /// Where the tool of each collider is at the beginning and at the end; None: it is absent.
    poses: Vec<Option<[Pose; 2]>>,
    /// Positions at the beginning (m), and how far friction's springs are stretched then; None:
    /// statics, which knows no friction.
    start: Option<(&'a [DVec3], &'a Stretches)>,
    list: Vec<Touch<'a>>,
    blur: f64,
}

impl<'a> Contacts<'a> {
    /// None known yet: [`Self::hold`] finds them.
    pub fn new(
        of: &'a Touching,
        stiffness: &'a [f64],
        fixed: &'a [bool],
        tools: &[ToolMotion],
        start: Option<(&'a [DVec3], &'a Stretches)>,
    ) -> Self {
        let pose = |collider: &Collider| tools.get(collider.tool).map(|tool| [tool.from, tool.to]);
        let poses = of.colliders.iter().map(pose).collect();
        Self { of, stiffness, fixed, poses, start, list: Vec::new(), blur: FIRST_BLUR / BLUR_SHARE }
    }

    /// Finds possible contacts near `x`, and fixes everything without a potential at its value
    /// there. Without friction unless `rubs`.
    pub fn hold(&mut self, x: &[DVec3], rubs: bool) {
        self.blur = (BLUR_SHARE * self.blur).max(LAST_BLUR);
        let mut list = Vec::new();
        for c in 0..self.of.colliders.len() {
            self.find_at_tool(c, x, &mut list);
        }
        if let Some(between) = &self.of.between {
            between.pairs.iter().for_each(|pair| self.find_between(between, pair, x, &mut list));
        }
        list.iter_mut().for_each(|touch| self.grip(touch, x, rubs));
        self.list = list;
    }

    /// Whether minima in valleys are as sharp as they will be.
    pub fn is_sharp(&self) -> bool {
        self.of.between.is_none() || self.blur <= LAST_BLUR
    }

    fn find_at_tool(&self, c: usize, x: &[DVec3], list: &mut Vec<Touch<'a>>) {
        let (of, Some([_, pose])) = (self.of, self.poses[c]) else { return };
        let collider = &of.colliders[c];
        let hard_from = features::axis(&collider.shape)
            .map_or(f64::INFINITY, |(_, radius)| HARD_FROM * (radius + collider.rest_offset));
        let mut push = |nodes: &[usize], end: u8, kind: Kind<'a>, free: f64, stiffness: f64| {
            let mut all = [nodes[0]; 4];
            all[..nodes.len()].copy_from_slice(nodes);
            let touch = Touch {
                key: self.key(Touched::Collider(c), nodes, end),
                pieces: vec![Piece { nodes: all, count: nodes.len(), kind }],
                surface: None,
                free,
                stiffness,
                hard_from,
                friction: collider.friction,
                grip: Grip::default(),
            };
            if touch.gap(x, self.blur).depth < REACH {
                list.push(touch);
            }
        };
        for surface in &of.surfaces {
            for i in surface.nodes.iter().filter(|i| !self.fixed[**i]) {
                push(&[*i], 0, Kind::Shape(&collider.shape, pose), collider.rest_offset, self.stiffness[*i]);
            }
            let Some((ends, radius)) = features::axis(&collider.shape) else { continue };
            if of.tool_contact != ToolContact::Surface {
                continue;
            }
            let (axis, free) = (ends.map(|p| pose.transform(p)), radius + collider.rest_offset);
            let moves = |nodes: &[usize]| nodes.iter().any(|i| !self.fixed[*i]);
            for edge in surface.edges.iter().filter(|edge| moves(&edge.0)) {
                if let Some(stiffness) = features::of_edge(edge, axis, x, self.stiffness) {
                    push(&edge.0, 0, Kind::Segment(axis), free, stiffness);
                }
            }
            let points = if axis[0] == axis[1] { 1 } else { 2 };
            for (t, end) in
                surface.triangles.iter().filter(|t| moves(&t[..])).flat_map(|t| (0..points).map(move |end| (t, end)))
            {
                if let Some(stiffness) = features::of_triangle(*t, axis[end], x, self.stiffness) {
                    push(t, end as u8, Kind::Point(axis[end]), free, stiffness);
                }
            }
        }
    }

    fn find_between(&self, between: &'a Between, pair: &Apart, x: &[DVec3], list: &mut Vec<Touch<'a>>) {
        let (one, other) = (&self.of.surfaces[pair.one], &self.of.surfaces[pair.other]);
        let (low, high) = other.bounds(x);
        let law = between.law;
        for (i, free) in one.nodes.iter().zip(&pair.free) {
            if x[*i].clamp(low, high).distance(x[*i]) > free + REACH {
                continue;
            }
            let near: Vec<(Piece<'_>, f64)> = other
                .triangles
                .iter()
                .map(|t| at_triangle(*i, *t))
                .map(|piece| (piece.clone(), piece.at(x).distance))
                .collect();
            let least = near.iter().map(|(_, distance)| *distance).fold(f64::INFINITY, f64::min);
            let Some((nearest, _)) = near.iter().find(|(_, distance)| *distance == least) else { continue };
            let shares = nearest.at(x).shares;
            let theirs: f64 = (1..4).map(|k| -shares[k] * between.tissue[nearest.nodes[k]]).sum();
            let ours = between.tissue[*i];
            let touch = Touch {
                key: self.key(Touched::Body(pair.other), &[*i], 0),
                pieces: near.into_iter().filter(|(_, d)| *d <= least + BESIDE).map(|(piece, _)| piece).collect(),
                surface: Some(other),
                free: *free,
                // Two springs in a row, one in each body.
                stiffness: 2.0 * law.stiffness * ours * theirs / (ours + theirs),
                hard_from: f64::INFINITY,
                friction: law.friction,
                grip: Grip::default(),
            };
            let depth = touch.gap(x, self.blur).depth;
            if depth < REACH && depth + free >= free.min(0.0) - law.depth {
                list.push(touch);
            }
        }
    }

    fn key(&self, touched: Touched, nodes: &[usize], end: u8) -> TouchKey {
        let mut all = [u32::MAX; 3];
        nodes.iter().zip(&mut all).for_each(|(i, name)| *name = (self.of.first + i) as u32);
        all[..nodes.len()].sort_unstable();
        TouchKey { touched, nodes: all, end }
    }

    /// Holds friction as it is at `x`.
    fn grip(&self, touch: &mut Touch<'a>, x: &[DVec3], rubs: bool) {
        let gap = touch.gap(x, self.blur);
        // The direction in which the point that touches would open the gap.
        let slopes = gap.gradient.iter().zip(&gap.shares);
        let push: DVec3 = slopes.filter(|(_, (_, share))| *share > 0.0).map(|((_, slope), _)| *slope).sum();
        let place = self.start.map_or(DVec3::ZERO, |(start, stretches)| {
            let stretch = stretches.get(&touch.key).copied().unwrap_or_default();
            let before = gap.shares.iter().map(|(i, share)| *share * start[*i]).sum::<DVec3>() - stretch;
            match touch.key.touched {
                Touched::Collider(c) => {
                    let carried = |[from, to]: [Pose; 2]| to.transform(from.inverse().transform(before));
                    self.poses[c].map_or(before, carried)
                }
                Touched::Body(_) => before,
            }
        });
        let pressed = touch.pressure(gap.depth);
        let limit = if rubs && self.start.is_some() { touch.friction * pressed } else { 0.0 };
        touch.grip = Grip { normal: push.normalize_or_zero(), place, limit, shares: gap.shares };
    }

    /// Energy at `x` (J); calls `add` for the gradient of every node of every contact (N).
    pub fn gradient(&self, x: &[DVec3], mut add: impl FnMut(usize, DVec3)) -> f64 {
        let mut energy = 0.0;
        for touch in &self.list {
            let gap = touch.gap(x, self.blur);
            if gap.depth < 0.0 {
                energy += touch.energy(gap.depth);
                let force = -touch.pressure(gap.depth);
                gap.gradient.iter().for_each(|(i, slope)| add(*i, force * *slope));
            }
            if let Some(rub) = touch.rub(x) {
                energy += rub.energy;
                touch.grip.shares.iter().for_each(|(i, share)| add(*i, *share * rub.gradient));
            }
        }
        energy
    }

    /// Adds the Hessian at `x` (N/m); see [`super::potential::Potential::hessian`].
    pub fn hessian(&self, x: &[DVec3], project: bool, secant: bool, into: &mut Stiffness) {
        self.list.iter().for_each(|touch| touch.hessian(x, self.blur, project, secant, into));
    }

    /// Nodes that contacts between bodies couple, in sets.
    pub fn couplings(&self) -> impl Iterator<Item = Vec<usize>> + '_ {
        let between = self.list.iter().filter(|touch| matches!(touch.key.touched, Touched::Body(_)));
        between.map(|touch| touch.grip.shares.iter().map(|(i, _)| *i).collect())
    }

    /// How far friction's springs are stretched after a step that ended at `x`.
    pub fn stretches(&self, x: &[DVec3]) -> Stretches {
        let pressed = self.list.iter().filter(|touch| touch.gap(x, self.blur).depth < 0.0);
        pressed.map(|touch| (touch.key, touch.stretch(x))).collect()
    }

    /// Adds the forces on tools with the nodes at `x`.
    pub fn add_forces(&self, x: &[DVec3], forces: &mut [ToolForce]) {
        for touch in &self.list {
            let Touched::Collider(c) = touch.key.touched else { continue };
            let (gap, Some([_, pose])) = (touch.gap(x, self.blur), self.poses[c]) else { continue };
            let Some(force) = forces.get_mut(self.of.colliders[c].tool).filter(|_| gap.depth < 0.0) else { continue };
            let normal: DVec3 = gap.gradient.iter().map(|(_, g)| *g).sum();
            let rub = touch.rub(x).map_or(DVec3::ZERO, |rub| rub.gradient);
            let push = -touch.pressure(gap.depth) * normal + rub;
            force.contact += Wrench::at(push, touch.point(x) - pose.translation);
            force.pressing += touch.pressure(gap.depth);
            force.touching += 1;
        }
    }
}
