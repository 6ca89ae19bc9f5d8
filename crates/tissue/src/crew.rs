//! The bodies of a model with their solvers: those that may touch each other are stepped together, islands of them in parallel.

use crate::contact::{Contacts, Coupling, Pairs, Reaction, Source};
use crate::integrator::{Frame, Solver, Worker, for_each};
use crate::report::{Divergence, Measured};
use crate::untangle::Untangler;
use crate::{Body, BodyContact, Model, State, StepReport};
use glam::DVec3;

/// What the stepper knows of the solvers' kind: nothing.
pub(crate) trait Crew: Send + Sync {
    /// Goes over to another model; what both have in common keeps its solver. `alone`: the calling thread is to do all the work.
    fn set_model(&mut self, model: &Model, alone: bool);

    /// Whether the model is the one that was followed, and the state one of it.
    fn fits(&self, model: &Model, state: &State) -> bool;

    /// Advances the bodies by a frame, on the threads of a pool if there is one. Where a number is lost, all are as they were.
    fn advance(
        &mut self,
        model: &Model,
        state: &mut State,
        frame: &Frame<'_>,
        pool: Option<&rayon::ThreadPool>,
    ) -> StepReport;

    /// Calls `tell` for every body with what it did to the tools in the last frame.
    fn for_bodies(&self, tell: &mut dyn FnMut(usize, &Reaction, Option<&Contacts>));

    /// Calls `tell` for every force [N] that tools and other bodies did to a vertex at the end of the last frame, which left `state`, with its body.
    fn for_contact(&self, state: &State, tell: &mut dyn FnMut(usize, u32, DVec3));
}

/// Makes the solver of a body; the flag says whether the calling thread is to do all the work.
type Make<S> = Box<dyn Fn(&Body, bool) -> S + Send + Sync>;

/// Bodies that are all stepped by the same kind of solver.
pub(crate) struct Workers<S> {
    make: Make<S>,
    /// Island by island, the largest first.
    list: Vec<Worker<S>>,
    coupling: Option<Coupling>,
    /// What of the model the coupling was made for.
    contact: Option<BodyContact>,
    filtered: Vec<[usize; 2]>,
    /// By body: elements of the island that begins with it.
    sizes: Vec<usize>,
}

impl<S: Solver> Workers<S> {
    pub fn new(make: impl Fn(&Body, bool) -> S + Send + Sync + 'static) -> Self {
        Self {
            make: Box::new(make),
            list: Vec::new(),
            coupling: None,
            contact: None,
            filtered: Vec::new(),
            sizes: Vec::new(),
        }
    }

    /// Finds what may touch, and sorts the bodies into islands.
    fn find_islands(&mut self, model: &Model, state: &State, frame: &Frame<'_>) {
        let Self { list, coupling, sizes, .. } = self;
        if let Some(coupling) = coupling {
            coupling.find(model, state, frame);
        }
        sizes.fill(0);
        for worker in list.iter_mut() {
            worker.island = coupling.as_ref().map_or(worker.index, |coupling| coupling.island(worker.index));
            sizes[worker.island] += worker.body.tets.len();
        }
        list.sort_unstable_by_key(|worker| (std::cmp::Reverse(sizes[worker.island]), worker.island, worker.index));
    }
}

impl<S: Solver> Crew for Workers<S> {
    fn set_model(&mut self, model: &Model, alone: bool) {
        let mut old = std::mem::take(&mut self.list);
        for (index, (state, body)) in State::new(model).bodies.into_iter().zip(&model.bodies).enumerate() {
            let worker = match old.iter().position(|worker| worker.body.is(body)) {
                Some(at) => Worker { index, ..old.swap_remove(at) },
                None => Worker {
                    index,
                    body: body.clone(),
                    solver: (self.make)(body, alone),
                    report: StepReport::default(),
                    pairs: Pairs::default(),
                    island: index,
                    reaction: Reaction::new(body),
                    untangler: Untangler::new(&state),
                    measured: Measured::nothing(body.len()),
                    before: state.clone(),
                    state,
                },
            };
            self.list.push(worker);
        }
        self.contact = model.body_contact;
        self.filtered.clone_from(&model.filtered);
        let couple = |contact: BodyContact| Coupling::new(model, contact);
        self.coupling = model.body_contact.filter(|_| S::COUPLES).map(couple);
        self.sizes = vec![0; model.bodies.len()];
    }

    fn fits(&self, model: &Model, state: &State) -> bool {
        let contact = self.coupling.is_none() || self.contact == model.body_contact && self.filtered == model.filtered;
        let counts = contact && self.list.len() == model.bodies.len() && self.list.len() == state.bodies.len();
        // A model that was built again is as good as the same; one that was cut elsewhere is not.
        let same =
            |w: &Worker<S>| state.bodies[w.index].x.len() == w.state.x.len() && model.bodies[w.index].is_alike(&w.body);
        counts && self.list.iter().all(same)
    }

