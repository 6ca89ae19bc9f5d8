//! What the solver knows of one body, and does with it alone.

use super::elements::Elements;
use super::factor::Factor;
use super::go::Guess;
use super::history::{History, Memory};
use super::layout::Layout;
use super::patch::Patch;
use super::rigid::Rigid;
use super::warp::Warp;
use crate::contact::Contacts;
use crate::descent::DescentIntegrator;
use crate::integrator::Frame;
use crate::lanes::{Row, dot_rows};
use crate::settings::{Descent, QuasiNewton, Start};
use crate::state::BodyState;
use crate::{Body, Isa};
use fearless_simd::{Level, Simd, SimdBase, dispatch, f32x4};
use glam::Vec3A;

/// Sweeps a substep for a body that the quasi-Newton steps gave up.
const FALLBACK_SWEEPS: usize = 20;

/// The solver of one body.
pub(crate) struct QuasiNewtonSolver {
    pub(super) settings: QuasiNewton,
    pub(super) level: Level,
    pub(super) layout: Layout,
    /// None if no node is free or the matrix cannot be had.
    pub(super) factor: Option<Factor>,
    /// What the factor does not know of what presses.
    pub(super) patch: Patch,
    /// Nodes that press as far as the factor knows, and how hard [N/m]; negative where they do not any more.
    pub(super) known: Vec<(u32, f32)>,
    /// Stiffness of what presses each free node [N/m]; scratch.
    pub(super) pressing: Vec<f32>,
    pub(super) elements: Elements,
    /// The body's part of what the island's last steps taught.
    pub(super) memory: Memory,
    /// The island's, of its first body.
    pub(super) history: History,
    pub(super) warp: Warp,
    /// Of a body that touches others and that nothing holds.
    pub(super) rigid: Option<Rigid>,
    pub(super) contacts: Contacts,
    /// Forces from outside on free nodes [N], and whether there are any.
    loads: Vec<Row>,
    loaded: bool,
    /// Limits of friction of what is touched [N], held during a search.
    pub(super) limits: Vec<f32>,
    pub(super) fallback: DescentIntegrator,
    /// Positions of all nodes [m].
    pub(super) x: Vec<Row>,
    /// Over free nodes: where the substep began, velocities, inertial predictor.
    pub(super) start: Vec<Row>,
    pub(super) v: Vec<Row>,
    pub(super) predictor: Vec<Row>,
    pub(super) gradient: Vec<Row>,
    pub(super) next_gradient: Vec<Row>,
    pub(super) direction: Vec<Row>,
    pub(super) base: Vec<Row>,
    pub(super) right: Vec<f32>,
    /// Nodes that a tool carries, now and in the factor.
    pub(super) held: Vec<bool>,
    pub(super) held_in_factor: Vec<bool>,
    /// Stiffness of what free nodes touch or hang on that is in the factor [N/m].
    pub(super) touches_in_factor: Vec<f32>,
    /// Whether the factor is that of the matrix.
    pub(super) usable: bool,
    /// Whether the body takes part in the search: one that is at rest among others is left alone until they push it.
    pub(super) active: bool,
    /// Whether it took no part when that was last looked at.
    pub(super) was_resting: bool,
    /// Whether it moved in this substep, is where it is to be, and is left alone until others push it.
    pub(super) dozes: bool,
    /// Where the elements were last looked at in place and accepted, and where that substep had begun; whether nothing else was looked at since, and whether the warp is that of there.
    pub(super) place_x: Vec<Row>,
    pub(super) place_start: Vec<Row>,
    pub(super) in_place: bool,
    pub(super) warped_in_place: bool,
    /// Where the body was last asked whether it is at rest, the gradient there, and its correction [m], if the factor is still the same.
    pub(super) rest_x: Vec<Row>,
    pub(super) rest_gradient: Vec<Row>,
    pub(super) rest_correction: Option<f32>,
    /// Whether others push it otherwise than when it was left alone.
    pub(super) stirred: bool,
    /// Whether it bore the last step along a direction.
    pub(super) went: bool,
    /// Whether another body presses it when a substep begins.
    pub(super) pressed: bool,
    /// Whether a tool carries held nodes on in this substep.
    pub(super) carried: bool,
    /// Largest coordinate of the direction, and how far the body went in the substep [m], when last looked at.
    pub(super) longest: f32,
    pub(super) gone: f32,
    /// Where the substep started from.
    pub(super) guess: Guess,
    /// Whether a held node could not go on in this substep because an edge would be too long.
    pub(super) yielded: bool,
    /// What the report said of that when the substep began.
    pub(super) limited: usize,
    pub(super) targets: Vec<Row>,
}

