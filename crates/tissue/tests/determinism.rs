//! The same bits over 600 frames, whatever the threads, runs and interruptions.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and print figures")]

use glam::{DQuat, DVec3};
use trocar_core::Pose;
use trocar_testing::blocks::{self, FRAME, three_bodies};
use trocar_tissue::{Grasp, Model, SolverSettings, State, Stepper, ToolMotion};

const FRAMES: usize = 600;

/// A tool that lifts, turns and lowers.
fn tool(frame: usize) -> Pose {
    let t = frame as f64 / FRAMES as f64;
    // A parabola, not a sine: the library's sines differ between machines.
    let bump = 4.0 * t * (1.0 - t);
    let rotation = DQuat::from_xyzw(0.0, 0.1 * bump, 0.0, 1.0).normalize();
    Pose { rotation, translation: DVec3::new(0.0, 0.0, 4e-3 * bump) }
}

fn run(model: &Model, stepper: &mut Stepper, state: &mut State, frames: std::ops::Range<usize>) {
    for k in frames {
        let motion = ToolMotion { from: tool(k), to: tool(k + 1) };
        assert_eq!(stepper.step(model, state, &[motion]).divergence, None);
    }
}

fn start(model: &Model, held: &[u32]) -> State {
    let mut state = State::new(model);
    state.grasps.push(Grasp::capture(model, &state, 0, held, 0, &tool(0)));
    state
}

fn same_bits(schedule: SolverSettings, name: &str) -> u64 {
    let (model, held) = three_bodies();
    let whole = |threads: usize| {
        let mut state = start(&model, &held);
        run(&model, &mut Stepper::new(&model, schedule, FRAME, threads).unwrap(), &mut state, 0..FRAMES);
        state.hash()
    };
    let one = whole(1);
    for threads in [1, 2, 3, 4] {
        assert_eq!(one, whole(threads), "{name}: {threads} threads");
    }
    // Saved in the middle: the stepper continues elsewhere, and the saved state continues in it and
    // in a new stepper.
    let mut state = start(&model, &held);
    let mut stepper = Stepper::new(&model, schedule, FRAME, 2).unwrap();
    run(&model, &mut stepper, &mut state, 0..FRAMES / 2);
    let saved = state.clone();
    run(&model, &mut stepper, &mut state, 0..30);
    let mut restored = saved.clone();
    run(&model, &mut stepper, &mut restored, FRAMES / 2..FRAMES);
    assert_eq!(one, restored.hash(), "{name}: restored in the stepper that went on");
    let mut restored = saved;
    let mut fresh = Stepper::new(&model, schedule, FRAME, 1).unwrap();
    run(&model, &mut fresh, &mut restored, FRAMES / 2..FRAMES);
    assert_eq!(one, restored.hash(), "{name}: restored in a new stepper");
    one
}

#[test]
fn six_hundred_frames_of_sweeps_have_the_same_bits() {
    for (name, schedule) in [("paper", SolverSettings::PAPER), ("adaptive sweeps", blocks::adaptive())] {
        println!("{name}: {:#018x}", same_bits(schedule, name));
    }
}

#[test]
fn six_hundred_frames_of_the_fast_schedule_have_the_same_bits() {
    println!("fast: {:#018x}", same_bits(SolverSettings::FAST, "fast"));
}
