//! A WebSocket connection: connects, sends and receives, each until a deadline, and maps failures
//! to errors.

use super::stream::{Control, Halt, POLL_INTERVAL, Timed};
use crate::endpoint::Endpoint;
use crate::error::{Error, Result, one_line};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::error::{CapacityError, ProtocolError};
use tungstenite::handshake::HandshakeError;
use tungstenite::http::{HeaderValue, Uri, header};
use tungstenite::protocol::{CloseFrame, WebSocketConfig, frame::coding::CloseCode};
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Bytes, Message, WebSocket};

/// Maximum time to read between requests from a server that sends without a pause.
const MAX_PENDING_READ: Duration = Duration::from_millis(100);
/// Maximum kept size of a traceback (bytes).
const MAX_TRACEBACK: usize = 64 << 10;

/// The purpose and the deadline of a wait.
#[derive(Clone, Copy)]
pub(crate) struct Wait {
    pub what: &'static str,
    allowed: Duration,
    deadline: Instant,
}

impl Wait {
    pub fn new(what: &'static str, allowed: Duration) -> Self {
        let now = Instant::now();
        // 100 years, if the duration does not fit.
        let deadline = now.checked_add(allowed).unwrap_or(now + Duration::from_secs(3_200_000_000));
        Self { what, allowed, deadline }
    }

    /// The same deadline with another purpose.
    fn with_purpose(self, what: &'static str) -> Self {
        Self { what, ..self }
    }

    fn timed_out(&self, url: &str) -> Error {
        Error::TimedOut { url: url.into(), what: self.what, seconds: self.allowed.as_secs_f64() }
    }
}

/// A message of the server.
pub(crate) enum Incoming {
    Binary(Bytes),
    Text(String),
}

/// An open connection.
pub(crate) struct Socket {
    web: WebSocket<MaybeTlsStream<Timed>>,
    control: Control,
    url: String,
    limit: usize,
}

impl Socket {
    /// Attempts to connect once. Also returns the first message, the server's metadata.
    pub fn connect(endpoint: &Endpoint, uri: &Uri, key: Option<&HeaderValue>) -> Result<(Self, Incoming)> {
        let url = endpoint.shown();
        let wait = Wait::new("a connection", endpoint.timeouts.connect);
        let tcp = connect_tcp(endpoint, uri, &url, wait)?;
        let wait = wait.with_purpose("the WebSocket handshake");
        // Sends small messages at once (no Nagle delay).
        let _ = tcp.set_nodelay(true);
        let (stream, control) = Timed::new(tcp, wait.deadline, endpoint.interrupt.clone());
        let mut request = uri.clone().into_client_request().map_err(|e| handshake(&url, &e.to_string()))?;
        if let Some(key) = key {
            request.headers_mut().insert(header::AUTHORIZATION, key.clone());
        }
        let limit = endpoint.max_message;
        let config = WebSocketConfig::default().max_message_size(Some(limit)).max_frame_size(Some(limit));
        // A process can have only one provider; any is fine.
        #[cfg(feature = "rustls")]
        let _ = rustls::crypto::ring::default_provider().install_default();
        #[cfg(feature = "rustls")]
        let upgraded = tungstenite::client_tls_with_config(request, stream, Some(config), None);
        #[cfg(not(feature = "rustls"))]
        let upgraded = tungstenite::client::client_with_config(request, MaybeTlsStream::Plain(stream), Some(config));
        let web = match upgraded {
            Ok((web, _)) => web,
            Err(HandshakeError::Interrupted(_)) => return Err(wait.timed_out(&url)),
            Err(HandshakeError::Failure(e)) => return Err(refusal(e, &url, limit, key.is_some(), wait)),
        };
        let mut socket = Self { web, control, url, limit };
        match socket.receive(wait.with_purpose("the server's metadata")) {
            Ok(first) => Ok((socket, first)),
            Err(e) => Err(e),
        }
    }

    pub fn send(&mut self, message: Vec<u8>, wait: Wait) -> Result<()> {
        self.control.until(wait.deadline);
        self.web.send(Message::Binary(message.into())).map_err(|e| failure(e, &self.url, self.limit, wait))
    }

