//! Policies in other processes, by openpi's protocol: a running server, or a Python callable that a
//! child process serves.
//!
//! An observation has `observation/state` (the numbers of [`trocar_task::STATE_NAMES`]),
//! `observation/images/NAME` for each camera of the scene except the recording camera, `prompt`,
//! `episode/seed` and `episode/step`. The reply has `actions`: a chunk of absolute targets, for
//! each arm two pivots (rad), insertion (m), roll (rad) and jaw opening. Up to 8 of them are
//! executed.

use crate::policy_server::{PYTHON_SOURCE, PolicyServer, interpreter};
use crate::policy_spec::PolicySpec;
use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use trocar_cell::{Action, ActionSpace};
use trocar_core::Progress;
use trocar_remote::{Array, Client, Endpoint, Observation, Value};
use trocar_render::RenderSettings;
use trocar_sensors::CameraRig;
use trocar_task::policy::CHUNK;
use trocar_task::{Bounds, Episode, Policy};
use trocar_workflow::{Error, Result};

/// The camera that policies do not see, because it exists only for recordings.
const RECORDING: &str = "recording";

/// Environment variable with the server's key.
const KEY: &str = "TROCAR_POLICY_KEY";
/// Environment variable with the timeout of a reply (s).
const TIMEOUT: &str = "TROCAR_POLICY_TIMEOUT_S";

/// Interval at which an attempt to connect is checked.
const CONNECT_POLL: Duration = Duration::from_millis(5);

/// A policy in another process.
pub(super) struct RemotePolicy {
    name: String,
    endpoint: Endpoint,
    module: Option<String>,
    /// The interpreter of a Python policy.
    python: String,
    server: Option<PolicyServer>,
    client: Option<Client>,
    bounds: Bounds,
    rig: Option<CameraRig>,
    stop: Arc<AtomicBool>,
    cameras: Vec<(String, [usize; 2])>,
    prompt: String,
    seed: u64,
    /// The server must be reset for a new episode.
    needs_reset: bool,
    /// The connection is unused since an earlier episode, so it may have closed unnoticed.
    stale: bool,
    /// RoboArena's name of the running episode.
    session: String,
}

impl RemotePolicy {
    /// A server's policy, or a Python policy. `server` is the running server of a Python policy;
    /// without one, `$TROCAR_PYTHON`, `python` or `python3` starts it.
    pub fn new(
        spec: &PolicySpec,
        episode: &Episode,
        stop: Arc<AtomicBool>,
        python: Option<&str>,
        server: Option<PolicyServer>,
    ) -> Result<Self> {
        let scene = episode.scene();
        let module = spec.source.strip_prefix(PYTHON_SOURCE).map(str::to_owned);
        let mut endpoint = endpoint(spec)?;
        endpoint.interrupt = Some(Arc::clone(&stop));
        let bounds = Bounds::new(episode.cell(), ActionSpace::Pivots)?;
        endpoint.actions.dim = Some(bounds.low.len());
        let seen = scene.cameras.iter().filter(|c| c.name != RECORDING);
        let cameras = seen.map(|c| (c.name.clone(), c.policy_size_px.map(|n| n as usize))).collect();
        let mut made = Self {
            name: spec.name.clone(),
            endpoint,
            module,
            python: interpreter(python),
            server: None,
            client: None,
            bounds,
            rig: None,
            stop,
            cameras,
            prompt: trocar_task::prompt(scene),
            seed: 0,
            needs_reset: false,
            stale: false,
            session: String::new(),
        };
        if let Some(server) = server {
            made.use_server(server);
        }
        match made.start_server() {
            Err(_) if made.stop.load(Ordering::Relaxed) => Err(Error::Interrupted),
            Err(why) => Err(Error::Mismatch(why)),
            Ok(()) => Ok(made),
        }
    }

    fn use_server(&mut self, server: PolicyServer) {
        self.endpoint.url.clone_from(&server.url);
        (self.server, self.client) = (Some(server), None);
    }

