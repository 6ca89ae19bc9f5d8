//! What a whole episode costs: two arms, all organs, and pictures of two cameras once a control period, as policies see them.
//!
//! The scripted controller does the scene's task; the same seed each time, so that all runs do the same work.

use super::machine::Machine;
use super::timing::median;
use crate::{Error, Result};
use serde::Serialize;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use trocar_core::Progress;
use trocar_render::RenderSettings;
use trocar_scene::Scene;
use trocar_sensors::CameraRig;
use trocar_task::{Episode, Policy, policy};
use trocar_workflow::scene_specimen;

/// Least real-time factor that is asked of two cores (SPEC E6).
const BAR: f64 = 0.5;

/// Largest side of a picture [px].
const LARGEST: usize = 4096;

/// The benchmark's options.
#[derive(Clone, Debug)]
pub struct EpisodeBench {
    /// Scene file or name.
    pub scene: String,
    /// Folder for a scene's phantom.
    pub phantoms: PathBuf,
    /// Worker threads for tissue, 0 for all.
    pub threads: usize,
    /// Times that the episode is run.
    pub runs: usize,
    /// Seed of the episode.
    pub seed: u64,
    /// Cameras that look once a control period.
    pub cameras: Vec<String>,
    /// Side of their square pictures [px].
    pub size: usize,
}

/// The benchmark's outcome: medians over runs. Times are means over control periods, in milliseconds of wall time.
#[derive(Clone, Debug, Serialize)]
pub struct EpisodeBenchResult {
    /// Simulated over wall time, from after the reset to the end, pictures included.
    pub real_time_factor: f64,
    /// What is asked of it on two cores.
    pub bar: f64,
    /// It is that or more.
    pub met: bool,
    /// Run by run.
    pub run_factors: Vec<f64>,
    /// Controllers, ports and dynamics of the arms.
    pub arms_ms: f64,
    /// Elasticity, supports, contact, grasp.
    pub tissue_ms: f64,
    /// Bringing the stage to where the cell is, and drawing it through all cameras.
    pub pictures_ms: f64,
    /// All else: the policy, jaws and mouths, channels.
    pub rest_ms: f64,
    /// Length of a control period [ms].
    pub period_ms: f64,
    /// Control periods of the episode.
    pub periods: usize,
    /// Their time [s].
    pub simulated_s: f64,
    /// How the episode ended.
    pub end: String,
    /// All stages passed.
    pub passed: bool,
    /// Hash of the first run's final state.
    pub state_hash: String,
    /// All runs ended in it.
    pub repeatable: bool,
    /// Organs.
    pub organs: usize,
    /// Nodes.
    pub nodes: usize,
    /// The cameras.
    pub cameras: Vec<String>,
    /// Side of their pictures [px].
    pub size: usize,
    /// Worker threads for tissue.
    pub threads: usize,
    /// The machine.
    pub machine: Machine,
}

/// One run, in seconds.
#[derive(Clone, Copy, Debug, Default)]
struct Took {
    arms: f64,
    tissue: f64,
    pictures: f64,
    all: f64,
}

impl EpisodeBench {
    /// Runs it.
    ///
    /// # Errors
    /// A scene or specimen that cannot be had, a camera that the scene lacks, an interruption.
    pub fn run(&self, progress: &dyn Progress) -> Result<EpisodeBenchResult> {
        if self.runs == 0 || !(1..=LARGEST).contains(&self.size) {
            let given = format!("--runs {} --size {}", self.runs, self.size);
            return Err(Error::Mismatch(format!("{given}: 1 or more runs and 1 to {LARGEST} px are wanted")));
        }
        let scene = Scene::read(&self.scene)?;
        let specimen = scene_specimen(&scene, &self.phantoms, progress)?;
        let machine = Machine::here();
        let mut episode = Episode::new(&scene, &specimen, self.threads)?;
        let mut sight = CameraRig::new(&scene, &specimen, episode.cell())?;
        let mut scripted = policy::named("scripted")?;
        let (mut runs, mut hashes) = (Vec::new(), Vec::new());
        progress.begin("episodes", self.runs as u64);
        for _ in 0..self.runs {
            runs.push(self.once(&mut episode, &mut sight, scripted.as_mut(), progress)?);
            hashes.push(episode.state_hash());
            progress.advance(1);
        }
        progress.end();
        let periods = episode.rows().len();
        let ms = |of: fn(&Took) -> f64| {
            let mut values: Vec<f64> = runs.iter().map(|t| 1e3 * of(t) / periods.max(1) as f64).collect();
            median(&mut values)
        };
        let run_factors: Vec<f64> = runs.iter().map(|t| episode.time() / t.all.max(1e-9)).collect();
        let real_time_factor = median(&mut run_factors.clone());
        let bodies = episode.cell().world().model.bodies();
        Ok(EpisodeBenchResult {
            real_time_factor,
            bar: BAR,
            met: real_time_factor >= BAR,
            run_factors,
            arms_ms: ms(|t| t.arms),
            tissue_ms: ms(|t| t.tissue),
            pictures_ms: ms(|t| t.pictures),
            rest_ms: ms(|t| t.all - t.arms - t.tissue - t.pictures),
            period_ms: 1e3 * episode.cell().period(),
            periods,
            simulated_s: episode.time(),
            end: episode.end().map_or("no end".to_owned(), ToString::to_string),
            passed: episode.summary().passed,
            state_hash: format!("{:016x}", hashes[0]),
            repeatable: hashes.iter().all(|h| *h == hashes[0]),
            organs: bodies.len(),
            nodes: bodies.iter().map(|b| b.len()).sum(),
            cameras: self.cameras.clone(),
            size: self.size,
            threads: if self.threads == 0 { machine.cores } else { self.threads },
            machine,
        })
    }

    fn once(
        &self,
        episode: &mut Episode,
        sight: &mut CameraRig,
        scripted: &mut dyn Policy,
        progress: &dyn Progress,
    ) -> Result<Took> {
        episode.reset(self.seed)?;
        scripted.begin(episode, self.seed)?;
        let before = episode.cell().timing();
        let (clock, mut pictures) = (Instant::now(), Duration::ZERO);
        'episode: while episode.end().is_none() {
            for action in scripted.act(episode)? {
                if progress.interrupted() {
                    return Err(Error::Interrupted);
                }
                let ended = episode.step(&action)?.end.is_some();
                let looking = Instant::now();
                for camera in &self.cameras {
                    let size = [self.size; 2];
                    sight.render(episode.cell(), camera, size, &RenderSettings::Preview { shadows: false })?;
                }
                pictures += looking.elapsed();
                if ended {
                    break 'episode;
                }
            }
        }
        let (all, now) = (clock.elapsed(), episode.cell().timing());
        Ok(Took {
            arms: (now.arms - before.arms).as_secs_f64(),
            tissue: (now.tissue - before.tissue).as_secs_f64(),
            pictures: pictures.as_secs_f64(),
            all: all.as_secs_f64(),
        })
    }
}
