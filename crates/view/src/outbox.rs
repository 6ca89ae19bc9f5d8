//! What waits for a client: replies in order, and the newest frame.

use crate::frame::Frame;
use crate::inbox::{ClientId, lock};
use crate::protocol::Subscription;
use serde_json::Value;
use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Replies that wait for a client before it is cut off as too slow.
const MAX_REPLIES: usize = 256;
/// Bytes of those that were made for it alone, beside the newest of them.
const MAX_REPLY_BYTES: usize = 8 << 20;

/// A message as it is sent.
#[derive(Clone, Debug)]
pub(crate) enum Outgoing {
    Text(Arc<str>),
    Binary(Arc<[u8]>),
    /// The answer to a ping.
    Pong(Arc<[u8]>),
}

impl Outgoing {
    pub fn text(value: &Value) -> Self {
        Self::Text(value.to_string().into())
    }

    fn len(&self) -> usize {
        match self {
            Self::Text(text) => text.len(),
            Self::Binary(bytes) | Self::Pong(bytes) => bytes.len(),
        }
    }
}

/// What waits for a client: replies in order, and the newest frame.
#[derive(Default)]
struct Outbox {
    /// The waiting replies, each with its bytes that are not shared with other clients.
    replies: VecDeque<(Outgoing, usize)>,
    bytes: usize,
    frame: Option<Arc<Frame>>,
    /// Frames that were replaced before they were sent.
    dropped: u64,
    closed: bool,
    wants: Subscription,
    /// When the next frame is due, and the next measurements.
    due: [Option<Instant>; 2],
    /// The next frame has all organs: the client asked for other values on them.
    whole: bool,
}

/// A client.
pub(crate) struct Client {
    pub id: ClientId,
    outbox: Mutex<Outbox>,
    news: Condvar,
}

impl Outbox {
    /// From when on the next frame may be sent, half a period before its place in the client's
    /// rhythm; none if any time is right.
    fn frame_due(&self) -> Option<Instant> {
        let hz = self.wants.frames_hz;
        self.due[0].filter(|_| hz > 0.0).map(|due| due.checked_sub(period(hz) / 2).unwrap_or(due))
    }
}

/// The next task of a client's writer.
pub(crate) enum Next {
    Reply(Outgoing),
    /// The frame, how many were dropped, and whether it has all organs.
    Frame(Arc<Frame>, u64, bool),
    /// Nothing for a while: a sign of life is due.
    Quiet,
    Closed,
}

impl Client {
    pub fn new(id: ClientId) -> Self {
        Self { id, outbox: Mutex::default(), news: Condvar::new() }
    }

    /// Sends a reply. A client that lets too many wait is cut off, and what waited is let go.
    pub fn reply(&self, message: Outgoing) {
        let bytes = message.len();
        self.push(message, bytes);
    }

    /// The same with a message that all clients share.
    pub fn tell(&self, message: &Outgoing) {
        self.push(message.clone(), 0);
    }

    fn push(&self, message: Outgoing, bytes: usize) {
        let mut outbox = lock(&self.outbox);
        if outbox.replies.len() >= MAX_REPLIES || outbox.bytes > MAX_REPLY_BYTES {
            outbox.closed = true;
        }
        if outbox.closed {
            (outbox.replies, outbox.bytes, outbox.frame) = (VecDeque::new(), 0, None);
        } else {
            outbox.bytes += bytes;
            outbox.replies.push_back((message, bytes));
        }
        drop(outbox);
        self.news.notify_one();
    }

    /// Puts a frame into its slot, in the place of one that it has not got. One that comes too
    /// early for the client's rate waits there: it may be the last for a while.
    pub fn offer(&self, frame: &Arc<Frame>, now: Instant) {
        let mut outbox = lock(&self.outbox);
        if outbox.wants.frames_hz <= 0.0 || outbox.closed {
            return;
        }
        let late = outbox.frame_due() <= Some(now);
        if outbox.frame.replace(Arc::clone(frame)).is_some() && late {
            outbox.dropped += 1;
        }
        drop(outbox);
        self.news.notify_one();
    }

    /// Whether a frame would be sent, and measurements.
    pub fn wants_now(&self, now: Instant) -> bool {
        let outbox = lock(&self.outbox);
        !outbox.closed && outbox.wants.frames_hz > 0.0 && outbox.frame_due() <= Some(now)
    }

    /// Waits for what is to be sent, at most for `most`.
    pub fn next(&self, most: Duration) -> Next {
        let end = Instant::now() + most;
        let mut outbox = lock(&self.outbox);
        loop {
            if outbox.closed {
                return Next::Closed;
            }
            if let Some((reply, bytes)) = outbox.replies.pop_front() {
                outbox.bytes -= bytes;
                return Next::Reply(reply);
            }
            let now = Instant::now();
            let due = outbox.frame.is_some().then(|| outbox.frame_due().unwrap_or(now));
            if due.is_some_and(|due| due <= now)
                && let Some(frame) = outbox.frame.take()
            {
                let hz = outbox.wants.frames_hz;
                if hz > 0.0 {
                    is_due(&mut outbox.due[0], hz, now);
                }
                let whole = std::mem::take(&mut outbox.whole);
                return Next::Frame(frame, outbox.dropped, whole);
            }
            if end <= now {
                return Next::Quiet;
            }
            let left = due.unwrap_or(end).min(end).saturating_duration_since(now);
            outbox = self.news.wait_timeout(outbox, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Ends the connection.
    pub fn close(&self) {
        lock(&self.outbox).closed = true;
        self.news.notify_one();
    }

    /// Voids the frame that waits.
    pub fn forget_frame(&self) {
        lock(&self.outbox).frame = None;
    }

    /// Whether measurements are due.
    pub fn is_measured_now(&self, now: Instant) -> bool {
        let mut outbox = lock(&self.outbox);
        let hz = outbox.wants.measured_hz;
        hz > 0.0 && is_due(&mut outbox.due[1], hz, now)
    }

    /// Replaces what the client wants. The next frame has all of it.
    pub fn subscribe(&self, wants: Subscription) {
        let mut outbox = lock(&self.outbox);
        outbox.wants = wants;
        outbox.due = [None; 2];
        outbox.whole = true;
    }

    /// The client's subscription.
    pub fn wants(&self) -> Subscription {
        lock(&self.outbox).wants.clone()
    }
}

fn period(hz: f64) -> Duration {
    Duration::from_secs_f64(1.0 / hz)
}

/// Whether something that happens `hz` times a second is due, with half a period of slack for
/// jitter.
fn is_due(due: &mut Option<Instant>, hz: f64, now: Instant) -> bool {
    let period = period(hz);
    let next = due.unwrap_or(now);
    // Half a period early is still the same place in the rhythm.
    if next > now + period / 2 {
        return false;
    }
    *due = Some((next + period).max(now));
    true
}
