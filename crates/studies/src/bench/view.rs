//! The live view: what a client costs the simulation, how large frames are, and how long it takes
//! from an operator's command to the frame that shows it.
//!
//! One viewer runs the scripted episode as fast as it goes, in turn without a client and with one
//! that takes 60 frames a second. At real time, frames are counted and measured. An operator then
//! moves an instrument with commands at 60 Hz.

use crate::machine::Machine;
use crate::names::SceneChoice;
use crate::statistics::{median, percentile};
use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use trocar_core::Progress;
use trocar_report::document::{Document, Section, Table};
use trocar_report::table::fixed;
use trocar_view::client::{Client, Received};
use trocar_view::{Building, Options, Server, Source};
use trocar_workflow::check_interrupted;

/// Frames a second that the client takes, and commands a second that the operator sends (Hz).
const RATE: f64 = 60.0;
/// How long the operator moves (s).
const MOVING_S: f64 = 12.0;
/// Amplitude (m) and frequency (Hz) of the operator's motion.
const MOTION: (f64, f64) = (0.004, 0.5);
/// Longest wait for an episode (s).
const MAX_WAIT_S: u64 = 600;

/// Cost of a client of the live view to the simulation, size of frames, and latency.
#[derive(Clone, Debug, Args)]
pub struct ViewBench {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneChoice,
    /// Worker threads for tissue; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Pairs of episodes, without a client and with one; the median of their ratios counts.
    #[arg(long, default_value_t = 3)]
    pub pairs: usize,
    /// Seed of the episodes.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
}

/// Figures of the benchmark.
#[derive(Clone, Debug, Serialize)]
pub struct ViewBenchResult {
    /// Speed of the simulation with a client over that without: median over the pairs.
    pub speed_share: f64,
    /// The same of each pair.
    pub speed_shares: Vec<f64>,
    /// Simulated over wall time without a client: median.
    pub real_time_factor: f64,
    /// Mean size of a frame at real time (bytes).
    pub bytes_per_frame: f64,
    /// Frames a second at real time.
    pub frames_per_s: f64,
    /// Frames that the client got then.
    pub frames_sent: u64,
    /// Frames that it missed because a newer one was there.
    pub frames_dropped: u64,
    /// From an operator's command to the frame that shows it (ms): 95th percentile.
    pub input_to_state_ms_p95: f64,
    /// The same without the wait for the control period and the step: median and 95th percentile.
    pub added_latency_ms_p50: f64,
    /// See [`added_latency_ms_p50`](Self::added_latency_ms_p50).
    pub added_latency_ms_p95: f64,
    /// Commands whose frame was seen.
    pub commands: usize,
    /// Simulated over wall time while the operator moved.
    pub operator_rate: f64,
    /// Whether speed share, latency and frames meet their targets: at least 0.9, at most 10 ms, at
    /// least 54 a second.
    pub met: bool,
    /// Worker threads, 0 for all.
    pub threads: usize,
    /// The machine.
    pub machine: Machine,
}

#[allow(clippy::needless_pass_by_value, reason = "what map_err passes")]
fn failed(why: impl ToString) -> Error {
    Error::Mismatch(why.to_string())
}

/// A client with what it does, while a viewer runs.
struct Driver<'a> {
    server: &'a Server,
    control: Client,
    asked: i64,
    progress: &'a dyn Progress,
}

impl Driver<'_> {
    fn ask(&mut self, message: Value) -> Result<()> {
        self.asked += 1;
        self.control.ask(message, self.asked).map(|_| ()).map_err(failed)
    }

    /// Begins the episode of `seed`, paused.
    fn begin(&mut self, seed: u64, policy: &str, speed: f64) -> Result<()> {
        self.ask(json!({"type": "pause"}))?;
        self.ask(json!({"type": "speed", "factor": speed}))?;
        self.ask(json!({"type": "reset", "seed": seed, "policy": policy}))
    }

    /// Waits until the episode has ended. Returns the wall time from `from` (s).
    fn ended(&mut self, from: Instant) -> Result<f64> {
        let end = from + Duration::from_secs(MAX_WAIT_S);
        while Instant::now() < end {
            check_interrupted(self.progress)?;
            let got = self.control.receive(Duration::from_millis(200)).map_err(failed)?;
            if let Some(got) = got.filter(|m| m.kind() == "status" && m.header["mode"] == "ended") {
                return Ok((got.at - from).as_secs_f64());
            }
        }
        Err(failed(format!("the episode has not ended after {MAX_WAIT_S} s")))
    }

    /// Wall time of the episode as fast as it goes (s), with a client that takes frames or without,
    /// and its periods.
    fn episode(&mut self, seed: u64, watched: bool) -> Result<(f64, u64)> {
        self.begin(seed, "scripted", 0.0)?;
        let watcher = watched.then(|| Watcher::start(&self.server.wire())).transpose()?;
        let before = self.server.periods();
        let clock = Instant::now();
        self.ask(json!({"type": "play"}))?;
        let took = self.ended(clock)?;
        let periods = self.server.periods() - before;
        if let Some(watcher) = watcher {
            watcher.stop()?;
        }
        Ok((took, periods))
    }
}