impl QuasiNewtonSolver {
    /// For `body` stepped by frames of `dt` [s]; `alone`: the calling thread does all of it.
    pub fn new(settings: QuasiNewton, body: &Body, dt: f64, alone: bool) -> Self {
        let h = dt / settings.substeps as f64;
        let mut factor = Factor::new(body, h);
        let free: Vec<u32> = (0..body.len() as u32).filter(|i| !body.pinned[*i as usize]).collect();
        let layout = Layout::new(body, factor.as_ref().map_or(&free, |factor| &factor.order));
        let held = vec![false; layout.free];
        if let Some(made) = &mut factor {
            made.set_step(&layout.masses, h);
            if !made.factorise(&held, &vec![0.0; layout.free]) {
                factor = None;
            }
        }
        let rows = || vec![[0.0f32; 4]; layout.rows];
        let sweeps = Descent { substeps: settings.substeps, iterations: FALLBACK_SWEEPS, start: Start::Adaptive };
        Self {
            settings,
            level: Isa::detect().level(),
            elements: Elements::new(&layout, body),
            memory: Memory::new(settings.memory, layout.rows),
            history: History::new(settings.memory),
            warp: Warp::new(&layout),
            rigid: None,
            contacts: Contacts::new(body),
            loads: rows(),
            loaded: false,
            limits: Vec::with_capacity(2 * body.len()),
            fallback: DescentIntegrator::new(sweeps, body, alone),
            x: vec![[0.0; 4]; layout.nodes.max(layout.rows)],
            start: vec![[0.0; 4]; layout.nodes.max(layout.rows)],
            v: rows(),
            predictor: rows(),
            gradient: rows(),
            next_gradient: rows(),
            direction: rows(),
            base: rows(),
            targets: rows(),
            right: vec![0.0; 3 * layout.rows + 16],
            patch: Patch::new(3 * layout.rows),
            known: Vec::with_capacity(layout.free),
            pressing: vec![0.0; layout.free],
            held_in_factor: held.clone(),
            touches_in_factor: vec![0.0; layout.free],
            usable: factor.is_some() || layout.free == 0,
            active: true,
            went: true,
            pressed: false,
            was_resting: false,
            dozes: false,
            place_x: vec![[0.0; 4]; layout.nodes.max(layout.rows)],
            place_start: vec![[0.0; 4]; layout.nodes.max(layout.rows)],
            in_place: false,
            warped_in_place: false,
            rest_x: rows(),
            rest_gradient: rows(),
            rest_correction: None,
            stirred: false,
            carried: false,
            longest: 0.0,
            gone: 0.0,
            guess: Guess::Still,
            yielded: false,
            limited: 0,
            held,
            factor,
            layout,
        }
    }

    /// Begins a frame.
    pub fn begin(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState) {
        self.load(state);
        self.hold(frame, body);
        if std::mem::take(&mut self.loaded) {
            self.loads.fill([0.0; 4]);
        }
        frame.for_loads(body, |vertex, force| {
            let i = self.layout.number[vertex] as usize;
            if i < self.layout.free && !self.held[i] {
                add(&mut self.loads[i], force.as_vec3a());
                self.loaded = true;
            }
        });
        self.contacts.begin(frame, body, state);
        self.refresh_factor(frame, body, state);
    }

    /// Finds the touches of the substep between two shares of the frame.
    pub fn find_touches(&mut self, frame: &Frame<'_>, body: &Body, from: f64, to: f64) {
        let (x, number) = (&self.x, &self.layout.number);
        self.contacts.find(frame, body, from, to, |vertex| position(&x[number[vertex] as usize]));
        self.limits.clear();
        self.limits.resize(self.contacts.touches().len(), 0.0);
    }

    /// Ends the substep that ends with `share` of the frame.
    pub fn settle(&mut self, frame: &Frame<'_>, body: &Body, share: f64) {
        let (x, number) = (&self.x, &self.layout.number);
        self.contacts.settle(frame, body, share, |vertex| position(&x[number[vertex] as usize]));
    }

