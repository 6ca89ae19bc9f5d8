//! The server: the page and the wire on a port of this machine alone.

use crate::error::{Error, Result};
use crate::http::{Counter, Head, answer, refuse};
use crate::hub::{Hub, MAX_CLIENTS};
use crate::page::Page;
use crate::protocol::{MAX_MESSAGE, SPEEDS};
use crate::session::{self, Plan};
use crate::source::{Building, Source};
use crate::{policy, socket};
use serde_json::{Value, json};
use std::hash::{BuildHasher, RandomState};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Version of the wire.
const VERSION: u32 = 1;
/// Most requests for files and handshakes at a time, beside the clients.
const MAX_REQUESTS: usize = 32;

/// What is shown, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// What is shown.
    pub source: Source,
    /// How it is built.
    pub building: Building,
    /// The policy, as of `trocar episode`, or `operator`.
    pub policy: String,
    /// The seed of the first episode.
    pub seed: u64,
    /// The port; 0 for a free one.
    pub port: u16,
    /// Folder of demonstrations; `None` to record nothing.
    pub record: Option<PathBuf>,
    /// Whether it plays at once.
    pub playing: bool,
    /// Simulated over wall time; 0 for as fast as it goes.
    pub speed: f64,
}

/// What all connections share.
struct Shared {
    hub: Arc<Hub>,
    token: String,
    page: Page,
    hello: Value,
    stop: Arc<AtomicBool>,
    requests: Counter,
    clients: Counter,
}

/// A running viewer. It stops when it is dropped.
pub struct Server {
    address: SocketAddr,
    shared: Arc<Shared>,
    periods: Arc<AtomicU64>,
    accepting: Option<JoinHandle<()>>,
    session: Option<JoinHandle<Result<()>>>,
}

/// 128 random bits, hexadecimal.
fn token() -> String {
    // Keys of the hashes are random numbers of the system.
    (0..2).map(|k| format!("{:016x}", RandomState::new().hash_one(k))).collect()
}

impl Server {
    /// Listens, and begins to build what is shown in a thread of its own.
    ///
    /// # Errors
    /// A port that is in use.
    pub fn start(options: Options) -> Result<Self> {
        let port = options.port;
        let cannot = |why: std::io::Error| Error::Listen { port, reason: why.to_string() };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(cannot)?;
        let address = listener.local_addr().map_err(cannot)?;
        let hello = json!({
            "type": "hello", "version": VERSION, "program": env!("CARGO_PKG_VERSION"),
            "source": {"kind": options.source.kind(), "name": options.source.name()},
            "policies": policy::names(&options.policy),
            "record": options.record.as_ref().map(|f| f.display().to_string()),
            "speeds": SPEEDS.into_iter().chain([0.0]).collect::<Vec<f64>>(), "message_bytes": MAX_MESSAGE,
            "command_life_ms": crate::hub::COMMAND_LIFE.as_millis() as u64,
        });
        let (hub, stop, periods) = (Arc::new(Hub::new()), Arc::<AtomicBool>::default(), Arc::<AtomicU64>::default());
        let shared = Arc::new(Shared {
            hub: Arc::clone(&hub),
            token: token(),
            page: Page::find(),
            hello,
            stop: Arc::clone(&stop),
            requests: Counter::default(),
            clients: Counter::default(),
        });
        let Options { source, building, policy, seed, port: _, record, playing, speed } = options;
        let plan = Plan { source, building, policy, seed, record, playing, speed };
        let count = Arc::clone(&periods);
        let simulate = move || session::run(&hub, plan, &stop, count);
        let session = std::thread::Builder::new().name("view-simulation".to_owned()).spawn(simulate).map_err(cannot)?;
        let own = Arc::clone(&shared);
        let accept = move || accept(&listener, &own);
        let accepting = std::thread::Builder::new().name("view-server".to_owned()).spawn(accept).map_err(cannot)?;
        Ok(Self { address, shared, periods, accepting: Some(accepting), session: Some(session) })
    }

    /// The port.
    pub fn port(&self) -> u16 {
        self.address.port()
    }

    /// The token.
    pub fn token(&self) -> &str {
        &self.shared.token
    }

    /// The page's address, with the token.
    pub fn address(&self) -> String {
        format!("http://{}/?token={}", self.address, self.shared.token)
    }

    /// The wire's address, with the token.
    pub fn wire(&self) -> String {
        format!("ws://{}/wire/{VERSION}?token={}", self.address, self.shared.token)
    }

    /// Whether the page is there.
    pub fn has_page(&self) -> bool {
        self.shared.page != Page::Missing
    }

