//! Policies of other processes, by openpi's protocol: a server that runs already, or a Python callable that is served for as long as it is needed.
//!
//! What they are shown: `observation/state` (the numbers of [`trocar_task::STATE_NAMES`]), `observation/images/NAME` for each camera of the scene but the recording one, `prompt`,
//! `episode/seed` and `episode/step`. What they answer: `actions`, a chunk of absolute targets (two pivots [rad], insertion [m], roll [rad], jaw opening, for each arm), of which up to 8 are done.

use crate::served::{PYTHON_SOURCE, Served, interpreter, serve};
use crate::source::PolicySpec;
use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use trocar_cell::{Action, ActionSpace};
use trocar_remote::{Array, Client, Endpoint, Observation, Value};
use trocar_render::RenderSettings;
use trocar_scene::Frame;
use trocar_sensors::CameraRig;
use trocar_specimen::Specimen;
use trocar_task::policy::CHUNK;
use trocar_task::{Bounds, Episode, Policy};
use trocar_workflow::{Error, Result};

/// The camera that policies do not see through: no hospital has it.
const RECORDING: &str = "recording";

/// The key that a server may want.
const KEY: &str = "TROCAR_POLICY_KEY";
/// Longest wait for a reply [s], unless this says another.
const TIMEOUT: &str = "TROCAR_POLICY_TIMEOUT_S";

/// A policy of another process.
pub(super) struct Remote {
    name: String,
    endpoint: Endpoint,
    module: Option<String>,
    /// The interpreter that serves it.
    python: String,
    child: Option<Served>,
    client: Option<Client>,
    bounds: Bounds,
    specimen: Specimen,
    /// What the cameras see, with where the specimen was when it was made; made in the first episode, and anew where the specimen lies elsewhere.
    sight: Option<(Frame, CameraRig)>,
    stop: Arc<AtomicBool>,
    cameras: Vec<(String, [usize; 2])>,
    prompt: String,
    seed: u64,
    /// The server is still to be told that an episode begins.
    begins: bool,
    /// The connection is an earlier episode's and was not asked in this one: it may be dead without having been seen to be.
    left: bool,
    /// RoboArena's name of the episode at hand.
    session: String,
}

impl Remote {
    /// A server's policy, or a Python policy. `served` is the latter's server if it runs already;
    /// otherwise `$TROCAR_PYTHON`, or `python`, or `python3` starts it.
    ///
    /// # Errors
    /// A Python policy that cannot be loaded.
    pub fn new(
        spec: &PolicySpec,
        specimen: &Specimen,
        episode: &Episode,
        stop: Arc<AtomicBool>,
        python: Option<&str>,
        served: Option<Served>,
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
            child: None,
            client: None,
            bounds,
            specimen: specimen.clone(),
            sight: None,
            stop,
            cameras,
            prompt: trocar_task::prompt(scene),
            seed: 0,
            begins: false,
            left: false,
            session: String::new(),
        };
        if let Some(served) = served {
            made.endpoint.url.clone_from(&served.url);
            made.child = Some(served);
        }
        match made.serve() {
            Err(_) if made.stop.load(Ordering::Relaxed) => Err(Error::Interrupted),
            Err(why) => Err(Error::Mismatch(why)),
            Ok(()) => Ok(made),
        }
    }

    /// Serves the callable, if it is one and its server does not run.
    fn serve(&mut self) -> std::result::Result<(), String> {
        if self.child.as_mut().is_some_and(Served::has_ended) {
            (self.child, self.client) = (None, None);
        }
        if let Some(module) = &self.module
            && self.child.is_none()
        {
            let served = serve(&self.python, module, &self.stop)?;
            self.endpoint.url.clone_from(&served.url);
            self.child = Some(served);
            self.client = None;
        }
        Ok(())
    }

    /// Makes the connection when it is first needed and after it was lost, and tells a server that an episode begins.
    fn connect(&mut self) -> std::result::Result<&mut Client, String> {
        self.serve()?;
        let said = |e: trocar_remote::Error| e.to_string();
        if self.begins
            && let Some(client) = &mut self.client
            && client.reset(&session(client, &self.session).map_err(said)?).is_ok()
        {
            self.begins = false;
        }
        if self.begins || self.client.as_ref().is_none_or(|c| !c.is_connected()) {
            self.client = None;
            let mut client = Client::connect(&self.endpoint).map_err(said)?;
            if self.begins {
                client.reset(&session(&client, &self.session).map_err(said)?).map_err(said)?;
                self.begins = false;
            }
            (self.client, self.left) = (Some(client), false);
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
        if self.sight.as_ref().is_none_or(|(placed, _)| *placed != scene.placement) {
            let sight = CameraRig::new(&scene, &self.specimen, episode.cell()).map_err(|e| e.to_string())?;
            self.sight = Some((scene.placement, sight));
        }
        let Some((_, sight)) = &mut self.sight else { return Err("there are no cameras".to_owned()) };
        for (camera, size) in &self.cameras {
            let picture = sight
                .render(episode.cell(), camera, *size, &RenderSettings::Preview { shadows: false })
                .map_err(|e| e.to_string())?;
            let pixels = picture.color.pixels.as_flattened().to_vec();
            let array = Array::from_u8(&[size[1], size[0], 3], pixels).map_err(said)?;
            seen.insert(format!("observation/images/{camera}"), Value::Array(array));
        }
        seen.insert("prompt".to_owned(), Value::Text(self.prompt.clone()));
        let seed = i64::try_from(self.seed).map_err(|_| format!("the seed {} is beyond {}", self.seed, i64::MAX))?;
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
            // A child that has died says why on its last line.
            let last = self.child.as_mut().and_then(|c| c.last_words());
            if last.is_some() {
                self.child = None;
            }
            // Whoever went between two episodes is asked once more, on a new connection.
            if std::mem::take(&mut self.left) && why.is_disconnection() {
                (self.client, self.begins) = (None, true);
                continue;
            }
            return Err(last.map_or_else(|| why.to_string(), |words| format!("{why}; its last words: {words}")));
        };
        self.left = false;
        let steps = reply.actions.horizon().min(CHUNK);
        (0..steps)
            .filter_map(|k| reply.actions.step(k))
            .map(|numbers| self.bounds.action(numbers).map_err(|e| e.to_string()))
            .collect()
    }
}

