//! Transfers the properties of a cut body to its pieces: masses, pins, motion, grasps, collision
//! filters.

use super::split::{Split, parts};
use super::{Piece, Severed};
use crate::builder::{Inherited, NodeMasses, embed, lay_out};
use crate::state::{Anchor, BodyState, WarmStart};
use crate::{Backend, Body, BodyDescription, Compliance, Grasp, Hole, Model, Result, State, Tether};
use trocar_geometry::TetMesh;

/// A mass this many times the weight of the volume around a node was raised to the floor; less is
/// rounding.
const RAISED_MASS_RATIO: f64 = 1.0 + 1e-5;

/// The model and state with the body at `index` as it was `split`.
///
/// # Errors
/// A piece without a lattice, if the whole has one.
pub(super) fn carry(model: &Model, state: &State, index: usize, split: &Split) -> Result<Severed> {
    let whole = &model.bodies[index];
    let (group, groups) = bodies(whole, split);
    // Place of each new node in its body.
    let mut place = vec![0u32; group.len()];
    let mut nodes: Vec<Vec<u32>> = vec![Vec::new(); groups];
    for (node, g) in group.iter().enumerate() {
        place[node] = nodes[*g].len() as u32;
        nodes[*g].push(node as u32);
    }
    let mut elements: Vec<Vec<u32>> = vec![Vec::new(); groups];
    for (t, tet) in split.tets.iter().enumerate() {
        elements[group[tet[0] as usize]].push(t as u32);
    }
    let masses = Masses::new(whole, split);
    let (mut after, mut moved) = (model.clone(), state.clone());
    let mut pieces = Vec::with_capacity(groups);
    for (g, (nodes, elements)) in nodes.into_iter().zip(elements).enumerate() {
        let name = if g == 0 { whole.name.clone() } else { free_name(&after.bodies, &whole.name) };
        let mesh = TetMesh {
            vertices: nodes.iter().map(|i| whole.rest.vertices[split.parent[*i as usize] as usize]).collect(),
            tets: elements.iter().map(|t| split.tets[*t as usize].map(|i| place[i as usize])).collect(),
        };
        let inherited = Inherited {
            origin: whole.origin,
            masses: nodes.iter().map(|i| masses.of[*i as usize]).collect(),
            raised: nodes.iter().filter(|i| masses.raised[split.parent[**i as usize] as usize]).count(),
        };
        // A node that fell apart leaves its threads to the first of its copies.
        let threads = |t: &Tether| Some(Tether { node: nodes.binary_search(&t.node).ok()? as u32, ..*t });
        let tethers = whole.tethers.iter().filter_map(threads).collect();
        let nodes: Vec<u32> = nodes.iter().map(|i| split.parent[*i as usize]).collect();
        let pinned = (0..nodes.len() as u32).filter(|k| whole.pinned[nodes[*k as usize] as usize]).collect();
        let (material, supports) = (whole.material, whole.supports.clone());
        let description = BodyDescription { name, mesh: &mesh, material, pinned, supports };
        let mut body = lay_out(description, whole.contact_stiffness, NodeMasses::Inherited(inherited));
        body.tethers = tethers;
        if let Backend::Lattice(settings) = model.backend {
            body.lattice = embed(&body, settings)?;
        }
        let mut motion = motion(whole, &state.bodies[index], &body, &nodes);
        if let (Some(lattice), Some(before), Some(state)) =
            (&body.lattice, &whole.lattice, &state.bodies[index].lattice)
        {
            motion.lattice = Some(lattice.of_piece(before, state, &elements));
        }
        let at = if g == 0 { index } else { after.bodies.len() };
        if g == 0 {
            after.bodies[at] = body;
            moved.bodies[at] = motion;
        } else {
            after.bodies.push(body);
            moved.bodies.push(motion);
        }
        pieces.push(Piece { body: at, nodes, elements });
    }
    filter(&mut after.filtered, index, model.bodies.len()..after.bodies.len());
    let hands = Hands { split, group: &group, place: &place, pieces: &pieces };
    moved.grasps.clear();
    for grasp in &state.grasps {
        if grasp.body == index && !grasp.nodes.is_empty() {
            hands.share_out(grasp, &mut moved.grasps);
        } else {
            moved.grasps.push(grasp.clone());
        }
    }
    moved.holes.clear();
    for hole in &state.holes {
        if hole.body == index {
            hands.follow(hole, &mut moved.holes);
        } else {
            moved.holes.push(hole.clone());
        }
    }
    Ok(Severed { model: after, state: moved, faces: split.faces, pieces })
}

