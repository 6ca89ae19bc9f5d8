//! The subcommands of `experiment` and `bench`, from the registry of studies.

use clap::{ArgMatches, Args, Command, Error, FromArgMatches, Subcommand, error::ErrorKind};
use trocar_studies::registry::STUDIES;
use trocar_studies::study::Kind;

#[derive(Debug, Args)]
pub struct Experiment {
    /// The study.
    #[command(subcommand)]
    pub study: ExperimentChoice,
}

#[derive(Debug, Args)]
pub struct Bench {
    /// The study.
    #[command(subcommand)]
    pub study: BenchChoice,
}

#[derive(Debug)]
pub struct StudyChoice {
    /// Its name.
    pub name: String,
    /// Its options.
    pub options: ArgMatches,
}

#[derive(Debug)]
pub struct ExperimentChoice(pub StudyChoice);

#[derive(Debug)]
pub struct BenchChoice(pub StudyChoice);

impl StudyChoice {
    fn of(matches: &ArgMatches) -> Result<Self, Error> {
        let Some((name, options)) = matches.subcommand() else {
            return Err(Error::raw(ErrorKind::MissingSubcommand, "the name of a study is missing\n"));
        };
        Ok(Self { name: name.to_owned(), options: options.clone() })
    }
}

fn with_studies(command: Command, kind: Kind) -> Command {
    let studies = STUDIES.iter().filter(|e| e.kind() == kind).map(|e| e.command());
    command.subcommands(studies).subcommand_required(true).arg_required_else_help(true)
}

fn is_study(name: &str, kind: Kind) -> bool {
    STUDIES.iter().any(|e| e.kind() == kind && e.name() == name)
}

macro_rules! choice {
    ($choice:ident, $kind:expr) => {
        impl FromArgMatches for $choice {
            fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
                StudyChoice::of(matches).map(Self)
            }

            fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
                *self = Self::from_arg_matches(matches)?;
                Ok(())
            }
        }

        impl Subcommand for $choice {
            fn augment_subcommands(command: Command) -> Command {
                with_studies(command, $kind)
            }

            fn augment_subcommands_for_update(command: Command) -> Command {
                with_studies(command, $kind)
            }

            fn has_subcommand(name: &str) -> bool {
                is_study(name, $kind)
            }
        }
    };
}

choice!(ExperimentChoice, Kind::Experiment);
choice!(BenchChoice, Kind::Bench);