/// Where the policy `spec` is asked, with what the environment says of it. A Python callable has no address before it is served.
///
/// # Errors
/// An address, a key or a longest wait that cannot be used.
pub(super) fn endpoint(spec: &PolicySpec) -> Result<Endpoint> {
    let is_python = spec.source.starts_with(PYTHON_SOURCE);
    let mut endpoint = Endpoint::new(if is_python { "ws://127.0.0.1:1" } else { &spec.source });
    // Its address is a random port, which says nothing to a reader and differs from run to run.
    endpoint.label = is_python.then(|| spec.source.clone());
    endpoint.api_key = std::env::var(KEY).ok();
    if let Ok(text) = std::env::var(TIMEOUT) {
        let seconds = text.parse().ok().filter(|s: &f64| *s > 0.0 && *s < 1e6);
        let seconds =
            seconds.ok_or_else(|| Error::Mismatch(format!("${TIMEOUT} is '{text:.40}'; seconds are wanted")))?;
        endpoint.timeouts.infer = Duration::from_secs_f64(seconds);
    }
    endpoint.check().map_err(|why| Error::Mismatch(format!("--policy {}: {why}", spec.name)))?;
    Ok(endpoint)
}

/// What each message has besides: the episode's name, where a RoboArena server asks for one.
fn session(client: &Client, name: &str) -> trocar_remote::Result<Observation> {
    let asked = client.server_config()?.is_some_and(|c| c.needs_session_id);
    Ok(asked.then(|| ("session_id".to_owned(), Value::Text(name.to_owned()))).into_iter().collect())
}

impl Policy for Remote {
    fn name(&self) -> &str {
        &self.name
    }

    fn begin(&mut self, _episode: &Episode, seed: u64) -> trocar_task::Result<()> {
        self.seed = seed;
        // A server that keeps a history is told before the first observation, on whatever connection there is then.
        self.begins = true;
        self.left = self.client.is_some();
        // No two episodes have the same, not even of one policy and seed: several processes may ask one server.
        self.session = format!("{}-{seed}-{:016x}", self.name, RandomState::new().build_hasher().finish());
        Ok(())
    }

    fn act(&mut self, episode: &Episode) -> trocar_task::Result<Vec<Action>> {
        self.chunk(episode).map_err(trocar_task::Error::Option)
    }
}
