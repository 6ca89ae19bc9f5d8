//! The linear system of one body: its stiffness at rest with the masses of a substep, factorised
//! once, turned with the tissue, and updated for contacts. It preconditions the search.

use super::elements::Elements;
use super::factor::Factor;
use super::iterate::{add, position};
use super::layout::Layout;
use super::low_rank_update::LowRankUpdate;
use super::stiffened::{MAX_STIFFENED, Stiffened};
use super::warp::Warp;
use crate::Body;
use crate::contact::ContactSet;
use crate::lanes::Row;
use fearless_simd::{Level, dispatch};
use glam::{Mat3A, Vec3A};

/// A node that presses harder than in the factor by less than this share is taken as it is there.
const MIN_HARDER: f32 = 0.5;

/// The preconditioner of one body.
pub(super) struct System {
    /// None if no node is free.
    factor: Option<Factor>,
    /// Contacts and stiffness of stiffened elements that are not in the factor, or no longer there.
    update: LowRankUpdate,
    warp: Warp,
    /// Nodes that press in the factor, and their stiffness (N/m); negative where they no longer do.
    known: Vec<(u32, f32)>,
    /// Nodes that tools carry in the factor.
    held: Vec<bool>,
    /// Stiffness of the contacts and grasps of free nodes in the factor (N/m).
    contacts: Vec<f32>,
    /// Whether the factor is that of the matrix.
    pub usable: bool,
    /// Scratch: stiffness of what presses each free node now (N/m).
    pressing: Vec<f32>,
    /// Scratch: the stiffened elements.
    stiffened: Vec<Stiffened>,
    /// Scratch: the vector of a solve.
    right: Vec<f32>,
}

impl System {
    /// For `body` with substeps of `h` (s), and the body's layout in the order of elimination.
    pub fn new(level: Level, body: &Body, h: f64) -> (Self, Layout) {
        let mut factor = Factor::new(body, h);
        let free: Vec<u32> = (0..body.len() as u32).filter(|i| !body.pinned[*i as usize]).collect();
        let layout = Layout::new(body, factor.as_ref().map_or(&free, |factor| &factor.order));
        let (held, contacts) = (vec![false; layout.free], vec![0.0; layout.free]);
        if let Some(made) = &mut factor {
            made.set_step(&layout.masses, h);
            if !made.factorise(level, &held, &contacts) {
                factor = None;
            }
        }
        let system = Self {
            usable: factor.is_some() || layout.free == 0,
            update: LowRankUpdate::new(),
            warp: Warp::new(&layout),
            known: Vec::with_capacity(layout.free),
            held,
            contacts,
            pressing: vec![0.0; layout.free],
            stiffened: Vec::with_capacity(MAX_STIFFENED),
            right: vec![0.0; 3 * layout.rows + 16],
            factor,
        };
        (system, layout)
    }

    /// Factorises again unless the factor is the one for the `held` nodes and the stiffness of
    /// contacts at each vertex (N/m). `supported` marks the vertices that press. Returns whether it
    /// did.
    pub fn refresh(
        &mut self,
        level: Level,
        body: &Body,
        layout: &Layout,
        held: &[bool],
        supported: &[bool],
        stiffness: impl Fn(usize) -> f32,
    ) -> bool {
        let Some(factor) = &mut self.factor else { return false };
        let mut stale = !self.usable || *held != self.held[..];
        for (vertex, known) in layout.vertex.iter().zip(&mut self.contacts) {
            let now = stiffness(*vertex as usize);
            stale |= now != *known;
            *known = now;
        }
        if stale {
            self.update.clear();
            self.known.clear();
            for (i, vertex) in layout.vertex[..layout.free].iter().enumerate() {
                if supported[*vertex as usize] {
                    self.known.push((i as u32, body.pressed_stiffness(*vertex as usize)));
                }
            }
            self.usable = factor.factorise(level, held, &self.contacts);
            self.held.copy_from_slice(held);
        }
        stale
    }

    /// Begins a substep: the contacts are those in the factor, and no element is stiffened.
    pub fn reset_update(&mut self) {
        self.update.reset();
    }

    /// Updates the inverse for the elements that are stiffened at the positions `x`. The contacts
    /// are to be updated after it.
    pub fn update_stiffened(
        &mut self,
        level: Level,
        layout: &Layout,
        elements: &mut Elements,
        held: &[bool],
        x: &[Row],
    ) {
        let Self { factor: Some(factor), update, warp, stiffened, right, .. } = self else { return };
        elements.find_stiffened(layout, x, held, stiffened);
        for element in stiffened.iter_mut() {
            for (node, g) in element.nodes.iter().zip(&mut element.gradient) {
                *g = warp.turn_back(*node, *g);
            }
        }
        dispatch!(level, simd => update.set_stiffened(simd, factor, right, stiffened));
    }

    /// Takes the stiffened elements out of the inverse.
    pub fn forget_stiffened(&mut self) {
        self.update.forget_stiffened();
    }

