//! The linear system of one body: its stiffness at rest with the masses of a substep, factorised
//! once, turned with the tissue, and updated for contacts. It preconditions the search.

use super::contact_springs::{ContactSprings, Placed};
use super::elements::Elements;
use super::factor::Factor;
use super::iterate::{add, position};
use super::layout::Layout;
use super::low_rank_update::LowRankUpdate;
use super::springs::Term;
use super::stiffened::{MAX_STIFFENED, Stiffened};
use super::warp::Warp;
use crate::Body;
use crate::contact::ContactSet;
use crate::lanes::Row;
use fearless_simd::{Level, dispatch};
use glam::{Mat3A, Vec3A};

/// The preconditioner of one body.
pub(super) struct System {
    /// None if no node is free.
    factor: Option<Factor>,
    /// Contacts and stiffness of stiffened elements that are not in the factor, or no longer there.
    update: LowRankUpdate,
    warp: Warp,
    /// Nodes that tools carry in the factor.
    held: Vec<bool>,
    /// Stiffness of the contacts and grasps of free nodes in the factor (N/m), and whether there is
    /// any.
    contacts: Vec<f32>,
    has_contacts: bool,
    /// Whether the factor is that of the matrix.
    pub usable: bool,
    /// The springs of the stiffened elements, and then those of contacts.
    springs: ContactSprings,
    /// Number of those of elements.
    of_elements: usize,
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
            held,
            contacts,
            has_contacts: false,
            springs: ContactSprings::new(&layout),
            of_elements: 0,
            stiffened: Vec::with_capacity(MAX_STIFFENED),
            right: vec![0.0; 3 * layout.rows + 16],
            factor,
        };
        (system, layout)
    }

    /// Factorises again unless the factor is the one for the `held` nodes and the stiffness of
    /// contacts at each vertex (N/m). Returns whether it did.
    pub fn refresh(&mut self, level: Level, layout: &Layout, held: &[bool], stiffness: impl Fn(usize) -> f32) -> bool {
        let Some(factor) = &mut self.factor else { return false };
        let mut stale = !self.usable || *held != self.held[..];
        for (vertex, known) in layout.vertex.iter().zip(&mut self.contacts) {
            let now = stiffness(*vertex as usize);
            stale |= now != *known;
            *known = now;
        }
        if stale {
            self.update.clear();
            self.has_contacts = self.contacts.iter().any(|stiffness| *stiffness > 0.0);
            self.usable = factor.factorise(level, held, &self.contacts);
            self.held.copy_from_slice(held);
        }
        stale
    }

    /// Begins a substep: the contacts are those in the factor, and no element is stiffened.
    pub fn reset_update(&mut self) {
        self.update.reset();
        self.forget_stiffened();
    }

    /// Finds the elements that are stiffened at the positions `x`. The contacts are to be updated
    /// after it.
    pub fn update_stiffened(&mut self, layout: &Layout, elements: &mut Elements, held: &[bool], x: &[Row]) {
        let Self { warp, stiffened, springs: ContactSprings { springs, .. }, .. } = self;
        elements.find_stiffened(layout, x, held, stiffened);
        springs.clear();
        for element in stiffened.iter() {
            let along = |(node, gradient)| Term { node, along: warp.turn_back(node, gradient) };
            springs.push(element.stiffness, element.gradients().map(along));
        }
        self.of_elements = springs.len();
    }

    /// Forgets the stiffened elements. The contacts are to be updated after it.
    pub fn forget_stiffened(&mut self) {
        self.springs.springs.clear();
        self.of_elements = 0;
    }

    /// Updates the inverse for the contacts as they are at the positions `x`, with these `limits`
    /// of friction (N).
    pub fn update_contacts(
        &mut self,
        level: Level,
        layout: &Layout,
        (contacts, limits): (&ContactSet, &[f32]),
        held: &[bool],
        x: &[Row],
    ) {
        self.springs.springs.truncate(self.of_elements);
        if !contacts.list().is_empty() || self.has_contacts {
            let placed = Placed { layout, warp: &self.warp, x, held, in_factor: &self.contacts };
            self.springs.add(&placed, contacts, limits);
        }
        self.set_update(level);
    }

    /// Updates the inverse for the contacts that press at the positions `x`, as if each were as
    /// stiff in all directions as along its normal.
    pub fn update_contacts_alike(
        &mut self,
        level: Level,
        layout: &Layout,
        contacts: &ContactSet,
        held: &[bool],
        x: &[Row],
    ) {
        self.springs.springs.truncate(self.of_elements);
        let placed = Placed { layout, warp: &self.warp, x, held, in_factor: &self.contacts };
        self.springs.add_alike(&placed, contacts);
        self.set_update(level);
    }

    fn set_update(&mut self, level: Level) {
        if let Self { factor: Some(factor), update, springs: ContactSprings { springs, .. }, .. } = self {
            update.set(level, factor, springs);
        }
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
            update.apply(level, right);
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
            update.apply(level, right);
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

    /// Root mean square over the nodes of the distance (m) that the forces `gradient` (N) would
    /// move each of them if all others stayed. Springs do not count, and nodes that tools hold
    /// stay.
    pub fn mean_motion(&self, level: Level, gradient: &[Row]) -> f32 {
        let Some(factor) = &self.factor else { return 0.0 };
        let sum = dispatch!(level, _simd => {
            let mut sums = [0.0f32; 4];
            for (force, compliance) in gradient.iter().zip(&factor.compliance) {
                for c in 0..4 {
                    sums[c] += (force[c] * compliance[c]).powi(2);
                }
            }
            sums[0] + sums[1] + sums[2]
        });
        (sum / (3 * factor.compliance.len()) as f32).sqrt()
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
