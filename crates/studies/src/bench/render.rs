//! What pictures cost: a policy's preview with an organ refitted, a path-traced frame, and rays a second beside Embree.

mod rays;

pub use rays::RayRow;

use super::Machine;
use super::median;
use crate::{Error, Result};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;
use trocar_camera::{Camera, Endoscope};
use trocar_cell::Cell;
use trocar_core::{Pose, Progress};
use trocar_render::{Appearance, BodyId, Film, Light, RayGenerator, RenderSettings, ShapeId, Stage, render};
use trocar_scene::Scene;
use trocar_sensors::CameraRig;
use trocar_testing::scenes::{LaparoscopicScene, endoscope_view};
use trocar_workflow::ScriptedLift;
use trocar_workflow::scene_specimen;

/// The organ that deforms.
const MOVING: usize = 1;
/// Frames that are timed, after a tenth as many that are not.
const FRAMES: usize = 60;

/// The benchmark's options.
#[derive(Clone, Debug)]
pub struct RenderBench {
    /// Triangles of all organs, about; a fifth of them deform.
    pub triangles: usize,
    /// Paths a pixel of the large picture; 0 leaves it out.
    pub samples: u32,
    /// Side of the square image of rays for the comparison with Embree.
    pub rays: usize,
    /// Python with `embreex`.
    pub python: PathBuf,
    /// Where to write the large picture (PNG); nowhere if left out.
    pub picture: Option<PathBuf>,
    /// Scene whose cameras are measured while its grasp-lift goes on; none if left out.
    pub scene: Option<String>,
    /// Folder in which its phantom is recorded and reconstructed.
    pub phantoms: PathBuf,
}

/// The benchmark's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct RenderBenchResult {
    /// The scene through its cameras; left out without a scene.
    pub cell: Option<CellRow>,
    /// Median of a frame of 224 x 224 with colour, depth and labels, all deformed organs refitted and arms moved, hard shadows: of the scene through its first camera, or else of the stage of
    /// loops of bowel [ms].
    pub preview_224_ms: f64,
    /// The same without shadows [ms].
    pub preview_224_unshadowed_ms: f64,
    /// The fastest frame with shadows [ms]: what the machine can do when it is left alone.
    pub preview_224_best_ms: f64,
    /// Median of bringing the stage to where the cell is, or of the refit alone [ms].
    pub refit_ms: f64,
    /// Triangles of the loops of bowel.
    pub triangles: usize,
    /// Triangles of them that are refitted each frame.
    pub refitted_triangles: usize,
    /// Median of a frame of 224 x 224 of the loops of bowel with hard shadows [ms].
    pub loops_224_ms: f64,
    /// The same without shadows [ms].
    pub loops_224_unshadowed_ms: f64,
    /// Building all trees anew [ms].
    pub build_ms: f64,
    /// One frame of 1280 x 720 at `samples` paths a pixel [ms]; left out with 0 samples.
    pub path_720p_ms: Option<f64>,
    /// Paths a pixel of it.
    pub samples: u32,
    /// Rays on one thread, by kind of ray, beside Embree.
    pub rays: Vec<RayRow>,
    /// Why Embree was not measured.
    pub embree_failure: Option<String>,
    /// Worker threads for pictures.
    pub threads: usize,
    /// Where this was measured.
    pub machine: Machine,
}

/// A cell through its cameras.
#[derive(Clone, Debug, Serialize)]
pub struct CellRow {
    /// The scene.
    pub scene: String,
    /// Triangles on the stage.
    pub triangles: usize,
    /// Making the sight: field, arms, instruments, all trees [ms].
    pub begin_ms: f64,
    /// Median of bringing the stage to where the cell is [ms].
    pub follow_ms: f64,
    /// The cameras, 224 x 224.
    pub cameras: Vec<CameraRow>,
}

/// One camera of a cell.
#[derive(Clone, Debug, Serialize)]
pub struct CameraRow {
    /// Its name.
    pub camera: String,
    /// Median of a frame with shadows, all that has moved included [ms].
    pub ms: f64,
    /// The fastest [ms].
    pub best_ms: f64,
    /// Median without shadows [ms].
    pub unshadowed_ms: f64,
}

