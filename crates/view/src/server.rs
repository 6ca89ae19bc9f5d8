//! A viewer that simulates: a session behind a front.

use crate::error::{Error, Result};
use crate::front::Front;
use crate::hub::Hub;
use crate::policy;
use crate::protocol::SPEEDS;
use crate::session::{self, Plan};
use crate::source::{Building, Source};
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;

/// The source of the view and its settings.
#[derive(Clone, Debug)]
pub struct Options {
    /// The source that is shown.
    pub source: Source,
    /// How it is built.
    pub building: Building,
    /// The policy, as of `trocar episode`, or `operator`.
    pub policy: String,
    /// The seed of the first episode.
    pub seed: u64,
    /// The port; 0 for a free one.
    pub port: u16,
    /// Folder of demonstrations; `None` to record nothing.
    pub record: Option<PathBuf>,
    /// Whether it plays at once.
    pub playing: bool,
    /// Simulated over wall time; 0 for as fast as it goes.
    pub speed: f64,
}

/// A running viewer. It stops when it is dropped.
pub struct Server {
    front: Front,
    periods: Arc<AtomicU64>,
    session: Option<JoinHandle<Result<()>>>,
}

impl Server {
    /// Listens, and begins to build what is shown in a thread of its own.
    ///
    /// # Errors
    /// A port that is in use.
    pub fn start(options: Options) -> Result<Self> {
        let Options { source, building, policy, seed, port, record, playing, speed } = options;
        let hello = json!({
            "source": {"kind": source.kind(), "name": source.name()}, "policies": policy::names(&policy),
            "record": record.as_ref().map(|f| f.display().to_string()),
            "speeds": SPEEDS.into_iter().chain([0.0]).collect::<Vec<f64>>(),
        });
        let (hub, periods) = (Arc::new(Hub::new()), Arc::<AtomicU64>::default());
        let front = Front::open(port, Arc::clone(&hub), hello)?;
        let plan = Plan { source, building, policy, seed, record, playing, speed };
        let (stop, count) = (Arc::clone(front.stopping()), Arc::clone(&periods));
        let simulate = move || session::run(&hub, plan, &stop, count);
        let cannot = |why: std::io::Error| Error::Listen { port, reason: why.to_string() };
        let session = std::thread::Builder::new().name("view-simulation".to_owned()).spawn(simulate).map_err(cannot)?;
        Ok(Self { front, periods, session: Some(session) })
    }

    /// The port.
    pub fn port(&self) -> u16 {
        self.front.port()
    }

    /// The token.
    pub fn token(&self) -> &str {
        self.front.token()
    }

    /// The page's address, with the token.
    pub fn address(&self) -> String {
        self.front.address()
    }

    /// The wire's address, with the token.
    pub fn wire(&self) -> String {
        self.front.wire()
    }

    /// Whether the page is there.
    pub fn has_page(&self) -> bool {
        self.front.has_page()
    }

    /// Control periods simulated so far.
    pub fn periods(&self) -> u64 {
        self.periods.load(Ordering::Relaxed)
    }

    /// Whether the simulation has ended, because what is shown could not be built.
    pub fn has_ended(&self) -> bool {
        self.session.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Stops, and returns why the simulation had failed.
    ///
    /// # Errors
    /// The source could not be built.
    pub fn stop(mut self) -> Result<()> {
        self.end()
    }

    fn end(&mut self) -> Result<()> {
        self.front.close();
        let Some(session) = self.session.take() else { return Ok(()) };
        session.join().unwrap_or_else(|_| Err(Error::Source("the simulation has panicked".to_owned())))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.end();
    }
}
