//! The quasi-Newton solver of one body: its parts by purpose, and the potential of one body.

use super::elements::Elements;
use super::iterate::{InitialGuess, Iterate, add, max_coordinate, position};
use super::layout::Layout;
use super::memory::Memory;
use super::rigid_modes::RigidModes;
use super::sleep::{RestCache, Sleep};
use super::system::System;
use crate::contact::ContactSet;
use crate::descent::BodyDescent;
use crate::frame::Frame;
use crate::lanes::{Row, dot_rows, same_rows};
use crate::settings::{Descent, QuasiNewton, Start};
use crate::state::BodyState;
use crate::threads::in_parts;
use crate::{Body, Isa};
use fearless_simd::{Level, SimdBase, dispatch, f32x4};
use glam::Vec3A;

/// Fewest nodes whose gradient is worth a thread of its own.
const MIN_NODES: usize = 1000;

/// Sweeps a substep for a body that the quasi-Newton steps gave up.
const FALLBACK_SWEEPS: usize = 20;

/// Most free nodes of a body whose factor is read with 8 bits a number. What they leave of the
/// softest motions grows with the body.
const MAX_ROUGH_NODES: usize = 8_000;

/// The solver of one body.
pub(crate) struct QuasiNewtonSolver {
    pub(super) settings: QuasiNewton,
    pub(super) level: Level,
    /// Where the body's data lie.
    pub(super) layout: Layout,
    /// The preconditioner.
    pub(super) system: System,
    /// Forces and volumes of the elements.
    pub(super) elements: Elements,
    /// The vectors of the search.
    pub(super) iterate: Iterate,
    /// What the body touches.
    pub(super) touching: Touching,
    /// Forces from outside.
    pub(super) loads: Loads,
    /// Free nodes that a tool carries.
    pub(super) held: Vec<bool>,
    /// The same in the frame before.
    held_before: Vec<bool>,
    /// The body's part of the island's last steps.
    pub(super) memory: Memory,
    /// Rigid motions, of a body that touches others and that nothing holds.
    pub(super) rigid: Option<RigidModes>,
    /// The result of the substep for the body.
    pub(super) progress: Progress,
    /// Whether the body takes part in the search.
    pub(super) sleep: Sleep,
    pub(super) rest: RestCache,
    /// The fallback solver, for when the quasi-Newton steps fail.
    pub(super) fallback: BodyDescent,
}

/// What a body touches in a substep.
pub(super) struct Touching {
    pub contacts: ContactSet,
    /// Limits of friction of the contacts (N), held during a search.
    pub limits: Vec<f32>,
    /// Whether another body presses it when the substep begins.
    pub pressed: bool,
}

/// Forces from outside on free nodes.
pub(super) struct Loads {
    /// (N)
    forces: Vec<Row>,
    /// Whether there is any.
    pub any: bool,
}

/// The progress of a body in a substep.
pub(super) struct Progress {
    /// Where the search started.
    pub guess: InitialGuess,
    /// Whether a tool moves held nodes in the substep.
    pub carried: bool,
    /// Whether a held node lags because an edge would be too long.
    pub yielded: bool,
    /// The report's count of that when the substep began.
    pub limited: usize,
    /// Whether the last step along a direction was possible.
    pub stepped: bool,
    /// Largest coordinate of the direction (m).
    pub longest: f32,
    /// Largest coordinate of the deviation from the body's free motion (m).
    pub gone: f32,
    /// Mean motion of a node by forces that cannot be told from zero (m).
    pub rounding: f32,
}

impl QuasiNewtonSolver {
    /// For `body` stepped by frames of `dt` (s); `single_thread`: the calling thread does all the
    /// work.
    pub fn new(settings: QuasiNewton, body: &Body, dt: f64, single_thread: bool) -> Self {
        let level = Isa::detect().level();
        let (system, layout) = System::new(level, body, dt / settings.substeps as f64);
        let sweeps = Descent { substeps: settings.substeps, iterations: FALLBACK_SWEEPS, start: Start::Adaptive };
        let limits = Vec::with_capacity(2 * body.len());
        Self {
            settings,
            level,
            system,
            elements: Elements::new(&layout, body),
            iterate: Iterate::new(&layout),
            touching: Touching { contacts: ContactSet::new(body), limits, pressed: false },
            loads: Loads { forces: vec![[0.0; 4]; layout.rows], any: false },
            held: vec![false; layout.free],
            held_before: vec![false; layout.free],
            memory: Memory::new(settings.memory, layout.rows),
            rigid: None,
            progress: Progress {
                guess: InitialGuess::Still,
                carried: false,
                yielded: false,
                limited: 0,
                stepped: true,
                longest: 0.0,
                gone: 0.0,
                rounding: 0.0,
            },
            sleep: Sleep { active: true, ..Sleep::default() },
            rest: RestCache::new(&layout),
            fallback: BodyDescent::new(sweeps, body, single_thread),
            layout,
        }
    }

