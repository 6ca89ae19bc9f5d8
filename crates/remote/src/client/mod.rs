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

/// How often pings are looked for between requests. Python's servers give up 20 s after one.
const TEND: Duration = Duration::from_millis(500);
/// What a RoboArena server answers to a reset.
const RESET_DONE: &str = "reset successful";

/// An answer to an observation.
#[derive(Clone, Debug, PartialEq)]
pub struct Reply {
    /// The chunk of actions.
    pub actions: Actions,
    /// What the server says that the policy took [ms].
    pub server_ms: Option<f64>,
    /// From packing the observation to having the actions [ms].
    pub round_trip_ms: f64,
    /// The reply's other fields.
    pub fields: Map,
}

/// A connection, or why there is none any more.
enum Link {
    Open(Box<Socket>),
    Lost(String),
}

/// A client of a policy server.
///
/// A request is sent once: a policy may keep a history, so after an error of the connection only
/// [`Client::reconnect`] or [`Client::reset`] bring it back. Replies that are whole but wrong
/// (malformed, not finite, ...) leave the connection as it is.
pub struct Client {
    endpoint: Endpoint,
    url: String,
    link: Arc<Mutex<Link>>,
    metadata: Map,
    dialect: Dialect,
    keeper: Option<(Sender<()>, JoinHandle<()>)>,
}

impl std::fmt::Debug for Client {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Client").field("url", &self.url).field("dialect", &self.dialect).finish_non_exhaustive()
    }
}

impl Client {
    /// Connects, and waits for the server's metadata.
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
        let keeper = keep(Arc::clone(&link))?;
        let url = endpoint.shown();
        Ok(Self { endpoint: endpoint.clone(), url, link, metadata, dialect, keeper: Some(keeper) })
    }

    /// What the server said of itself when it was connected to.
    pub fn metadata(&self) -> &Map {
        &self.metadata
    }

    /// What the server understands; never [`Dialect::Auto`].
    pub fn dialect(&self) -> Dialect {
        self.dialect
    }

    /// The server's address, without passwords.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// What a RoboArena server asks for; none where it is another server.
    ///
    /// # Errors
    /// As [`ServerConfig::from_metadata`].
    pub fn server_config(&self) -> Result<Option<ServerConfig>> {
        if self.dialect != Dialect::RoboArena {
            return Ok(None);
        }
        ServerConfig::from_metadata(&self.metadata).map(Some).map_err(|e| e.within(&format!("{}: metadata", self.url)))
    }

    /// Sends an observation and waits for the chunk of actions.
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

    /// Begins an episode: connects anew where the connection was lost, and tells a RoboArena
    /// server, with `info` (such as its `session_id`), to forget the last one. openpi's protocol
    /// has no such message.
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
            // Servers made after RoboArena's answer in their own ways.
            Incoming::Binary(_) => Ok(()),
        }
    }

    /// Whether the connection was good when it was last looked at.
    pub fn is_connected(&self) -> bool {
        matches!(*self.lock(), Link::Open(_))
    }

    /// Connects anew, with new metadata.
    ///
    /// # Errors
    /// As [`Client::connect`].
    pub fn reconnect(&mut self) -> Result<()> {
        if let Link::Open(old) = &mut *self.lock() {
            old.close();
        }
        *self.lock() = Link::Lost("it was given up for another".into());
        let (socket, metadata) = dial(&self.endpoint)?;
        self.dialect = dialect_of(&self.endpoint, &metadata);
        self.metadata = metadata;
        *self.lock() = Link::Open(Box::new(socket));
        Ok(())
    }

    /// A message of `map`, with RoboArena's `endpoint` where it is needed.
    fn request(&self, map: &Map, endpoint: &str) -> Result<Vec<u8>> {
        if self.dialect != Dialect::RoboArena {
            return pack(map).map_err(|e| e.within("observation"));
        }
        let mut map = map.clone();
        map.insert("endpoint".into(), endpoint.into());
        pack(&map).map_err(|e| e.within("observation"))
    }

    /// Sends a message and waits for the next one.
    fn exchange(&mut self, request: Vec<u8>, what: &'static str) -> Result<Incoming> {
        let wait = Wait::new(what, self.endpoint.timeouts.infer);
        let mut link = self.lock();
        let outcome = match &mut *link {
            Link::Lost(reason) => {
                return Err(Error::NotConnected { url: self.url.clone(), reason: reason.clone() });
            }
            // What came before the request is no answer to it.
            Link::Open(socket) => {
                socket.tend().and_then(|()| socket.send(request, wait)).and_then(|()| socket.receive(wait))
            }
        };
        if let Err(e) = &outcome {
            // A late answer must not be taken for that of the next request.
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
        if let Some((sender, thread)) = self.keeper.take() {
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

/// Answers the server's pings between requests, however long the simulation takes for its frames.
fn keep(link: Arc<Mutex<Link>>) -> Result<(Sender<()>, JoinHandle<()>)> {
    let (sender, receiver) = mpsc::channel::<()>();
    let work = move || {
        while receiver.recv_timeout(TEND) == Err(RecvTimeoutError::Timeout) {
            let mut link = lock(&link);
            if let Link::Open(socket) = &mut *link
                && let Err(e) = socket.tend()
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
        told => told,
    }
}

/// Connects, with as many attempts as it takes and are allowed.
fn dial(endpoint: &Endpoint) -> Result<(Socket, Map)> {
    let (uri, key) = endpoint.parts()?;
    let mut pause = endpoint.retry.first;
    let mut attempt = 1;
    let (socket, first) = loop {
        match Socket::connect(endpoint, &uri, key.as_ref()) {
            Err(Error::CannotConnect { .. }) if attempt < endpoint.retry.attempts => {
                rest(endpoint, pause.min(endpoint.retry.most))?;
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
        other => Err(Error::WrongField { at: place, reason: format!("must be a map, is {}", other.kind()) }),
    }
}

/// Waits, unless interrupted.
fn rest(endpoint: &Endpoint, pause: Duration) -> Result<()> {
    let start = Instant::now();
    loop {
        if endpoint.interrupted() {
            return Err(Error::Interrupted);
        }
        let left = pause.saturating_sub(start.elapsed());
        if left.is_zero() {
            return Ok(());
        }
        std::thread::sleep(left.min(stream::GLANCE));
    }
}