/// The scene on a stage.
struct Set {
    scene: LaparoscopicScene,
    stage: Stage,
    moving: ShapeId,
    instruments: [BodyId; 2],
    view: Pose,
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
        Ok(Self { moving: shapes[MOVING], scene, stage, instruments, view })
    }

    /// Median and least time of a frame [ms].
    fn preview(&mut self, shadows: bool) -> Result<(f64, f64)> {
        let Endoscope { camera, .. } = Endoscope::thirty_degrees();
        // The square middle of the endoscope's picture.
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
        let mut times = Vec::with_capacity(FRAMES);
        for frame in 0..FRAMES + FRAMES / 10 {
            let t = frame as f64 / 30.0;
            let positions = self.scene.moved(MOVING, t);
            let poses = [false, true].map(|right| self.scene.instrument_pose(right, t));
            let clock = Instant::now();
            self.stage.deform(self.moving, &positions)?;
            for (body, pose) in self.instruments.iter().zip(&poses) {
                self.stage.place(*body, pose)?;
            }
            let picture = render(&mut self.stage, &eye, &self.view, &RenderSettings::Preview { shadows }, &film);
            let took = 1e3 * clock.elapsed().as_secs_f64();
            std::hint::black_box(picture);
            if frame >= FRAMES / 10 {
                times.push(took);
            }
        }
        Ok((median(&mut times), times[0]))
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

impl RenderBench {
    /// Runs everything.
    ///
    /// # Errors
    /// An interruption, or a picture that cannot be written. Embree that cannot be run is told in the result.
    pub fn run(&self, progress: &dyn Progress) -> Result<RenderBenchResult> {
        let machine = Machine::here();
        progress.begin("measurements", 5);
        let step = || {
            progress.advance(1);
            if progress.interrupted() { Err(Error::Interrupted) } else { Ok(()) }
        };
        let cell = self.scene.as_ref().map(|scene| self.cell(scene, progress)).transpose()?;
        let clock = Instant::now();
        let mut set = Set::new(self.triangles)?;
        let build_ms = 1e3 * clock.elapsed().as_secs_f64();
        let (loops_224_ms, loops_best_ms) = set.preview(true)?;
        let (loops_224_unshadowed_ms, _) = set.preview(false)?;
        step()?;
        let loops_refit_ms = set.refit()?;
        step()?;
        let whole = rays::merged(&set.scene.organs);
        let (mut rays, embree_failure) = self.rays(&whole, &set.view)?;
        rays.shrink_to_fit();
        step()?;
        let path_720p_ms = if self.samples > 0 { Some(self.path(&mut set)?) } else { None };
        step()?;
        progress.end();
        let first = cell.as_ref().and_then(|c| c.cameras.first());
        Ok(RenderBenchResult {
            preview_224_ms: first.map_or(loops_224_ms, |c| c.ms),
            preview_224_unshadowed_ms: first.map_or(loops_224_unshadowed_ms, |c| c.unshadowed_ms),
            preview_224_best_ms: first.map_or(loops_best_ms, |c| c.best_ms),
            refit_ms: cell.as_ref().map_or(loops_refit_ms, |c| c.follow_ms),
            cell,
            loops_224_ms,
            loops_224_unshadowed_ms,
            triangles: set.stage.triangles(),
            refitted_triangles: set.scene.organs[MOVING].triangles.len(),
            build_ms,
            path_720p_ms,
            samples: self.samples,
            rays,
            embree_failure,
            threads: rayon::current_num_threads(),
            machine,
        })
    }

    /// The cell's cameras while the grasp-lift goes on: frames of all of them after each period, which is not timed.
    fn cell(&self, name: &str, progress: &dyn Progress) -> Result<CellRow> {
        let scene = Scene::read(name)?;
        let specimen = scene_specimen(&scene, &self.phantoms, progress)?;
        let mut script = ScriptedLift::new(&scene, &specimen, 0)?;
        let clock = Instant::now();
        let mut sight = CameraRig::new(&scene, &specimen, script.cell())?;
        let begin_ms = 1e3 * clock.elapsed().as_secs_f64();
        let names: Vec<String> = scene.cameras.iter().map(|c| c.name.clone()).collect();
        let mut shadowed = vec![Vec::new(); names.len()];
        let mut plain = shadowed.clone();
        let mut follow = Vec::new();
        for frame in 0..FRAMES + FRAMES / 10 {
            let mut step =
                |timed: &mut dyn FnMut(&mut CameraRig, &Cell) -> Result<()>, times: &mut Vec<f64>| -> Result<()> {
                    if progress.interrupted() {
                        return Err(Error::Interrupted);
                    }
                    script.advance()?;
                    let clock = Instant::now();
                    timed(&mut sight, script.cell())?;
                    if frame >= FRAMES / 10 {
                        times.push(1e3 * clock.elapsed().as_secs_f64());
                    }
                    Ok(())
                };
            // A camera and a kind a period, so that all that moves has moved before each.
            let k = frame % names.len().max(1);
            let see = |shadows: bool| {
                let camera = &names[k];
                move |sight: &mut CameraRig, cell: &Cell| -> Result<()> {
                    std::hint::black_box(sight.render(cell, camera, [224; 2], &RenderSettings::Preview { shadows })?);
                    Ok(())
                }
            };
            if !names.is_empty() {
                step(&mut see(true), &mut shadowed[k])?;
                step(&mut see(false), &mut plain[k])?;
            }
            step(&mut |sight, cell| Ok(sight.update(cell)?), &mut follow)?;
        }
        let rows = names.into_iter().zip(shadowed.iter_mut().zip(&mut plain));
        let cameras = rows
            .map(|(camera, (shadowed, plain))| {
                let ms = median(shadowed);
                let best_ms = shadowed.first().copied().unwrap_or(ms);
                CameraRow { camera, ms, best_ms, unshadowed_ms: median(plain) }
            })
            .collect();
        let (scene, triangles, follow_ms) = (scene.name, sight.triangles(), median(&mut follow));
        Ok(CellRow { scene, triangles, begin_ms, follow_ms, cameras })
    }

    fn path(&self, set: &mut Set) -> Result<f64> {
        let eye = RayGenerator::new(Endoscope::thirty_degrees().camera);
        let clock = Instant::now();
        let picture = render(&mut set.stage, &eye, &set.view, &RenderSettings::path(self.samples), &Film::endoscope());
        let took = 1e3 * clock.elapsed().as_secs_f64();
        if let Some(path) = &self.picture {
            picture.color.write_png(path)?;
        }
        Ok(took)
    }
}
