//! The front of a viewer: the page and the wire on a port of this machine alone, for clients of
//! whatever simulates behind it.

use crate::error::{Error, Result};
use crate::http::{Counter, Head, answer, refuse};
use crate::hub::{Hub, MAX_CLIENTS};
use crate::page::Page;
use crate::protocol::MAX_MESSAGE;
use crate::socket;
use serde_json::{Value, json};
use std::hash::{BuildHasher, RandomState};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Version of the wire.
const VERSION: u32 = 1;
/// Most requests for files and handshakes at a time, beside the clients.
const MAX_REQUESTS: usize = 32;

/// State that all connections share.
struct Shared {
    hub: Arc<Hub>,
    token: String,
    page: Page,
    hello: Value,
    stop: Arc<AtomicBool>,
    requests: Counter,
    clients: Counter,
}

/// A listening front. It closes when it is dropped.
pub(crate) struct Front {
    address: SocketAddr,
    shared: Arc<Shared>,
    accepting: Option<JoinHandle<()>>,
}

/// 128 random bits, hexadecimal.
fn token() -> String {
    // Keys of the hashes are random numbers of the system.
    (0..2).map(|k| format!("{:016x}", RandomState::new().hash_one(k))).collect()
}

impl Front {
    /// Listens on `port`, 0 for a free one, for clients of `hub`. `hello` has what is said to a new
    /// client, beside what is the same for all.
    ///
    /// # Errors
    /// A port that is in use.
    pub fn open(port: u16, hub: Arc<Hub>, mut hello: Value) -> Result<Self> {
        let cannot = |why: std::io::Error| Error::Listen { port, reason: why.to_string() };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(cannot)?;
        let address = listener.local_addr().map_err(cannot)?;
        let same = json!({
            "type": "hello", "version": VERSION, "program": env!("CARGO_PKG_VERSION"), "message_bytes": MAX_MESSAGE,
            "command_life_ms": crate::hub::COMMAND_LIFE.as_millis() as u64,
        });
        for (key, value) in same.as_object().into_iter().flatten() {
            hello[key] = value.clone();
        }
        let shared = Arc::new(Shared {
            hub,
            token: token(),
            page: Page::find(),
            hello,
            stop: Arc::default(),
            requests: Counter::default(),
            clients: Counter::default(),
        });
        let own = Arc::clone(&shared);
        let accept = move || accept(&listener, &own);
        let accepting = std::thread::Builder::new().name("view-server".to_owned()).spawn(accept).map_err(cannot)?;
        Ok(Self { address, shared, accepting: Some(accepting) })
    }

    /// Set when the front closes.
    pub fn stopping(&self) -> &Arc<AtomicBool> {
        &self.shared.stop
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

    /// Tells whoever simulates to stop, and ends all connections.
    pub fn close(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        self.shared.hub.inbox.wake();
        self.shared.hub.close_all();
        // Wakes the thread, which waits for a client.
        let _ = TcpStream::connect_timeout(&self.address, Duration::from_secs(1));
        if let Some(accepting) = self.accepting.take() {
            let _ = accepting.join();
        }
    }
}

impl Drop for Front {
    fn drop(&mut self) {
        self.close();
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
    // If the lengths are equal, all bytes are compared: the time reveals nothing.
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