/// A client that takes frames in a thread of its own.
struct Watcher {
    stop: std::sync::Arc<std::sync::atomic::AtomicBool>,
    thread: std::thread::JoinHandle<Result<Frames>>,
}

/// Frames that were taken.
#[derive(Clone, Copy, Debug, Default)]
struct Frames {
    count: u64,
    bytes: u64,
    dropped: u64,
    /// Wall time from the first to the last (s).
    wall_s: f64,
}

impl Watcher {
    /// Connects, and waits for the first frame.
    fn start(wire: &str) -> Result<Self> {
        let mut client = Client::connect(wire).map_err(failed)?;
        client.wait(Duration::from_secs(60), |m| m.kind() == "frame").map_err(failed)?;
        let stop = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
        let own = std::sync::Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let (mut frames, mut first) = (Frames::default(), None);
            while !own.load(std::sync::atomic::Ordering::Relaxed) {
                let got = client.receive(Duration::from_millis(100)).map_err(failed)?;
                let Some(got) = got.filter(|m| m.kind() == "frame") else { continue };
                let first = *first.get_or_insert(got.at);
                frames.count += 1;
                frames.bytes += got.bytes.len() as u64;
                frames.dropped = got.header["dropped"].as_u64().unwrap_or(0);
                frames.wall_s = (got.at - first).as_secs_f64();
            }
            Ok(frames)
        });
        Ok(Self { stop, thread })
    }

    fn stop(self) -> Result<Frames> {
        self.stop.store(true, std::sync::atomic::Ordering::Relaxed);
        self.thread.join().unwrap_or_else(|_| Err(failed("the client's thread has panicked")))
    }
}

/// Latencies of an operator's commands (ms), and simulated over wall time.
#[derive(Default)]
struct Latencies {
    whole: Vec<f64>,
    added: Vec<f64>,
    rate: f64,
}

/// Moves the first arm to and fro with commands at 60 Hz, and finds for each the first frame that
/// shows it.
fn move_arm(driver: &mut Driver<'_>, seed: u64) -> Result<Latencies> {
    driver.begin(seed, "operator", 1.0)?;
    driver.ask(json!({"type": "seats", "take": ["left"]}))?;
    driver.ask(json!({"type": "subscribe", "frames_hz": RATE}))?;
    driver.ask(json!({"type": "play"}))?;
    let (begin, mut sent, mut seen) = (Instant::now(), Vec::new(), 0);
    let (mut latencies, periods) = (Latencies::default(), driver.server.periods());
    while begin.elapsed().as_secs_f64() < MOVING_S {
        check_interrupted(driver.progress)?;
        let now = begin.elapsed().as_secs_f64();
        let turn = std::f64::consts::TAU * MOTION.1 * now;
        let x = MOTION.0 * turn.sin();
        sent.push(Instant::now());
        driver
            .control
            .send(&json!({"type": "servo_cr", "arm": "left", "seq": sent.len(), "time_s": now, "clutch": 1,
                "frame": "world", "translation_m": [x, 0.0, 0.0]}))
            .map_err(failed)?;
        let next = begin + Duration::from_secs_f64(sent.len() as f64 / RATE);
        while Instant::now() < next {
            let left = next.saturating_duration_since(Instant::now());
            if let Some(got) = driver.control.receive(left).map_err(failed)? {
                seen = note(&got, &sent, seen, &mut latencies);
            }
        }
    }
    let period_s = 1.0 / 30.0;
    latencies.rate = (driver.server.periods() - periods) as f64 * period_s / begin.elapsed().as_secs_f64();
    driver.ask(json!({"type": "pause"}))?;
    driver.ask(json!({"type": "subscribe", "frames_hz": 0}))?;
    driver.ask(json!({"type": "seats", "give": ["left"]}))?;
    Ok(latencies)
}

/// Notes the latency of the command that a frame shows first. Returns its number.
fn note(got: &Received, sent: &[Instant], seen: usize, latencies: &mut Latencies) -> usize {
    let command = &got.header["commands"]["left"];
    let number = |name: &str| command[name].as_f64();
    let (Some(seq), Some(waited), Some(step)) = (command["seq"].as_u64(), number("waited_ms"), number("step_ms"))
    else {
        return seen;
    };
    let seq = seq as usize;
    let Some(at) = sent.get(seq.wrapping_sub(1)).filter(|_| seq > seen) else { return seen };
    let whole = 1e3 * (got.at - *at).as_secs_f64();
    latencies.whole.push(whole);
    latencies.added.push(whole - waited - step);
    seq
}