    /// Updates the inverse for the contacts that press at the positions `x`.
    pub fn update_contacts(&mut self, level: Level, layout: &Layout, contacts: &ContactSet, held: &[bool], x: &[Row]) {
        let Self { factor: Some(factor), update, pressing, known, right, .. } = self else { return };
        if contacts.list().is_empty() && known.is_empty() && !update.is_stale() {
            return;
        }
        pressing.fill(0.0);
        for contact in contacts.list().iter().filter(|contact| !contact.source.is_in_factor()) {
            let here = contact.site.at(|vertex| layout.value(vertex, |i| position(&x[i])));
            if contact.height(here) >= 0.0 {
                continue;
            }
            let stiffness = contact.tangent(here);
            for (vertex, share) in contact.site.shares() {
                let spread = layout.spread(vertex);
                let stiffness = spread.unwrap_or(1.0) * stiffness;
                let is_node = contact.site.is_vertex() && spread.is_none();
                layout.for_nodes(vertex, share, |i, share| {
                    if i < layout.free && !held[i] {
                        // What is between nodes comes after them and adds to them. By weights of
                        // both signs it is no less than their part of the matrix.
                        pressing[i] = if is_node { stiffness } else { pressing[i] + share.abs() * stiffness };
                    }
                });
            }
        }
        // What remains in `pressing` after this is new, or harder than in the factor.
        for (i, stiffness) in known.iter_mut() {
            let pressing = &mut pressing[*i as usize];
            *stiffness = stiffness.abs().copysign(if *pressing > 0.0 { 1.0 } else { -1.0 });
            let more = *pressing - stiffness.abs();
            *pressing = if more > MIN_HARDER * stiffness.abs() { more } else { 0.0 };
        }
        let gone = known.iter().filter(|(i, stiffness)| *stiffness < 0.0 && !held[*i as usize]).copied();
        let new = pressing.iter().enumerate().filter(|(_, k)| **k > 0.0).map(|(i, k)| (i as u32, *k));
        dispatch!(level, simd => update.set(simd, factor, right, gone.chain(new)));
    }

    /// Turns the system with the tissue, nodes at `x`.
    pub fn update_warp(&mut self, level: Level, layout: &Layout, x: &[Row]) {
        let Self { warp, .. } = self;
        warp.update(level, layout, x);
    }

    /// direction = P^-1 direction, P being the stiffness at rest turned with the tissue; to some
    /// per cent unless `precise`.
    pub fn apply(&mut self, level: Level, direction: &mut [Row], precise: bool) {
        let Self { warp, factor, update, right, .. } = self;
        let Some(factor) = factor else { return };
        dispatch!(level, simd => {
            warp.to_rest(simd, direction, right);
            factor.forward(simd, right, precise);
            update.apply(simd, right);
            factor.backward(simd, right, precise);
            warp.out_of_rest(simd, right, direction);
        });
    }

    /// The mean rotation of the tissue from rest, as the warp has it; `scratch` has a row a node.
    pub fn mean_rotation(&mut self, level: Level, layout: &Layout, scratch: &mut [Row]) -> Mat3A {
        let Self { warp, right, .. } = self;
        let mut inverse = [Vec3A::ZERO; 3];
        for (c, column) in inverse.iter_mut().enumerate() {
            scratch.fill([0.0; 4]);
            scratch.iter_mut().for_each(|row| row[c] = 1.0);
            dispatch!(level, simd => warp.to_rest(simd, scratch, right));
            *column = right[..3 * layout.free].chunks_exact(3).fold(Vec3A::ZERO, |sum, v| sum + Vec3A::from_slice(v));
        }
        nearest_rotation(Mat3A::from_cols(inverse[0], inverse[1], inverse[2])).transpose()
    }

    /// x = P^-1 x, P being the stiffness at rest turned by one `rotation`: unlike the warped one,
    /// it resists no translation of tissue that is bent.
    pub fn apply_turned(&mut self, level: Level, rotation: &Mat3A, x: &mut [Row]) {
        let Self { factor, update, right, .. } = self;
        let Some(factor) = factor else { return };
        let back = rotation.transpose();
        for (number, row) in right.chunks_exact_mut(3).zip(x.iter()) {
            number.copy_from_slice(&(back * position(row)).to_array());
        }
        dispatch!(level, simd => {
            factor.forward(simd, right, true);
            update.apply(simd, right);
            factor.backward(simd, right, true);
        });
        for (row, number) in x.iter_mut().zip(right.chunks_exact(3)) {
            let turned = *rotation * Vec3A::from_slice(number);
            *row = [turned.x, turned.y, turned.z, 0.0];
        }
    }

    /// Subtracts the product of the body's matrix without springs, turned by one `rotation`, and
    /// `x`.
    pub fn subtract_product(&self, rotation: &Mat3A, x: &[Row], from: &mut [Row]) {
        let Some(factor) = &self.factor else { return };
        let back = rotation.transpose();
        let mut product = vec![Vec3A::ZERO; x.len()];
        factor.multiply(|i| back * position(&x[i]), &mut product);
        for (row, product) in from.iter_mut().zip(&product) {
            add(row, -(*rotation * *product));
        }
    }

    /// The stiffness of the springs of a node in the matrix: those in the factor, and what the
    /// update adds or takes (N/m).
    pub fn spring(&self, i: usize) -> f32 {
        self.holding(i) + self.update.added(i as u32)
    }

    /// The stiffness that holds a held node (N/m).
    pub fn holding(&self, i: usize) -> f32 {
        self.factor.as_ref().map_or(0.0, |factor| factor.holding[i])
    }
}

/// The rotation nearest to a matrix (Higham 1986, "Computing the polar decomposition": Newton's
/// iteration). The identity where there is none.
fn nearest_rotation(matrix: Mat3A) -> Mat3A {
    let mut x = matrix * (1.0 / libm::cbrtf(matrix.determinant().abs()).max(f32::MIN_POSITIVE));
    for _ in 0..20 {
        x = 0.5 * (x + x.inverse().transpose());
    }
    if x.is_finite() && (x.determinant() - 1.0).abs() < 1e-3 { x } else { Mat3A::IDENTITY }
}
