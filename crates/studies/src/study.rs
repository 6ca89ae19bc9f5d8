//! The trait of a study: options, a run, figures and a document. It gives every study its command,
//! JSON, page, table for the docs, progress, resume and interruption.

use crate::trials::{Outcomes, Trials};
use crate::{Error, Result};
use clap::{Arg, ArgMatches, Args, Command, value_parser};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::time::Instant;
use trocar_core::Progress;
use trocar_report::document::Document;
use trocar_workflow::REPORT;

/// The command that runs a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `trocar experiment`: a table or figure of the paper.
    Experiment,
    /// `trocar bench`: a benchmark.
    Bench,
}

impl Kind {
    /// The name of the command.
    pub fn name(self) -> &'static str {
        match self {
            Self::Experiment => "experiment",
            Self::Bench => "bench",
        }
    }
}

/// A table or figure of the paper, or a benchmark. The fields of the type are the options; its doc
/// comment is the help text of the command.
pub trait Study: Args {
    /// The name on the command line.
    const NAME: &'static str;
    /// The command that runs it.
    const KIND: Kind;
    /// Version of the table in the docs. Increase it when a column or row changes its meaning.
    const SCHEMA: u32 = 1;
    /// Help text of `--output`; `None` if the study writes no folder.
    const FOLDER: Option<&'static str> = Some("Output folder of the report.");
    /// Whether the study writes its own files into the output folder, instead of page and JSON.
    const WRITES_OWN_FILES: bool = false;
    /// The content of `--json`.
    type Figures: Serialize;

    /// Measures.
    ///
    /// # Errors
    /// Options out of range, unreadable inputs, an interruption.
    fn run(&self, job: &Job<'_>) -> Result<(Self::Figures, Document)>;
}

/// One run of a study: output folder, progress.
pub struct Job<'a> {
    output: PathBuf,
    study: &'static str,
    /// Progress, and the request to stop.
    pub progress: &'a dyn Progress,
}

impl<'a> Job<'a> {
    /// A run of study `S` with output folder `output`.
    pub fn new<S: Study>(output: &Path, progress: &'a dyn Progress) -> Self {
        Self { output: output.to_owned(), study: S::NAME, progress }
    }

    /// The output folder.
    pub fn output(&self) -> &Path {
        &self.output
    }

    /// The JSON file of the study. A folder that holds it is the output of an earlier run.
    fn marker(&self) -> PathBuf {
        self.output.join(format!("{}.json", self.study))
    }

    /// Creates the output folder. It must be new, empty, or the output of an earlier run of this
    /// study. Check the options first: then invalid options leave no folder.
    ///
    /// # Errors
    /// A folder with other content, or one that cannot be written.
    pub fn claim(&self) -> Result<()> {
        let (output, marker) = (&self.output, self.marker());
        let io = |source| Error::Io { path: output.clone(), source };
        if marker.is_file() {
            return Ok(());
        }
        if output.exists() && output.read_dir().map_err(io)?.next().is_some() {
            let reason = format!(
                "is not empty and holds no {}.json of an earlier run; choose another output folder",
                self.study
            );
            return Err(Error::Exists { path: output.clone(), reason });
        }
        std::fs::create_dir_all(output).map_err(io)?;
        write(&marker, b"{}\n")
    }

    /// Runs the trials that no earlier run in the output folder has finished, on `threads` threads
    /// (0: all). `key` names a trial uniquely; `settings` is everything else that its row depends
    /// on. The folder must exist. See [`crate::trials`].
    pub(crate) fn trials<T: Sync, R: Serialize + DeserializeOwned + Send>(
        &self,
        stage: &str,
        settings: &str,
        items: &[T],
        key: impl Fn(&T) -> String,
        threads: usize,
        run: impl Fn(&T, &dyn Progress) -> Result<R> + Sync,
    ) -> Result<Outcomes<R>> {
        Trials::open(&self.output, self.study, settings)?.run(stage, items, key, threads, self.progress, run)
    }
}

/// The outcome of a study, as it is in the JSON.
#[derive(Debug, Serialize)]
pub struct Outcome<F> {
    /// The figures.
    #[serde(flatten)]
    pub figures: F,
    /// Wall time (s), of a study with a page.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// Path of the page.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub report: Option<String>,
}

/// Runs `study` and writes its page and its figures as JSON into the folder `output`.
///
/// # Errors
/// Those of the study; an unwritable file.
pub fn run<S: Study>(study: &S, output: &Path, progress: &dyn Progress) -> Result<(Outcome<S::Figures>, Document)> {
    let (job, clock) = (Job::new::<S>(output, progress), Instant::now());
    let (figures, document) = study.run(&job)?;
    let mut outcome = Outcome { figures, seconds: None, report: None };
    if S::FOLDER.is_some() && !S::WRITES_OWN_FILES {
        let page = output.join(REPORT);
        outcome.seconds = Some(clock.elapsed().as_secs_f64());
        outcome.report = Some(page.display().to_string());
        job.claim()?;
        write(&page, document.page().as_bytes())?;
        let json = serde_json::to_vec_pretty(&outcome).map_err(|e| Error::Format(e.to_string()))?;
        write(&job.marker(), &json)?;
    }
    Ok((outcome, document))
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|source| Error::Io { path: path.to_owned(), source })
}

/// The output of a study for the terminal and the docs.
#[derive(Clone, Debug)]
pub struct Printed {
    /// The figures as one JSON object.
    pub json: String,
    /// Plain text for the terminal.
    pub text: String,
    /// Markdown for the docs.
    pub docs: String,
}

/// A study behind a trait object, as the command line lists it.
pub trait Entry: Sync {
    /// The name.
    fn name(&self) -> &'static str;
    /// The command that runs it.
    fn kind(&self) -> Kind;
    /// Version of the table in the docs.
    fn schema(&self) -> u32;
    /// The command with all options.
    fn command(&self) -> Command;
    /// Runs the study with the options of `matches`.
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
        let path = |name: &'static str, value: &'static str| {
            Arg::new(name).long(name).value_name(value).value_parser(value_parser!(PathBuf))
        };
        let docs = path("docs", "FILE").help("Also write the table as Markdown for the docs.");
        let command = S::augment_args(Command::new(S::NAME)).arg(docs);
        let Some(help) = S::FOLDER else { return command };
        // clap takes static texts only.
        let folder: &'static str = Box::leak(format!("trocar-{}/{}", S::KIND.name(), S::NAME).into_boxed_str());
        command.arg(path("output", "FOLDER").short('o').visible_alias("resume").default_value(folder).help(help))
    }

    fn run(&self, matches: &ArgMatches, progress: &dyn Progress) -> Result<Printed> {
        let study = S::from_arg_matches(matches).map_err(|e| Error::Mismatch(e.to_string()))?;
        let output = S::FOLDER.and_then(|_| matches.get_one::<PathBuf>("output"));
        let (outcome, document) = run(&study, output.map_or(Path::new(""), PathBuf::as_path), progress)?;
        let json = serde_json::to_string(&outcome).map_err(|e| Error::Format(e.to_string()))?;
        let mut text = document.text();
        if let Some(output) = output {
            text += &format!("report {}\n", output.join(REPORT).display());
        }
        Ok(Printed { json, text, docs: document.markdown() })
    }
}