    /// Forces and volume ratios where the nodes are; whether an element has lost too much of its accepted volume.
    pub fn pass(&mut self, h: f32) -> bool {
        self.in_place = false;
        let Self { level, elements, layout, x, start, .. } = self;
        dispatch!(*level, simd => elements.pass(simd, layout, x, start, h))
    }

    /// Begins a substep: where nodes would be without forces but gravity.
    pub fn predict(&mut self, h: f32, gravity: Row) {
        self.start.copy_from_slice(&self.x);
        // A body in free flight falls exactly: gravity's part of its motion is uniform and integrated as h^2/2 g. Elsewhere implicit Euler's h^2 g.
        let reach = if !self.pressed && self.flies() { 0.5 * h * h } else { h * h };
        let Self { level, layout, predictor, x, v, .. } = self;
        dispatch!(*level, _simd => {
            for ((y, x), v) in predictor[..layout.free].iter_mut().zip(x.iter()).zip(v.iter()) {
                for c in 0..3 {
                    y[c] = x[c] + h * v[c] + reach * gravity[c];
                }
            }
        });
    }

    /// The warp of the nodes where they are.
    pub fn update_warp(&mut self) {
        if self.in_place && std::mem::replace(&mut self.warped_in_place, true) {
            return;
        }
        let Self { level, warp, layout, x, .. } = self;
        dispatch!(*level, simd => warp.update(simd, layout, x));
    }

    /// Writes the gradient of the body's own potential into `next_gradient`, from the forces of the last pass; 0 at held nodes.
    pub fn take_gradient(&mut self, h: f32) {
        let level = self.level;
        dispatch!(level, simd => self.gradient_at(simd, h));
        for (touch, limit) in self.contacts.touches().iter().zip(&self.limits) {
            let i = self.layout.number[touch.vertex as usize] as usize;
            if let Some(push) = touch.push_within(position(&self.x[i]), *limit) {
                add(&mut self.next_gradient[i], push.gradient);
            }
        }
        if self.loaded {
            for (sum, force) in self.next_gradient.iter_mut().zip(&self.loads) {
                (0..3).for_each(|c| sum[c] -= force[c]);
            }
        }
    }

    #[inline(always)]
    fn gradient_at<S: Simd>(&mut self, simd: S, h: f32) {
        let inertia = 1.0 / (h * h);
        for i in 0..self.layout.free {
            if self.held[i] {
                self.next_gradient[i] = [0.0; 4];
                continue;
            }
            let x = f32x4::from_slice(simd, &self.x[i]);
            let off = x - f32x4::from_slice(simd, &self.predictor[i]);
            let mut sum = off * (self.layout.masses[i] * inertia);
            let (first, end) = (self.layout.first_corner[i] as usize, self.layout.first_corner[i + 1] as usize);
            for k in &self.layout.corners[first..end] {
                sum += f32x4::from_slice(simd, &self.elements.corners[*k as usize]);
            }
            sum.store_slice(&mut self.next_gradient[i]);
        }
    }

    /// Takes over the next gradient, and friction's limits as they are here; the gradient knows. Within a search they are held, so that there is a function to minimise.
    pub fn accept_gradient(&mut self) {
        std::mem::swap(&mut self.gradient, &mut self.next_gradient);
        for (touch, limit) in self.contacts.touches().iter().zip(&mut self.limits) {
            let i = self.layout.number[touch.vertex as usize] as usize;
            let x = position(&self.x[i]);
            let now = touch.limit(x);
            if now != *limit && !self.held[i] {
                let push = |limit| touch.push_within(x, limit).map_or(Vec3A::ZERO, |push| push.gradient);
                add(&mut self.gradient[i], push(now) - push(*limit));
            }
            *limit = now;
        }
    }

    /// Where a vertex is [m].
    pub fn at(&self, vertex: u32) -> Vec3A {
        position(&self.x[self.layout.number[vertex as usize] as usize])
    }

    /// Adds a force to a vertex's gradient, the accepted one or the next, if the vertex is free to move.
    pub fn push(&mut self, next: bool, vertex: u32, force: Vec3A) {
        let i = self.layout.number[vertex as usize] as usize;
        if i < self.layout.free && !self.held[i] {
            add(if next { &mut self.next_gradient[i] } else { &mut self.gradient[i] }, force);
        }
    }

    /// The gradient's product with the direction; of the next gradient's.
    pub fn slope(&self) -> f32 {
        dispatch!(self.level, simd => dot_rows(simd, &self.gradient, &self.direction))
    }

