//! The simulation's thread: it plays an episode at a pace, does what clients ask, and tells how it
//! stands. It never waits for a client.

mod status;

use crate::encode::Encoder;
use crate::error::{Error, Result};
use crate::hub::Hub;
use crate::inbox::{Request, Wish};
use crate::message::{Binary, Data};
use crate::outbox::Outgoing;
use crate::pace::Pace;
use crate::picture::Pictures;
use crate::protocol::{ArmName, Mistake, RecordAction, done, error};
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

/// What a session is made of.
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
/// What is shown cannot be built.
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
                let folder = folder_of(&plan);
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

    /// Does a period, and tells what happened.
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

    fn answer(&mut self, request: Request) {
        let Request { client, number, wish } = request;
        let (refresh, lost) = (wish == Wish::Refresh, matches!(wish, Wish::Lost(_)));
        let reply = match self.grant(client, number, wish) {
            Ok(reply) => reply,
            Err(mistake) => Some(Outgoing::text(&error(number, &mistake))),
        };
        if let Some(reply) = reply.filter(|_| !refresh && !lost) {
            self.hub.reply(client, reply);
        }
    }

    /// Does what is asked. Returns the reply, unless it is sent later.
    fn grant(
        &mut self,
        client: u32,
        number: Option<i64>,
        wish: Wish,
    ) -> std::result::Result<Option<Outgoing>, Mistake> {
        let done = Some(Outgoing::text(&done(number)));
        match wish {
            Wish::Play => {
                (self.playing, self.note) = (true, None);
                self.pace.restart();
            }
            Wish::Pause => (self.playing, self.steps) = (false, 0),
            Wish::Step(periods) => (self.playing, self.steps) = (false, periods),
            Wish::Speed(factor) => self.pace.set_factor(factor),
            Wish::Reset { seed, policy } => self.reset(seed, policy)?,
            Wish::Seek(time_s) => {
                let to = (time_s / self.show.period()).round().clamp(0.0, self.show.head() as f64) as usize;
                self.show.rewind(to).map_err(internal)?;
                self.goal = Some(to);
            }
            Wish::Open(id) => self.open(id)?,
            Wish::Live => {
                if let Some(live) = self.parked.take() {
                    self.show = *live;
                }
                (self.open, self.goal, self.stale) = (None, None, true);
                if self.show.live.is_none() {
                    return Err(Mistake("state", "there is no live episode: no scene is shown".to_owned()));
                }
            }
            Wish::Record(action) => return self.record(number, action).map(Some),
            Wish::HandBack(arm) => {
                if let Some(live) = &mut self.show.live {
                    live.operators.hand_back(arm);
                }
                self.hub.let_go(arm);
            }
            Wish::History { channels, from_s } => return self.history(number, &channels, from_s).map(Some),
            Wish::Picture { camera, size, quality } => {
                let what = (camera.as_str(), size, quality);
                self.pictures.make(&self.show.episode, what, (&self.hub, client, number))?;
                return Ok(None);
            }
            Wish::Table => {
                let table = match self.folder() {
                    Some(folder) => folder.message(number, self.open.as_deref()),
                    None => json!({"type": "table", "request": number, "kind": "none", "name": "", "episodes": []}),
                };
                return Ok(Some(Outgoing::text(&table)));
            }
            Wish::Refresh => self.stale = true,
            Wish::Lost(arm) => self.lost(arm),
        }
        Ok(done)
    }

    /// The client that drove an arm is gone.
    fn lost(&mut self, arm: ArmName) {
        let had = self.show.live.as_ref().is_some_and(|l| l.operators.actor(arm).name() != "policy");
        if had {
            self.playing = false;
            self.note =
                Some(format!("the operator of the {} arm is gone: paused, the arm holds its place", arm.name()));
        }
    }

    fn reset(&mut self, seed: Option<u64>, policy: Option<String>) -> std::result::Result<(), Mistake> {
        if self.show.live.is_none() {
            if policy.is_some() || seed.is_some_and(|s| s != self.show.episode.seed()) {
                let why = "an episode file is shown; it has its own seed and actions";
                return Err(Mistake("state", why.to_owned()));
            }
            self.show.rewind(0).map_err(internal)?;
            (self.goal, self.stale) = (None, true);
            return Ok(());
        }
        let (seed, policy) = (seed.unwrap_or(self.seed), policy.unwrap_or_else(|| self.policy.clone()));
        let telling = Telling { hub: &self.hub, stop: &self.stop };
        telling.begin("the episode begins", 0);
        for arm in [ArmName::Left, ArmName::Right] {
            self.hub.let_go(arm);
        }
        let made = self.show.reset(seed, &policy, self.recorder.is_some(), &self.stop);
        if let Err(why) = made {
            return Err(Mistake("value", why.to_string()));
        }
        (self.seed, self.policy) = (seed, policy);
        (self.goal, self.stale, self.note) = (None, true, None);
        (self.record_state, self.record_path) = ("none", None);
        if let Some(recorder) = &mut self.recorder {
            recorder.begin();
        }
        self.pace.restart();
        Ok(())
    }

    /// The folder of the table: the one that is shown, or that of the recordings.
    fn folder(&self) -> Option<Folder> {
        folder_of(&self.plan).or_else(|| self.recorder.as_ref().map(|r| Folder::Demonstrations(r.folder.clone())))
    }

    fn open(&mut self, id: String) -> std::result::Result<(), Mistake> {
        let folder = self.folder().ok_or_else(no_table)?;
        let path = folder.episode(&id);
        let path = path.ok_or_else(|| Mistake("value", format!("no episode '{id:.60}' in the table")))?;
        let telling = Telling { hub: &self.hub, stop: &self.stop };
        telling.begin("the episode is opened", 0);
        let opened = self.plan.building.episode(&path, &telling).map_err(|why| Mistake("value", why.to_string()))?;
        let before = std::mem::replace(&mut self.show, opened);
        if before.live.is_some() {
            self.parked = Some(Box::new(before));
        }
        (self.open, self.goal, self.stale) = (Some(id), None, true);
        self.hub.tell(&folder.message(None, self.open.as_deref()));
        self.pace.restart();
        Ok(())
    }

    fn record(&mut self, number: Option<i64>, action: RecordAction) -> std::result::Result<Outgoing, Mistake> {
        let Some(recorder) = &mut self.recorder else {
            return Err(Mistake("state", "nothing is recorded: start with --record FOLDER".to_owned()));
        };
        if self.show.live.is_none() {
            return Err(Mistake("state", "an episode file is shown; go back to the live episode".to_owned()));
        }
        let mut reply = done(number);
        if action == RecordAction::Keep {
            if self.show.head() == 0 {
                return Err(Mistake("state", "nothing was done yet".to_owned()));
            }
            recorder.take(&self.hub, self.show.episode.time());
            // What is kept ends at the head.
            self.show.rewind(self.show.head()).map_err(internal)?;
            while self.show.in_review() {
                let mut around = Around { hub: &self.hub, encoder: &self.encoder, pace: &mut self.pace };
                self.show.advance(&mut around, true).map_err(internal)?;
            }
            let (path, passed) = recorder.keep(&mut self.show).map_err(internal)?;
            reply["path"] = json!(path.display().to_string());
            reply["passed"] = json!(passed);
        }
        let seed = if action == RecordAction::Redo { self.seed } else { self.seed + 1 };
        self.reset(Some(seed), None)?;
        self.record_state = match action {
            RecordAction::Keep => "kept",
            RecordAction::Discard | RecordAction::Redo => "discarded",
        };
        self.record_path = reply["path"].as_str().map(str::to_owned);
        if action == RecordAction::Keep
            && let Some(folder) = self.folder()
        {
            self.hub.tell(&folder.message(None, None));
        }
        Ok(Outgoing::text(&reply))
    }

    fn history(&self, number: Option<i64>, names: &[String], from_s: f64) -> std::result::Result<Outgoing, Mistake> {
        let unknown =
            |name: String| Mistake("value", format!("no channel '{name:.60}'; the scene's message lists them"));
        let (times, rows) = self.show.history(names, from_s).map_err(unknown)?;
        let header = json!({"type": "history", "request": number, "channels": names, "from_s": from_s});
        let mut message = Binary::new(header);
        let count = times.len();
        message.add("time".to_owned(), &[count], Data::F32(times));
        message.add("rows".to_owned(), &[count, names.len()], Data::F32(rows));
        Ok(Outgoing::Binary(message.into_bytes().into()))
    }

    /// Sends measurements to whom they are due.
    fn measured(&self) -> Result<()> {
        let due = self.hub.measured_clients();
        if due.is_empty() {
            return Ok(());
        }
        let message = crate::measured::message(&self.show)?;
        due.iter().for_each(|client| client.reply(message.clone()));
        Ok(())
    }
}

fn folder_of(plan: &Plan) -> Option<Folder> {
    match &plan.source {
        Source::Campaign(path) => Some(Folder::Campaign(path.clone())),
        Source::Demonstrations(path) => Some(Folder::Demonstrations(path.clone())),
        _ => None,
    }
}

#[allow(clippy::needless_pass_by_value, reason = "what map_err passes")]
fn internal(why: Error) -> Mistake {
    Mistake("internal", why.to_string())
}

fn no_table() -> Mistake {
    Mistake("state", "there is no table: no campaign is shown and nothing is recorded".to_owned())
}
