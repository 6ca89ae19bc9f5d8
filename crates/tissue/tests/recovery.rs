//! Tissue from the worst of starts: every node thrown to a random place.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and print figures")]

use glam::DVec3;
use trocar_testing::blocks::{self, FRAME, block, model, nodes, noise, tissue};
use trocar_tissue::{ConstitutiveModel, Divergence, Material, SolverSettings, State, Stepper};

/// Nodes at random places inside the bounding box find back until no element is inverted. They are
/// near their rest shape then, and end in it.
fn recovers(name: &str, schedule: SolverSettings) {
    let mesh = block([3, 3, 3], 2e-3);
    let high = DVec3::splat(6e-3);
    for constitutive in ConstitutiveModel::ALL {
        for (pinned, how) in [(vec![], "free"), (nodes(&mesh, |p| p.z == 0.0), "pinned")] {
            let material = Material { model: constitutive, viscosity: 4.0, ..tissue(12e3) };
            let model = model(&mesh, material, pinned, DVec3::ZERO);
            for seed in 0..3 {
                let mut state = State::new(&model);
                for i in 0..mesh.vertices.len() {
                    let at = |c: u64| noise(1000 * seed + 3 * i as u64 + c);
                    if !model.bodies()[0].pinned()[i] {
                        state.set_position(&model, 0, i, high * DVec3::new(at(0), at(1), at(2)));
                    }
                }
                let mut stepper = Stepper::new(&model, schedule, FRAME, 1).unwrap();
                let what = format!("{constitutive:?}, {how}, {name}, seed {seed}");
                let mut step = || {
                    let report = stepper.step(&model, &mut state, &[]);
                    // Speeds and stretches are absurd at first; numbers never are.
                    let lost = matches!(report.divergence, Some(Divergence::NonFinite { .. }));
                    assert!(!lost, "{what}: {report:?}");
                    report
                };
                let (first, mut frames) = (step(), 1);
                let mut report = first;
                while report.inverted > 0 && frames < 60 {
                    report = step();
                    frames += 1;
                }
                for _ in 0..60 {
                    report = step();
                    assert_eq!(report.inverted, 0, "{what}: {report:?}");
                }
                println!(
                    "{what}: {} inverted after a frame, none after {frames}, least ratio {:.2}",
                    first.inverted, report.min_volume_ratio
                );
                assert!(report.min_volume_ratio > 0.95, "{what}: {report:?}");
            }
        }
    }
}

#[test]
fn random_starts_recover_by_sweeps() {
    recovers("paper", SolverSettings::PAPER);
    recovers("adaptive sweeps", blocks::adaptive());
}

#[test]
fn random_starts_recover_by_the_fast_schedule() {
    recovers("fast", SolverSettings::FAST);
}