    /// Starts the server of a Python policy unless it runs.
    fn start_server(&mut self) -> std::result::Result<(), String> {
        if self.server.as_mut().is_some_and(PolicyServer::has_ended) {
            (self.server, self.client) = (None, None);
        }
        if let Some(module) = &self.module
            && self.server.is_none()
        {
            let server = PolicyServer::start(&self.python, module, &self.stop)?;
            self.use_server(server);
        }
        Ok(())
    }

    /// Connects if there is no connection, and resets the server for a new episode.
    fn connect(&mut self) -> std::result::Result<&mut Client, String> {
        self.start_server()?;
        let said = |e: trocar_remote::Error| e.to_string();
        if self.needs_reset
            && let Some(client) = &mut self.client
            && client.reset(&session(client, &self.session).map_err(said)?).is_ok()
        {
            self.needs_reset = false;
        }
        if self.needs_reset || self.client.as_ref().is_none_or(|c| !c.is_connected()) {
            self.client = None;
            let mut client = Client::connect(&self.endpoint).map_err(said)?;
            if self.needs_reset {
                client.reset(&session(&client, &self.session).map_err(said)?).map_err(said)?;
                self.needs_reset = false;
            }
            (self.client, self.stale) = (Some(client), false);
        }
        self.client.as_mut().ok_or_else(|| "there is no connection".to_owned())
    }

    fn observation(&mut self, episode: &Episode) -> std::result::Result<Observation, String> {
        let state: Vec<f32> = episode.observe().to_vec().iter().map(|x| *x as f32).collect();
        let said = |e: trocar_remote::Error| e.to_string();
        let mut seen = Observation::new();
        let array = Array::from_f32(&[state.len()], &state).map_err(said)?;
        seen.insert("observation/state".to_owned(), Value::Array(array));
        let scene = episode.arranged_scene();
        if self.rig.as_ref().is_none_or(|rig| !rig.is_of(scene)) {
            let rig = CameraRig::new(scene, episode.specimen(), episode.cell()).map_err(|e| e.to_string())?;
            self.rig = Some(rig);
        }
        let Some(rig) = &mut self.rig else { return Err("there are no cameras".to_owned()) };
        for (camera, size) in &self.cameras {
            let picture = rig
                .render(episode.cell(), camera, *size, &RenderSettings::Preview { shadows: false })
                .map_err(|e| e.to_string())?;
            let pixels = picture.color.pixels.as_flattened().to_vec();
            let array = Array::from_u8(&[size[1], size[0], 3], pixels).map_err(said)?;
            seen.insert(format!("observation/images/{camera}"), Value::Array(array));
        }
        seen.insert("prompt".to_owned(), Value::Text(self.prompt.clone()));
        let seed = i64::try_from(self.seed)
            .map_err(|_| format!("the seed is {}; it must be at most {}", self.seed, i64::MAX))?;
        seen.insert("episode/seed".to_owned(), Value::Int(seed));
        seen.insert("episode/step".to_owned(), Value::Int(episode.rows().len() as i64));
        Ok(seen)
    }

    fn chunk(&mut self, episode: &Episode) -> std::result::Result<Vec<Action>, String> {
        let mut observation = self.observation(episode)?;
        let name = self.session.clone();
        let reply = loop {
            let client = self.connect()?;
            observation.extend(session(client, &name).map_err(|e| e.to_string())?);
            let why = match client.infer(&observation) {
                Ok(reply) => break reply,
                Err(why) => why,
            };
            // A server that has ended gives the reason in its last line.
            let last = self.server.as_mut().and_then(|c| c.error_line());
            if last.is_some() {
                self.server = None;
            }
            // A connection that closed between two episodes is made once more.
            if std::mem::take(&mut self.stale) && why.is_disconnection() {
                (self.client, self.needs_reset) = (None, true);
                continue;
            }
            return Err(last.map_or_else(|| why.to_string(), |line| format!("{why}; its last line: {line}")));
        };
        self.stale = false;
        let steps = reply.actions.horizon().min(CHUNK);
        (0..steps)
            .filter_map(|k| reply.actions.step(k))
            .map(|numbers| self.bounds.action(numbers).map_err(|e| e.to_string()))
            .collect()
    }
}

