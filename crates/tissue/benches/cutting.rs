//! Cost of a cut: severing a tube, and changing the stepper to the new model.
//!
//! `cargo bench -p trocar-tissue --bench cutting`

#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "a benchmark prints")]

#[path = "../tests/common/mod.rs"]
mod common;

use common::{FRAME, GRAVITY, appendix, nodes, tissue};
use glam::DVec3;
use std::time::{Duration, Instant};
use trocar_tissue::{Cut, SolverSettings, State, Stepper, sever};

/// Repetitions; the fastest counts.
const TIMES: usize = 30;

/// Of all (ms).
fn least(times: &[Duration]) -> f64 {
    1e3 * times.iter().min().map_or(0.0, Duration::as_secs_f64)
}

fn main() {
    println!("elements  sever  follow (fast)  follow (sweeps)  [ms, least of {TIMES}]  frame (fast)");
    for cell in [2.6e-3, 2.1e-3, 1.3e-3] {
        let mesh = appendix(cell);
        let model = common::model(&mesh, tissue(12e3), nodes(&mesh, |p| p.x < 6e-3), GRAVITY);
        let state = State::new(&model);
        let mut fast = Stepper::new(&model, SolverSettings::FAST, FRAME, 1).unwrap();
        let mut sweeps = Stepper::new(&model, SolverSettings::PAPER, FRAME, 1).unwrap();
        let cut = Cut::through(0, DVec3::X * 0.04, DVec3::X);
        let mut moving = state.clone();
        let mut times = [const { Vec::new() }; 4];
        for _ in 0..TIMES {
            let start = Instant::now();
            fast.step(&model, &mut moving, &[]);
            times[3].push(start.elapsed());
            let start = Instant::now();
            let severed = sever(&model, &state, &cut).unwrap();
            times[0].push(start.elapsed());
            assert_eq!(severed.pieces.len(), 2);
            for (k, stepper) in [&mut fast, &mut sweeps].into_iter().enumerate() {
                let start = Instant::now();
                stepper.set_model(&severed.model).unwrap();
                times[1 + k].push(start.elapsed());
                stepper.set_model(&model).unwrap();
            }
        }
        let [sever, fast, sweeps, frame] = times.map(|times| least(&times));
        println!("{:8} {sever:6.1} {fast:14.1} {sweeps:16.1} {frame:38.1}", mesh.tets.len());
    }
}