    /// The next message.
    pub fn receive(&mut self, wait: Wait) -> Result<Incoming> {
        self.control.until(wait.deadline);
        loop {
            match self.web.read() {
                Ok(Message::Binary(bytes)) => return Ok(Incoming::Binary(bytes)),
                Ok(Message::Text(text)) => return Ok(Incoming::Text(text.as_str().to_owned())),
                Ok(Message::Close(frame)) => return Err(closed(&self.url, wait.what, frame.as_ref())),
                // tungstenite answers pings with the next read.
                Ok(Message::Ping(_) | Message::Pong(_) | Message::Frame(_)) => {}
                Err(e) => return Err(failure(e, &self.url, self.limit, wait)),
            }
        }
    }

    /// Answers pings and notices a close, without waiting. Any other message between requests is an
    /// error.
    pub fn read_pending(&mut self) -> Result<()> {
        let wait = Wait::new("a request", Duration::from_millis(1));
        self.control.at_once(Instant::now() + MAX_PENDING_READ);
        loop {
            match self.web.read() {
                Ok(Message::Ping(_) | Message::Pong(_) | Message::Frame(_)) => {}
                Ok(Message::Close(frame)) => return Err(closed(&self.url, wait.what, frame.as_ref())),
                Ok(Message::Text(text)) => return Err(server_error(&self.url, text.as_str())),
                Ok(Message::Binary(_)) => {
                    let reason = "a message without a request".into();
                    return Err(Error::Protocol { url: self.url.clone(), reason });
                }
                Err(tungstenite::Error::Io(e)) if e.kind() == std::io::ErrorKind::WouldBlock => return Ok(()),
                Err(e) => {
                    return Err(match failure(e, &self.url, self.limit, wait) {
                        Error::TimedOut { url, .. } => {
                            Error::Protocol { url, reason: "the server sends without a pause".into() }
                        }
                        other => other,
                    });
                }
            }
        }
    }

    /// Closes the connection, within 100 ms.
    pub fn close(&mut self) {
        self.control.until(Instant::now() + Duration::from_millis(100));
        let _ = self.web.close(None);
        let _ = self.web.flush();
    }
}

