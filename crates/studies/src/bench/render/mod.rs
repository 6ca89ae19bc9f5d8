//! Cost of pictures: a preview for policies with deforming organs, a path-traced frame, and rays
//! per second beside Embree.

mod rays;

pub use rays::RayRow;

use crate::Result;
use crate::machine::Machine;
use crate::scenes::{LaparoscopicScene, endoscope_view};
use crate::statistics::median;
use crate::study::{Job, Kind, Study};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;
use trocar_camera::{Camera, Endoscope};
use trocar_cell::Cell;
use trocar_core::{Pose, Progress};
use trocar_render::{
    Appearance, BodyId, Film, Light, Picture, RayGenerator, RenderSettings, ShapeId, Stage, render, render_into,
};
use trocar_report::document::{Document, Section, Table};
use trocar_report::table::{count, fixed};
use trocar_scene::Scene;
use trocar_sensors::CameraRig;
use trocar_workflow::scene_specimen;
use trocar_workflow::{ScriptedLift, check_interrupted};

/// Index of the organ that deforms.
const MOVING: usize = 1;
/// Timed frames. A tenth as many warm-up frames come first.
const FRAMES: usize = 60;

/// Cost of pictures: a preview for policies, a path-traced frame, rays beside Embree.
#[derive(Clone, Debug, Args)]
pub struct RenderBench {
    /// Approximate number of triangles of the organs; a fifth of them deform.
    #[arg(long, default_value_t = 100_000)]
    pub triangles: usize,
    /// Paths per pixel of the large picture; 0 for none.
    #[arg(long, default_value_t = 64)]
    pub samples: u32,
    /// Side of the square image of rays cast beside Embree.
    #[arg(long, default_value_t = 1024)]
    pub rays: usize,
    /// Python with the package embreex.
    #[arg(long, default_value = "python3")]
    pub python: PathBuf,
    /// Output file of the large picture (PNG).
    #[arg(long, value_name = "FILE")]
    pub picture: Option<PathBuf>,
    /// Scene file or built-in scene whose cameras are measured; "none" for none.
    #[arg(long, default_value = "cell-a")]
    pub scene: String,
    /// Folder of phantoms. A phantom is made once and used again (default: $TROCAR_PHANTOMS, else
    /// trocar/phantoms in the user's cache)
    #[arg(long, value_name = "FOLDER", default_value_os_t = trocar_phantom::phantoms_folder(), hide_default_value = true)]
    pub phantoms: PathBuf,
}

/// Figures of the benchmark.
#[derive(Clone, Debug, Serialize)]
pub struct RenderBenchResult {
    /// The cameras of the scene; none without a scene.
    pub cell: Option<CellRow>,
    /// Median time of a frame of 224 x 224 with colour, depth, labels and normals, without shadows,
    /// as policies see it, after each control period of the grasp-lift: of the first camera of the
    /// scene, without a scene of the loops of bowel (ms).
    pub preview_224_ms: f64,
    /// The same with a ray per pixel, measured in turn with it (ms).
    pub traced_preview_224_ms: f64,
    /// `traced_preview_224_ms` over `preview_224_ms`.
    pub preview_ratio: f64,
    /// Target of the ratio.
    pub preview_bar: f64,
    /// The median of pictures from nothing: the first through a camera, for which nothing is kept
    /// (ms). Without a scene, as `preview_224_ms`.
    pub fresh_preview_224_ms: f64,
    /// `traced_preview_224_ms` over `fresh_preview_224_ms`.
    pub fresh_preview_ratio: f64,
    /// Fastest frame (ms): the speed of an undisturbed machine.
    pub preview_224_best_ms: f64,
    /// The median with hard shadows (ms).
    pub preview_224_shadowed_ms: f64,
    /// Median time of updating the stage from the cell; without a scene, of refitting the loops of
    /// bowel (ms).
    pub refit_ms: f64,
    /// Triangles of the loops of bowel.
    pub triangles: usize,
    /// Triangles of them refitted in each frame.
    pub refitted_triangles: usize,
    /// Median time of a frame of 224 x 224 of the loops of bowel, without shadows (ms).
    pub loops_224_ms: f64,
    /// The same with a ray per pixel (ms).
    pub traced_loops_224_ms: f64,
    /// Building all trees of the loops of bowel (ms).
    pub build_ms: f64,
    /// One frame of 1280 x 720 with `samples` paths per pixel (ms); none with 0 samples.
    pub path_720p_ms: Option<f64>,
    /// Paths per pixel of that frame.
    pub samples: u32,
    /// The same frame with a quarter of the paths, whose noise is filtered out (ms).
    pub denoised_720p_ms: Option<f64>,
    /// `path_720p_ms` over `denoised_720p_ms`.
    pub path_over_denoised: Option<f64>,
    /// Root mean square of the colour's error in a frame of 320 x 180 with `samples` paths, beside
    /// one with sixteen times as many (levels of 255).
    pub path_error: Option<f64>,
    /// The same with a quarter of the paths, filtered.
    pub denoised_error: Option<f64>,
    /// Rays on one thread, by kind.
    pub rays: Vec<RayRow>,
    /// Why Embree was not measured.
    pub embree_failure: Option<String>,
    /// Worker threads for pictures.
    pub threads: usize,
    /// The machine.
    pub machine: Machine,
}

