//! A policy server on the loopback interface, for tests and examples. It speaks openpi's or
//! RoboArena's protocol with one client at a time.

use crate::client::stream::{Control, Timed};
use crate::endpoint::Dialect;
use crate::error::{Error, Result, one_line};
use crate::value::{Map, Value};
use crate::wire::{pack, unpack};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tungstenite::http::{StatusCode, header};
use tungstenite::protocol::{CloseFrame, WebSocketConfig, frame::coding::CloseCode};
use tungstenite::{Message, WebSocket};

/// Maximum size of an observation (bytes).
const MAX_MESSAGE: usize = 256 << 20;
/// Maximum wait for a client's next request. Then another client is served.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(3600);
/// Maximum wait for a client to close after an error.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);

/// A call of the policy.
#[derive(Clone, Debug, PartialEq)]
pub enum Call {
    /// Asks for the actions of an observation. The policy returns a map with the field `actions`.
    Infer(Map),
    /// Starts an episode. The result is not sent.
    Reset(Map),
}

/// Options of a loopback server.
#[derive(Clone, Debug, Default)]
pub struct LoopbackOptions {
    /// The first message to a client.
    pub metadata: Map,
    /// The key that clients must send.
    pub api_key: Option<String>,
    /// [`Dialect::RoboArena`]; any other value is openpi's.
    pub dialect: Dialect,
}

/// A running server. It stops when it is dropped.
#[derive(Debug)]
pub struct Loopback {
    address: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Loopback {
    /// Serves `policy` on a free port of 127.0.0.1. An error of the policy is sent to the client as
    /// the last line of a traceback, and closes its connection.
    ///
    /// # Errors
    /// [`Error::CannotConnect`] if there is no free port, those of [`pack`] for the metadata.
    pub fn start<P>(options: &LoopbackOptions, policy: P) -> Result<Self>
    where
        P: FnMut(Call) -> std::result::Result<Map, String> + Send + 'static,
    {
        let cannot = |e: std::io::Error| Error::CannotConnect {
            url: "ws://127.0.0.1:0".into(),
            reason: one_line(&e.to_string()),
        };
        let metadata = pack(&options.metadata).map_err(|e| e.within("metadata"))?;
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).map_err(cannot)?;
        let address = listener.local_addr().map_err(cannot)?;
        let stop = Arc::new(AtomicBool::new(false));
        let mut server = Server {
            metadata,
            key: options.api_key.as_ref().map(|k| format!("Api-Key {k}")),
            roboarena: options.dialect == Dialect::RoboArena,
            stop: Arc::clone(&stop),
            policy,
        };
        let serve = move || {
            while let Ok((socket, _)) = listener.accept() {
                if server.stop.load(Ordering::Relaxed) {
                    return;
                }
                // An error of a client ends its own connection only.
                let _ = server.serve(socket);
            }
        };
        let thread = std::thread::Builder::new().name("loopback".into()).spawn(serve).map_err(cannot)?;
        Ok(Self { address, stop, thread: Some(thread) })
    }

    /// The address for an [`Endpoint`](crate::Endpoint).
    pub fn url(&self) -> String {
        format!("ws://{}", self.address)
    }
}

impl Drop for Loopback {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // Wakes the thread, which waits for a client.
        let _ = TcpStream::connect_timeout(&self.address, Duration::from_secs(1));
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Server<P> {
    metadata: Vec<u8>,
    key: Option<String>,
    roboarena: bool,
    stop: Arc<AtomicBool>,
    policy: P,
}

/// Why a connection ended.
type Ended = Box<dyn std::error::Error>;

impl<P: FnMut(Call) -> std::result::Result<Map, String>> Server<P> {
    fn serve(&mut self, socket: TcpStream) -> std::result::Result<(), Ended> {
        socket.set_nodelay(true)?;
        let (stream, control) = Timed::new(socket, Instant::now() + REQUEST_TIMEOUT, Some(Arc::clone(&self.stop)));
        let config = WebSocketConfig::default().max_message_size(Some(MAX_MESSAGE)).max_frame_size(Some(MAX_MESSAGE));
        let key = self.key.clone();
        #[allow(clippy::result_large_err, reason = "tungstenite's signature")]
        let check = |request: &Request, response: Response| -> std::result::Result<Response, ErrorResponse> {
            let sent = request.headers().get(header::AUTHORIZATION).and_then(|v| v.to_str().ok());
            if key.is_none() || sent == key.as_deref() {
                return Ok(response);
            }
            let mut refused = ErrorResponse::new(Some("Invalid API key".into()));
            *refused.status_mut() = StatusCode::UNAUTHORIZED;
            Err(refused)
        };
        let mut web = tungstenite::accept_hdr_with_config(stream, check, Some(config)).map_err(|e| e.to_string())?;
        web.send(Message::Binary(self.metadata.clone().into()))?;
        loop {
            control.until(Instant::now() + REQUEST_TIMEOUT);
            let bytes = match web.read()? {
                Message::Binary(bytes) => bytes,
                Message::Close(_) => {
                    // The answer to the close goes out with the next flush.
                    let _ = web.flush();
                    return Ok(());
                }
                Message::Text(_) => return fail(&mut web, &control, "text is no observation"),
                _ => continue,
            };
            let map = match unpack(&bytes) {
                Ok(Value::Map(map)) => map,
                Ok(_) => return fail(&mut web, &control, "an observation must be a map"),
                Err(e) => return fail(&mut web, &control, &e.to_string()),
            };
            if let Err(why) = self.answer(&mut web, map)? {
                return fail(&mut web, &control, &why);
            }
        }
    }

    /// Answers one request. The inner error is the policy's.
    fn answer(
        &mut self,
        web: &mut WebSocket<Timed>,
        mut map: Map,
    ) -> std::result::Result<std::result::Result<(), String>, Ended> {
        let start = Instant::now();
        let reset = match map.remove("endpoint") {
            Some(endpoint) if self.roboarena => endpoint == Value::from("reset"),
            None if self.roboarena => return Ok(Err("KeyError: 'endpoint'".into())),
            Some(endpoint) => {
                map.insert("endpoint".into(), endpoint);
                false
            }
            None => false,
        };
        let mut reply = match (self.policy)(if reset { Call::Reset(map) } else { Call::Infer(map) }) {
            Ok(reply) => reply,
            Err(why) => return Ok(Err(why)),
        };
        if reset {
            web.send(Message::text("reset successful"))?;
            return Ok(Ok(()));
        }
        if !self.roboarena {
            let timing = Map::from([("infer_ms".to_owned(), Value::Float(start.elapsed().as_secs_f64() * 1e3))]);
            reply.insert("server_timing".into(), timing.into());
        }
        match pack(&reply) {
            Ok(bytes) => web.send(Message::Binary(bytes.into()))?,
            Err(e) => return Ok(Err(e.to_string())),
        }
        Ok(Ok(()))
    }
}

/// Sends an error as the last line of a traceback, and closes.
fn fail(web: &mut WebSocket<Timed>, control: &Control, why: &str) -> std::result::Result<(), Ended> {
    control.until(Instant::now() + CLOSE_TIMEOUT);
    web.send(Message::text(format!("Traceback (most recent call last):\nRuntimeError: {}\n", one_line(why))))?;
    let reason = "Internal server error.".into();
    web.close(Some(CloseFrame { code: CloseCode::Error, reason }))?;
    // Reads until the client has closed, so that it receives the text.
    while web.read().is_ok() {}
    Ok(())
}