    /// Begins a frame.
    pub fn begin_frame(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState) {
        let same = self.iterate.load(&self.layout, state);
        self.elements.is_accepted_here &= same;
        if self.mark_held(frame, body) {
            self.rest.has_gradient = false;
        }
        if std::mem::take(&mut self.loads.any) {
            self.loads.forces.fill([0.0; 4]);
        }
        frame.for_loads(body, |vertex, force| {
            let i = self.layout.number[vertex] as usize;
            if i < self.layout.free && !self.held[i] {
                add(&mut self.loads.forces[i], force.as_vec3a());
                self.loads.any = true;
            }
        });
        self.touching.contacts.begin_frame(frame, body, state);
        self.refresh_system(frame, body, state);
    }

    /// Marks the nodes that tools carry. Returns whether they are others than before.
    fn mark_held(&mut self, frame: &Frame<'_>, body: &Body) -> bool {
        std::mem::swap(&mut self.held, &mut self.held_before);
        self.held.fill(false);
        for grasp in frame.rigid_grasps() {
            for node in &grasp.nodes {
                let i = self.layout.number[body.internal[*node as usize] as usize] as usize;
                if i < self.layout.free {
                    self.held[i] = true;
                }
            }
        }
        self.held != self.held_before
    }

    /// Factorises again if other nodes are held, in contact, or in a compliant grasp than in the
    /// factor.
    fn refresh_system(&mut self, frame: &Frame<'_>, body: &Body, state: &BodyState) {
        let Self { level, system, layout, held, touching, .. } = self;
        let stiffness = |vertex: usize| touching.contacts.stiffness(frame, body, state, vertex);
        if system.refresh(*level, layout, held, stiffness) {
            self.rest.correction = None;
        }
    }

    /// Adds to the matrix the tools and supports that press at the substep's beginning or at its
    /// free end. Returns false if it has them all.
    pub fn add_contacts_to_system(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState) -> bool {
        let (x, targets, layout) = (&self.iterate.x, &self.iterate.targets, &self.layout);
        // Edges and triangles may have vertices that are pinned.
        let begin = |i: usize| position(&x[i]);
        let end = |i: usize| position(if i < layout.free { &targets[i] } else { &x[i] });
        let mut new = false;
        let contacts = self.touching.contacts.list().iter();
        for contact in contacts.filter(|contact| !contact.source.is_in_factor()) {
            let presses = |place: &dyn Fn(usize) -> Vec3A| {
                contact.height(contact.site.at(|vertex| layout.value(vertex, place))) < 0.0
            };
            if !(presses(&begin) || presses(&end)) {
                continue;
            }
            for (vertex, share) in contact.site.shares() {
                layout.for_nodes(vertex, share, |i, _| {
                    if i < layout.free {
                        new |= !std::mem::replace(&mut state.warm.supported[layout.vertex[i] as usize], true);
                    }
                });
            }
        }
        if new {
            self.refresh_system(frame, body, state);
        }
        new
    }

    /// Finds the contacts of the substep of `h` (s) between two shares of the frame.
    pub fn find_contacts(&mut self, frame: &Frame<'_>, body: &Body, shares: [f64; 2], h: f32) {
        let Self { iterate, layout, touching: Touching { contacts, limits, .. }, .. } = self;
        let way = |vertex: usize| h * iterate.velocity(layout, vertex as u32);
        contacts.find(frame, body, shares, |vertex| iterate.at(layout, vertex as u32), way);
        limits.clear();
        limits.resize(contacts.list().len(), 0.0);
    }

    /// Ends the substep that ends with `share` of the frame.
    pub fn end_substep(&mut self, frame: &Frame<'_>, body: &Body, share: f64) {
        let Self { iterate, layout, touching, .. } = self;
        touching.contacts.end_substep(frame, body, share, |vertex| iterate.at(layout, vertex as u32));
    }

