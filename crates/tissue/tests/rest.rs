//! A body alone comes to rest, where it belongs, and stays there.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::DVec3;
use trocar_testing::blocks::{FRAME, GRAVITY, block, nodes, tissue};
use trocar_tissue::{BodyDescription, Load, Material, Model, ModelBuilder, SolverSettings, State, StepReport, Stepper};

/// Frames in which the block is pulled, and in which it comes to rest.
const PULLED: usize = 10;
const FRAMES: usize = 150;

/// A block of 24 x 8 x 8 mm that is clamped at one end.
fn clamped(gravity: DVec3, viscosity: f64) -> Model {
    let mesh = block([12, 4, 4], 2e-3);
    let material = Material { viscosity, ..tissue(12e3) };
    let pinned = nodes(&mesh, |p| p.x == 0.0);
    let mut builder = ModelBuilder::new().gravity(gravity);
    builder.body(BodyDescription { name: "block".into(), mesh: &mesh, material, pinned, supports: vec![] }).unwrap();
    builder.build().unwrap()
}

fn stepper(model: &Model) -> Stepper {
    Stepper::new(model, SolverSettings::FAST, FRAME, 1).unwrap()
}

/// Steps the block frame by frame, and pulls at its end first.
fn step(model: &Model, state: &mut State, stepper: &mut Stepper, frame: usize) -> StepReport {
    let end = model.bodies()[0].len() - 1;
    let pull = [Load { body: 0, node: end, force: DVec3::new(0.0, 0.02, 0.01) }];
    let report = stepper.step_with_loads(model, state, &[], if frame < PULLED { &pull } else { &[] });
    assert_eq!((report.divergence, report.fallbacks), (None, 0));
    report
}

#[test]
fn a_pulled_block_comes_to_rest_and_stays_there() {
    for (gravity, viscosity) in [(GRAVITY, 72.0), (DVec3::ZERO, 72.0), (0.01 * GRAVITY, 300.0)] {
        let model = clamped(gravity, viscosity);
        let (mut state, mut stepper) = (State::new(&model), stepper(&model));
        let mut rested = None;
        for frame in 0..FRAMES {
            let before = state.positions(&model, 0);
            let report = step(&model, &mut state, &mut stepper, frame);
            match rested {
                None if frame > PULLED && report.max_speed == 0.0 => rested = Some(frame),
                Some(_) => {
                    assert_eq!((report.iterations, report.max_speed), (0, 0.0), "frame {frame}");
                    assert_eq!(state.positions(&model, 0), before, "frame {frame}");
                }
                None => {}
            }
        }
        println!("gravity {:.3} m/s2: at rest after {rested:?} frames", gravity.length());
        assert!(rested.is_some(), "gravity {gravity}: still moves after {FRAMES} frames");

        // Without gravity the block belongs where it began; else where one lies that was never
        // pulled.
        let mut never = State::new(&model);
        if gravity != DVec3::ZERO {
            let mut stepper = self::stepper(&model);
            (PULLED..3 * FRAMES).for_each(|frame| _ = step(&model, &mut never, &mut stepper, frame));
        }
        let place = |state: &State, i: usize| state.position(&model, 0, i);
        let off = (0..model.bodies()[0].len()).map(|i| place(&state, i).distance(place(&never, i)));
        let off = off.fold(0.0, f64::max);
        println!("off by {:.1} nm", 1e9 * off);
        assert!(off < 1e-7, "gravity {gravity}: rests {:.1} nm from its place", 1e9 * off);
    }
}

/// When a body comes to rest depends on its state alone: a stepper that continues a saved state
/// agrees to the bit, whatever frame it was saved in.
#[test]
fn coming_to_rest_does_not_depend_on_the_past() {
    let model = clamped(GRAVITY, 72.0);
    let (mut state, mut stepper) = (State::new(&model), stepper(&model));
    for frame in 0..FRAMES {
        let mut saved = state.clone();
        step(&model, &mut state, &mut stepper, frame);
        step(&model, &mut saved, &mut self::stepper(&model), frame);
        assert_eq!(saved.hash(), state.hash(), "frame {frame}");
    }
}
