//! Random legal actions break nothing.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]
#![allow(clippy::print_stdout, reason = "what was measured, for those who ask with --nocapture")]

mod common;

use common::{ONE_END, meshed, scene};
use glam::DVec3;
use trocar_cell::{Cell, CellEvent, Policy, RandomActions};
use trocar_scene::Scene;
use trocar_specimen::Specimen;

const ARMS: [&str; 2] = ["left", "right"];

fn check_joints(cell: &Cell) {
    for arm in ARMS {
        let q = cell.measured_js(arm).unwrap().position;
        for (i, [low, high]) in cell.joint_limits(arm).unwrap().into_iter().enumerate() {
            assert!((low..=high).contains(&q[i]), "{arm} joint {i}: {} not in {low} to {high}", q[i]);
        }
    }
}

/// What a run came to.
#[derive(Clone, Copy, Debug, Default)]
struct Outcome {
    touched: bool,
    /// Largest RCM deviation [mm].
    rcm: f64,
    stretch: f64,
    /// Events.
    unhooked: usize,
    relaxed: usize,
}

/// Random legal actions, each kept for a random while.
fn random_run(scene: &Scene, specimen: &Specimen, seed: u64, steps: usize) -> Outcome {
    let mut cell = Cell::new(scene, specimen, 1).unwrap();
    let mut policy = RandomActions::new(seed, &ARMS);
    let mut out = Outcome::default();
    for step in 0..steps {
        let action = policy.act(&cell).unwrap().unwrap();
        let report = cell.step(&action).unwrap();
        let t = &report.tissue;
        assert!(t.divergence.is_none() && t.inverted == 0, "seed {seed}, step {step}: {t:?}");
        check_joints(&cell);
        for arm in &report.arms {
            assert!(arm.tip.translation.is_finite() && arm.force.wrench.is_finite());
            out.rcm = out.rcm.max(1e3 * arm.rcm_peak);
            out.touched |= arm.contact != DVec3::ZERO;
        }
        out.stretch = out.stretch.max(cell.max_stretch());
        out.unhooked += report.events.iter().filter(|e| matches!(e, CellEvent::Unhooked { .. })).count();
        out.relaxed += report.events.iter().filter(|e| matches!(e, CellEvent::Relaxed { .. })).count();
    }
    println!("seed {seed}: {out:?}");
    out
}

fn random_runs(scene: &Scene, seeds: std::ops::Range<u64>, steps: usize, edge: f64) {
    let specimen = meshed(ONE_END, edge);
    let next = std::sync::atomic::AtomicU64::new(seeds.start);
    let all = std::sync::Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    if seed >= seeds.end {
                        return;
                    }
                    let outcome = random_run(scene, &specimen, seed, steps);
                    all.lock().unwrap().push(outcome);
                }
            });
        }
    });
    let all = all.into_inner().unwrap();
    let most = |part: fn(&Outcome) -> f64| all.iter().map(part).fold(0.0, f64::max);
    println!("largest RCM deviation {:.3} mm, largest stretch {:.2}", most(|o| o.rcm), most(|o| o.stretch));
    assert!(most(|o| o.rcm) < 5.0, "RCM deviation of {} mm", most(|o| o.rcm));
    assert!(2 * all.iter().filter(|o| o.touched).count() >= all.len(), "most runs touch the tissue");
}

#[test]
fn random_legal_actions_break_nothing() {
    random_runs(&scene(), 0..20, 500, 2.2e-3);
}

#[test]
#[ignore = "takes minutes"]
fn ten_thousand_random_actions_break_nothing() {
    let mut scene = scene();
    scene.tissue.support.kind = trocar_scene::SupportKind::None;
    random_runs(&scene, 100..102, 10_000, 2.2e-3);
}