/// Opens a TCP connection. Another thread resolves the name and tries the addresses, because
/// neither can be interrupted.
fn connect_tcp(endpoint: &Endpoint, uri: &Uri, url: &str, wait: Wait) -> Result<TcpStream> {
    let cannot = |reason: String| Error::CannotConnect { url: url.to_owned(), reason };
    let host = uri.host().unwrap_or("").trim_start_matches('[').trim_end_matches(']').to_owned();
    let port = uri.port_u16().unwrap_or(if uri.scheme_str() == Some("wss") { 443 } else { 80 });
    let (sender, receiver) = mpsc::channel();
    let try_all = move || {
        let outcome = (host.as_str(), port).to_socket_addrs().and_then(|addresses| {
            let mut last = std::io::Error::new(std::io::ErrorKind::NotFound, "the name has no address");
            for address in addresses {
                let left = wait.deadline.saturating_duration_since(Instant::now());
                match TcpStream::connect_timeout(&address, left.max(Duration::from_millis(1))) {
                    Ok(socket) => return Ok(socket),
                    Err(e) => last = e,
                }
            }
            Err(last)
        });
        // The receiver is gone after an interruption.
        let _ = sender.send(outcome);
    };
    std::thread::Builder::new().name("connect".into()).spawn(try_all).map_err(|e| cannot(one_line(&e.to_string())))?;
    loop {
        let left = wait.deadline.saturating_duration_since(Instant::now());
        match receiver.recv_timeout(left.min(POLL_INTERVAL)) {
            Ok(Ok(socket)) => return Ok(socket),
            Ok(Err(e)) if e.kind() == std::io::ErrorKind::TimedOut => return Err(wait.timed_out(url)),
            Ok(Err(e)) => return Err(cannot(one_line(&e.to_string()))),
            Err(RecvTimeoutError::Disconnected) => return Err(cannot("the attempt ended without a result".into())),
            Err(RecvTimeoutError::Timeout) if endpoint.interrupted() => return Err(Error::Interrupted),
            Err(RecvTimeoutError::Timeout) if left.is_zero() => return Err(wait.timed_out(url)),
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

fn handshake(url: &str, reason: &str) -> Error {
    Error::Handshake { url: url.into(), reason: one_line(reason) }
}

/// The error of a failed handshake.
fn refusal(e: tungstenite::Error, url: &str, limit: usize, with_key: bool, wait: Wait) -> Error {
    match e {
        tungstenite::Error::Http(response) => {
            let status = response.status();
            let body = response.body().as_deref().map(String::from_utf8_lossy).unwrap_or_default();
            let answer = one_line(body.lines().next().unwrap_or(""));
            let answer = if answer.is_empty() { status.to_string() } else { format!("{status}: {answer}") };
            match status.as_u16() {
                401 | 403 => {
                    let reason = if with_key { answer } else { format!("{answer}; no key was sent") };
                    Error::KeyRefused { url: url.into(), reason }
                }
                502..=504 => Error::CannotConnect { url: url.into(), reason: answer },
                300..=399 => handshake(url, &format!("{answer}; redirects are not followed")),
                _ => handshake(url, &answer),
            }
        }
        tungstenite::Error::Protocol(ProtocolError::HandshakeIncomplete) => {
            handshake(url, "the connection was closed during the handshake")
        }
        tungstenite::Error::Capacity(CapacityError::TooManyHeaders) => handshake(url, "too many headers"),
        tungstenite::Error::AttackAttempt => handshake(url, "a header is too long or in too many parts"),
        tungstenite::Error::Protocol(e) => handshake(url, &e.to_string()),
        e => failure(e, url, limit, wait),
    }
}

/// The error of a failed connection.
fn failure(e: tungstenite::Error, url: &str, limit: usize, wait: Wait) -> Error {
    let closed = |reason: &str| Error::Closed { url: url.into(), what: wait.what, reason: one_line(reason) };
    match e {
        tungstenite::Error::Io(e) => match e.get_ref().and_then(|inner| inner.downcast_ref::<Halt>()) {
            Some(Halt::TimedOut) => wait.timed_out(url),
            Some(Halt::Interrupted) => Error::Interrupted,
            // rustls reports its errors as I/O errors.
            None if e.kind() == std::io::ErrorKind::InvalidData => {
                Error::Tls { url: url.into(), reason: one_line(&e.to_string()) }
            }
            None => closed(&e.to_string()),
        },
        tungstenite::Error::ConnectionClosed | tungstenite::Error::AlreadyClosed => closed("no reason given"),
        tungstenite::Error::Protocol(ProtocolError::ResetWithoutClosingHandshake) => closed("no close frame"),
        tungstenite::Error::Capacity(CapacityError::MessageTooLong { size, .. }) => {
            Error::TooLarge { url: url.into(), size, limit }
        }
        tungstenite::Error::Tls(e) => Error::Tls { url: url.into(), reason: one_line(&e.to_string()) },
        e => Error::Protocol { url: url.into(), reason: one_line(&e.to_string()) },
    }
}

/// The error of a close frame. Gateways refuse a key after the handshake by 1008, 3000, 3003, 4401
/// or 4403.
fn closed(url: &str, what: &'static str, frame: Option<&CloseFrame>) -> Error {
    let Some(frame) = frame else {
        return Error::Closed { url: url.into(), what, reason: "no reason given".into() };
    };
    let code = u16::from(frame.code);
    let reason = one_line(&format!("{code} {}", frame.reason.as_str()));
    if frame.code == CloseCode::Policy || matches!(code, 3000 | 3003 | 4401 | 4403) {
        return Error::KeyRefused { url: url.into(), reason };
    }
    Error::Closed { url: url.into(), what, reason }
}

/// The error of a text message, which is a traceback: its last line and its innermost place.
pub(crate) fn server_error(url: &str, text: &str) -> Error {
    let end = (0..=text.len().min(MAX_TRACEBACK)).rev().find(|i| text.is_char_boundary(*i)).unwrap_or(0);
    let traceback = text[..end].to_owned();
    // The kept traceback is cut at its end, but the message needs the end.
    let mut lines = text.trim_end().lines().rev();
    let mut last = one_line(lines.next().unwrap_or(""));
    if last.is_empty() {
        last = "no reason given".into();
    }
    let place = text.trim_end().lines().rev().take(20_000).find(|l| l.trim_start().starts_with("File \""));
    if let Some(place) = place {
        last = format!("{last} ({})", one_line(place));
    }
    Error::Server { url: url.into(), last, traceback }
}
