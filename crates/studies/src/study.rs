//! What a study is: options, a run, figures, and a document of them. The command line, the JSON, the
//! page, the table for the docs, progress and interruption come from here; a study is one file.

use crate::{Error, Result};
use clap::{Arg, ArgMatches, Args, Command, value_parser};
use serde::Serialize;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::time::Instant;
use trocar_core::Progress;
use trocar_report::document::Document;
use trocar_workflow::REPORT;

/// Which command runs a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `trocar experiment`: a table or figure of the paper.
    Experiment,
    /// `trocar bench`: speed.
    Bench,
}

impl Kind {
    /// The command's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Experiment => "experiment",
            Self::Bench => "bench",
        }
    }
}

/// A table or figure of the paper, or a benchmark. The options are the fields of the type; the doc
/// comment of the type is the command's help.
pub trait Study: Args {
    /// Its name on the command line.
    const NAME: &'static str;
    /// Which command runs it.
    const KIND: Kind;
    /// Version of its table in the docs: increase it when a column or a row changes its meaning.
    const SCHEMA: u32 = 1;
    /// Help of `--output`; `None` if the study writes no folder.
    const FOLDER: Option<&'static str> = Some("Folder for the report.");
    /// Whether the study keeps its own page and JSON in the folder, as campaigns do.
    const KEEPS_OWN_FILES: bool = false;
    /// What is printed with `--json`.
    type Figures: Serialize;

    /// Measures.
    ///
    /// # Errors
    /// Options out of range, inputs that cannot be read, an interruption.
    fn run(&self, job: &Job<'_>) -> Result<(Self::Figures, Document)>;
}

/// Stops an interrupted study.
///
/// # Errors
/// [`Error::Interrupted`] when the user asked to stop.
pub(crate) fn stop_if_asked(progress: &dyn Progress) -> Result<()> {
    if progress.interrupted() { Err(Error::Interrupted) } else { Ok(()) }
}

/// Where a study writes, and how it reports progress.
pub struct Job<'a> {
    output: PathBuf,
    marker: String,
    /// Progress and the request to stop.
    pub progress: &'a dyn Progress,
    clock: Instant,
}

impl<'a> Job<'a> {
    /// A job of study `S` that writes to the folder `output`.
    pub fn new<S: Study>(output: &Path, progress: &'a dyn Progress) -> Self {
        Self { output: output.to_owned(), marker: format!("{}.json", S::NAME), progress, clock: Instant::now() }
    }

    /// The output folder.
    pub fn output(&self) -> &Path {
        &self.output
    }

    /// The report's path, as figures name it.
    pub fn report(&self) -> String {
        self.output.join(REPORT).display().to_string()
    }

    /// Wall time since the start of the job (s).
    pub fn seconds(&self) -> f64 {
        self.clock.elapsed().as_secs_f64()
    }

    /// Creates the output folder, which must be new, empty, or of an earlier run of this study. A
    /// study that fails on its options leaves no folder if it checks them before this call.
    ///
    /// # Errors
    /// A folder of something else, or one that cannot be written.
    pub fn claim(&self) -> Result<()> {
        let (output, marker) = (&self.output, &self.marker);
        let io = |source| Error::Io { path: output.clone(), source };
        let path = output.join(marker);
        if output.exists() && !path.is_file() && output.read_dir().map_err(io)?.next().is_some() {
            let reason =
                format!("holds no {marker}, so it is no earlier experiment and is not written to; name a new folder");
            return Err(Error::Exists { path: output.clone(), reason });
        }
        std::fs::create_dir_all(output).map_err(io)?;
        if path.is_file() { Ok(()) } else { write(&path, b"{}\n") }
    }
}

/// Runs `study` into the folder `output`: its page and its figures as JSON.
///
/// # Errors
/// Those of the study; a file that cannot be written.
pub fn run<S: Study>(study: &S, output: &Path, progress: &dyn Progress) -> Result<(S::Figures, Document)> {
    let job = Job::new::<S>(output, progress);
    let (figures, document) = study.run(&job)?;
    if S::FOLDER.is_some() && !S::KEEPS_OWN_FILES {
        job.claim()?;
        write(&output.join(REPORT), document.page().as_bytes())?;
        let json = serde_json::to_vec_pretty(&figures).map_err(|e| Error::Format(e.to_string()))?;
        write(&output.join(&job.marker), &json)?;
    }
    Ok((figures, document))
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|source| Error::Io { path: path.to_owned(), source })
}

/// What a study leaves for the terminal and the docs.
#[derive(Clone, Debug)]
pub struct Printed {
    /// The figures as one JSON object.
    pub json: String,
    /// Lines for people.
    pub text: String,
    /// The table for the docs.
    pub docs: String,
}

/// A study whose type is not known: what the command line lists.
pub trait Entry: Sync {
    /// Its name.
    fn name(&self) -> &'static str;
    /// Which command runs it.
    fn kind(&self) -> Kind;
    /// Version of its table in the docs.
    fn schema(&self) -> u32;
    /// Its command with all options.
    fn command(&self) -> Command;
    /// Runs it with the options of `matches`.
    ///
    /// # Errors
    /// Those of the study.
    fn run(&self, matches: &ArgMatches, progress: &dyn Progress) -> Result<Printed>;
}

/// The [`Entry`] of study `S`.
pub struct Of<S>(PhantomData<fn() -> S>);

impl<S> Of<S> {
    /// The entry.
    pub const NEW: Self = Self(PhantomData);
}

impl<S: Study> Entry for Of<S> {
    fn name(&self) -> &'static str {
        S::NAME
    }

    fn kind(&self) -> Kind {
        S::KIND
    }

    fn schema(&self) -> u32 {
        S::SCHEMA
    }

    fn command(&self) -> Command {
        let docs = Arg::new("docs")
            .long("docs")
            .value_name("FILE")
            .value_parser(value_parser!(PathBuf))
            .help("Also write the table as Markdown for the docs.");
        let command = S::augment_args(Command::new(S::NAME)).arg(docs);
        let Some(help) = S::FOLDER else { return command };
        // clap keeps what it is given for as long as the program runs.
        let folder: &'static str = Box::leak(format!("trocar-{}/{}", S::KIND.name(), S::NAME).into_boxed_str());
        let output = Arg::new("output")
            .short('o')
            .long("output")
            .value_name("FOLDER")
            .visible_alias("resume")
            .value_parser(value_parser!(PathBuf))
            .default_value(folder)
            .help(help);
        command.arg(output)
    }

    fn run(&self, matches: &ArgMatches, progress: &dyn Progress) -> Result<Printed> {
        let study = S::from_arg_matches(matches).map_err(|e| Error::Mismatch(e.to_string()))?;
        let output = S::FOLDER.and_then(|_| matches.get_one::<PathBuf>("output"));
        let (figures, document) = run(&study, output.map_or(Path::new(""), PathBuf::as_path), progress)?;
        let json = serde_json::to_string(&figures).map_err(|e| Error::Format(e.to_string()))?;
        let mut text = document.text();
        if let Some(output) = output {
            text += &format!("report {}\n", output.join(REPORT).display());
        }
        Ok(Printed { json, text, docs: document.markdown() })
    }
}