/// The cameras of a cell.
#[derive(Clone, Debug, Serialize)]
pub struct CellRow {
    /// Name of the scene.
    pub scene: String,
    /// Triangles on the stage.
    pub triangles: usize,
    /// Building the stage: organs, arms, instruments, all trees (ms).
    pub begin_ms: f64,
    /// Median time of updating the stage from the cell (ms).
    pub follow_ms: f64,
    /// The cameras, with pictures of 224 x 224.
    pub cameras: Vec<CameraRow>,
}

/// One camera of a cell.
#[derive(Clone, Debug, Serialize)]
pub struct CameraRow {
    /// Name of the camera.
    pub camera: String,
    /// Median time of a frame without shadows, the update of the stage included (ms).
    pub ms: f64,
    /// Fastest such frame (ms).
    pub best_ms: f64,
    /// Median time of such a frame from nothing, as the first through a camera (ms).
    pub fresh_ms: f64,
    /// Median time of such a frame with a ray per pixel (ms).
    pub traced_ms: f64,
    /// Median time of a frame with hard shadows (ms).
    pub shadowed_ms: f64,
    /// Median time of a frame with hard shadows and a ray per pixel (ms).
    pub traced_shadowed_ms: f64,
}

/// The kinds of frames, in the order of the columns of [`CameraRow`].
const KINDS: [RenderSettings; 4] = [
    RenderSettings::Preview { shadows: false },
    RenderSettings::Traced { shadows: false },
    RenderSettings::Preview { shadows: true },
    RenderSettings::Traced { shadows: true },
];

/// Target of the time of a traced preview over that of a rasterised one.
const BAR: f64 = 5.0;

/// The loops of bowel on a stage.
struct Set {
    scene: LaparoscopicScene,
    stage: Stage,
    moving: ShapeId,
    instruments: [BodyId; 2],
    view: Pose,
    picture: Picture,
}

impl Set {
    fn new(triangles: usize) -> Result<Self> {
        let scene = LaparoscopicScene::new(triangles / 5);
        let view = endoscope_view();
        let mut stage = Stage::new();
        let mut shapes = Vec::new();
        for (i, organ) in scene.organs.iter().enumerate() {
            shapes.push(stage.add_mesh(organ, i as u16 + 1, &Appearance::tissue([200, 110, 100]))?.0);
        }
        let instrument = stage.add_shape(&scene.instrument)?;
        let mut place = |right: bool, label| {
            stage.add_body(instrument, &scene.instrument_pose(right, 0.0), label, &Appearance::steel())
        };
        let instruments = [place(false, 101)?, place(true, 102)?];
        stage.lights.push(Light::endoscope(&view, 0.006, 0.11));
        stage.environment = [0.02; 3];
        Ok(Self { moving: shapes[MOVING], scene, stage, instruments, view, picture: Picture::default() })
    }

