//! Requests of clients to the simulation, in order. The queue is bounded, and the simulation waits
//! for it only when it has nothing else to do.

use crate::protocol::{ArmName, Quality, RecordAction};
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Most requests that wait.
const CAPACITY: usize = 256;

/// Number of a client.
pub(crate) type ClientId = u32;

/// A request of a client.
#[derive(Clone, Debug)]
pub(crate) struct Request {
    pub client: ClientId,
    /// The client's number for the reply.
    pub number: Option<i64>,
    pub wish: Wish,
}

/// A request.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Wish {
    Play,
    Pause,
    Step(u32),
    Speed(f64),
    Reset {
        seed: Option<u64>,
        policy: Option<String>,
    },
    Seek(f64),
    Open(String),
    Live,
    Record(RecordAction),
    HandBack(ArmName),
    History {
        channels: Vec<String>,
        from_s: f64,
    },
    Picture {
        camera: String,
        size: [usize; 2],
        quality: Quality,
    },
    Table,
    /// A frame is wanted now: a client came, or wants other things in it.
    Refresh,
    /// The client that drove this arm has disconnected.
    Lost(ArmName),
}

/// The requests that wait.
#[derive(Default)]
pub(crate) struct Inbox {
    waiting: Mutex<VecDeque<Request>>,
    news: Condvar,
}

/// Locks a mutex also if a thread that held it has panicked: what it guards is valid at all times.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Inbox {
    /// Adds a request; false if too many wait. One for a frame takes no place of its own.
    pub fn push(&self, request: Request) -> bool {
        let mut waiting = lock(&self.waiting);
        let refresh = request.wish == Wish::Refresh;
        if refresh && waiting.iter().any(|r| r.wish == Wish::Refresh) {
            return true;
        }
        // The program's own requests always fit: there is one per client.
        let own = refresh || matches!(request.wish, Wish::Lost(_));
        if waiting.len() >= CAPACITY && !own {
            return false;
        }
        waiting.push_back(request);
        drop(waiting);
        self.news.notify_all();
        true
    }

    /// Wakes who waits, without a request.
    pub fn wake(&self) {
        // The lock orders this after the check of who is about to wait.
        drop(lock(&self.waiting));
        self.news.notify_all();
    }

    /// Takes all requests.
    pub fn take(&self) -> VecDeque<Request> {
        std::mem::take(&mut *lock(&self.waiting))
    }

    /// Waits until there is a request, at most until `end`. Returns whether there is one.
    pub fn wait(&self, end: Instant) -> bool {
        let mut waiting = lock(&self.waiting);
        loop {
            if !waiting.is_empty() {
                return true;
            }
            let left = end.saturating_duration_since(Instant::now());
            if left == Duration::ZERO {
                return false;
            }
            let (guard, timed) = self.news.wait_timeout(waiting, left).unwrap_or_else(PoisonError::into_inner);
            waiting = guard;
            if timed.timed_out() || waiting.is_empty() {
                return !waiting.is_empty();
            }
        }
    }
}