    pub fn next_slope(&self) -> f32 {
        dispatch!(self.level, simd => dot_rows(simd, &self.next_gradient, &self.direction))
    }

    /// direction = P^-1 direction, P being the stiffness at rest turned with the tissue.
    pub fn precondition(&mut self) {
        let Self { level, warp, factor, patch, direction, right, .. } = self;
        let Some(factor) = factor else { return };
        dispatch!(*level, simd => {
            warp.to_rest(simd, direction, right);
            factor.solve(simd, right);
            patch.apply(simd, right);
            warp.out_of_rest(simd, right, direction);
        });
    }

    /// Turns the direction downhill; held nodes have none.
    pub fn turn_downhill(&mut self) {
        let Self { level, held, direction, .. } = self;
        dispatch!(*level, _simd => direction.as_flattened_mut().iter_mut().for_each(|d| *d = -*d));
        for (d, _) in direction.iter_mut().zip(held).filter(|(_, held)| **held) {
            *d = [0.0; 4];
        }
    }

    /// The stiffness that holds a held node [N/m].
    pub fn holding(&self, i: usize) -> f32 {
        self.factor.as_ref().map_or(0.0, |factor| factor.holding[i])
    }

    /// Largest coordinate of any free node [m].
    pub fn extent(&self) -> f32 {
        dispatch!(self.level, _simd => longest(&self.x[..self.layout.free]))
    }

    /// Sum of the gradient over the nodes [N].
    pub fn force(&self) -> Vec3A {
        self.gradient[..self.layout.free].iter().fold(Vec3A::ZERO, |sum, row| sum + position(row))
    }

    /// Mass of the free nodes [kg].
    pub fn mass(&self) -> f32 {
        self.layout.masses.iter().sum()
    }

    /// Moves all nodes alike [m].
    pub fn shift(&mut self, by: Vec3A) {
        self.x[..self.layout.free].iter_mut().for_each(|row| add(row, by));
    }

    /// Puts the substep's beginning back.
    pub fn restore(&mut self) {
        let free = self.layout.free;
        self.x[..free].copy_from_slice(&self.start[..free]);
    }

    /// The velocities after the substep.
    pub fn take_velocities(&mut self, h: f32, gravity: Row) {
        let Self { level, layout, predictor, held, x, v, .. } = self;
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

    /// Whether no tool and no support holds or touches the body, and no load acts on it.
    pub fn flies(&self) -> bool {
        !self.loaded
            && self.is_free()
            && self.contacts.flies(|vertex| position(&self.x[self.layout.number[vertex] as usize]))
    }

    pub fn load(&mut self, state: &BodyState) {
        for (i, vertex) in self.layout.vertex.iter().enumerate() {
            self.x[i] = state.x[*vertex as usize].extend(0.0).to_array();
        }
        for i in 0..self.layout.free {
            self.v[i] = state.v[self.layout.vertex[i] as usize].extend(0.0).to_array();
        }
    }

    pub fn store(&self, state: &mut BodyState) {
        for i in 0..self.layout.free {
            let vertex = self.layout.vertex[i] as usize;
            state.x[vertex] = position(&self.x[i]);
            state.v[vertex] = position(&self.v[i]);
            // The sweeps' start is none of this solver's; a body that goes over to them starts afresh.
            state.falling[vertex] = 0.0;
        }
        for vertex in &self.layout.vertex[self.layout.free..] {
            state.v[*vertex as usize] = Vec3A::ZERO;
        }
    }
}

/// The place of a row [m].
pub(super) fn position(row: &Row) -> Vec3A {
    Vec3A::new(row[0], row[1], row[2])
}

/// Largest coordinate of any row; not a number counts as infinite.
#[inline(always)]
pub(super) fn longest(rows: &[Row]) -> f32 {
    let mut most = [0.0f32; 4];
    let mut sane = true;
    for row in rows {
        for c in 0..4 {
            most[c] = most[c].max(row[c].abs());
        }
        sane &= row[0].is_finite() & row[1].is_finite() & row[2].is_finite();
    }
    if sane { most[0].max(most[1]).max(most[2]) } else { f32::INFINITY }
}

/// Adds to a row.
pub(super) fn add(row: &mut Row, by: Vec3A) {
    row.iter_mut().zip(by.to_array()).for_each(|(sum, part)| *sum += part);
}
