//! A client of the wire, for benchmarks and tests.

use crate::error::{Error, Result};
use serde_json::Value;
use std::net::TcpStream;
use std::time::{Duration, Instant};
use tungstenite::{Message, WebSocket};

/// A connection to a viewer.
pub struct Client {
    web: WebSocket<TcpStream>,
}

/// A message of the server.
#[derive(Clone, Debug)]
pub struct Received {
    /// The text's object, or the header of a binary message.
    pub header: Value,
    /// The whole binary message; empty of a text.
    pub bytes: Vec<u8>,
    /// When it was there.
    pub at: Instant,
}

impl Received {
    /// The field `type`.
    pub fn kind(&self) -> &str {
        self.header["type"].as_str().unwrap_or("")
    }
}

#[allow(clippy::needless_pass_by_value, reason = "what map_err passes")]
fn ended(why: impl ToString) -> Error {
    Error::Connection(why.to_string())
}

impl Client {
    /// Connects to the address of a wire, as of [`Server::wire`](crate::Server::wire).
    ///
    /// # Errors
    /// An address that is none, a server that is not there or refuses.
    pub fn connect(wire: &str) -> Result<Self> {
        let place = wire.strip_prefix("ws://").and_then(|rest| rest.split('/').next());
        let place = place.ok_or_else(|| ended(format!("'{wire}' is no ws:// address")))?;
        let stream = TcpStream::connect(place).map_err(ended)?;
        stream.set_nodelay(true).map_err(ended)?;
        let (web, _) = tungstenite::client(wire, stream).map_err(ended)?;
        Ok(Self { web })
    }

    /// Sends an object.
    ///
    /// # Errors
    /// A connection that has ended.
    pub fn send(&mut self, message: &Value) -> Result<()> {
        self.web.send(Message::text(message.to_string())).map_err(ended)
    }

    /// The next message, if one comes within `most`.
    ///
    /// # Errors
    /// A connection that has ended, a message that cannot be read.
    pub fn receive(&mut self, most: Duration) -> Result<Option<Received>> {
        let end = Instant::now() + most;
        loop {
            let left = end.saturating_duration_since(Instant::now()).max(Duration::from_micros(100));
            self.web.get_ref().set_read_timeout(Some(left)).map_err(ended)?;
            let message = match self.web.read() {
                Ok(message) => message,
                Err(tungstenite::Error::Io(e))
                    if matches!(e.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) =>
                {
                    return Ok(None);
                }
                Err(why) => return Err(ended(why)),
            };
            let at = Instant::now();
            let parse = |text: &[u8]| serde_json::from_slice(text).map_err(ended);
            match message {
                Message::Text(text) => {
                    return Ok(Some(Received { header: parse(text.as_bytes())?, bytes: Vec::new(), at }));
                }
                Message::Binary(bytes) => {
                    let length = bytes.first_chunk::<4>().map_or(0, |n| u32::from_le_bytes(*n) as usize);
                    let header = bytes.get(4..4 + length).ok_or_else(|| ended("a message has no header"))?;
                    return Ok(Some(Received { header: parse(header)?, bytes: bytes.to_vec(), at }));
                }
                _ if Instant::now() >= end => return Ok(None),
                _ => {}
            }
        }
    }

    /// The first message for which `wanted` holds; others are left out.
    ///
    /// # Errors
    /// As [`receive`](Self::receive); none within `most`.
    pub fn wait(&mut self, most: Duration, mut wanted: impl FnMut(&Received) -> bool) -> Result<Received> {
        let end = Instant::now() + most;
        while Instant::now() < end {
            if let Some(got) = self.receive(end.saturating_duration_since(Instant::now()))?
                && wanted(&got)
            {
                return Ok(got);
            }
        }
        Err(ended(format!("what was waited for did not come in {:.1} s", most.as_secs_f64())))
    }

    /// Sends an object with a number and waits for its reply.
    ///
    /// # Errors
    /// As [`wait`](Self::wait); an answer that is an error.
    pub fn ask(&mut self, mut message: Value, number: i64) -> Result<Received> {
        message["request"] = number.into();
        self.send(&message)?;
        let got = self.wait(Duration::from_secs(60), |got| got.header["request"] == number)?;
        if got.kind() == "error" {
            return Err(ended(got.header["message"].as_str().unwrap_or("an error without a message")));
        }
        Ok(got)
    }
}
