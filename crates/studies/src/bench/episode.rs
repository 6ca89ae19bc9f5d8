//! Speed of a whole episode: two arms, all organs, and pictures of two cameras per control period.
//!
//! The scripted controller performs the task of the scene. All runs use the same seed and do the
//! same work.

use crate::machine::{Machine, Setup};
use crate::names::SceneChoice;
use crate::statistics::median;
use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use serde::Serialize;
use std::time::{Duration, Instant};
use trocar_core::Progress;
use trocar_render::RenderSettings;
use trocar_report::document::{Document, Section, Table};
use trocar_report::table::fixed;
use trocar_scene::Scene;
use trocar_sensors::CameraRig;
use trocar_task::{Episode, Policy, policy};
use trocar_workflow::{check_interrupted, scene_specimen};

/// Number of timed path-traced frames.
const PATH_FRAMES: usize = 10;

/// Target of the real-time factor on two cores.
const TARGET: f64 = 0.5;

/// Every such control period, the pictures are also traced.
const TRACED_EVERY: usize = 10;

/// Maximum side of a picture (px).
const MAX_SIZE: usize = 4096;

/// Speed of a whole scripted episode with arms, organs and two cameras, and the cost of its parts.
#[derive(Clone, Debug, Args)]
pub struct EpisodeBench {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneChoice,
    /// Worker threads for tissue; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Repetitions of the episode; the median counts.
    #[arg(long, default_value_t = 3)]
    pub runs: usize,
    /// Seed of the episode.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// A camera that renders once per control period; repeat for several.
    #[arg(long = "camera", value_name = "NAME", default_values_t = ["endoscope".to_owned(), "d405".to_owned()])]
    pub cameras: Vec<String>,
    /// Side of the square pictures (px).
    #[arg(long, default_value_t = 224)]
    pub size: usize,
    /// Paths per pixel of the path-traced pictures of 1280 x 720; 0 for none.
    #[arg(long, default_value_t = 64)]
    pub samples: u32,
}

/// Figures of the benchmark: medians over runs. Times are means over control periods (ms of wall
/// time).
#[derive(Clone, Debug, Serialize)]
pub struct EpisodeBenchResult {
    /// Simulated over wall time from the reset to the end, pictures included.
    pub real_time_factor: f64,
    /// Target on two cores.
    pub bar: f64,
    /// Whether the target is met.
    pub met: bool,
    /// Real-time factor of each run.
    pub run_factors: Vec<f64>,
    /// Controllers, ports and dynamics of the arms (ms).
    pub arms_ms: f64,
    /// Elasticity, supports, contact, grasp (ms).
    pub tissue_ms: f64,
    /// Update of the stage from the cell, and rendering through all cameras (ms).
    pub pictures_ms: f64,
    /// The rest: policy, jaws, grasp detection, channels (ms).
    pub rest_ms: f64,
    /// Share of a control period that pictures take: `pictures_ms` over `period_ms`.
    pub picture_share: f64,
    /// The same pictures again with a ray per pixel, after every tenth period and outside of all
    /// other times (ms). The stage is up to date then.
    pub traced_pictures_ms: f64,
    /// `traced_pictures_ms` over `pictures_ms`.
    pub picture_ratio: f64,
    /// Simulated length of a control period (ms).
    pub period_ms: f64,
    /// Number of control periods.
    pub periods: usize,
    /// Simulated time (s).
    pub simulated_s: f64,
    /// How the episode ended.
    pub end: String,
    /// All stages passed.
    pub passed: bool,
    /// Hash of the final state of the first run.
    pub state_hash: String,
    /// Whether all runs end in the same state.
    pub repeatable: bool,
    /// Names of the cameras.
    pub cameras: Vec<String>,
    /// Side of the pictures (px).
    pub size: usize,
    /// The kind of pictures behind `real_time_factor`.
    pub pictures: String,
    /// Mean time of ten path-traced frames of 1280 x 720 through the first camera (ms); none with 0
    /// samples.
    pub path_720p_ms: Option<f64>,
    /// Paths per pixel of these frames.
    pub samples: u32,
    /// Real-time factor with such a picture from every camera per control period, extrapolated from
    /// these frames.
    pub real_time_factor_path_720p: Option<f64>,
    /// What was stepped, and on what.
    #[serde(flatten)]
    pub setup: Setup,
}