    /// Times of frames in turn, rasterised and traced (ms): the median of each, and the least of
    /// the first.
    fn preview(&mut self) -> Result<([f64; 2], f64)> {
        let Endoscope { camera, .. } = Endoscope::thirty_degrees();
        // The square centre of the endoscope's picture.
        let scale = 224.0 / camera.height as f64;
        let policy = Camera {
            width: 224,
            height: 224,
            fx: camera.fx * scale,
            fy: camera.fy * scale,
            cx: 111.5,
            cy: 111.5,
            ..camera
        };
        let eye = RayGenerator::new(policy);
        let film = Film::endoscope();
        let mut times = [Vec::with_capacity(FRAMES), Vec::with_capacity(FRAMES)];
        for frame in 0..FRAMES + FRAMES / 10 {
            for (kind, times) in times.iter_mut().enumerate() {
                let t = (2 * frame + kind) as f64 / 30.0;
                let positions = self.scene.moved(MOVING, t);
                let poses = [false, true].map(|right| self.scene.instrument_pose(right, t));
                let clock = Instant::now();
                self.stage.deform(self.moving, &positions)?;
                for (body, pose) in self.instruments.iter().zip(&poses) {
                    self.stage.place(*body, pose)?;
                }
                render_into(&mut self.picture, &mut self.stage, &eye, &self.view, &KINDS[kind], &film);
                let took = 1e3 * clock.elapsed().as_secs_f64();
                std::hint::black_box(&self.picture);
                if frame >= FRAMES / 10 {
                    times.push(took);
                }
            }
        }
        let [raster, traced] = &mut times;
        Ok(([median(raster), median(traced)], raster[0]))
    }

    fn refit(&mut self) -> Result<f64> {
        let mut times = Vec::with_capacity(FRAMES);
        for frame in 0..FRAMES {
            let positions = self.scene.moved(MOVING, frame as f64 / 30.0);
            let clock = Instant::now();
            self.stage.deform(self.moving, &positions)?;
            times.push(1e3 * clock.elapsed().as_secs_f64());
        }
        Ok(median(&mut times))
    }
}

impl Study for RenderBench {
    const NAME: &'static str = "render";
    const KIND: Kind = Kind::Bench;
    const FOLDER: Option<&'static str> = None;
    const SCHEMA: u32 = 4;
    type Figures = RenderBenchResult;

    fn run(&self, job: &Job<'_>) -> Result<(RenderBenchResult, Document)> {
        let machine = Machine::here();
        let progress = job.progress;
        progress.begin("measurements", 5);
        let step = || {
            progress.advance(1);
            check_interrupted(progress)
        };
        let cell = (self.scene != "none").then(|| self.cell(&self.scene, progress)).transpose()?;
        let clock = Instant::now();
        let mut set = Set::new(self.triangles)?;
        let build_ms = 1e3 * clock.elapsed().as_secs_f64();
        let ([loops_224_ms, traced_loops_224_ms], loops_best_ms) = set.preview()?;
        step()?;
        let loops_refit_ms = set.refit()?;
        step()?;
        let whole = rays::merged(&set.scene.organs);
        let (rays, embree_failure) = rays::measure(&whole, &set.view, self.rays, &self.python)?;
        step()?;
        let paths = if self.samples > 0 { Some(self.paths(&mut set)?) } else { None };
        step()?;
        progress.end();
        let first = cell.as_ref().and_then(|c| c.cameras.first());
        let preview_224_ms = first.map_or(loops_224_ms, |c| c.ms);
        let traced_preview_224_ms = first.map_or(traced_loops_224_ms, |c| c.traced_ms);
        let fresh_preview_224_ms = first.map_or(preview_224_ms, |c| c.fresh_ms);
        let result = RenderBenchResult {
            preview_224_ms,
            traced_preview_224_ms,
            preview_ratio: traced_preview_224_ms / preview_224_ms,
            preview_bar: BAR,
            fresh_preview_224_ms,
            fresh_preview_ratio: traced_preview_224_ms / fresh_preview_224_ms,
            preview_224_shadowed_ms: first.map_or(loops_224_ms, |c| c.shadowed_ms),
            preview_224_best_ms: first.map_or(loops_best_ms, |c| c.best_ms),
            refit_ms: cell.as_ref().map_or(loops_refit_ms, |c| c.follow_ms),
            cell,
            loops_224_ms,
            traced_loops_224_ms,
            triangles: set.stage.triangles(),
            refitted_triangles: set.scene.organs[MOVING].triangles.len(),
            build_ms,
            path_720p_ms: paths.map(|p| p.times_ms[0]),
            samples: self.samples,
            denoised_720p_ms: paths.map(|p| p.times_ms[1]),
            path_over_denoised: paths.map(|p| p.times_ms[0] / p.times_ms[1]),
            path_error: paths.map(|p| p.errors[0]),
            denoised_error: paths.map(|p| p.errors[1]),
            rays,
            embree_failure,
            threads: rayon::current_num_threads(),
            machine,
        };
        let document = document(&result);
        Ok((result, document))
    }
}

