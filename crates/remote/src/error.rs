//! Errors of remote policies.

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Maximum length of foreign text in a message (characters).
const MAX_FOREIGN_TEXT: usize = 300;

/// A policy that cannot be reached, or a server that breaks the protocol. Every message is one
/// line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The endpoint is invalid.
    #[error("endpoint {field}: {reason}")]
    Endpoint {
        /// The field: `url`, `api_key`, ...
        field: &'static str,
        /// What is wrong and the remedy.
        reason: String,
    },
    /// All attempts to connect failed.
    #[error("{url}: cannot connect: {reason}; is the policy server running?")]
    CannotConnect {
        /// The server.
        url: String,
        /// The error of the system.
        reason: String,
    },
    /// The server refused the API key.
    #[error("{url}: the server refused the API key ({reason})")]
    KeyRefused {
        /// The server.
        url: String,
        /// Its answer, and whether a key was sent.
        reason: String,
    },
    /// The server does not speak WebSocket.
    #[error("{url}: not a WebSocket server: {reason}")]
    Handshake {
        /// The server.
        url: String,
        /// What it sent instead.
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
    /// The deadline passed.
    #[error("{url}: timed out after {seconds} s waiting for {what}")]
    TimedOut {
        /// The server.
        url: String,
        /// What the client waited for.
        what: &'static str,
        /// The allowed duration (s).
        seconds: f64,
    },
    /// The server closed the connection.
    #[error("{url}: the server closed the connection while the client waited for {what} ({reason})")]
    Closed {
        /// The server.
        url: String,
        /// What the client waited for.
        what: &'static str,
        /// The close code and the message of the server or the system.
        reason: String,
    },
    /// An earlier error ended the connection. A request is never sent twice.
    #[error("{url}: not connected because of an earlier error: {reason}; reset or reconnect")]
    NotConnected {
        /// The server.
        url: String,
        /// The earlier error.
        reason: String,
    },
    /// The policy raised an exception.
    #[error("{url}: {last}")]
    Server {
        /// The server.
        url: String,
        /// The last line of the traceback, and the place of its origin.
        last: String,
        /// The whole text of the server, at most 64 KiB.
        traceback: String,
    },
    /// A message, or the size in its header, exceeds the limit.
    #[error("{url}: a message has {size} bytes; the maximum is {limit}")]
    TooLarge {
        /// The server.
        url: String,
        /// Its size (bytes).
        size: usize,
        /// The limit (bytes).
        limit: usize,
    },
    /// The server breaks the WebSocket protocol, or sends a message without a request.
    #[error("{url}: protocol error: {reason}")]
    Protocol {
        /// The server.
        url: String,
        /// What it did.
        reason: String,
    },
    /// Bytes that are not MessagePack of this protocol.
    #[error("{at}: malformed message at byte {byte}: {reason}")]
    Malformed {
        /// Message and field.
        at: String,
        /// Offset of the byte.
        byte: usize,
        /// What is wrong and the remedy.
        reason: String,
    },
    /// Lists or maps nested beyond the limit.
    #[error("{at}: nested deeper than {limit} levels")]
    TooDeep {
        /// Message and field.
        at: String,
        /// The limit.
        limit: usize,
    },
    /// More values than a reply needs.
    #[error("{at}: more than {limit} values outside arrays")]
    TooMany {
        /// Message and field.
        at: String,
        /// The limit.
        limit: usize,
    },
    /// An array of a type of elements that is not allowed.
    #[error("{at}: an array has type '{dtype}'; it {wanted}")]
    WrongDtype {
        /// Message and field.
        at: String,
        /// NumPy's name of the type.
        dtype: String,
        /// The allowed types.
        wanted: &'static str,
    },
    /// An array whose bytes do not fit its shape.
    #[error("{at}: shape {shape} of {dtype} needs {needed} bytes; there are {bytes}")]
    WrongShape {
        /// Message and field.
        at: String,
        /// The shape.
        shape: String,
        /// NumPy's name of the type.
        dtype: &'static str,
        /// The number of bytes that the shape needs, in words.
        needed: String,
        /// The number of bytes in the message.
        bytes: usize,
    },
    /// A field is missing or of another kind.
    #[error("{at}: {reason}")]
    WrongField {
        /// Message and field.
        at: String,
        /// What is wrong and the remedy.
        reason: String,
    },
    /// Actions with another number of components.
    #[error("{at}: actions have {found} components; {expected} are needed")]
    WrongDimension {
        /// Message and field.
        at: String,
        /// Components of the actions.
        found: usize,
        /// Components needed.
        expected: usize,
    },
    /// A chunk without actions.
    #[error("{at}: the chunk of actions is empty (shape {shape})")]
    EmptyChunk {
        /// Message and field.
        at: String,
        /// Its shape.
        shape: String,
    },
    /// A chunk with too many actions.
    #[error("{at}: the chunk has {found} actions; the maximum is {limit}")]
    LongChunk {
        /// Message and field.
        at: String,
        /// Actions in the chunk.
        found: usize,
        /// The limit.
        limit: usize,
    },
    /// A component that is not finite.
    #[error("{at}: component {component} of action {step} is {value}; it must be finite")]
    NotFinite {
        /// Message and field.
        at: String,
        /// The action, from 0.
        step: usize,
        /// The component, from 0.
        component: usize,
        /// Its value.
        value: f64,
    },
    /// The interruption flag was set.
    #[error("interrupted")]
    Interrupted,
}

impl Error {
    /// Whether the connection ended. Another connection may then succeed; with a wrong message it
    /// does not.
    pub fn is_disconnection(&self) -> bool {
        matches!(self, Self::Closed { .. } | Self::NotConnected { .. })
    }

    /// This error with `place` before its place, if it has one: `within("reply")` turns `actions`
    /// into `reply/actions`.
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
            // The server chooses the keys: a deep tree of long keys must not make a long message.
            let whole = if at.is_empty() { place } else { format!("{place}/{at}") };
            *at = one_line(&whole);
        }
        self
    }
}

/// Foreign text for a message: one line without control characters, of limited length.
pub(crate) fn one_line(text: &str) -> String {
    let mut line: String =
        text.trim().chars().take(MAX_FOREIGN_TEXT).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.trim().chars().nth(MAX_FOREIGN_TEXT).is_some() {
        line.push_str("...");
    }
    line
}
