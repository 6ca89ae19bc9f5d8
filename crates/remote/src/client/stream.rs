//! A TCP stream whose reads and writes end at a deadline or an interruption, whatever the peer
//! does.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Interval at which the interruption flag is checked.
pub(crate) const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// Why a stream stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Halt {
    /// The deadline passed.
    #[error("the deadline passed")]
    TimedOut,
    /// The interruption flag was set.
    #[error("interrupted")]
    Interrupted,
}

/// The time limit of operations.
#[derive(Clone, Copy, Debug)]
enum Limit {
    /// They may wait until the deadline.
    Until(Instant),
    /// They do not wait; a stream of data without end is read until the deadline.
    AtOnce(Instant),
}

/// Sets the limit of a stream that a WebSocket owns.
#[derive(Clone, Debug)]
pub(crate) struct Control(Arc<Mutex<Limit>>);

impl Control {
    /// Later operations end at `deadline`.
    pub fn until(&self, deadline: Instant) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Limit::Until(deadline);
    }

    /// Later operations return [`io::ErrorKind::WouldBlock`] instead of waiting, and fail if there
    /// is still data after `deadline`. A thread that was kept waiting until then may still learn
    /// that there is none.
    pub fn at_once(&self, deadline: Instant) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Limit::AtOnce(deadline);
    }

    fn now(&self) -> Limit {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A stream with a time limit.
#[derive(Debug)]
pub(crate) struct Timed {
    socket: TcpStream,
    control: Control,
    interrupt: Option<Arc<AtomicBool>>,
}

impl Timed {
    /// Wraps a blocking `socket`.
    pub fn new(socket: TcpStream, deadline: Instant, interrupt: Option<Arc<AtomicBool>>) -> (Self, Control) {
        let control = Control(Arc::new(Mutex::new(Limit::Until(deadline))));
        (Self { socket, control: control.clone(), interrupt }, control)
    }

    /// Repeats `operate` with the remaining timeout until it transfers data.
    fn wait(&mut self, mut operate: impl FnMut(&mut TcpStream, Duration) -> io::Result<usize>) -> io::Result<usize> {
        loop {
            let limit = self.control.now();
            // Checked even if there is always data.
            let left = match limit {
                Limit::AtOnce(_) => Duration::from_millis(1),
                Limit::Until(_) if self.interrupt.as_ref().is_some_and(|f| f.load(Ordering::Relaxed)) => {
                    return Err(io::Error::other(Halt::Interrupted));
                }
                Limit::Until(deadline) => deadline.saturating_duration_since(Instant::now()),
            };
            if left.is_zero() {
                return Err(io::Error::other(Halt::TimedOut));
            }
            let pause = if self.interrupt.is_some() { left.min(POLL_INTERVAL) } else { left };
            match operate(&mut self.socket, pause.max(Duration::from_millis(1))) {
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) if matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                    if matches!(limit, Limit::AtOnce(_)) {
                        return Err(io::ErrorKind::WouldBlock.into());
                    }
                }
                done => {
                    return match limit {
                        Limit::AtOnce(end) if Instant::now() >= end => Err(io::Error::other(Halt::TimedOut)),
                        _ => done,
                    };
                }
            }
        }
    }
}

impl Read for Timed {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.wait(|socket, pause| {
            socket.set_read_timeout(Some(pause))?;
            socket.read(buffer)
        })
    }
}

impl Write for Timed {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.wait(|socket, pause| {
            socket.set_write_timeout(Some(pause))?;
            socket.write(buffer)
        })
    }

    fn flush(&mut self) -> io::Result<()> {
        self.socket.flush()
    }
}
