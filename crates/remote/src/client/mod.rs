//! The client: one connection, one request at a time.

mod socket;
pub(crate) mod stream;

use crate::actions::Actions;
use crate::endpoint::{Dialect, Endpoint};
use crate::error::{Error, Result};
use crate::roboarena::ServerConfig;
use crate::value::{Map, Observation, Value};
use crate::wire::{pack, unpack};
use socket::{Incoming, Socket, Wait, server_error};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Interval at which pings are answered between requests. Python's servers wait 20 s for an answer.
const PING_INTERVAL: Duration = Duration::from_millis(500);
/// The reply of a RoboArena server to a reset.
const RESET_DONE: &str = "reset successful";

/// An answer to an observation.
#[derive(Clone, Debug, PartialEq)]
pub struct Reply {
    /// The chunk of actions.
    pub actions: Actions,
    /// Time of the policy as reported by the server (ms).
    pub server_ms: Option<f64>,
    /// Time from the observation to the actions, packing included (ms).
    pub round_trip_ms: f64,
    /// The reply's other fields.
    pub fields: Map,
}

/// A connection, or the reason why it was lost.
enum Link {
    Open(Box<Socket>),
    Lost(String),
}

/// A client of a policy server.
///
/// A request is sent once, because a policy may keep a history. After a connection error only
/// [`Client::reconnect`] or [`Client::reset`] connect again. A complete but invalid reply
/// (malformed, not finite, ...) leaves the connection open.
pub struct Client {
    endpoint: Endpoint,
    url: String,
    link: Arc<Mutex<Link>>,
    metadata: Map,
    dialect: Dialect,
    ping_thread: Option<(Sender<()>, JoinHandle<()>)>,
}

impl std::fmt::Debug for Client {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Client").field("url", &self.url).field("dialect", &self.dialect).finish_non_exhaustive()
    }
}

impl Client {
    /// Connects and waits for the server's metadata.
    ///
    /// # Errors
    /// [`Error::Endpoint`], [`Error::CannotConnect`], [`Error::KeyRefused`], [`Error::Handshake`],
    /// [`Error::Tls`], [`Error::TimedOut`], [`Error::Closed`], [`Error::Server`],
    /// [`Error::TooLarge`], [`Error::Protocol`], [`Error::Interrupted`], and those of [`unpack`]
    /// for the metadata.
    pub fn connect(endpoint: &Endpoint) -> Result<Self> {
        let (socket, metadata) = dial(endpoint)?;
        let dialect = dialect_of(endpoint, &metadata);
        let link = Arc::new(Mutex::new(Link::Open(Box::new(socket))));
        let ping_thread = answer_pings(Arc::clone(&link))?;
        let url = endpoint.shown();
        Ok(Self { endpoint: endpoint.clone(), url, link, metadata, dialect, ping_thread: Some(ping_thread) })
    }

    /// The metadata that the server sent after the connection.
    pub fn metadata(&self) -> &Map {
        &self.metadata
    }

    /// The protocol of the server; never [`Dialect::Auto`].
    pub fn dialect(&self) -> Dialect {
        self.dialect
    }

    /// The server's label or address, without passwords.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// The requirements of a RoboArena server; `None` for other servers.
    ///
    /// # Errors
    /// As [`ServerConfig::from_metadata`].
    pub fn server_config(&self) -> Result<Option<ServerConfig>> {
        if self.dialect != Dialect::RoboArena {
            return Ok(None);
        }
        ServerConfig::from_metadata(&self.metadata).map(Some).map_err(|e| e.within(&format!("{}: metadata", self.url)))
    }

    /// Sends an observation and waits for a chunk of actions.
    ///
    /// # Errors
    /// Those of [`pack`] for the observation; [`Error::TimedOut`], [`Error::Closed`],
    /// [`Error::Server`], [`Error::TooLarge`], [`Error::Protocol`] and [`Error::Interrupted`],
    /// which end the connection; those of [`unpack`] and [`Error::WrongField`],
    /// [`Error::WrongDimension`], [`Error::EmptyChunk`], [`Error::LongChunk`], [`Error::NotFinite`]
    /// for the reply; [`Error::NotConnected`] after an earlier one.
    pub fn infer(&mut self, observation: &Observation) -> Result<Reply> {
        let start = Instant::now();
        let request = self.request(observation, "infer")?;
        let bytes = match self.exchange(request, "a reply")? {
            Incoming::Binary(bytes) => bytes,
            Incoming::Text(text) => return Err(self.lose(server_error(&self.url, &text))),
        };
        let place = format!("{}: reply", self.url);
        let reply = unpack(&bytes).map_err(|e| e.within(&place))?;
        let actions = self.endpoint.actions.take(&reply).map_err(|e| e.within(&place))?;
        let mut fields = match reply {
            Value::Map(map) => map,
            _ => Map::new(),
        };
        fields.remove("actions");
        let server_ms = match fields.get("server_timing") {
            Some(Value::Map(timing)) => timing.get("infer_ms").and_then(Value::as_f64).filter(|ms| ms.is_finite()),
            _ => None,
        };
        Ok(Reply { actions, server_ms, round_trip_ms: start.elapsed().as_secs_f64() * 1e3, fields })
    }

    /// Starts an episode: reconnects if the connection was lost, and resets a RoboArena server with
    /// `info` (such as `session_id`). openpi's protocol has no such message.
    ///
    /// # Errors
    /// As [`Client::connect`] and [`Client::infer`].
    pub fn reset(&mut self, info: &Observation) -> Result<()> {
        if !self.is_connected() {
            self.reconnect()?;
        }
        if self.dialect != Dialect::RoboArena {
            return Ok(());
        }
        let request = self.request(info, "reset")?;
        match self.exchange(request, "a reset")? {
            Incoming::Text(text) if text.trim_start().starts_with(RESET_DONE) => Ok(()),
            Incoming::Text(text) => Err(self.lose(server_error(&self.url, &text))),
            // Servers derived from RoboArena's send other replies.
            Incoming::Binary(_) => Ok(()),
        }
    }

