//! A viewer of an episode that another program steps, such as an environment of Gymnasium. That
//! program reports every step, and the viewer shows it. Clients only watch: their messages never
//! reach the episode, and the program waits for none of them.

mod watchers;

use crate::encode::Encoder;
use crate::error::{Error, Result};
use crate::front::Front;
use crate::hub::Hub;
use crate::inbox::lock;
use crate::picture::Pictures;
use crate::protocol::error;
use crate::readings::{Readings, actors, header};
use crate::shapes::channel_names;
use crate::snapshot::Taker;
use serde_json::{Value, json};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use trocar_scene::Scene;
use trocar_sensors::CameraRig;
use trocar_task::Episode;
use watchers::Known;

/// Why clients drive nothing.
const WATCHED: &str = "the environment's own program steps it; clients watch";
/// Who moves the arms.
const ACTOR: &str = "environment";
/// Time between the states that are kept for the next client while nobody watches.
const UNWATCHED_EVERY: Duration = Duration::from_millis(100);

/// A running viewer of an episode of another program. It stops when it is dropped; in a child made
/// by `fork` that is left to the parent.
pub struct Follower {
    inner: Option<Box<Inner>>,
    process: u32,
}

struct Inner {
    front: Front,
    hub: Arc<Hub>,
    encoder: Arc<Encoder>,
    known: Arc<Mutex<Known>>,
    answering: Option<JoinHandle<()>>,
    taker: Taker,
    /// The scene of the pictures, which is also that of the taker's meshes.
    drawn: Scene,
    readings: Readings,
    pictures: Pictures,
    /// Number of events reported so far.
    events: usize,
    /// When the last state was taken.
    taken: Instant,
}

impl Follower {
    /// Listens on `port`, 0 for a free one, and shows `episode` as it stands, under `name`.
    ///
    /// # Errors
    /// A port that is in use, shapes that cannot be read.
    pub fn start(name: &str, episode: &Episode, port: u16) -> Result<Self> {
        let hello = json!({
            "source": {"kind": "environment", "name": name}, "policies": [ACTOR], "record": null, "speeds": [],
        });
        let hub = Arc::new(Hub::watched(WATCHED));
        let cannot = |why: std::io::Error| Error::Source(format!("a thread cannot be started: {why}"));
        let encoder = Arc::new(Encoder::start(Arc::clone(&hub)).map_err(cannot)?);
        let taker = Taker::of(episode)?;
        let front = Front::open(port, Arc::clone(&hub), hello)?;
        let known = Arc::<Mutex<Known>>::default();
        let shared = (Arc::clone(&hub), Arc::clone(&encoder), Arc::clone(&known), Arc::clone(front.stopping()));
        let answer = move || watchers::answer(&shared.0, &shared.1, &shared.2, &shared.3);
        let answering = std::thread::Builder::new().name("view-answers".to_owned()).spawn(answer).map_err(cannot)?;
        let mut inner = Box::new(Inner {
            front,
            hub,
            encoder,
            known,
            answering: Some(answering),
            taker,
            drawn: episode.arranged_scene().clone(),
            readings: Readings::default(),
            pictures: Pictures::default(),
            events: 0,
            taken: Instant::now(),
        });
        inner.see(episode, true)?;
        Ok(Self { inner: Some(inner), process: std::process::id() })
    }

    /// Shows `episode` after a step. `fresh` says that it was begun or restored: earlier states are
    /// not part of what is shown.
    ///
    /// # Errors
    /// Shapes that cannot be read.
    pub fn see(&mut self, episode: &Episode, fresh: bool) -> Result<()> {
        match &mut self.inner {
            Some(inner) if self.process == std::process::id() => inner.see(episode, fresh),
            _ => Ok(()),
        }
    }

    /// The page's address, with the token.
    pub fn address(&self) -> String {
        self.inner.as_ref().map_or_else(String::new, |inner| inner.front.address())
    }

    /// The wire's address, with the token.
    pub fn wire(&self) -> String {
        self.inner.as_ref().map_or_else(String::new, |inner| inner.front.wire())
    }

    /// Whether the page is there.
    pub fn has_page(&self) -> bool {
        self.inner.as_ref().is_some_and(|inner| inner.front.has_page())
    }
}