impl RenderBench {
    /// Times the cameras of the cell during the grasp-lift, after each control period, which is not
    /// timed.
    fn cell(&self, name: &str, progress: &dyn Progress) -> Result<CellRow> {
        let scene = Scene::read(name)?;
        let specimen = scene_specimen(&scene, &self.phantoms, progress)?;
        let mut script = ScriptedLift::new(&scene, &specimen, 0)?;
        let clock = Instant::now();
        let mut rig = CameraRig::new(&scene, &specimen, script.cell())?;
        let begin_ms = 1e3 * clock.elapsed().as_secs_f64();
        let names: Vec<String> = scene.cameras.iter().map(|c| c.name.clone()).collect();
        // By camera and kind.
        let mut times = vec![[const { Vec::new() }; KINDS.len()]; names.len()];
        let (mut forgetful, mut fresh) = (rig.clone(), vec![Vec::new(); names.len()]);
        let mut follow = Vec::new();
        for frame in 0..FRAMES + FRAMES / 10 {
            let mut step =
                |timed: &mut dyn FnMut(&mut CameraRig, &Cell) -> Result<()>, times: &mut Vec<f64>| -> Result<()> {
                    check_interrupted(progress)?;
                    if !script.advance()? {
                        // The grasp-lift begins again: arms move in every period.
                        script = ScriptedLift::new(&scene, &specimen, 0)?;
                        script.advance()?;
                    }
                    let clock = Instant::now();
                    timed(&mut rig, script.cell())?;
                    if frame >= FRAMES / 10 {
                        times.push(1e3 * clock.elapsed().as_secs_f64());
                    }
                    Ok(())
                };
            // One camera and one kind per period: everything has moved before each picture.
            let k = frame % names.len().max(1);
            if let (Some(camera), Some(times), Some(fresh)) = (names.get(k), times.get_mut(k), fresh.get_mut(k)) {
                for (kind, times) in KINDS.iter().zip(times) {
                    let mut see = |rig: &mut CameraRig, cell: &Cell| -> Result<()> {
                        std::hint::black_box(rig.render(cell, camera, [224; 2], kind)?);
                        Ok(())
                    };
                    step(&mut see, times)?;
                }
                let mut see = |_: &mut CameraRig, cell: &Cell| -> Result<()> {
                    forgetful.forget_pictures();
                    std::hint::black_box(forgetful.render(cell, camera, [224; 2], &KINDS[0])?);
                    Ok(())
                };
                step(&mut see, fresh)?;
            }
            step(&mut |rig, cell| Ok(rig.update(cell)?), &mut follow)?;
        }
        let cameras = names
            .into_iter()
            .zip(times.iter_mut().zip(&mut fresh))
            .map(|(camera, ([raster, traced, shadowed, traced_shadowed], fresh))| {
                let ms = median(raster);
                CameraRow {
                    camera,
                    ms,
                    best_ms: raster.first().copied().unwrap_or(ms),
                    fresh_ms: median(fresh),
                    traced_ms: median(traced),
                    shadowed_ms: median(shadowed),
                    traced_shadowed_ms: median(traced_shadowed),
                }
            })
            .collect();
        let (scene, triangles, follow_ms) = (scene.name, rig.triangles(), median(&mut follow));
        Ok(CellRow { scene, triangles, begin_ms, follow_ms, cameras })
    }

    /// Path-traced pictures, as they are and with a quarter of the paths and filtered.
    fn paths(&self, set: &mut Set) -> Result<Paths> {
        let camera = Endoscope::thirty_degrees().camera;
        let kinds = [RenderSettings::path(self.samples), RenderSettings::denoised(self.samples.div_ceil(4))];
        let mut see = |camera: Camera, settings: &RenderSettings| {
            render(&mut set.stage, &RayGenerator::new(camera), &set.view, settings, &Film::endoscope())
        };
        let mut times_ms = [0.0; 2];
        for (settings, time) in kinds.iter().zip(&mut times_ms) {
            let clock = Instant::now();
            let picture = see(camera, settings);
            *time = 1e3 * clock.elapsed().as_secs_f64();
            if let Some(path) = self.picture.as_ref().filter(|_| *settings == kinds[0]) {
                picture.color.write_png(path)?;
            }
        }
        let scale = 0.25;
        let small = Camera {
            width: camera.width / 4,
            height: camera.height / 4,
            fx: camera.fx * scale,
            fy: camera.fy * scale,
            cx: (camera.cx + 0.5) * scale - 0.5,
            cy: (camera.cy + 0.5) * scale - 0.5,
            ..camera
        };
        let more = RenderSettings::Path { samples: 16 * self.samples, bounces: 8, seed: 1, denoise: false };
        let truth = see(small, &more).color.pixels;
        let error = |settings: &RenderSettings| -> f64 {
            let made = see(small, settings).color.pixels;
            let channels = made.iter().flatten().zip(truth.iter().flatten());
            let squares: f64 = channels.map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
            (squares / (3 * truth.len()) as f64).sqrt()
        };
        Ok(Paths { times_ms, errors: [&kinds[0], &kinds[1]].map(error) })
    }
}