    /// Begins a substep: predicts the positions under gravity alone.
    pub fn predict(&mut self, h: f32, gravity: Row) {
        if !same_rows(self.level, &self.iterate.start, &self.iterate.x) {
            self.iterate.start.copy_from_slice(&self.iterate.x);
            self.elements.dashpots.begin_elsewhere();
        }
        // A body in free flight falls exactly: gravity's part of its motion is uniform and
        // integrated as h^2/2 g. Elsewhere implicit Euler's h^2 g.
        let reach = if !self.touching.pressed && self.flies() { 0.5 * h * h } else { h * h };
        let Self { level, layout, iterate: Iterate { predictor, x, v, .. }, .. } = self;
        dispatch!(*level, _simd => {
            for ((y, x), v) in predictor[..layout.free].iter_mut().zip(x.iter()).zip(v.iter()) {
                for c in 0..3 {
                    y[c] = x[c] + h * v[c] + reach * gravity[c];
                }
            }
        });
    }

    /// Rotates the system with the tissue.
    pub fn update_warp(&mut self) {
        if self.elements.in_place && std::mem::replace(&mut self.rest.warped, true) {
            return;
        }
        self.system.update_warp(self.level, &self.layout, &self.iterate.x);
    }

    /// Updates the system for the elements that are stiffened where the nodes are. The contacts are
    /// to be updated after it.
    pub fn update_stiffened(&mut self) {
        let Self { system, layout, elements, held, iterate, .. } = self;
        system.update_stiffened(layout, elements, held, &iterate.x);
    }

    /// Updates the system for the contacts as they are where the nodes are.
    pub fn update_contacts(&mut self) {
        let Self { level, system, layout, touching: Touching { contacts, limits, .. }, held, iterate, .. } = self;
        system.update_contacts(*level, layout, (contacts, limits), held, &iterate.x);
    }

    /// Writes the gradient of the body's own potential into the next gradient, from the forces of
    /// the last evaluation; 0 at held nodes.
    pub fn take_gradient(&mut self, h: f32) {
        self.take_own_gradient(h);
        let Self { iterate: Iterate { x, next_gradient, .. }, touching, loads, layout, held, .. } = self;
        for (contact, limit) in touching.contacts.list().iter().zip(&touching.limits) {
            let here = contact.site.at(|vertex| layout.value(vertex, |i| position(&x[i])));
            if let Some(push) = contact.push_within(here, *limit) {
                for (vertex, share) in contact.site.shares() {
                    layout.for_nodes(vertex, share, |i, share| {
                        if i < layout.free && !held[i] {
                            add(&mut next_gradient[i], share * push.gradient);
                        }
                    });
                }
            }
        }
        if loads.any {
            for (sum, force) in next_gradient.iter_mut().zip(&loads.forces) {
                (0..3).for_each(|c| sum[c] -= force[c]);
            }
        }
    }

    /// Writes the gradient of elements and inertia into the next gradient.
    pub(super) fn gradient_at(&mut self, h: f32) {
        let inertia = 1.0 / (h * h);
        let Self { iterate: Iterate { x, predictor, next_gradient, .. }, layout, elements, held, level, .. } = self;
        in_parts(&mut next_gradient[..layout.free], MIN_NODES, |first, gradient| {
            dispatch!(*level, simd => for (k, sum) in gradient.iter_mut().enumerate() {
                let i = first + k;
                if held[i] {
                    *sum = [0.0; 4];
                    continue;
                }
                let off = f32x4::from_slice(simd, &x[i]) - f32x4::from_slice(simd, &predictor[i]);
                let mut all = off * (layout.masses[i] * inertia);
                let (first, end) = (layout.first_corner[i] as usize, layout.first_corner[i + 1] as usize);
                for k in &layout.corners[first..end] {
                    all += f32x4::from_slice(simd, &elements.corners[*k as usize]);
                }
                all.store_slice(sum);
            });
        });
    }

    /// Accepts the next gradient, with the present limits of friction. The limits are constant
    /// within a search, so that there is a function to minimise.
    pub fn accept_gradient(&mut self) {
        let Self { iterate: Iterate { x, gradient, next_gradient, .. }, touching, layout, held, .. } = self;
        std::mem::swap(gradient, next_gradient);
        for (contact, limit) in touching.contacts.list().iter().zip(&mut touching.limits) {
            let x = contact.site.at(|vertex| layout.value(vertex, |i| position(&x[i])));
            let now = contact.limit(x);
            if now != *limit {
                let push = |limit| contact.push_within(x, limit).map_or(Vec3A::ZERO, |push| push.gradient);
                let change = push(now) - push(*limit);
                for (vertex, share) in contact.site.shares() {
                    layout.for_nodes(vertex, share, |i, share| {
                        if i < layout.free && !held[i] {
                            add(&mut gradient[i], share * change);
                        }
                    });
                }
            }
            *limit = now;
        }
    }

