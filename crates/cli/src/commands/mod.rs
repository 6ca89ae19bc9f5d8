//! The commands, one per file.

mod demo;
mod episode;
mod evaluate;
mod export;
mod identify;
mod inspect;
mod measure;
mod reconstruct;
mod record;
mod render;
mod scene;
mod segment;
mod simulate;
mod specimens;
mod study;
mod task;
mod view;

use crate::cli::{Cli, Command};
use trocar_core::Progress;
use trocar_studies::Result;
use trocar_studies::study::Kind;

/// Runs the command that was typed.
pub fn run(cli: &Cli, progress: &dyn Progress) -> Result<()> {
    match &cli.command {
        Command::Bench(arguments) => study::run(&arguments.study.0, Kind::Bench, cli.json, progress)?,
        Command::Demo(arguments) => demo::run(arguments, cli.json, progress)?,
        Command::Evaluate(arguments) => evaluate::run(arguments, cli.json, progress)?,
        Command::Episode(arguments) => episode::run(arguments, cli.json, progress)?,
        Command::Replay(arguments) => episode::replay_file(arguments, cli.json, progress)?,
        Command::Export(arguments) => export::run(arguments, cli.json, cli.quiet, progress)?,
        Command::Sweep(arguments) => episode::sweep(arguments, cli.json, progress)?,
        Command::Identify(arguments) => identify::run(arguments, cli.json, progress)?,
        Command::Inspect(arguments) => inspect::run(arguments, cli.json)?,
        Command::Measure(arguments) => measure::run(arguments, cli.json, progress)?,
        Command::Record(arguments) => record::run(arguments, cli.json, progress)?,
        Command::Render(arguments) => render::run(arguments, cli.json, progress)?,
        Command::Reconstruct(arguments) => reconstruct::run(arguments, cli.json, progress)?,
        Command::Experiment(arguments) => study::run(&arguments.study.0, Kind::Experiment, cli.json, progress)?,
        Command::Scene(arguments) => scene::run(arguments, cli.json)?,
        Command::Task(arguments) => task::run(arguments, cli.json)?,
        Command::Specimens(arguments) => specimens::run(arguments, cli.json, progress)?,
        Command::Segment(arguments) => segment::run(arguments, cli.json, progress)?,
        Command::View(arguments) => view::run(arguments, cli.json, progress)?,
        Command::Simulate(arguments) => simulate::run(arguments, cli.json, progress)?,
    }
    Ok(())
}
