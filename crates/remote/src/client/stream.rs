//! A TCP stream whose reads and writes end by a deadline or an interruption, whatever the other
//! side does.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How often an interruption is looked for.
pub(crate) const GLANCE: Duration = Duration::from_millis(20);

/// Why a stream stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Halt {
    /// The deadline passed.
    #[error("the deadline passed")]
    TimedOut,
    /// The flag was set.
    #[error("interrupted")]
    Interrupted,
}

/// How long operations may last.
#[derive(Clone, Copy, Debug)]
enum Patience {
    /// Until then.
    Until(Instant),
    /// What is not there at once is not waited for; what never ends is read until then.
    AtOnce(Instant),
}

/// The way to a stream that has been put into a WebSocket.
#[derive(Clone, Debug)]
pub(crate) struct Control(Arc<Mutex<Patience>>);

impl Control {
    /// Operations from here on end by `deadline`.
    pub fn until(&self, deadline: Instant) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Patience::Until(deadline);
    }

    /// Operations from here on give [`io::ErrorKind::WouldBlock`] where they would wait, and end by
    /// `deadline` where there is always something.
    pub fn at_once(&self, deadline: Instant) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Patience::AtOnce(deadline);
    }

    fn now(&self) -> Patience {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The stream.
#[derive(Debug)]
pub(crate) struct Timed {
    socket: TcpStream,
    control: Control,
    interrupt: Option<Arc<AtomicBool>>,
}

impl Timed {
    /// Takes a blocking `socket`.
    pub fn new(socket: TcpStream, deadline: Instant, interrupt: Option<Arc<AtomicBool>>) -> (Self, Control) {
        let control = Control(Arc::new(Mutex::new(Patience::Until(deadline))));
        (Self { socket, control: control.clone(), interrupt }, control)
    }

    /// Repeats `operate` with the timeout that is left until it does something.
    fn wait(&mut self, mut operate: impl FnMut(&mut TcpStream, Duration) -> io::Result<usize>) -> io::Result<usize> {
        loop {
            let patience = self.control.now();
            // The flag and the deadline also end what always has something to read.
            let left = match patience {
                Patience::AtOnce(deadline) if Instant::now() < deadline => Duration::from_millis(1),
                Patience::AtOnce(_) => Duration::ZERO,
                Patience::Until(_) if self.interrupt.as_ref().is_some_and(|f| f.load(Ordering::Relaxed)) => {
                    return Err(io::Error::other(Halt::Interrupted));
                }
                Patience::Until(deadline) => deadline.saturating_duration_since(Instant::now()),
            };
            if left.is_zero() {
                return Err(io::Error::other(Halt::TimedOut));
            }
            let pause = if self.interrupt.is_some() { left.min(GLANCE) } else { left };
            match operate(&mut self.socket, pause.max(Duration::from_millis(1))) {
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) if matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                    if matches!(patience, Patience::AtOnce(_)) {
                        return Err(io::ErrorKind::WouldBlock.into());
                    }
                }
                done => return done,
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