    /// Position of a vertex (m).
    #[inline(always)]
    pub fn at(&self, vertex: u32) -> Vec3A {
        self.iterate.at(&self.layout, vertex)
    }

    /// Adds a force of another body to a vertex's accepted gradient, if the vertex is free to move.
    pub fn push(&mut self, vertex: u32, force: Vec3A) {
        let Self { iterate, layout, held, .. } = self;
        layout.for_nodes(vertex, 1.0, |i, share| {
            if i < layout.free && !held[i] {
                add(&mut iterate.gradient[i], share * force);
            }
        });
    }

    /// Adds it to the next gradient.
    pub fn push_next(&mut self, vertex: u32, force: Vec3A) {
        let Self { iterate, layout, held, .. } = self;
        layout.for_nodes(vertex, 1.0, |i, share| {
            if i < layout.free && !held[i] {
                add(&mut iterate.next_gradient[i], share * force);
            }
        });
    }

    pub(super) fn free_node(&self, vertex: u32) -> Option<usize> {
        let i = self.layout.number[vertex as usize] as usize;
        (i < self.layout.free && !self.held[i]).then_some(i)
    }

    /// Product of the gradient and the direction.
    pub fn slope(&self) -> f32 {
        dispatch!(self.level, simd => dot_rows(simd, &self.iterate.gradient, &self.iterate.direction))
    }

    /// Product of the next gradient and the direction.
    pub fn next_slope(&self) -> f32 {
        dispatch!(self.level, simd => dot_rows(simd, &self.iterate.next_gradient, &self.iterate.direction))
    }

    /// direction = P^-1 direction.
    pub fn precondition(&mut self) {
        // Nothing but the solve keeps the momentum of a free body.
        let precise = self.is_free() || self.layout.free > MAX_ROUGH_NODES;
        self.system.apply(self.level, &mut self.iterate.direction, precise);
    }

    /// Turns the direction downhill; held nodes have none.
    pub fn turn_downhill(&mut self) {
        let Self { level, held, iterate: Iterate { direction, .. }, .. } = self;
        dispatch!(*level, _simd => direction.as_flattened_mut().iter_mut().for_each(|d| *d = -*d));
        for (d, _) in direction.iter_mut().zip(held).filter(|(_, held)| **held) {
            *d = [0.0; 4];
        }
    }

    /// Largest coordinate of any free node (m).
    pub fn extent(&self) -> f32 {
        dispatch!(self.level, _simd => max_coordinate(&self.iterate.x[..self.layout.free]))
    }

    /// Whether the gradient cannot be told from zero: no more than positions that are rounded.
    pub fn is_rounding(&self) -> bool {
        self.system.mean_motion(self.level, &self.iterate.gradient) <= self.progress.rounding
    }

    /// Sum of the gradient over the nodes (N).
    pub fn force(&self) -> Vec3A {
        self.iterate.gradient[..self.layout.free].iter().fold(Vec3A::ZERO, |sum, row| sum + position(row))
    }

    /// Mass of the free nodes (kg).
    pub fn mass(&self) -> f32 {
        self.layout.masses.iter().sum()
    }

    /// Moves all nodes alike (m).
    pub fn shift(&mut self, by: Vec3A) {
        self.elements.is_accepted_here = false;
        self.iterate.x[..self.layout.free].iter_mut().for_each(|row| add(row, by));
    }

    /// Restores the beginning of the substep.
    pub fn restore(&mut self) {
        self.elements.is_accepted_here = false;
        self.iterate.restore(self.layout.free);
    }

    /// The velocities after the substep.
    pub fn take_velocities(&mut self, h: f32, gravity: Row) {
        let Self { level, layout, held, iterate: Iterate { predictor, x, v, .. }, .. } = self;
        dispatch!(*level, _simd => {
            let ways = x[..layout.free].iter().zip(predictor.iter()).zip(held.iter());
            for (v, ((x, y), held)) in v.iter_mut().zip(ways) {
                for c in 0..3 {
                    let next = v[c] + h * gravity[c] + (x[c] - y[c]) / h;
                    v[c] = if *held { 0.0 } else { next };
                }
            }
        });
    }

    /// Whether nothing holds any node.
    pub fn is_free(&self) -> bool {
        self.layout.free == self.layout.nodes && !self.held.contains(&true)
    }

    /// Whether no tool and no support holds or touches the body, and no load acts on it.
    pub fn flies(&self) -> bool {
        let x = |vertex: usize| self.iterate.at(&self.layout, vertex as u32);
        !self.loads.any && self.is_free() && self.touching.contacts.is_idle(x)
    }
}