    fn advance(
        &mut self,
        model: &Model,
        state: &mut State,
        frame: &Frame<'_>,
        pool: Option<&rayon::ThreadPool>,
    ) -> StepReport {
        for worker in &mut self.list {
            let (body, state) = (&worker.body, &mut state.bodies[worker.index]);
            worker.report = StepReport::default();
            worker.before.copy_from(state);
            worker.untangler.untangle(&frame.of(worker.index), body, state);
        }
        self.find_islands(model, state, frame);
        for worker in &mut self.list {
            std::mem::swap(&mut worker.state, &mut state.bodies[worker.index]);
        }
        let Self { list, coupling, .. } = self;
        let advance = |island: &mut [Worker<S>]| advance(island, coupling.as_ref(), frame);
        match pool {
            Some(pool) => pool.install(|| for_islands(list, &advance)),
            None => list.chunk_by_mut(|a, b| a.island == b.island).for_each(advance),
        }
        let report = list.iter().fold(StepReport::default(), |all, worker| all.with(&worker.report));
        let broken = matches!(report.divergence, Some(Divergence::NonFinite { .. }));
        for worker in list {
            // The whole state is of one instant: if a body is lost, all are put back.
            if broken {
                worker.state.copy_from(&worker.before);
            }
            std::mem::swap(&mut worker.state, &mut state.bodies[worker.index]);
        }
        report
    }

    fn for_bodies(&self, tell: &mut dyn FnMut(usize, &Reaction, Option<&Contacts>)) {
        self.list.iter().for_each(|worker| tell(worker.index, &worker.reaction, worker.solver.contacts()));
    }

    fn for_contact(&self, state: &State, tell: &mut dyn FnMut(usize, u32, DVec3)) {
        for island in self.list.chunk_by(|a, b| a.island == b.island) {
            let x = |m: usize, vertex: u32| state.bodies[island[m].index].x[vertex as usize];
            for (m, worker) in island.iter().enumerate() {
                let touches = worker.solver.contacts().map_or(&[][..], Contacts::touches);
                for touch in touches.iter().filter(|touch| matches!(touch.source, Source::Collider(_))) {
                    if let Some(push) = touch.push(x(m, touch.vertex)) {
                        tell(worker.index, touch.vertex, -push.gradient.as_dvec3());
                    }
                }
            }
            for pair in island[0].pairs.list() {
                if let Some(push) = pair.touch.push(pair.offset(x)) {
                    for (m, vertex, share) in pair.shares() {
                        tell(island[m].index, vertex, (-share * push.gradient).as_dvec3());
                    }
                }
            }
        }
    }
}

/// Does the same with every island, in parallel: who is free takes the next.
fn for_islands<S: Solver>(list: &mut [Worker<S>], work: &(impl Fn(&mut [Worker<S>]) + Sync)) {
    let Some(first) = list.first().map(|worker| worker.island) else { return };
    let count = list.iter().take_while(|worker| worker.island == first).count();
    let (island, rest) = list.split_at_mut(count);
    if rest.is_empty() {
        work(island);
    } else {
        rayon::join(|| work(island), || for_islands(rest, work));
    }
}

/// Hands what other bodies do to rigidly held nodes on to the tools.
fn press_tools<S: Solver>(island: &mut [Worker<S>], frame: &Frame<'_>) {
    let pairs = std::mem::take(&mut island[0].pairs);
    for pair in pairs.list() {
        let offset = pair.offset(|m, vertex| island[m].state.x[vertex as usize]);
        if let Some(push) = pair.touch.push(offset) {
            for (m, vertex, share) in pair.shares() {
                let Worker { body, state, reaction, .. } = &mut island[m];
                let force = (-share * push.gradient).as_dvec3();
                reaction.press(frame, body, state, vertex as usize, force);
            }
        }
    }
    island[0].pairs = pairs;
}

/// Advances an island by a frame.
fn advance<S: Solver>(island: &mut [Worker<S>], coupling: Option<&Coupling>, frame: &Frame<'_>) {
    let mut pairs = std::mem::take(&mut island[0].pairs);
    if let Some(coupling) = coupling {
        pairs.begin(coupling, frame, island);
    }
    island[0].pairs = pairs;
    S::advance(island, frame);
    for_each(island, frame, |Worker { index, body, solver, state, report, reaction, measured, .. }| {
        report.measure(*index, body, state, measured);
        reaction.take(&frame.of(*index), body, state, solver.contacts().is_none());
    });
    press_tools(island, frame);
}
