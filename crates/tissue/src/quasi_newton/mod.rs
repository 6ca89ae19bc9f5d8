//! The fast solver: a warped, prefactored quasi-Newton method.
//!
//! Every substep minimises implicit Euler's incremental potential of a body by L-BFGS (Nocedal 1980) whose first guess of the inverse Hessian is the body's stiffness at rest, factorised
//! once (Liu, Bouaziz and Kavan, "Quasi-Newton methods for real-time simulation of hyperelastic materials", 2017), and turned with the tissue around each node (stiffness warping,
//! Mueller and others 2002). It is global: a force at one end of an organ is felt at the other within one iteration. A line search by slope and a guard on the volumes make it safe;
//! a body that it cannot bring forward is left to the sweeps of Vertex Block Descent for that substep.

mod dissection;
mod elements;
mod factor;
mod history;
mod layout;
mod search;
mod stress;
mod tiles;
mod warp;

use crate::contact::{Contacts, Source};
use crate::descent::DescentIntegrator;
use crate::integrator::{Frame, Integrator};
use crate::lanes::Row;
use crate::schedule::{Descent, QuasiNewton, Start};
use crate::state::BodyState;
use crate::{Body, Isa, StepReport};
use elements::Elements;
use factor::Factor;
use fearless_simd::{Level, Simd, dispatch};
use history::History;
use layout::Layout;
use search::{Found, Guess, Pulled};
use warp::Warp;

/// Sweeps a substep for a body that the quasi-Newton steps gave up.
const FALLBACK_SWEEPS: usize = 20;

/// The solver of one body.
pub(crate) struct QuasiNewtonIntegrator {
    settings: QuasiNewton,
    level: Level,
    layout: Layout,
    factor: Factor,
    elements: Elements,
    history: History,
    warp: Warp,
    contacts: Contacts,
    /// Limits of friction of what is touched [N], held during a search.
    limits: Vec<f32>,
    fallback: DescentIntegrator,
    /// Positions of all nodes [m].
    x: Vec<Row>,
    /// Over free nodes: where the substep began, velocities, inertial predictor.
    start: Vec<Row>,
    v: Vec<Row>,
    predictor: Vec<Row>,
    gradient: Vec<Row>,
    next_gradient: Vec<Row>,
    direction: Vec<Row>,
    base: Vec<Row>,
    right: Vec<f32>,
    /// Nodes that a tool carries, now and in the factor.
    held: Vec<bool>,
    held_in_factor: Vec<bool>,
    /// Stiffness of what free nodes touch or hang on that is in the factor [N/m].
    touches_in_factor: Vec<f32>,
    /// Whether the factor is that of the matrix.
    usable: bool,
    /// Whether a held node could not go on in this substep because an edge would be too long.
    yielded: bool,
    targets: Vec<Row>,
}

impl QuasiNewtonIntegrator {
    /// For `body` stepped by frames of `dt` [s]; `alone`: the calling thread does all of it. None if every node is pinned or the matrix cannot be factorised.
    pub fn new(settings: QuasiNewton, body: &Body, dt: f64, alone: bool) -> Option<Self> {
        let h = dt / settings.substeps as f64;
        let mut factor = Factor::new(body, h)?;
        let layout = Layout::new(body, &factor.order);
        let held = vec![false; layout.free];
        factor.set_step(&layout.masses, h);
        factor.factorise(&held, &vec![0.0; layout.free]).then_some(())?;
        let rows = || vec![[0.0f32; 4]; layout.rows];
        let sweeps = Descent { substeps: settings.substeps, iterations: FALLBACK_SWEEPS, start: Start::Adaptive };
        Some(Self {
            settings,
            level: Isa::detect().level(),
            elements: Elements::new(&layout, body),
            history: History::new(settings.memory, layout.rows),
            warp: Warp::new(&layout),
            contacts: Contacts::new(body),
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
            held_in_factor: held.clone(),
            touches_in_factor: vec![0.0; layout.free],
            usable: true,
            yielded: false,
            held,
            factor,
            layout,
        })
    }
}

impl Integrator for QuasiNewtonIntegrator {
    fn advance(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState, report: &mut StepReport) {
        let level = self.level;
        dispatch!(level, simd => self.frame(simd, frame, body, state, report));
    }

    fn contacts(&self) -> Option<&Contacts> {
        Some(&self.contacts)
    }
}