impl Study for ViewBench {
    const NAME: &'static str = "view";
    const KIND: Kind = Kind::Bench;
    const FOLDER: Option<&'static str> = None;
    type Figures = ViewBenchResult;

    fn run(&self, job: &Job<'_>) -> Result<(ViewBenchResult, Document)> {
        if self.pairs == 0 {
            return Err(Error::Mismatch("--pairs 0: needs at least 1".to_owned()));
        }
        let progress = job.progress;
        let building = Building { phantoms: self.scene.phantoms.clone(), threads: self.threads, variation: None };
        let server = Server::start(Options {
            source: Source::Scene(self.scene.scene.clone()),
            building,
            policy: "scripted".to_owned(),
            seed: self.seed,
            port: 0,
            record: None,
            playing: false,
            speed: 0.0,
        })
        .map_err(failed)?;
        let mut control = Client::connect(&server.wire()).map_err(failed)?;
        let ready = |m: &Received| m.kind() == "status" && m.header["phase"] != "building";
        let status = control.wait(Duration::from_secs(MAX_WAIT_S), ready).map_err(failed)?;
        if status.header["phase"] == "failed" {
            return Err(failed(status.header["message"].as_str().unwrap_or("the scene cannot be built")));
        }
        let mut driver = Driver { server: &server, control, asked: 0, progress };
        driver.ask(json!({"type": "subscribe", "frames_hz": 0}))?;
        driver.ask(json!({"type": "seats", "take": ["controls"]}))?;
        progress.begin("episodes", 2 * self.pairs as u64 + 2);
        let (mut shares, mut factors) = (Vec::new(), Vec::new());
        for pair in 0..self.pairs {
            // The order changes, because a drift with time must not favour one side.
            let mut walls = [0.0; 2];
            for watched in if pair % 2 == 0 { [false, true] } else { [true, false] } {
                let (took, periods) = driver.episode(self.seed, watched)?;
                walls[usize::from(watched)] = took / periods.max(1) as f64;
                progress.advance(1);
            }
            shares.push(walls[0] / walls[1]);
            factors.push(1.0 / 30.0 / walls[0]);
        }
        driver.begin(self.seed, "scripted", 1.0)?;
        let watcher = Watcher::start(&server.wire())?;
        driver.ask(json!({"type": "play"}))?;
        driver.ended(Instant::now())?;
        let frames = watcher.stop()?;
        progress.advance(1);
        let mut latencies = move_arm(&mut driver, self.seed)?;
        progress.end();
        let result = ViewBenchResult {
            speed_share: median(&mut shares.clone()),
            speed_shares: shares,
            real_time_factor: median(&mut factors),
            bytes_per_frame: frames.bytes as f64 / frames.count.max(1) as f64,
            frames_per_s: frames.count.saturating_sub(1) as f64 / frames.wall_s.max(1e-9),
            frames_sent: frames.count,
            frames_dropped: frames.dropped,
            input_to_state_ms_p95: percentile(&mut latencies.whole, 0.95),
            added_latency_ms_p50: percentile(&mut latencies.added, 0.5),
            added_latency_ms_p95: percentile(&mut latencies.added, 0.95),
            commands: latencies.whole.len(),
            operator_rate: latencies.rate,
            met: false,
            threads: self.threads,
            machine: Machine::here(),
        };
        let met = result.speed_share >= 0.9 && result.added_latency_ms_p95 <= 10.0 && result.frames_per_s >= 54.0;
        let result = ViewBenchResult { met, ..result };
        let document = document(&result);
        server.stop().map_err(failed)?;
        Ok((result, document))
    }
}

fn document(r: &ViewBenchResult) -> Document {
    let rows = [
        ("speed with a client over without", fixed(r.speed_share, 3), "0.9 or more"),
        ("simulated over wall time without a client", fixed(r.real_time_factor, 2), ""),
        ("bytes a frame", fixed(r.bytes_per_frame, 0), ""),
        ("frames a second at real time", fixed(r.frames_per_s, 1), "54 or more"),
        ("frames sent, dropped", format!("{}, {}", r.frames_sent, r.frames_dropped), ""),
        ("command to frame, p95 (ms)", fixed(r.input_to_state_ms_p95, 1), ""),
        ("of which the viewer adds, p95 (ms)", fixed(r.added_latency_ms_p95, 1), "10 or less"),
    ];
    let rows = rows.into_iter().map(|(name, value, target)| vec![name.to_owned(), value, target.to_owned()]);
    let lead = format!(
        "One client at {RATE:.0} Hz; the scripted episode, then an operator for {MOVING_S:.0} s; {}",
        r.machine.described()
    );
    let table = Table::new(["figure", "value", "target"], rows.collect());
    Document::new("View", "The live view").with(Section::new("View", lead).table(table))
}
