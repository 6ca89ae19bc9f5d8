//! What tissue costs: a frame by each solver and instruction set, building a model, and a cut.
//! `cargo bench -p trocar-tissue`.

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first error")]

use divan::Bencher;
use glam::DVec3;
use trocar_testing::blocks::{self, FRAME, GRAVITY, appendix, nodes, tissue};
use trocar_tissue::{Cut, Isa, Model, SolverSettings, State, Stepper, sever};

fn main() {
    divan::main();
}

/// Edges of the lattices (m).
const EDGES: [f64; 3] = [2.6e-3, 2.1e-3, 1.3e-3];

/// Frames before a measurement, so that the organ moves.
const WARM_UP: usize = 5;

/// An appendix of 12 kPa that is held by its base.
fn model(edge: f64) -> Model {
    let mesh = appendix(edge);
    blocks::model(&mesh, tissue(12e3), nodes(&mesh, |p| p.x < 6e-3), GRAVITY)
}

/// One frame (1/60 s) of an appendix that falls from its rest shape, on one thread.
fn frame(bencher: Bencher<'_, '_>, edge: f64, settings: SolverSettings) {
    let model = model(edge);
    let mut stepper = Stepper::new(&model, settings, FRAME, 1).unwrap();
    let mut state = State::new(&model);
    for _ in 0..WARM_UP {
        stepper.step(&model, &mut state, &[]);
    }
    bencher.with_inputs(|| state.clone()).bench_local_refs(|state| stepper.step(&model, state, &[]));
}

#[divan::bench(args = EDGES)]
fn frame_quasi_newton(bencher: Bencher<'_, '_>, edge: f64) {
    frame(bencher, edge, SolverSettings::FAST);
}

#[divan::bench(args = EDGES)]
fn frame_vertex_block_descent(bencher: Bencher<'_, '_>, edge: f64) {
    frame(bencher, edge, SolverSettings::PAPER);
}

/// The same frame by each instruction set that the machine has, the least one last: the limit
/// stays.
#[divan::bench(args = available())]
fn instruction_set(bencher: Bencher<'_, '_>, isa: &str) {
    let chosen = Isa::ALL.into_iter().find(|i| i.name() == isa).unwrap();
    Isa::limit(chosen);
    frame(bencher, EDGES[1], SolverSettings::PAPER);
}

fn available() -> impl Iterator<Item = &'static str> {
    Isa::ALL.into_iter().filter(|isa| isa.is_available()).map(Isa::name)
}

#[divan::bench(args = EDGES)]
fn build_model(bencher: Bencher<'_, '_>, edge: f64) {
    bencher.bench_local(|| model(edge));
}

/// Severing the appendix in its middle.
#[divan::bench(args = EDGES)]
fn cut(bencher: Bencher<'_, '_>, edge: f64) {
    let model = model(edge);
    let state = State::new(&model);
    let plane = Cut::through(0, DVec3::X * 0.04, DVec3::X);
    bencher.bench_local(|| sever(&model, &state, &plane).unwrap());
}

/// Changing the stepper to the pieces of a cut.
#[divan::bench(args = EDGES)]
fn stepper_after_cut(bencher: Bencher<'_, '_>, edge: f64) {
    let model = model(edge);
    let severed = sever(&model, &State::new(&model), &Cut::through(0, DVec3::X * 0.04, DVec3::X)).unwrap();
    bencher.with_inputs(|| Stepper::new(&model, SolverSettings::FAST, FRAME, 1).unwrap()).bench_local_values(
        |mut stepper| {
            stepper.set_model(&severed.model).unwrap();
            stepper
        },
    );
}