/// Wall times of one run (s).
#[derive(Clone, Copy, Debug, Default)]
struct Took {
    arms: f64,
    tissue: f64,
    pictures: f64,
    traced: f64,
    all: f64,
}

impl Study for EpisodeBench {
    const NAME: &'static str = "episode";
    const KIND: Kind = Kind::Bench;
    const FOLDER: Option<&'static str> = None;
    const SCHEMA: u32 = 3;
    type Figures = EpisodeBenchResult;

    fn run(&self, job: &Job<'_>) -> Result<(EpisodeBenchResult, Document)> {
        if self.runs == 0 || !(1..=MAX_SIZE).contains(&self.size) {
            let given = format!("--runs {} --size {}", self.runs, self.size);
            return Err(Error::Mismatch(format!("{given}: needs at least 1 run and a size in [1, {MAX_SIZE}] px")));
        }
        let progress = job.progress;
        let scene = Scene::read(&self.scene.scene)?;
        let specimen = scene_specimen(&scene, &self.scene.phantoms, progress)?;
        let machine = Machine::here();
        let mut episode = Episode::new(&scene, &specimen, self.threads)?;
        let mut rig = CameraRig::new(&scene, &specimen, episode.cell())?;
        let mut scripted = policy::named("scripted")?;
        let (mut runs, mut hashes) = (Vec::new(), Vec::new());
        progress.begin("episodes", self.runs as u64);
        for _ in 0..self.runs {
            runs.push(self.once(&mut episode, &mut rig, scripted.as_mut(), progress)?);
            hashes.push(episode.state_hash());
            progress.advance(1);
        }
        progress.end();
        let periods = episode.rows().len();
        let ms = |of: fn(&Took) -> f64| {
            let mut values: Vec<f64> = runs.iter().map(|t| 1e3 * of(t) / periods.max(1) as f64).collect();
            median(&mut values)
        };
        let period_ms = 1e3 * episode.cell().period();
        let run_factors: Vec<f64> = runs.iter().map(|t| episode.time() / t.all.max(1e-9)).collect();
        let real_time_factor = median(&mut run_factors.clone());
        let path_720p_ms = (self.samples > 0).then(|| self.path_traced(&episode, &mut rig, progress)).transpose()?;
        let pictures_ms = ms(|t| t.pictures);
        let traced_pictures_ms = ms(|t| t.traced);
        let rest_of_period = ms(|t| t.all - t.pictures);
        let with_paths = |frame: f64| period_ms / (rest_of_period + frame * self.cameras.len() as f64);
        let result = EpisodeBenchResult {
            pictures: format!("previews of {0} x {0} pixels without shadows", self.size),
            real_time_factor_path_720p: path_720p_ms.map(with_paths),
            path_720p_ms,
            samples: self.samples,
            real_time_factor,
            bar: TARGET,
            met: real_time_factor >= TARGET,
            run_factors,
            arms_ms: ms(|t| t.arms),
            tissue_ms: ms(|t| t.tissue),
            pictures_ms,
            picture_share: pictures_ms / period_ms,
            traced_pictures_ms,
            picture_ratio: traced_pictures_ms / pictures_ms.max(1e-9),
            rest_ms: ms(|t| t.all - t.arms - t.tissue - t.pictures),
            period_ms,
            periods,
            simulated_s: episode.time(),
            end: episode.end().map_or("no end".to_owned(), ToString::to_string),
            passed: episode.summary().passed,
            state_hash: format!("{:016x}", hashes[0]),
            repeatable: hashes.iter().all(|h| *h == hashes[0]),
            cameras: self.cameras.clone(),
            size: self.size,
            setup: Setup::new(&episode.cell().world().model, self.threads, machine),
        };
        let document = document(&result);
        Ok((result, document))
    }
}

impl EpisodeBench {
    /// Mean wall time of path-traced frames of 1280 x 720 through the first camera, at the end of
    /// the episode (ms).
    fn path_traced(&self, episode: &Episode, rig: &mut CameraRig, progress: &dyn Progress) -> Result<f64> {
        let Some(camera) = self.cameras.first() else {
            return Err(Error::Mismatch("--camera: name at least one camera".to_owned()));
        };
        let settings = RenderSettings::path(self.samples);
        progress.begin("path-traced frames", PATH_FRAMES as u64);
        let clock = Instant::now();
        for _ in 0..PATH_FRAMES {
            check_interrupted(progress)?;
            rig.render(episode.cell(), camera, [1280, 720], &settings)?;
            progress.advance(1);
        }
        progress.end();
        Ok(1e3 * clock.elapsed().as_secs_f64() / PATH_FRAMES as f64)
    }

