//! A policy of one's own in two episodes of the resection task, scored by stages.

#![allow(clippy::print_stdout, reason = "an example prints its result")]

use trocar::prelude::*;
use trocar::task;

/// Keeps both arms where they are. A real policy looks at `episode.observe()`.
struct Wait;

impl Policy for Wait {
    fn name(&self) -> &str {
        "wait"
    }

    fn begin(&mut self, _episode: &Episode, _seed: u64) -> task::Result<()> {
        Ok(())
    }

    fn act(&mut self, episode: &Episode) -> task::Result<Vec<Action>> {
        let targets: Vec<_> = episode.cell().observe().iter().map(|arm| arm.commanded).collect();
        Ok(vec![Action::targets(&targets); 8])
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut scene = Scene::builtin("cell-a")?;
    scene.task.episode_s = 2.0;
    let specimen = trocar::workflow::scene_specimen(&scene, "target/phantoms".as_ref(), &Silent)?;
    let mut episode = Episode::new(&scene, &specimen, 0)?;
    for seed in 0..2 {
        let recording = task::run(&mut episode, &mut Wait, seed, &mut |_| true)?;
        let result = recording.result();
        println!(
            "seed {seed}: {} of {} stages, ended with '{}', state {}",
            episode.progress().stage,
            episode.progress().stages.len(),
            episode.end().map_or("nothing", |end| end.name()),
            result.state_hash
        );
    }
    Ok(())
}