impl QuasiNewtonIntegrator {
    #[inline(always)]
    fn frame<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame<'_>,
        body: &Body,
        state: &mut BodyState,
        report: &mut StepReport,
    ) {
        let substeps = self.settings.substeps;
        let h = (frame.dt / substeps as f64) as f32;
        self.load(state);
        self.hold(frame, body);
        self.contacts.begin(frame, body, state);
        self.refresh_factor(frame, body, state);
        self.begin_anew(simd, h);
        for substep in 1..=substeps {
            let share = substep as f64 / substeps as f64;
            let (x, number) = (&self.x, &self.layout.number);
            let begin = (substep - 1) as f64 / substeps as f64;
            self.contacts.find(frame, body, begin, share, |vertex| position(&x[number[vertex] as usize]));
            self.limits.clear();
            self.limits.resize(self.contacts.touches().len(), 0.0);
            let limited = report.grasp_limited;
            // What the matrix does not know of may be too stiff for it.
            let went = self.usable && self.substep(simd, frame, share, h, body, report)
                || self.learn_touches(frame, body, state) && {
                    self.begin_anew(simd, h);
                    report.grasp_limited = limited;
                    self.substep(simd, frame, share, h, body, report)
                };
            if !went {
                report.grasp_limited = limited;
                report.fallbacks += 1;
                self.store(state);
                self.fallback.begin(frame, body);
                self.fallback.substep(frame, share, body, &self.contacts, state, report);
                self.load(state);
                self.begin_anew(simd, h);
            }
            let (x, number) = (&self.x, &self.layout.number);
            self.contacts.settle(frame, body, share, |vertex| position(&x[number[vertex] as usize]));
        }
        self.contacts.end(state);
        self.store(state);
    }

    /// Forgets the way, and looks at the elements as they are.
    #[inline(always)]
    fn begin_anew<S: Simd>(&mut self, simd: S, h: f32) {
        self.history.clear();
        self.elements.pass(simd, &self.layout, &self.x, &self.start, h);
        self.elements.accept();
    }

    /// One substep, which ends when `share` of the frame is over; false if it was given up, and nothing has changed then but scratch memory.
    #[inline(always)]
    fn substep<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame<'_>,
        share: f64,
        h: f32,
        body: &Body,
        report: &mut StepReport,
    ) -> bool {
        let gravity = frame.gravity.as_vec3a().extend(0.0).to_array();
        let free = self.layout.free;
        self.start.copy_from_slice(&self.x);
        // A body in free flight falls exactly: gravity's part of its motion is uniform and integrated as h^2/2 g. Elsewhere implicit Euler's h^2 g.
        let reach = if self.flies() { 0.5 * h * h } else { h * h };
        for i in 0..free {
            for c in 0..3 {
                self.predictor[i][c] = self.x[i][c] + h * self.v[i][c] + reach * gravity[c];
            }
        }
        let guess = self.guess(simd, frame, share, h, body);
        self.warp.update(simd, &self.layout, &self.x);
        self.take_gradient(simd, h);
        std::mem::swap(&mut self.gradient, &mut self.next_gradient);
        self.refresh_limits();
        let moved = guess != Guess::Still;
        let mut stepped = false;
        report.grasp_limited += usize::from(self.yielded);
        if guess == Guess::Behind {
            report.iterations += 1;
            let pulled = self.pull(simd, h);
            stepped = pulled != Pulled::Nowhere;
            report.grasp_limited += usize::from(pulled != Pulled::There && !self.yielded);
        }
        // Neither what positions cannot hold nor, at rest, what gravity does in a short substep is a correction.
        let rounding = 2.0 * f32::EPSILON * longest(&self.x[..free]);
        let settled = if gravity == [0.0; 4] { f32::INFINITY } else { 1e-4 * h * h * frame.gravity.length() as f32 };
        let (tolerance, relative) = ((self.settings.tolerance as f32).max(rounding), self.settings.relative as f32);
        for iteration in usize::from(guess == Guess::Behind)..self.settings.iterations {
            self.find_direction(simd);
            report.iterations += 1;
            let longest = longest(&self.direction);
            if longest <= tolerance.max(if iteration > 0 { relative * self.way() } else { 0.0 }) {
                if iteration > 0 || moved {
                    break;
                }
                if longest <= settled {
                    // At rest: what is left of the velocity is noise.
                    self.v.fill([0.0; 4]);
                    return true;
                }
            }
            match self.search(simd, h) {
                Found::Step => stepped = true,
                Found::Nothing if stepped => break,
                // What an earlier substep taught may mislead where contacts have changed.
                Found::Nothing if self.history.forget() => {}
                Found::Nothing => return self.restore(),
            }
        }
        for i in 0..free {
            for c in 0..3 {
                let v = self.v[i][c] + h * gravity[c] + (self.x[i][c] - self.predictor[i][c]) / h;
                self.v[i][c] = if self.held[i] { 0.0 } else { v };
            }
        }
        true
    }

    /// direction = -H gradient.
    #[inline(always)]
    fn find_direction<S: Simd>(&mut self, simd: S) {
        self.direction.copy_from_slice(&self.gradient);
        self.history.before(simd, &mut self.direction);
        self.precondition(simd);
        self.history.after(simd, &mut self.direction);
        for (i, d) in self.direction.iter_mut().enumerate() {
            *d = if self.held.get(i) == Some(&true) { [0.0; 4] } else { d.map(|d| -d) };
        }
    }

    /// direction = P^-1 direction, P being the stiffness at rest turned with the tissue.
    #[inline(always)]
    fn precondition<S: Simd>(&mut self, simd: S) {
        self.warp.to_rest(simd, &self.direction, &mut self.right);
        self.factor.solve(simd, &mut self.right);
        self.warp.out_of_rest(simd, &self.right, &mut self.direction);
    }

    /// How far any coordinate is from where the node would have gone by itself [m]: what the substep was found to be about, without any rigid motion.
    fn way(&self) -> f32 {
        let mut way = 0.0f32;
        for i in (0..self.layout.free).filter(|i| !self.held[*i]) {
            for c in 0..3 {
                way = way.max((self.x[i][c] - self.targets[i][c]).abs());
            }
        }
        way
    }

    /// Puts the substep's beginning back.
    fn restore(&mut self) -> bool {
        let rows = self.layout.free;
        self.x[..rows].copy_from_slice(&self.start[..rows]);
        false
    }

    /// Whether nothing holds or touches the body.
    fn flies(&self) -> bool {
        self.layout.free == self.layout.nodes
            && !self.held.contains(&true)
            && self.contacts.flies(|vertex| position(&self.x[self.layout.number[vertex] as usize]))
    }

    /// Marks the nodes that tools carry; a factor in which others are held is made anew.
    fn hold(&mut self, frame: &Frame<'_>, body: &Body) {
        self.held.fill(false);
        for grasp in frame.rigid_grasps() {
            for node in &grasp.nodes {
                let i = self.layout.number[body.internal[*node as usize] as usize] as usize;
                if i < self.layout.free {
                    self.held[i] = true;
                }
            }
        }
    }

    /// Makes the factor anew if it is not the one for the nodes that are held, pressed or hang on a tool.
    fn refresh_factor(&mut self, frame: &Frame<'_>, body: &Body, state: &BodyState) {
        let mut stale = !self.usable || self.held != self.held_in_factor;
        for i in 0..self.layout.free {
            let stiffness = self.contacts.stiffness(frame, body, state, self.layout.vertex[i] as usize);
            stale |= stiffness != self.touches_in_factor[i];
            self.touches_in_factor[i] = stiffness;
        }
        if stale {
            self.usable = self.factor.factorise(&self.held, &self.touches_in_factor);
            self.held_in_factor.copy_from_slice(&self.held);
        }
    }

    /// Lets the matrix know of what presses where a substep began or would have gone by itself; false if it did already.
    fn learn_touches(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState) -> bool {
        let (x, targets, number) = (&self.x, &self.targets, &self.layout.number);
        let places = |vertex: u32| {
            let i = number[vertex as usize] as usize;
            [position(&x[i]), position(&targets[i])]
        };
        let mut new = false;
        for touch in self.contacts.touches().iter().filter(|touch| !matches!(touch.source, Source::Grasp(..))) {
            let presses = places(touch.vertex).iter().any(|x| touch.height(*x) < 0.0);
            let known = &mut state.supported[touch.vertex as usize];
            new |= presses && !*known;
            *known |= presses;
        }
        if new {
            self.refresh_factor(frame, body, state);
        }
        new && self.usable
    }

    fn load(&mut self, state: &BodyState) {
        for (i, vertex) in self.layout.vertex.iter().enumerate() {
            self.x[i] = state.x[*vertex as usize].extend(0.0).to_array();
        }
        for i in 0..self.layout.free {
            self.v[i] = state.v[self.layout.vertex[i] as usize].extend(0.0).to_array();
        }
    }

    fn store(&self, state: &mut BodyState) {
        for i in 0..self.layout.free {
            let vertex = self.layout.vertex[i] as usize;
            state.x[vertex] = position(&self.x[i]);
            state.v[vertex] = position(&self.v[i]);
            // The sweeps' start is none of this solver's; a body that goes over to them starts afresh.
            state.falling[vertex] = 0.0;
        }
        for vertex in &self.layout.vertex[self.layout.free..] {
            state.v[*vertex as usize] = glam::Vec3A::ZERO;
        }
    }
}

fn position(row: &Row) -> glam::Vec3A {
    glam::Vec3A::new(row[0], row[1], row[2])
}

/// Largest coordinate of any row; not a number counts as infinite.
fn longest(rows: &[Row]) -> f32 {
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
