//! The simulation's thread: it plays an episode at a pace, carries out the requests of clients, and
//! reports its status. It never waits for a client.

mod answers;
mod status;

use crate::encode::Encoder;
use crate::error::{Error, Result};
use crate::hub::Hub;
use crate::inbox::Wish;
use crate::pace::Pace;
use crate::picture::Pictures;
use crate::record::Recorder;
use crate::show::{Around, Show};
use crate::source::{Building, Source};
use crate::table::Folder;
use serde_json::{Value, json};
use status::Telling;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};
use trocar_core::Progress;

/// Time between statuses (s).
const STATUS_EVERY: Duration = Duration::from_millis(500);
/// Periods that are done without a look at the requests on the way to a time.
const SEEK_PERIODS: usize = 4;

/// The parts of a session.
pub(crate) struct Plan {
    pub source: Source,
    pub building: Building,
    pub policy: String,
    pub seed: u64,
    pub record: Option<PathBuf>,
    pub playing: bool,
    pub speed: f64,
}

/// A session.
pub(crate) struct Session {
    hub: Arc<Hub>,
    plan: Plan,
    stop: Arc<AtomicBool>,
    periods: Arc<AtomicU64>,
    encoder: Encoder,
    pace: Pace,
    show: Show,
    /// The live episode while another one is shown.
    parked: Option<Box<Show>>,
    /// The episode of the table that is shown.
    open: Option<String>,
    playing: bool,
    /// Periods to do before it pauses.
    steps: u32,
    /// The period to go to.
    goal: Option<usize>,
    policy: String,
    seed: u64,
    recorder: Option<Recorder>,
    record_state: &'static str,
    record_path: Option<String>,
    pictures: Pictures,
    note: Option<String>,
    told: Instant,
    /// A frame is wanted though nothing moves.
    stale: bool,
}

/// Builds and runs a session until `stop` is set. Tells the clients of an error and returns it.
///
/// # Errors
/// The source cannot be built.
pub(crate) fn run(hub: &Arc<Hub>, plan: Plan, stop: &Arc<AtomicBool>, periods: Arc<AtomicU64>) -> Result<()> {
    let ran = Session::build(hub, plan, stop, periods).and_then(|mut session| session.run());
    if let Err(why) = &ran {
        hub.tell_status(&json!({"type": "status", "phase": "failed", "message": why.to_string()}));
    }
    ran
}

impl Session {
    fn build(hub: &Arc<Hub>, plan: Plan, stop: &Arc<AtomicBool>, periods: Arc<AtomicU64>) -> Result<Self> {
        let telling = Telling { hub, stop };
        telling.begin("the scene is built", 0);
        let (mut open, policy, seed) = (None, plan.policy.clone(), plan.seed);
        let mut show = match &plan.source {
            Source::Scene(name) => plan.building.scene(name, seed, &telling)?,
            Source::Specimen(folder) => plan.building.specimen(folder, &telling)?,
            Source::Episode(path) => plan.building.episode(path, &telling)?,
            Source::Campaign(_) | Source::Demonstrations(_) => {
                let folder = plan.source.folder();
                let first = folder.as_ref().and_then(Folder::first);
                let path = first.as_ref().and_then(|id| folder.as_ref()?.episode(id));
                let path = path.ok_or_else(|| Error::Source(format!("{}: has no episode", plan.source.name())))?;
                open = first;
                plan.building.episode(&path, &telling)?
            }
        };
        if show.file.is_none() {
            show.reset(seed, &policy, plan.record.is_some(), stop)?;
        }
        let encoder = Encoder::start(Arc::clone(hub))
            .map_err(|why| Error::Source(format!("a thread cannot be started: {why}")))?;
        Ok(Self {
            hub: Arc::clone(hub),
            recorder: plan.record.as_deref().map(Recorder::new),
            pace: Pace::new(plan.speed),
            playing: plan.playing,
            plan,
            stop: Arc::clone(stop),
            periods,
            encoder,
            show,
            parked: None,
            open,
            steps: 0,
            goal: None,
            policy,
            seed,
            record_state: "none",
            record_path: None,
            pictures: Pictures::default(),
            note: None,
            told: Instant::now(),
            stale: true,
        })
    }

    fn run(&mut self) -> Result<()> {
        self.tell();
        self.pace.restart();
        while !self.stop.load(Ordering::Relaxed) {
            let requests = self.hub.inbox.take();
            let asked = requests.iter().any(|r| !matches!(r.wish, Wish::Refresh | Wish::History { .. }));
            for request in requests {
                self.answer(request);
            }
            if std::mem::take(&mut self.stale) {
                self.frame()?;
            }
            if asked || self.told.elapsed() >= STATUS_EVERY {
                self.tell();
            }
            if self.goal.is_some() {
                self.seek_on()?;
            } else if (self.playing || self.steps > 0) && !self.show.is_over() {
                if self.steps > 0 || !self.hub.inbox.wait(self.pace.due()) {
                    self.period()?;
                }
            } else {
                self.pace.restart();
                self.hub.inbox.wait(self.told + STATUS_EVERY);
            }
        }
        Ok(())
    }

    /// Runs a period, and reports its events.
    fn period(&mut self) -> Result<()> {
        if let Some(recorder) = &mut self.recorder {
            recorder.take(&self.hub, self.show.episode.time());
        } else {
            self.hub.take_raw();
        }
        self.pace.begin(Instant::now());
        let mut around = Around { hub: &self.hub, encoder: &self.encoder, pace: &mut self.pace };
        let happened = self.show.advance(&mut around, false)?;
        self.pace.end(self.show.period());
        self.periods.fetch_add(1, Ordering::Relaxed);
        for event in happened.iter().flatten() {
            let mut said = serde_json::to_value(event).unwrap_or(Value::Null);
            said["type"] = json!("event");
            said["time_s"] = json!(self.show.episode.time());
            said["text"] = json!(event.to_string());
            self.hub.tell(&said);
        }
        if self.steps > 0 {
            self.steps -= 1;
        }
        if self.show.live.is_some() && self.record_state != "kept" && self.recorder.is_some() {
            self.record_state = "open";
        }
        self.measured()?;
        if self.show.is_over() {
            self.tell();
        }
        Ok(())
    }

    /// Sends a frame of the present state.
    fn frame(&mut self) -> Result<()> {
        let around = Around { hub: &self.hub, encoder: &self.encoder, pace: &mut self.pace };
        self.show.show(&around, 0)
    }

    /// Goes on towards the wanted time, a few periods at once.
    fn seek_on(&mut self) -> Result<()> {
        let Some(goal) = self.goal else { return Ok(()) };
        for _ in 0..SEEK_PERIODS {
            if self.show.at >= goal {
                break;
            }
            let mut around = Around { hub: &self.hub, encoder: &self.encoder, pace: &mut self.pace };
            if self.show.advance(&mut around, true)?.is_none() {
                break;
            }
        }
        if self.show.at >= goal || !self.show.in_review() {
            self.goal = None;
            self.pace.restart();
            self.stale = true;
            self.tell();
        }
        Ok(())
    }

    /// Sends measurements to whom they are due.
    fn measured(&self) -> Result<()> {
        let due = self.hub.measured_clients();
        if due.is_empty() {
            return Ok(());
        }
        let (show, live) = (&self.show, self.show.live.as_ref());
        let shown = |arm| live.and_then(|live| live.operators.shown(arm));
        let message = crate::measured::message(&show.episode, show.at, shown, |arm| show.actor(arm))?;
        due.iter().for_each(|client| client.reply(message.clone()));
        Ok(())
    }
}
