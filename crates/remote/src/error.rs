//! What can go wrong with a remote policy.

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Longest piece of foreign text in a message [characters].
const LONGEST: usize = 300;

/// A policy that cannot be reached, or a server that does not keep to the protocol. Every message
/// is one line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The endpoint cannot be used as it is written.
    #[error("endpoint {field}: {reason}")]
    Endpoint {
        /// What of it: `url`, `api_key`, ...
        field: &'static str,
        /// What is wrong and what would be right.
        reason: String,
    },
    /// No connection, after all attempts.
    #[error("{url}: cannot connect: {reason}; is the policy server running?")]
    CannotConnect {
        /// The server.
        url: String,
        /// What the system said.
        reason: String,
    },
    /// The server wants another API key.
    #[error("{url}: the server refused the API key ({reason})")]
    KeyRefused {
        /// The server.
        url: String,
        /// What it said, and whether a key was sent.
        reason: String,
    },
    /// What answers is no policy server.
    #[error("{url}: no WebSocket there: {reason}")]
    Handshake {
        /// The server.
        url: String,
        /// What came instead.
        reason: String,
    },
    /// Encryption failed.
    #[error("{url}: TLS: {reason}")]
    Tls {
        /// The server.
        url: String,
        /// What is wrong.
        reason: String,
    },
    /// Nothing whole came by the deadline.
    #[error("{url}: timed out after {seconds} s waiting for {what}")]
    TimedOut {
        /// The server.
        url: String,
        /// What was waited for.
        what: &'static str,
        /// The time allowed [s].
        seconds: f64,
    },
    /// The server closed the connection.
    #[error("{url}: the server closed the connection while {what} was awaited ({reason})")]
    Closed {
        /// The server.
        url: String,
        /// What was waited for.
        what: &'static str,
        /// The close code and what the server or the system said.
        reason: String,
    },
    /// An earlier error ended the connection; a request is never sent twice.
    #[error("{url}: not connected since an earlier error: {reason}; reset or reconnect")]
    NotConnected {
        /// The server.
        url: String,
        /// The earlier error.
        reason: String,
    },
    /// The policy raised an exception.
    #[error("{url}: the policy failed: {last}")]
    Server {
        /// The server.
        url: String,
        /// The last line of the traceback, and where that was raised.
        last: String,
        /// All that the server sent, at most 64 KiB.
        traceback: String,
    },
    /// A message, or what its header claims, is above the limit.
    #[error("{url}: a message of {size} bytes, {limit} allowed")]
    TooLarge {
        /// The server.
        url: String,
        /// Its size [bytes].
        size: usize,
        /// The limit [bytes].
        limit: usize,
    },
    /// The server does not keep to WebSocket, or speaks out of turn.
    #[error("{url}: broken protocol: {reason}")]
    Protocol {
        /// The server.
        url: String,
        /// What it did.
        reason: String,
    },
    /// Bytes that are no MessagePack of this protocol.
    #[error("{at}: malformed message at byte {byte}: {reason}")]
    Malformed {
        /// Message and field.
        at: String,
        /// Where.
        byte: usize,
        /// What is wrong and what would be right.
        reason: String,
    },
    /// Lists or maps within each other beyond the limit.
    #[error("{at}: nested deeper than {limit} levels")]
    TooDeep {
        /// Message and field.
        at: String,
        /// The limit.
        limit: usize,
    },
    /// More values than any reply needs.
    #[error("{at}: more than {limit} values outside arrays")]
    TooMany {
        /// Message and field.
        at: String,
        /// The limit.
        limit: usize,
    },
    /// An array of another type of elements than is allowed there.
    #[error("{at}: an array of type '{dtype}'; {wanted}")]
    WrongDtype {
        /// Message and field.
        at: String,
        /// NumPy's name of the type.
        dtype: String,
        /// What would be right.
        wanted: &'static str,
    },
    /// An array whose shape and bytes do not belong together.
    #[error("{at}: shape {shape} of {dtype} needs {needed} bytes, there are {bytes}")]
    WrongShape {
        /// Message and field.
        at: String,
        /// The shape.
        shape: String,
        /// NumPy's name of the type.
        dtype: &'static str,
        /// The bytes needed, in words where they cannot be counted.
        needed: String,
        /// The bytes there are.
        bytes: usize,
    },
    /// A field that must be there is not, or is something else.
    #[error("{at}: {reason}")]
    WrongField {
        /// Message and field.
        at: String,
        /// What is wrong and what would be right.
        reason: String,
    },
    /// An action with another number of components.
    #[error("{at}: actions of {found} components, {expected} wanted")]
    WrongDimension {
        /// Message and field.
        at: String,
        /// Components found.
        found: usize,
        /// Components wanted.
        expected: usize,
    },
    /// A chunk without actions.
    #[error("{at}: an empty chunk of actions (shape {shape})")]
    EmptyChunk {
        /// Message and field.
        at: String,
        /// Its shape.
        shape: String,
    },
    /// A chunk with too many actions.
    #[error("{at}: a chunk of {found} actions, at most {limit} allowed")]
    LongChunk {
        /// Message and field.
        at: String,
        /// Actions found.
        found: usize,
        /// The limit.
        limit: usize,
    },
    /// A component that is no number.
    #[error("{at}: component {component} of action {step} is {value}, not a finite number")]
    NotFinite {
        /// Message and field.
        at: String,
        /// Which action, from 0.
        step: usize,
        /// Which component, from 0.
        component: usize,
        /// What it is.
        value: f64,
    },
    /// The interruption flag was set.
    #[error("interrupted")]
    Interrupted,
}

impl Error {
    /// Whether the connection ended, rather than that a message or an answer was wrong: another
    /// connection may do.
    pub fn is_disconnection(&self) -> bool {
        matches!(self, Self::Closed { .. } | Self::NotConnected { .. })
    }

    /// This error with `place` before its place, where it has one: `within("reply")` makes
    /// `actions` `reply/actions`.
    pub(crate) fn within(mut self, place: &str) -> Self {
        if let Self::Malformed { at, .. }
        | Self::TooDeep { at, .. }
        | Self::TooMany { at, .. }
        | Self::WrongDtype { at, .. }
        | Self::WrongShape { at, .. }
        | Self::WrongField { at, .. }
        | Self::WrongDimension { at, .. }
        | Self::EmptyChunk { at, .. }
        | Self::LongChunk { at, .. }
        | Self::NotFinite { at, .. } = &mut self
        {
            let place = one_line(place);
            // Keys are the server's: a deep tree of long ones must not make a long message.
            let whole = if at.is_empty() { place } else { format!("{place}/{at}") };
            *at = one_line(&whole);
        }
        self
    }
}

/// Foreign text as a part of a message: one line without control characters, not too long.
pub(crate) fn one_line(text: &str) -> String {
    let mut line: String = text.trim().chars().take(LONGEST).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.trim().chars().nth(LONGEST).is_some() {
        line.push_str("...");
    }
    line
}
