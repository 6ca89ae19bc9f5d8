//! A body of more nodes than an organ usually has.

use glam::DVec3;
use trocar_core::Pose;
use trocar_testing::blocks::{FRAME, block, model, nodes, tissue};
use trocar_tissue::{Grasp, SolverSettings, State, Stepper, ToolMotion};

/// A patch at the middle of a slender block of 25,000 free nodes is shaken by 1 mm. With a factor
/// of 8 bits a number it took 175 iterations, with one of 16 bits it takes 83.
#[test]
fn a_large_body_has_a_precise_factor() {
    let (cells, edge) = ([150, 12, 12], 0.7e-3);
    let mesh = block(cells, edge);
    let model = model(&mesh, tissue(12e3), nodes(&mesh, |p| p.x == 0.0), DVec3::ZERO);
    let middle = edge * DVec3::new(75.0, 0.0, 12.0);
    let held = nodes(&mesh, |p| p.distance(middle) < 4e-3);
    let mut state = State::new(&model);
    state.grasps.push(Grasp::capture(&model, &state, 0, &held, 0, &Pose::IDENTITY));
    let mut stepper = Stepper::new(&model, SolverSettings::FAST, FRAME, 0).unwrap();
    let at = |frame: f64| {
        let height = 1e-3 * (46.0 * FRAME * frame).sin();
        Pose { translation: DVec3::new(0.0, 0.0, height), ..Pose::IDENTITY }
    };
    let mut iterations = 0;
    for frame in 0..12 {
        let frame = f64::from(frame);
        let report = stepper.step(&model, &mut state, &[ToolMotion { from: at(frame), to: at(frame + 1.0) }]);
        assert_eq!((report.divergence, report.inverted, report.fallbacks), (None, 0, 0));
        iterations += report.iterations;
    }
    assert!(iterations < 120, "{iterations} iterations");
}