/// The body of each new node, 0 being the one that stays, and the number of bodies. Of each
/// connected part that the cut severed, the piece with the most pinned nodes, then the largest,
/// then the first, stays.
fn bodies(whole: &Body, split: &Split) -> (Vec<usize>, usize) {
    let (part, count) = parts(&split.tets, split.parent.len());
    let (old, old_count) = parts(&whole.rest.tets, split.before);
    let (mut pins, mut volume, mut was) = (vec![0usize; count], vec![0.0; count], vec![0usize; count]);
    for (node, p) in part.iter().enumerate() {
        let parent = split.parent[node] as usize;
        pins[*p as usize] += usize::from(whole.pinned[parent]);
        was[*p as usize] = old[parent] as usize;
    }
    for (tet, v) in split.tets.iter().zip(&whole.volumes) {
        volume[part[tet[0] as usize] as usize] += v;
    }
    let mut stays: Vec<Option<usize>> = vec![None; old_count];
    for p in 0..count {
        let best = &mut stays[was[p]];
        let better = |b: usize| (pins[p], volume[p]) > (pins[b], volume[b]);
        if best.is_none_or(better) {
            *best = Some(p);
        }
    }
    let mut groups = 1;
    let mut group_of = vec![0; count];
    for p in (0..count).filter(|p| stays[was[*p]] != Some(*p)) {
        group_of[p] = groups;
        groups += 1;
    }
    (part.iter().map(|p| group_of[*p as usize]).collect(), groups)
}

/// Masses of the new nodes.
struct Masses {
    /// By new node (kg).
    of: Vec<f64>,
    /// By old node: whether the mass floor raised it.
    raised: Vec<bool>,
}

impl Masses {
    /// A node that fell apart leaves its mass, raised or not, to its copies by the volumes of the
    /// elements around them.
    fn new(whole: &Body, split: &Split) -> Self {
        let mut before = vec![0.0; split.before];
        let mut after = vec![0.0; split.parent.len()];
        for (t, v) in whole.volumes.iter().enumerate() {
            whole.rest.tets[t].iter().for_each(|i| before[*i as usize] += 0.25 * v);
            split.tets[t].iter().for_each(|i| after[*i as usize] += 0.25 * v);
        }
        let mass = |i: usize| {
            let parent = split.parent[i];
            let share = if split.fell_apart(parent) { after[i] / before[parent as usize] } else { 1.0 };
            share * whole.mass(parent as usize)
        };
        let raised = |i: usize| whole.mass(i) > RAISED_MASS_RATIO * whole.material.density * before[i];
        Self { of: (0..after.len()).map(mass).collect(), raised: (0..before.len()).map(raised).collect() }
    }
}

/// The motion of a piece whose nodes were `nodes` of the whole.
fn motion(whole: &Body, state: &BodyState, piece: &Body, nodes: &[u32]) -> BodyState {
    // Internal vertex of the whole for each internal vertex of the piece.
    let mut from = vec![0usize; nodes.len()];
    for (k, parent) in nodes.iter().enumerate() {
        from[piece.internal[k] as usize] = whole.internal[*parent as usize] as usize;
    }
    BodyState {
        x: from.iter().map(|i| state.x[*i]).collect(),
        v: from.iter().map(|i| state.v[*i]).collect(),
        anchors: from.iter().enumerate().flat_map(|(k, i)| anchors(state, *i, k as u32)).collect(),
        // Cut tissue settles against its neighbours and tools from the beginning.
        feature_anchors: Vec::new(),
        stretches: Vec::new(),
        disturbed: state.disturbed,
        warm: WarmStart {
            falling: from.iter().map(|i| state.warm.falling[*i]).collect(),
            supported: from.iter().map(|i| state.warm.supported[*i]).collect(),
        },
        lattice: piece.lattice.as_ref().map(|lattice| lattice.at_rest()),
        follows: false,
    }
}

/// The anchors of vertex `from`, for its copy `to`.
fn anchors(state: &BodyState, from: usize, to: u32) -> impl Iterator<Item = Anchor> {
    let of = move |anchor: &&Anchor| anchor.vertex == from as u32;
    let first = state.anchors.partition_point(|anchor| anchor.vertex < from as u32);
    state.anchors[first..].iter().take_while(of).map(move |anchor| Anchor { vertex: to, ..*anchor })
}

