//! The address of a policy server, with time limits.

use crate::actions::ReplyLimits;
use crate::error::{Error, Result, one_line};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tungstenite::http::{HeaderValue, Uri};

/// The protocol of a server.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dialect {
    /// RoboArena's if the metadata have its fields, openpi's otherwise.
    #[default]
    Auto,
    /// openpi's: every message is an observation, and there is no reset.
    OpenPi,
    /// RoboArena's: every message names its `endpoint`, `infer` or `reset`.
    RoboArena,
}

/// Maximum durations. Each limits the whole operation: a server that sends a byte now and then does
/// not extend it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timeouts {
    /// Of an attempt to connect, until the metadata have arrived.
    pub connect: Duration,
    /// Of a reply. The first one takes long if the server compiles its model then.
    pub infer: Duration,
}

impl Default for Timeouts {
    fn default() -> Self {
        Self { connect: Duration::from_secs(10), infer: Duration::from_secs(60) }
    }
}

/// Attempts to connect. They are repeated only for servers that cannot be reached or are busy (502,
/// 503, 504).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Retry {
    /// Number of attempts, at least 1.
    pub attempts: u32,
    /// Pause after the first attempt. It doubles with every attempt.
    pub first_pause: Duration,
    /// Maximum pause.
    pub max_pause: Duration,
}

impl Default for Retry {
    fn default() -> Self {
        Self { attempts: 5, first_pause: Duration::from_millis(200), max_pause: Duration::from_secs(5) }
    }
}

/// A policy server.
#[derive(Clone)]
pub struct Endpoint {
    /// `ws://host:port/path`. Without a scheme it is `ws://`. `wss://` needs the feature `rustls`.
    pub url: String,
    /// Sent as `Authorization: Api-Key ...`. Only `wss://` encrypts it.
    pub api_key: Option<String>,
    /// Maximum durations.
    pub timeouts: Timeouts,
    /// Attempts to connect.
    pub retry: Retry,
    /// Maximum size of a message (bytes).
    pub max_message: usize,
    /// Limits of accepted chunks.
    pub actions: ReplyLimits,
    /// The protocol of the server.
    pub dialect: Dialect,
    /// When it becomes true, every wait ends with [`Error::Interrupted`].
    pub interrupt: Option<Arc<AtomicBool>>,
    /// The server's name in error messages instead of its address, which may be a random port.
    pub label: Option<String>,
}

impl std::fmt::Debug for Endpoint {
    /// Without the key.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let key = self.api_key.as_ref().map(|_| "...");
        f.debug_struct("Endpoint").field("url", &self.shown()).field("api_key", &key).finish_non_exhaustive()
    }
}

impl Endpoint {
    /// The server at `url` with the default limits: 16 MiB a message, 10 s to connect, 60 s for a
    /// reply.
    pub fn new(url: impl Into<String>) -> Self {
        Self {
            url: url.into(),
            api_key: None,
            timeouts: Timeouts::default(),
            retry: Retry::default(),
            max_message: 16 << 20,
            actions: ReplyLimits::default(),
            dialect: Dialect::default(),
            interrupt: None,
            label: None,
        }
    }

    /// The server in error messages: its label, or its address without names and passwords.
    pub(crate) fn shown(&self) -> String {
        if let Some(label) = &self.label {
            return one_line(label);
        }
        let url = self.full();
        let (scheme, rest) = url.split_once("://").unwrap_or(("ws", &url));
        let rest = rest.split(['?', '#']).next().unwrap_or("");
        let (host, path) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
        let host = host.rsplit('@').next().unwrap_or("");
        one_line(&format!("{scheme}://{host}{}", path.trim_end_matches('/')))
    }

    fn full(&self) -> String {
        let url = self.url.trim();
        if url.contains("://") { url.to_owned() } else { format!("ws://{url}") }
    }

    /// Whether the interruption flag is set.
    pub(crate) fn interrupted(&self) -> bool {
        self.interrupt.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// Checks address, key, timeouts and the features of this build. Sends nothing.
    ///
    /// # Errors
    /// [`Error::Endpoint`] with the remedy. It contains no password, query or key.
    pub fn check(&self) -> Result<()> {
        self.parts().map(|_| ())
    }

    /// The address and the header with the key.
    pub(crate) fn parts(&self) -> Result<(Uri, Option<HeaderValue>)> {
        let wrong = |field, reason: String| Err(Error::Endpoint { field, reason });
        let full = self.full();
        let place = full.split_once("://").map_or("", |(_, place)| place);
        if place.is_empty() || place.starts_with(['/', '?', '#', ':']) {
            return wrong("url", format!("'{}' has no host; it must be such as ws://127.0.0.1:8000", self.shown()));
        }
        let uri: Uri = match full.parse() {
            Ok(uri) => uri,
            Err(e) => return wrong("url", format!("'{}': {e}; it must be such as ws://127.0.0.1:8000", self.shown())),
        };
        match uri.scheme_str() {
            Some("ws") => {}
            Some("wss") if cfg!(feature = "rustls") => {}
            Some("wss") => return wrong("url", "wss:// needs a build with the feature rustls".into()),
            _ => return wrong("url", format!("'{}' is neither ws:// nor wss://", self.shown())),
        }
        if uri.host().is_none_or(str::is_empty) {
            return wrong("url", format!("'{}' has no host", self.shown()));
        }
        let authority = uri.authority().map_or("", |a| a.as_str());
        let port = authority.rsplit('@').next().unwrap_or("").strip_prefix(uri.host().unwrap_or("")).unwrap_or("");
        if !port.is_empty() && uri.port_u16().is_none_or(|p| p == 0) {
            return wrong("url", format!("'{}': the port must be in [1, 65535]", self.shown()));
        }
        if self.timeouts.connect.is_zero() || self.timeouts.infer.is_zero() {
            return wrong("timeouts", "must be longer than 0 s".into());
        }
        if self.retry.attempts == 0 {
            return wrong("retry", "attempts must be at least 1".into());
        }
        let key = match &self.api_key {
            None => None,
            Some(key) => match HeaderValue::from_str(&format!("Api-Key {}", key.trim())) {
                Ok(mut value) => {
                    value.set_sensitive(true);
                    Some(value)
                }
                // The message must not contain the key.
                Err(_) => return wrong("api_key", "must be one line of printable characters".into()),
            },
        };
        Ok((uri, key))
    }
}