    fn once(
        &self,
        episode: &mut Episode,
        rig: &mut CameraRig,
        scripted: &mut dyn Policy,
        progress: &dyn Progress,
    ) -> Result<Took> {
        episode.reset(self.seed)?;
        scripted.begin(episode, self.seed)?;
        let before = episode.cell().timing();
        let (clock, mut pictures, mut traced) = (Instant::now(), Duration::ZERO, Duration::ZERO);
        let (mut periods, mut traced_periods) = (0_usize, 0_usize);
        'episode: while episode.end().is_none() {
            for action in scripted.act(episode)? {
                check_interrupted(progress)?;
                let ended = episode.step(&action)?.end.is_some();
                let before_pictures = Instant::now();
                for camera in &self.cameras {
                    let size = [self.size; 2];
                    rig.render(episode.cell(), camera, size, &RenderSettings::Preview { shadows: false })?;
                }
                pictures += before_pictures.elapsed();
                if periods.is_multiple_of(TRACED_EVERY) {
                    let before_traced = Instant::now();
                    for camera in &self.cameras {
                        let size = [self.size; 2];
                        rig.render(episode.cell(), camera, size, &RenderSettings::Traced { shadows: false })?;
                    }
                    traced += before_traced.elapsed();
                    traced_periods += 1;
                }
                periods += 1;
                if ended {
                    break 'episode;
                }
            }
        }
        let (all, now) = (clock.elapsed() - traced, episode.cell().timing());
        Ok(Took {
            arms: (now.arms - before.arms).as_secs_f64(),
            tissue: (now.tissue - before.tissue).as_secs_f64(),
            pictures: pictures.as_secs_f64(),
            // As if they had been made in every period.
            traced: traced.as_secs_f64() * periods as f64 / traced_periods.max(1) as f64,
            all: all.as_secs_f64(),
        })
    }
}

fn document(r: &EpisodeBenchResult) -> Document {
    let head = [
        "Pictures, once per control period",
        "times real time",
        "arms (ms)",
        "tissue (ms)",
        "pictures (ms)",
        "rest (ms)",
    ];
    let cameras = r.cameras.len();
    let row = |name: String, factor: f64, pictures: f64| {
        let times = [r.arms_ms, r.tissue_ms, pictures, r.rest_ms].map(|ms| fixed(ms, 2));
        [name, fixed(factor, if factor < 0.1 { 4 } else { 2 })].into_iter().chain(times).collect::<Vec<_>>()
    };
    let mut rows = vec![row(format!("{cameras} {}", r.pictures), r.real_time_factor, r.pictures_ms)];
    if let (Some(factor), Some(ms)) = (r.real_time_factor_path_720p, r.path_720p_ms) {
        let name = format!(
            "{cameras} of 1280 x 720 pixels, {} paths per pixel (extrapolated from {PATH_FRAMES} frames)",
            r.samples
        );
        rows.push(row(name, factor, ms * cameras as f64));
    }
    let factors = r.run_factors.iter().map(|f| fixed(*f, 2)).collect::<Vec<_>>().join(", ");
    let mut lines = vec![
        format!("target {}; runs {factors}; control period {} ms", r.bar, fixed(r.period_ms, 1)),
        format!(
            "{} s simulated, {}, {} periods; {}; {}",
            fixed(r.simulated_s, 1),
            r.end,
            r.periods,
            r.cameras.join(", "),
            r.setup.described()
        ),
    ];
    lines.push(format!(
        "pictures take {}% of a control period; with a ray per pixel {} ms, {} times as long",
        fixed(100.0 * r.picture_share, 1),
        fixed(r.traced_pictures_ms, 2),
        fixed(r.picture_ratio, 1)
    ));
    if !r.repeatable {
        lines.push("the runs ended in DIFFERENT states".to_owned());
    }
    let lead = "The scripted controller performs the task of the scene. The pictures of the first row are previews \
                for policies, small and without shadows; those of the second row are like the paper's figures.";
    Document::new("Episode", "Speed of a whole episode")
        .with(Section::new("Episode", lead).table(Table::new(head, rows)).lines(lines))
}