/// The first of `name.1`, `name.2`, ... that no body has.
fn free_name(bodies: &[Body], name: &str) -> String {
    let mut k = 1;
    loop {
        let candidate = format!("{name}.{k}");
        if bodies.iter().all(|body| body.name != candidate) {
            return candidate;
        }
        k += 1;
    }
}

/// Filters pieces against the bodies that the whole did not touch.
fn filter(filtered: &mut Vec<[usize; 2]>, whole: usize, pieces: std::ops::Range<usize>) {
    let known = filtered.clone();
    for [a, b] in known.into_iter().filter(|pair| pair.contains(&whole)) {
        for piece in pieces.clone() {
            if a == b {
                filtered.push([whole, piece]);
                filtered.extend((pieces.start..=piece).map(|other| [other, piece]));
            } else {
                filtered.push([if a == whole { b } else { a }, piece]);
            }
        }
    }
    filtered.sort_unstable();
}

/// Distributes grasps and holes among the pieces.
struct Hands<'a> {
    split: &'a Split,
    /// By new node: the number of its piece and its node there.
    group: &'a [usize],
    place: &'a [u32],
    pieces: &'a [Piece],
}

impl Hands<'_> {
    /// Appends a hole for each piece that has nodes of `hole`.
    fn follow(&self, hole: &Hole, to: &mut Vec<Hole>) {
        let mut nodes: Vec<Vec<u32>> = vec![Vec::new(); self.pieces.len()];
        for i in hole.nodes.iter().flat_map(|node| self.split.copies(*node)) {
            nodes[self.group[i as usize]].push(self.place[i as usize]);
        }
        for (piece, mut nodes) in self.pieces.iter().zip(nodes).filter(|(_, nodes)| !nodes.is_empty()) {
            nodes.sort_unstable();
            to.push(Hole { body: piece.body, tools: hole.tools.clone(), nodes });
        }
    }

    /// Appends a grasp for each piece of which `grasp` holds nodes.
    fn share_out(&self, grasp: &Grasp, to: &mut Vec<Grasp>) {
        let mut off_the_cut = vec![false; self.split.before];
        for node in &grasp.nodes {
            off_the_cut[*node as usize] = !self.split.fell_apart(*node);
        }
        // New nodes beside, and pieces with, a held node that stayed whole.
        let mut beside = vec![false; self.split.parent.len()];
        let mut holds = vec![false; self.pieces.len()];
        for tet in &self.split.tets {
            if tet.iter().any(|i| off_the_cut[self.split.parent[*i as usize] as usize]) {
                tet.iter().for_each(|i| beside[*i as usize] = true);
                holds[self.group[tet[0] as usize]] = true;
            }
        }
        let mut held: Vec<(Vec<u32>, Vec<glam::DVec3>, Vec<glam::Vec3A>)> = vec![Default::default(); self.pieces.len()];
        let mut total = 0;
        for ((node, captured), slid) in grasp.nodes.iter().zip(&grasp.captured).zip(&grasp.slid) {
            let copies = || self.split.copies(*node);
            let rule: &dyn Fn(u32) -> bool = if copies().any(|i| beside[i as usize]) {
                &|i| beside[i as usize]
            } else if copies().any(|i| holds[self.group[i as usize]]) {
                &|i| holds[self.group[i as usize]]
            } else {
                &|_| true
            };
            for i in copies().filter(|i| !self.split.fell_apart(*node) || rule(*i)) {
                let (nodes, places, slips) = &mut held[self.group[i as usize]];
                nodes.push(self.place[i as usize]);
                places.push(*captured);
                slips.push(*slid);
                total += 1;
            }
        }
        for (piece, (nodes, captured, slid)) in self.pieces.iter().zip(held).filter(|(_, held)| !held.0.is_empty()) {
            let share = nodes.len() as f64 / f64::from(total);
            let compliance = grasp.compliance.map(|c| Compliance {
                jaw_force: share * c.jaw_force,
                tear_force: share * c.tear_force,
                ..c
            });
            to.push(Grasp { body: piece.body, nodes, captured, slid, compliance, ..grasp.clone() });
        }
    }
}