    /// Whether the connection was open at its last use.
    pub fn is_connected(&self) -> bool {
        matches!(*self.lock(), Link::Open(_))
    }

    /// Connects again and reads new metadata.
    ///
    /// # Errors
    /// As [`Client::connect`].
    pub fn reconnect(&mut self) -> Result<()> {
        if let Link::Open(old) = &mut *self.lock() {
            old.close();
        }
        *self.lock() = Link::Lost("it was replaced by a new connection".into());
        let (socket, metadata) = dial(&self.endpoint)?;
        self.dialect = dialect_of(&self.endpoint, &metadata);
        self.metadata = metadata;
        *self.lock() = Link::Open(Box::new(socket));
        Ok(())
    }

    /// Packs `map`, with the field `endpoint` for a RoboArena server.
    fn request(&self, map: &Map, endpoint: &str) -> Result<Vec<u8>> {
        if self.dialect != Dialect::RoboArena {
            return pack(map).map_err(|e| e.within("observation"));
        }
        let mut map = map.clone();
        map.insert("endpoint".into(), endpoint.into());
        pack(&map).map_err(|e| e.within("observation"))
    }

    /// Sends a message and waits for the reply.
    fn exchange(&mut self, request: Vec<u8>, what: &'static str) -> Result<Incoming> {
        let wait = Wait::new(what, self.endpoint.timeouts.infer);
        let mut link = self.lock();
        let outcome = match &mut *link {
            Link::Lost(reason) => {
                return Err(Error::NotConnected { url: self.url.clone(), reason: reason.clone() });
            }
            // A message from before the request is not its reply.
            Link::Open(socket) => {
                socket.read_pending().and_then(|()| socket.send(request, wait)).and_then(|()| socket.receive(wait))
            }
        };
        if let Err(e) = &outcome {
            // A late reply must not be taken for the reply to the next request.
            *link = Link::Lost(e.to_string());
        }
        outcome
    }

    /// Ends the connection because of `e`.
    fn lose(&self, e: Error) -> Error {
        *self.lock() = Link::Lost(e.to_string());
        e
    }

    fn lock(&self) -> MutexGuard<'_, Link> {
        lock(&self.link)
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        if let Some((sender, thread)) = self.ping_thread.take() {
            drop(sender);
            let _ = thread.join();
        }
        if let Link::Open(socket) = &mut *self.lock() {
            socket.close();
        }
    }
}

fn lock(link: &Mutex<Link>) -> MutexGuard<'_, Link> {
    link.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts a thread that answers the server's pings between requests, which may be long apart.
fn answer_pings(link: Arc<Mutex<Link>>) -> Result<(Sender<()>, JoinHandle<()>)> {
    let (sender, receiver) = mpsc::channel::<()>();
    let work = move || {
        while receiver.recv_timeout(PING_INTERVAL) == Err(RecvTimeoutError::Timeout) {
            let mut link = lock(&link);
            if let Link::Open(socket) = &mut *link
                && let Err(e) = socket.read_pending()
            {
                *link = Link::Lost(e.to_string());
            }
        }
    };
    let thread = std::thread::Builder::new().name("policy".into()).spawn(work);
    let no_thread =
        |e: std::io::Error| Error::Endpoint { field: "thread", reason: crate::error::one_line(&e.to_string()) };
    Ok((sender, thread.map_err(no_thread)?))
}

fn dialect_of(endpoint: &Endpoint, metadata: &Map) -> Dialect {
    match endpoint.dialect {
        Dialect::Auto if ServerConfig::is_in(metadata) => Dialect::RoboArena,
        Dialect::Auto => Dialect::OpenPi,
        chosen => chosen,
    }
}

/// Connects, with repeated attempts.
fn dial(endpoint: &Endpoint) -> Result<(Socket, Map)> {
    let (uri, key) = endpoint.parts()?;
    let mut pause = endpoint.retry.first_pause;
    let mut attempt = 1;
    let (socket, first) = loop {
        match Socket::connect(endpoint, &uri, key.as_ref()) {
            Err(Error::CannotConnect { .. }) if attempt < endpoint.retry.attempts => {
                pause_for(endpoint, pause.min(endpoint.retry.max_pause))?;
                pause = pause.saturating_mul(2);
                attempt += 1;
            }
            outcome => break outcome?,
        }
    };
    let url = endpoint.shown();
    let bytes = match first {
        Incoming::Binary(bytes) => bytes,
        Incoming::Text(text) => return Err(server_error(&url, &text)),
    };
    let place = format!("{url}: metadata");
    match unpack(&bytes).map_err(|e| e.within(&place))? {
        Value::Map(metadata) => Ok((socket, metadata)),
        other => Err(Error::WrongField { at: place, reason: format!("must be a map, not {}", other.kind()) }),
    }
}

/// Sleeps, unless interrupted.
fn pause_for(endpoint: &Endpoint, pause: Duration) -> Result<()> {
    let start = Instant::now();
    loop {
        if endpoint.interrupted() {
            return Err(Error::Interrupted);
        }
        let left = pause.saturating_sub(start.elapsed());
        if left.is_zero() {
            return Ok(());
        }
        std::thread::sleep(left.min(stream::POLL_INTERVAL));
    }
}
