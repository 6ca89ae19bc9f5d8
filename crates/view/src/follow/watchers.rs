//! Answers the clients that watch an episode of another program, from its last reported state: the
//! program may pause for any time.

use super::WATCHED;
use crate::encode::Encoder;
use crate::hub::Hub;
use crate::inbox::{ClientId, Request, Wish, lock};
use crate::outbox::Outgoing;
use crate::pace::Pace;
use crate::protocol::{Mistake, Quality, error};
use crate::readings::history;
use crate::snapshot::Snapshot;
use crate::table::no_episodes;
use serde_json::{Value, json};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use trocar_task::Channels;

/// Time between statuses.
const STATUS_EVERY: Duration = Duration::from_millis(500);
/// How long the last state waits for a newer one before it is shown.
const PARKED: Duration = Duration::from_millis(40);
/// How long a picture waits for the next step.
const PICTURE_WAITS: Duration = Duration::from_secs(5);
/// Most pictures that wait.
const MAX_PICTURES: usize = 4;

/// A picture that waits for a step.
pub(super) struct Asked {
    pub client: ClientId,
    pub number: Option<i64>,
    pub camera: String,
    pub size: [usize; 2],
    pub quality: Quality,
    at: Instant,
}

/// The last reported state of the episode.
pub(super) struct Known {
    /// The rows so far, and the names of their columns.
    rows: Vec<Channels>,
    pub names: Vec<String>,
    /// The status, without the parts that change with wall time.
    status: Value,
    stepped: Option<Instant>,
    pace: Pace,
    /// The newest state, if no client was due to get it.
    pub parked: Option<Snapshot>,
    pub pictures: Vec<Asked>,
}

impl Default for Known {
    fn default() -> Self {
        Self {
            rows: Vec::new(),
            names: Vec::new(),
            status: json!({"type": "status", "phase": "building", "message": "the scene is built"}),
            stepped: None,
            pace: Pace::new(0.0),
            parked: None,
            pictures: Vec::new(),
        }
    }
}

impl Known {
    /// Notes a step of `period` seconds, or with `fresh` that the episode was begun or restored.
    pub fn note(&mut self, rows: &[Channels], status: Value, period: f64, fresh: bool) {
        self.status = status;
        if !fresh && rows.len() == self.rows.len() + 1 {
            self.rows.extend(rows.last());
        } else {
            self.rows = rows.to_vec();
        }
        if fresh {
            self.stepped = None;
            self.pace.restart();
        } else {
            self.stepped = Some(Instant::now());
            self.pace.end(period);
        }
    }

    /// Tells all how it stands.
    pub fn tell(&mut self, hub: &Hub) {
        let ended = self.status["mode"] == "ended";
        let playing = !ended && self.stepped.is_some_and(|at| at.elapsed() < STATUS_EVERY);
        self.status["playing"] = json!(playing);
        self.status["speed_actual"] = json!(if playing { self.pace.actual() } else { 0.0 });
        hub.tell_status(&self.status);
    }
}

/// Answers clients until `stop` is set.
pub(super) fn answer(hub: &Hub, encoder: &Encoder, known: &Mutex<Known>, stop: &AtomicBool) {
    let mut told = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        hub.inbox.wait(Instant::now() + PARKED);
        for request in hub.inbox.take() {
            let (client, number) = (request.client, request.number);
            let reply = match grant(request, hub, encoder, known) {
                Ok(reply) => reply,
                Err(mistake) => Some(Outgoing::text(&error(number, &mistake))),
            };
            if let Some(reply) = reply {
                hub.reply(client, reply);
            }
        }
        let mut known = lock(known);
        if let Some(snapshot) = known.parked.take_if(|snapshot| snapshot.taken.elapsed() >= PARKED) {
            encoder.give(snapshot);
        }
        if told.elapsed() >= STATUS_EVERY {
            told = Instant::now();
            known.tell(hub);
            for late in known.pictures.extract_if(.., |asked| asked.at.elapsed() >= PICTURE_WAITS) {
                let why = "the environment stands still; a picture is made with its next step".to_owned();
                hub.reply(late.client, Outgoing::text(&error(late.number, &Mistake("state", why))));
            }
        }
    }
}

fn grant(request: Request, hub: &Hub, encoder: &Encoder, known: &Mutex<Known>) -> Result<Option<Outgoing>, Mistake> {
    let Request { client, number, wish } = request;
    let mut known = lock(known);
    match wish {
        Wish::Refresh => {
            match known.parked.take() {
                Some(snapshot) => encoder.give(snapshot),
                None => hub.offer_again(),
            }
            Ok(None)
        }
        Wish::Lost(_) => Ok(None),
        Wish::History { channels, from_s } => {
            // The program's next step does not wait until the message is made.
            let (rows, names) = (known.rows.clone(), known.names.clone());
            drop(known);
            history(number, (&rows, &names), &channels, from_s).map(Some)
        }
        Wish::Picture { camera, size, quality } => {
            if known.pictures.len() >= MAX_PICTURES {
                return Err(Mistake("busy", "other pictures wait; ask again when they are there".to_owned()));
            }
            known.pictures.push(Asked { client, number, camera, size, quality, at: Instant::now() });
            Ok(None)
        }
        Wish::Table => Ok(Some(Outgoing::text(&no_episodes(number)))),
        Wish::Play
        | Wish::Pause
        | Wish::Step(_)
        | Wish::Speed(_)
        | Wish::Reset { .. }
        | Wish::Seek(_)
        | Wish::Open(_)
        | Wish::Live
        | Wish::Record(_)
        | Wish::HandBack(_) => Err(Mistake("seat", WATCHED.to_owned())),
    }
}