/// Path-traced pictures: as they are, and with a quarter of the paths and filtered.
#[derive(Clone, Copy)]
struct Paths {
    times_ms: [f64; 2],
    errors: [f64; 2],
}

fn document(r: &RenderBenchResult) -> Document {
    let mut lines = Vec::new();
    let mut rows = Vec::new();
    if let Some(cell) = &r.cell {
        lines.push(format!(
            "{}: {} triangles, built in {} ms; updated from the cell in {} ms",
            cell.scene,
            count(cell.triangles),
            fixed(cell.begin_ms, 0),
            fixed(cell.follow_ms, 2)
        ));
        for c in &cell.cameras {
            let ms = [c.ms, c.best_ms, c.fresh_ms, c.traced_ms].map(|ms| fixed(ms, 2));
            let shadowed = [fixed(c.traced_ms / c.ms, 1), fixed(c.shadowed_ms, 2), fixed(c.traced_shadowed_ms, 2)];
            rows.push([c.camera.clone()].into_iter().chain(ms).chain(shadowed).collect::<Vec<_>>());
        }
    }
    let ratio = fixed(r.traced_loops_224_ms / r.loops_224_ms, 1);
    let loops = ["loops of bowel".to_owned(), fixed(r.loops_224_ms, 2), String::new(), String::new()];
    let traced = [fixed(r.traced_loops_224_ms, 2), ratio, String::new(), String::new()];
    rows.push(loops.into_iter().chain(traced).collect());
    lines.push(format!(
        "loops of bowel: {} triangles, {} of them refitted each frame; all trees built in {} ms; {} threads on {}",
        count(r.triangles),
        count(r.refitted_triangles),
        fixed(r.build_ms, 0),
        r.threads,
        r.machine.described()
    ));
    if let Some(ms) = r.path_720p_ms {
        lines.push(format!("1280 x 720 pixels with {} paths each: {} s", r.samples, fixed(1e-3 * ms, 1)));
    }
    if let (Some(ms), Some(ratio), Some(path), Some(filtered)) =
        (r.denoised_720p_ms, r.path_over_denoised, r.path_error, r.denoised_error)
    {
        lines.push(format!(
            "with a quarter of the paths and filtered: {} s, {} times as fast; error of the colour {} instead of {} \
             of 255",
            fixed(1e-3 * ms, 1),
            fixed(ratio, 1),
            fixed(filtered, 2),
            fixed(path, 2)
        ));
    }
    lines.extend(r.embree_failure.as_ref().map(|why| format!("Embree: {why}")));
    let dash = || "\u{2013}".to_owned();
    let million = |x: Option<f64>| x.map_or_else(dash, |x| fixed(1e-6 * x, 2));
    let rays = Table::of(
        &r.rays,
        &[
            ("Rays", &|row| row.kind.to_owned()),
            ("count", &|row| count(row.rays)),
            ("ours (M/s)", &|row| million(Some(row.rays_per_second))),
            ("Embree (M/s)", &|row| million(row.embree_rays_per_second)),
            ("ratio", &|row| row.ratio.map_or_else(dash, |x| fixed(x, 2))),
            ("differ", &|row| row.differing.map_or_else(dash, count)),
            ("largest difference (\u{b5}m)", &|row| row.largest_difference_m.map_or_else(dash, |x| fixed(1e6 * x, 2))),
        ],
    );
    let pictures = [
        "224 x 224 pixels",
        "preview (ms)",
        "best (ms)",
        "first (ms)",
        "traced (ms)",
        "ratio",
        "with shadows (ms)",
        "traced (ms)",
    ];
    let lead = "The first picture is made from nothing. Later ones of a camera that stands still begin with what is at \
                rest.";
    Document::new("Render", "Cost of pictures")
        .with(Section::new("Previews", lead).table(Table::new(pictures, rows)).lines(lines))
        .with(Section::new("Rays on one thread", "").table(rays))
}