impl Drop for Follower {
    fn drop(&mut self) {
        let inner = self.inner.take();
        if self.process != std::process::id() {
            // The threads belong to the parent. A wait for them here would never end.
            std::mem::forget(inner);
        }
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        self.front.close();
        if let Some(answering) = self.answering.take() {
            let _ = answering.join();
        }
    }
}

impl Inner {
    fn see(&mut self, episode: &Episode, fresh: bool) -> Result<()> {
        if fresh && !CameraRig::shows_same(episode.arranged_scene(), &self.drawn) {
            self.drawn = episode.arranged_scene().clone();
            self.taker = Taker::of(episode)?;
        }
        self.readings.note(episode);
        self.tell_events(episode, fresh);
        self.know(episode, fresh);
        self.show(episode, fresh)?;
        self.measure(episode)?;
        self.make_pictures(episode);
        Ok(())
    }

    /// Sends the events since the last step to all clients.
    fn tell_events(&mut self, episode: &Episode, fresh: bool) {
        let all = episode.events();
        if !fresh {
            for (time_s, event) in all.get(self.events..).unwrap_or_default() {
                let mut said = serde_json::to_value(event).unwrap_or(Value::Null);
                said["type"] = json!("event");
                said["time_s"] = json!(time_s);
                said["text"] = json!(event.to_string());
                self.hub.tell(&said);
            }
        }
        self.events = all.len();
    }

    /// Notes what clients may ask for.
    fn know(&self, episode: &Episode, fresh: bool) {
        let (progress, end) = (episode.progress(), episode.end());
        let status = json!({
            "type": "status", "phase": "ready", "message": "", "scene": self.taker.topology.scene,
            "seed": episode.seed(), "policy": ACTOR, "mode": if end.is_some() { "ended" } else { "live" },
            "seeking": false, "speed_target": 0.0, "time_s": episode.time(), "head_s": episode.time(),
            "length_s": episode.scene().task.episode_s, "seekable_s": 0.0,
            "end": end.map(|e| json!({"kind": e.name(), "text": e.to_string()})), "passed": progress.passed(),
            "score": progress.score(), "stage": progress.name(), "actors": actors(episode, |_| ACTOR),
            "exact": null, "differs_s": null, "open": null, "seats": self.hub.seats(), "note": null,
            "record": {"folder": null, "state": "none", "path": null},
        });
        let mut known = lock(&self.known);
        known.note(episode.rows(), status, episode.cell().period(), fresh);
        if fresh {
            known.names = channel_names(episode);
        }
        if fresh || end.is_some() {
            known.tell(&self.hub);
        }
    }

    /// Gives a frame if anyone is due to get one. The last state before a pause waits where the
    /// thread that answers finds it.
    fn show(&mut self, episode: &Episode, fresh: bool) -> Result<()> {
        let watched = self.hub.shows_frames();
        let due = fresh || episode.end().is_some() || self.hub.wants_frame();
        if !due && !watched && self.taken.elapsed() < UNWATCHED_EVERY {
            return Ok(());
        }
        let mode = if episode.end().is_some() { "ended" } else { "live" };
        let mut header = header(episode, episode.rows().len(), mode, |_| ACTOR);
        header["part"] = header["parts"].clone();
        header["time_s"] = json!(episode.time());
        let snapshot = self.taker.take(episode.cell(), self.hub.wants(), header, &self.readings)?;
        self.taken = Instant::now();
        // Done under the lock, because no earlier snapshot may come after this one.
        let mut known = lock(&self.known);
        known.parked = None;
        if due || !watched {
            self.encoder.give(snapshot);
        } else {
            known.parked = Some(snapshot);
        }
        Ok(())
    }

    fn measure(&self, episode: &Episode) -> Result<()> {
        let due = self.hub.measured_clients();
        if !due.is_empty() {
            let message = crate::measured::message(episode, episode.rows().len(), |_| None, |_| ACTOR)?;
            due.iter().for_each(|client| client.reply(message.clone()));
        }
        Ok(())
    }

    /// Begins the pictures that were asked for: they need the cell.
    fn make_pictures(&mut self, episode: &Episode) {
        let asked = std::mem::take(&mut lock(&self.known).pictures);
        for one in asked {
            let what = (one.camera.as_str(), one.size, one.quality);
            if let Err(mistake) = self.pictures.make(episode, what, (&self.hub, one.client, one.number)) {
                self.hub.reply(one.client, crate::outbox::Outgoing::text(&error(one.number, &mistake)));
            }
        }
    }
}
