//! The scripted policy grasps the appendix of phantom A in the two-arm cell and lifts it.

#![allow(clippy::print_stdout, reason = "an example prints its result")]

use trocar::prelude::*;
use trocar::task;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut scene = Scene::builtin("cell-a")?;
    scene.task.name = TaskName::GraspLift;
    // The phantom is recorded and reconstructed once, and read from this folder afterwards.
    let specimen = trocar::workflow::scene_specimen(&scene, "target/phantoms".as_ref(), &Silent)?;
    let mut episode = Episode::new(&scene, &specimen, 0)?;
    let mut policy = task::policy::named("scripted")?;
    let recording = task::run(&mut episode, policy.as_mut(), 0, &mut |_| true)?;
    let lift = recording.channels.iter().map(|row| row.task.lift_mm).fold(0.0, f64::max);
    for stage in &episode.progress().stages {
        println!("{}: {}", stage.stage, if stage.passed { "passed" } else { "not passed" });
    }
    println!("lifted by {lift:.1} mm in {:.1} s of simulated time", episode.time());
    Ok(())
}
