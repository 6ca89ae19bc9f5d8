//! Where a policy is served and how long it is waited for.

use crate::actions::ActionLimits;
use crate::error::{Error, Result, one_line};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tungstenite::http::{HeaderValue, Uri};

/// What the server understands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dialect {
    /// RoboArena's where the metadata have its fields, openpi's otherwise.
    #[default]
    Auto,
    /// openpi's: every message is an observation, and there is no reset.
    OpenPi,
    /// RoboArena's: every message names its `endpoint`, `infer` or `reset`.
    RoboArena,
}

/// Longest waits. Each is for the whole, so that a server that sends a byte now and then does not
/// prolong it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timeouts {
    /// For an attempt to connect, until the metadata are there.
    pub connect: Duration,
    /// For a reply. The first one takes long where a model is compiled then.
    pub infer: Duration,
}

impl Default for Timeouts {
    fn default() -> Self {
        Self { connect: Duration::from_secs(10), infer: Duration::from_secs(60) }
    }
}

/// How often it is tried to connect. Only servers that cannot be reached or are busy (502, 503,
/// 504) are tried again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Retry {
    /// Attempts in all, at least 1.
    pub attempts: u32,
    /// Wait after the first attempt; it doubles from one to the next.
    pub first: Duration,
    /// Longest wait.
    pub most: Duration,
}

impl Default for Retry {
    fn default() -> Self {
        Self { attempts: 5, first: Duration::from_millis(200), most: Duration::from_secs(5) }
    }
}

/// A policy server.
#[derive(Clone)]
pub struct Endpoint {
    /// `ws://host:port/path`; without a scheme it is `ws://`. `wss://` needs the feature `rustls`.
    pub url: String,
    /// Sent as `Authorization: Api-Key ...`; readable by others on the way unless the address is
    /// `wss://`.
    pub api_key: Option<String>,
    /// Longest waits.
    pub timeouts: Timeouts,
    /// How often it is tried to connect.
    pub retry: Retry,
    /// Largest message taken [bytes].
    pub max_message: usize,
    /// Which chunks of actions are taken.
    pub actions: ActionLimits,
    /// What the server understands.
    pub dialect: Dialect,
    /// When this becomes true, every wait ends with [`Error::Interrupted`].
    pub interrupt: Option<Arc<AtomicBool>>,
}

impl std::fmt::Debug for Endpoint {
    /// Without the key.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let key = self.api_key.as_ref().map(|_| "...");
        f.debug_struct("Endpoint").field("url", &self.shown()).field("api_key", &key).finish_non_exhaustive()
    }
}

impl Endpoint {
    /// The server at `url` with the usual limits: 16 MiB a message, 10 s to connect, 60 s for a
    /// reply.
    pub fn new(url: impl Into<String>) -> Self {
        Self {
            url: url.into(),
            api_key: None,
            timeouts: Timeouts::default(),
            retry: Retry::default(),
            max_message: 16 << 20,
            actions: ActionLimits::default(),
            dialect: Dialect::default(),
            interrupt: None,
        }
    }

    /// The address for messages: without names and passwords.
    pub(crate) fn shown(&self) -> String {
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

    /// Whether it was asked to stop.
    pub(crate) fn interrupted(&self) -> bool {
        self.interrupt.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// Whether it can be connected to as it is written: address, key, waits, and what this build
    /// can do. Nothing is sent.
    ///
    /// # Errors
    /// [`Error::Endpoint`] with what would be right; no password, query or key stands in it.
    pub fn check(&self) -> Result<()> {
        self.parts().map(|_| ())
    }

    /// The address and the header of the key.
    pub(crate) fn parts(&self) -> Result<(Uri, Option<HeaderValue>)> {
        let wrong = |field, reason: String| Err(Error::Endpoint { field, reason });
        let full = self.full();
        let place = full.split_once("://").map_or("", |(_, place)| place);
        if place.is_empty() || place.starts_with(['/', '?', '#', ':']) {
            return wrong("url", format!("'{}' has no host; such as ws://127.0.0.1:8000", self.shown()));
        }
        let uri: Uri = match full.parse() {
            Ok(uri) => uri,
            Err(e) => return wrong("url", format!("'{}': {e}; such as ws://127.0.0.1:8000", self.shown())),
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
            return wrong("url", format!("'{}' has a port that is not from 1 to 65535", self.shown()));
        }
        if self.timeouts.connect.is_zero() || self.timeouts.infer.is_zero() {
            return wrong("timeouts", "must be longer than 0 s".into());
        }
        if self.retry.attempts == 0 {
            return wrong("retry", "at least 1 attempt is needed".into());
        }
        let key = match &self.api_key {
            None => None,
            Some(key) => match HeaderValue::from_str(&format!("Api-Key {}", key.trim())) {
                Ok(mut value) => {
                    value.set_sensitive(true);
                    Some(value)
                }
                // The key itself stays out of messages.
                Err(_) => return wrong("api_key", "must be one line of printable characters".into()),
            },
        };
        Ok((uri, key))
    }
}