/// Connects once to every server among `policies`, so that one that does not answer is reported
/// before anything is built.
///
/// # Errors
/// A server that cannot be reached or does not speak the protocol; an interruption.
pub fn check_servers(policies: &[&PolicySpec], progress: &dyn Progress) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    let mut endpoints = Vec::new();
    for spec in policies.iter().filter(|p| p.is_server()) {
        let mut endpoint = endpoint(spec)?;
        endpoint.interrupt = Some(Arc::clone(&stop));
        endpoints.push(endpoint);
    }
    if endpoints.is_empty() {
        return Ok(());
    }
    std::thread::scope(|scope| {
        let connect = || endpoints.iter().try_for_each(|endpoint| Client::connect(endpoint).map(|_| ()));
        let connecting = scope.spawn(connect);
        while !connecting.is_finished() {
            if progress.interrupted() {
                stop.store(true, Ordering::Relaxed);
            }
            std::thread::sleep(CONNECT_POLL);
        }
        match connecting.join() {
            _ if stop.load(Ordering::Relaxed) => Err(Error::Interrupted),
            Ok(connected) => connected.map_err(|why| Error::Mismatch(why.to_string())),
            Err(_) => Err(Error::Mismatch("the policy servers cannot be checked: a thread failed".to_owned())),
        }
    })
}

/// The endpoint of the policy `spec`, with key and timeout of the environment. A Python callable
/// has no address before it is served.
pub(super) fn endpoint(spec: &PolicySpec) -> Result<Endpoint> {
    let is_python = spec.source.starts_with(PYTHON_SOURCE);
    let mut endpoint = Endpoint::new(if is_python { "ws://127.0.0.1:1" } else { &spec.source });
    // Its address is a random port, which must not appear in results.
    endpoint.label = is_python.then(|| spec.source.clone());
    endpoint.api_key = std::env::var(KEY).ok();
    if let Ok(text) = std::env::var(TIMEOUT) {
        let seconds = text.parse().ok().filter(|s: &f64| *s > 0.0 && *s < 1e6);
        let seconds = seconds
            .ok_or_else(|| Error::Mismatch(format!("${TIMEOUT} is '{text:.40}'; it must be a number of seconds")))?;
        endpoint.timeouts.infer = Duration::from_secs_f64(seconds);
    }
    endpoint.check().map_err(|why| Error::Mismatch(format!("--policy {}: {why}", spec.name)))?;
    Ok(endpoint)
}

/// The additional entry of each message to a RoboArena server that asks for session names.
fn session(client: &Client, name: &str) -> trocar_remote::Result<Observation> {
    let asked = client.server_config()?.is_some_and(|c| c.needs_session_id);
    Ok(asked.then(|| ("session_id".to_owned(), Value::Text(name.to_owned()))).into_iter().collect())
}

impl Policy for RemotePolicy {
    fn name(&self) -> &str {
        &self.name
    }

    fn begin(&mut self, _episode: &Episode, seed: u64) -> trocar_task::Result<()> {
        self.seed = seed;
        // A server with a history is reset before the first observation.
        self.needs_reset = true;
        self.stale = self.client.is_some();
        // Several processes may use one server with the same policy and seed, so the name is
        // random.
        self.session = format!("{}-{seed}-{:016x}", self.name, RandomState::new().build_hasher().finish());
        Ok(())
    }

    fn act(&mut self, episode: &Episode) -> trocar_task::Result<Vec<Action>> {
        self.chunk(episode).map_err(trocar_task::Error::Option)
    }
}