    /// Control periods simulated so far.
    pub fn periods(&self) -> u64 {
        self.periods.load(Ordering::Relaxed)
    }

    /// Whether the simulation has ended, because what is shown could not be built.
    pub fn has_ended(&self) -> bool {
        self.session.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Stops, and returns why the simulation had failed.
    ///
    /// # Errors
    /// What is shown could not be built.
    pub fn stop(mut self) -> Result<()> {
        self.end()
    }

    fn end(&mut self) -> Result<()> {
        self.shared.stop.store(true, Ordering::Relaxed);
        self.shared.hub.inbox.wake();
        self.shared.hub.close_all();
        // Wakes the thread, which waits for a client.
        let _ = TcpStream::connect_timeout(&self.address, Duration::from_secs(1));
        if let Some(accepting) = self.accepting.take() {
            let _ = accepting.join();
        }
        let Some(session) = self.session.take() else { return Ok(()) };
        session.join().unwrap_or_else(|_| Err(Error::Source("the simulation has panicked".to_owned())))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.end();
    }
}

fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    for stream in listener.incoming() {
        if shared.stop.load(Ordering::Relaxed) {
            return;
        }
        let Ok(mut stream) = stream else { continue };
        if !shared.requests.enter(MAX_REQUESTS) {
            refuse(&mut stream, 503, "too many connections; try again");
            continue;
        }
        let own = Arc::clone(shared);
        let work = move || connection(stream, &own);
        if std::thread::Builder::new().name("view-client".to_owned()).spawn(work).is_err() {
            shared.requests.leave();
        }
    }
}

/// One connection: a file of the page, or a client of the wire.
fn connection(mut stream: TcpStream, shared: &Arc<Shared>) {
    let upgraded = request(&mut stream, shared);
    shared.requests.leave();
    if let Some(rest) = upgraded {
        let hello = |id, seats: &Value| {
            let mut hello = shared.hello.clone();
            (hello["client"], hello["seats"]) = (json!(id), seats.clone());
            hello
        };
        if let Some(client) = shared.hub.join(hello) {
            socket::serve(&stream, rest, &client, &shared.hub);
            shared.hub.leave(client.id);
        }
        shared.clients.leave();
    }
}

/// Answers a request. Of one that asks for the wire, what came after its head, with the handshake
/// done and a client counted.
fn request(stream: &mut TcpStream, shared: &Shared) -> Option<Vec<u8>> {
    let _ = stream.set_nodelay(true);
    let head = match Head::read(stream) {
        Ok(head) => head,
        Err((status, why)) => {
            refuse(stream, status, &why);
            return None;
        }
    };
    let refused = |stream: &mut TcpStream, status, why: &str| {
        refuse(stream, status, why);
        None
    };
    if !head.is_local() {
        return refused(stream, 403, "only pages of this server on this machine may connect (Host, Origin)");
    }
    if head.method != "GET" {
        return refused(stream, 405, "only GET is answered");
    }
    let Some(version) = head.path.strip_prefix("/wire/") else {
        match shared.page.file(&head.path) {
            Some((bytes, kind)) => answer(stream, 200, kind, &bytes),
            None => refuse(stream, 404, "there is no such file"),
        }
        return None;
    };
    if version != VERSION.to_string() {
        return refused(stream, 404, &format!("this program has version {VERSION} of the wire"));
    }
    // Of equal length, all bytes are compared, so that the time says nothing.
    let given = head.query("token").unwrap_or("").as_bytes();
    let own = shared.token.as_bytes();
    let differs = given.iter().zip(own).fold(0, |d, (a, b)| d | (a ^ b));
    if given.len() != own.len() || differs != 0 {
        return refused(stream, 401, "the token is missing or wrong; it is in the address that trocar view printed");
    }
    let mut asked = tungstenite::http::Request::builder().method("GET").uri("/");
    for (name, value) in &head.headers {
        asked = asked.header(name, value);
    }
    let response = asked
        .body(())
        .map_err(|e| e.to_string())
        .and_then(|asked| tungstenite::handshake::server::create_response(&asked).map_err(|e| e.to_string()));
    let response = match response {
        Ok(response) => response,
        Err(why) => return refused(stream, 400, &format!("no WebSocket handshake: {why}")),
    };
    if !shared.clients.enter(MAX_CLIENTS) {
        return refused(stream, 503, &format!("{MAX_CLIENTS} clients are connected, no more are served"));
    }
    let mut bytes = Vec::new();
    let written = tungstenite::handshake::server::write_response(&mut bytes, &response);
    if written.is_err() || std::io::Write::write_all(stream, &bytes).is_err() {
        shared.clients.leave();
        return None;
    }
    Some(head.rest)
}
