//! Contact of the fast solver beside the oracle's and beside Hertz: a sphere pressed on a layer of
//! tissue, a capsule dragged along it, a body on it.

mod page;
mod result;
mod scene;
mod theory;

pub use result::{BodyRow, ContactResult, DragRow, SceneRow, SphereRow};

use crate::Result;
use crate::scenes::{FRAME, reference};
use crate::study::{Job, Kind, Study};
use clap::Args;
use glam::DVec3;
use scene::{Base, THICKNESS, WIDTH};
use trocar_core::{Pose, Progress};
use trocar_report::document::Document;
use trocar_tissue::{Grasp, Material, Model, Shape, SolverSettings, State, Stepper, ToolContact, ToolMotion};
use trocar_tissue_reference::{Held, Oracle, OracleState};
use trocar_workflow::check_interrupted;

/// Radius of the sphere and of the capsule (m).
const RADIUS: f64 = 4e-3;
const CAPSULE_RADIUS: f64 = 3e-3;

/// How far the capsule and the body are pressed (m).
const CAPSULE_DEPTH: f64 = 1e-3;
const BODY_DEPTH: f64 = 2e-3;

/// Way of the capsule along the layer (m), and its friction.
const WAY: f64 = 3e-3;
const FRICTION: f64 = 0.15;

/// Frames to press and to come to rest.
const DOWN: u32 = 30;
const REST: u32 = 60;

/// Steps in which the oracle's tool goes down.
const PARTS: u32 = 4;

/// Contact that gives way by next to nothing, over the model's.
const STIFF: f64 = 50.0;

/// A contact's force by the fast solver beside the oracle's on the same mesh, and that of a scene's
/// tissue beside Hertz's.
#[derive(Clone, Debug, Args)]
pub struct ContactExperiment {
    /// Elements over the thickness of the layer (8 mm); 2, 4 and 6 by default.
    #[arg(long = "cells", value_delimiter = ',', value_parser = clap::value_parser!(u16).range(1..=16))]
    pub cells: Vec<u16>,
    /// Elements over the thickness of layers of a scene's tissue, which the default solver presses
    /// on.
    #[arg(long, value_name = "CELLS", value_delimiter = ',', value_parser = clap::value_parser!(u16).range(1..=16),
          default_values_t = [8, 10, 12, 14])]
    pub scene_cells: Vec<u16>,
    /// Cells of the lattice over the thickness of these layers.
    #[arg(long, value_name = "CELLS", value_delimiter = ',', value_parser = clap::value_parser!(u16).range(1..=16),
          default_values_t = [6, 8, 10])]
    pub lattice_cells: Vec<u16>,
    /// Poisson's ratios of these layers.
    #[arg(long, value_name = "RATIOS", value_delimiter = ',', default_values_t = [0.3, 0.45, 0.49, 0.499])]
    pub scene_ratios: Vec<f64>,
    /// Young's modulus (Pa).
    #[arg(long, default_value_t = 5e3)]
    pub young_modulus: f64,
    /// Poisson's ratio beside the oracle.
    #[arg(long, default_value_t = 0.3)]
    pub poisson_ratio: f64,
    /// Depth of the sphere (mm).
    #[arg(long, default_value_t = 1.2)]
    pub depth_mm: f64,
    /// Speed of the dragged capsule (mm/s).
    #[arg(long, default_value_t = 6.0)]
    pub speed_mm_s: f64,
}

impl Study for ContactExperiment {
    const NAME: &'static str = "contact";
    const KIND: Kind = Kind::Experiment;
    const SCHEMA: u32 = 3;
    type Figures = ContactResult;

    fn run(&self, job: &Job<'_>) -> Result<(ContactResult, Document)> {
        let invalid = |what: &str| crate::Error::Mismatch(what.to_owned());
        if !(self.depth_mm > 0.0 && self.depth_mm <= 4.0) {
            return Err(invalid("--depth-mm must be above 0 and at most 4"));
        }
        if !(self.speed_mm_s >= 0.5 && self.speed_mm_s <= 50.0) {
            return Err(invalid("--speed-mm-s must be in 0.5 to 50"));
        }
        job.claim()?;
        let cells: Vec<usize> = match &self.cells[..] {
            [] => vec![2, 4, 6],
            cells => cells.iter().map(|n| usize::from(*n)).collect(),
        };
        let coarse: Vec<usize> = cells.iter().copied().filter(|n| *n <= 3).collect();
        let coarse = if coarse.is_empty() { vec![cells[0]] } else { coarse };
        let modes = [ToolContact::Vertices, ToolContact::Surface];
        let mut result = ContactResult {
            young_modulus_pa: self.young_modulus,
            poisson_ratio: self.poisson_ratio,
            thickness_mm: 1e3 * THICKNESS,
            radius_mm: 1e3 * RADIUS,
            depth_mm: self.depth_mm,
            spheres: Vec::new(),
            scenes: Vec::new(),
            drags: Vec::new(),
            bodies: Vec::new(),
        };
        let material = scene::material(self.young_modulus, self.poisson_ratio);
        let layers = self.scene_ratios.len() * (self.scene_cells.len() + self.lattice_cells.len());
        let pressed = cells.len() + layers + coarse.len();
        job.progress.begin("contact", (modes.len() * pressed + cells.len()) as u64);
        for mode in modes {
            for cells in &cells {
                result.spheres.push(self.sphere(*cells, material, mode, job.progress)?);
                job.progress.advance(1);
            }
        }
        let backends = [(Base::Tetrahedra, &self.scene_cells), (Base::Lattice, &self.lattice_cells)];
        for ratio in &self.scene_ratios {
            for (base, list) in backends {
                for (mode, cells) in modes.iter().flat_map(|mode| list.iter().map(move |cells| (*mode, *cells))) {
                    result.scenes.push(self.scene(base, usize::from(cells), *ratio, mode, job.progress)?);
                    job.progress.advance(1);
                }
            }
        }
        for mode in modes {
            for cells in &coarse {
                result.drags.push(self.drag(*cells, material, mode, job.progress)?);
                job.progress.advance(1);
            }
        }
        for cells in &cells {
            result.bodies.push(body(*cells, material, job.progress)?);
            job.progress.advance(1);
        }
        job.progress.end();
        let document = page::document(&result);
        Ok((result, document))
    }
}

fn at(translation: DVec3) -> Pose {
    Pose { translation, ..Pose::IDENTITY }
}

fn name(mode: ToolContact) -> String {
    match mode {
        ToolContact::Vertices => "vertices".to_owned(),
        ToolContact::Surface => "surface".to_owned(),
    }
}

/// A share of the way down, by frame.
fn down(frame: u32) -> f64 {
    f64::from(frame.min(DOWN)) / f64::from(DOWN)
}

/// The middle of the layer's top, off any node.
fn middle(cells: usize) -> DVec3 {
    0.5 * WIDTH * DVec3::new(1.0, 1.0, 0.0) + THICKNESS / cells as f64 * DVec3::new(0.08, -0.1, 0.0)
}

/// Steps the fast solver with its tool at `place(frame)`.
fn stepped(
    model: &Model,
    state: &mut State,
    frames: u32,
    place: impl Fn(u32) -> Pose,
    progress: &dyn Progress,
) -> Result<Stepper> {
    let mut stepper = Stepper::new(model, SolverSettings::FAST, FRAME, 1)?;
    for k in 0..frames {
        check_interrupted(progress)?;
        stepper.step(model, state, &[ToolMotion { from: place(k), to: place(k + 1) }]);
    }
    Ok(stepper)
}

/// Greatest distance between the two places of a node, over the greatest displacement.
fn field_error(model: &Model, state: &State, exact: &OracleState) -> f64 {
    let farthest = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    let (mut off, mut moved) = (0.0f64, 0.0f64);
    for (b, body) in model.bodies().iter().enumerate() {
        off = off.max(farthest(&state.positions(model, b), exact.positions(b)));
        moved = moved.max(farthest(exact.positions(b), body.rest_positions()));
    }
    off / moved
}

/// Distance of a point from the surface of the first body (m).
fn distance_from_surface(model: &Model, state: &State, p: DVec3) -> f64 {
    let (mut surface, nodes) = model.bodies()[0].rest().boundary();
    let x = state.positions(model, 0);
    surface.vertices = nodes.iter().map(|i| x[*i as usize]).collect();
    let distance = |t: usize| {
        let [a, b, c] = surface.corners(t);
        let steps = 40;
        let places = (0..=steps).flat_map(|i| (0..=steps - i).map(move |j| (i, j)));
        let place = |(i, j)| a + (f64::from(i) * (b - a) + f64::from(j) * (c - a)) / f64::from(steps);
        places.map(|share| place(share).distance(p)).fold(f64::INFINITY, f64::min)
    };
    (0..surface.triangles.len()).map(distance).fold(f64::INFINITY, f64::min)
}

/// A sphere in the layer, pressed by the fast solver.
struct Pressed {
    model: Model,
    state: State,
    touching: usize,
    force_n: f64,
    overlap_mm: f64,
}

impl ContactExperiment {
    fn sphere(
        &self,
        cells: usize,
        material: Material,
        mode: ToolContact,
        progress: &dyn Progress,
    ) -> Result<SphereRow> {
        let layer = self.layer(cells, material, mode, 1.0)?;
        let Pressed { model, state, touching, force_n, overlap_mm } = self.pressed(layer, cells, progress)?;
        let settled = |model: &Model| -> Result<(f64, OracleState)> {
            let (mut oracle, mut exact) = (Oracle::new(model), OracleState::new(model));
            for part in 1..=PARTS {
                check_interrupted(progress)?;
                let pose = self.lowered(f64::from(part) / f64::from(PARTS));
                oracle.settle_with_tools(model, &mut exact, &[], &[pose]).map_err(reference)?;
            }
            Ok((oracle.forces()[0].contact.force.z, exact))
        };
        let (truth, exact) = settled(&model)?;
        // Some states of stiff contact have no minimum that Newton's method finds.
        let stiff = settled(&self.layer(cells, material, mode, STIFF)?).ok().map(|(force, _)| force);
        let [hertz_n, layer_n] = self.theory(self.poisson_ratio);
        Ok(SphereRow {
            tool_contact: name(mode),
            cells,
            edge_mm: 1e3 * THICKNESS / cells as f64,
            nodes: model.bodies()[0].len(),
            touching,
            fast_n: force_n,
            oracle_n: truth,
            force_error: (force_n / truth - 1.0).abs(),
            field_error: field_error(&model, &state, &exact),
            stiff_n: stiff,
            overlap_mm,
            hertz_n,
            layer_n,
        })
    }

    /// A layer with the tissue that a scene gives an organ of this ratio.
    fn scene(
        &self,
        base: Base,
        cells: usize,
        ratio: f64,
        mode: ToolContact,
        progress: &dyn Progress,
    ) -> Result<SceneRow> {
        let own = scene::material(self.young_modulus, ratio);
        let material = match base {
            Base::Tetrahedra => trocar_cell::element_material(own, &scene::mesh(cells)),
            Base::Lattice => own,
        };
        let layer = scene::layer(base, cells, material, self.shape(cells), 0.0, mode, 1.0)?;
        let Pressed { model, touching, force_n, overlap_mm, .. } = self.pressed(layer, cells, progress)?;
        let [_, layer_n] = self.theory(ratio);
        Ok(SceneRow {
            poisson_ratio: ratio,
            backend: base.name().to_owned(),
            tool_contact: name(mode),
            edge_mm: 1e3 * THICKNESS / cells as f64,
            nodes: model.bodies()[0].len(),
            touching,
            force_n,
            overlap_mm,
            layer_n,
            layer_error: force_n / layer_n - 1.0,
        })
    }

    /// Forces of a half-space and of the layer (N).
    fn theory(&self, ratio: f64) -> [f64; 2] {
        let depth = 1e-3 * self.depth_mm;
        let hertz = theory::hertz(self.young_modulus, ratio, RADIUS, depth);
        [hertz, hertz * theory::layer_over_half_space(ratio, RADIUS, depth, THICKNESS)]
    }

    /// The sphere's pose at a share of its way down.
    fn lowered(&self, share: f64) -> Pose {
        at(DVec3::Z * (THICKNESS + RADIUS - 1e-3 * self.depth_mm * share))
    }

    fn layer(&self, cells: usize, material: Material, mode: ToolContact, stiffer: f64) -> Result<Model> {
        scene::layer(Base::Tetrahedra, cells, material, self.shape(cells), 0.0, mode, stiffer)
    }

    /// The sphere, over the middle of a layer.
    fn shape(&self, cells: usize) -> Shape {
        Shape::Sphere { centre: middle(cells), radius: RADIUS }
    }

    fn pressed(&self, model: Model, cells: usize, progress: &dyn Progress) -> Result<Pressed> {
        let mut state = State::new(&model);
        let stepper = stepped(&model, &mut state, DOWN + REST, |k| self.lowered(down(k)), progress)?;
        let force = stepper.forces()[0];
        let centre = middle(cells) + self.lowered(1.0).translation;
        let overlap_mm = 1e3 * (RADIUS - distance_from_surface(&model, &state, centre)).max(0.0);
        Ok(Pressed { touching: force.touching, force_n: force.contact.force.z, overlap_mm, model, state })
    }

    fn drag(&self, cells: usize, material: Material, mode: ToolContact, progress: &dyn Progress) -> Result<DragRow> {
        const SUBSTEPS: u32 = 2;
        let edge = THICKNESS / cells as f64;
        let half = DVec3::new(0.2e-3, 4.75e-3, 0.0);
        let ends = [middle(cells) - half, middle(cells) + half].map(|p| p - DVec3::X * 3.5e-3);
        let shape = Shape::Capsule { ends, radius: CAPSULE_RADIUS };
        let model = scene::layer(Base::Tetrahedra, cells, material, shape, FRICTION, mode, 1.0)?;
        let step = 1e-3 * self.speed_mm_s * FRAME;
        let place = |t: f64| {
            let pressed = f64::from(DOWN) * 0.5;
            let down = CAPSULE_DEPTH * (t / pressed).min(1.0);
            at(DVec3::new(step * (t - pressed).max(0.0), 0.0, THICKNESS + CAPSULE_RADIUS - down))
        };
        let (mut state, mut stepper) = (State::new(&model), Stepper::new(&model, SolverSettings::FAST, FRAME, 1)?);
        let (mut oracle, mut exact) = (Oracle::new(&model), OracleState::new(&model));
        let motion = |from: f64, to: f64| [ToolMotion { from: place(from), to: place(to) }];
        let mut most = [0.0f64; 2];
        for k in 0..DOWN / 2 + (WAY / step).round() as u32 {
            check_interrupted(progress)?;
            let from = f64::from(k);
            stepper.step(&model, &mut state, &motion(from, from + 1.0));
            for s in 0..SUBSTEPS {
                let [a, b] = [s, s + 1].map(|s| from + f64::from(s) / f64::from(SUBSTEPS));
                let h = FRAME / f64::from(SUBSTEPS);
                oracle.step_with_tools(&model, &mut exact, h, &[], &motion(a, b)).map_err(reference)?;
            }
            if k >= DOWN / 2 {
                let forces = [stepper.forces()[0], oracle.forces()[0]];
                most = [0, 1].map(|i| most[i].max(-forces[i].contact.force.x));
            }
        }
        Ok(DragRow {
            tool_contact: name(mode),
            speed_mm_s: self.speed_mm_s,
            edge_mm: 1e3 * edge,
            fast_n: most[0],
            oracle_n: most[1],
            error: (most[0] / most[1] - 1.0).abs(),
        })
    }
}

fn body(cells: usize, material: Material, progress: &dyn Progress) -> Result<BodyRow> {
    let (model, held) = scene::two_bodies(cells, material)?;
    let mut state = State::new(&model);
    let grasp = Grasp::capture(&model, &state, 1, &held, 0, &Pose::IDENTITY);
    state.grasps.push(grasp.clone());
    let lowered = |share: f64| at(DVec3::Z * -BODY_DEPTH * share);
    let stepper = stepped(&model, &mut state, DOWN + REST, |k| lowered(down(k)), progress)?;
    let (mut oracle, mut exact) = (Oracle::new(&model), OracleState::new(&model));
    for part in 1..=PARTS {
        check_interrupted(progress)?;
        let share = f64::from(part) / f64::from(PARTS);
        oracle.settle(&model, &mut exact, &Held::by(&grasp, &lowered(share))).map_err(reference)?;
    }
    let loads = stepper.contact_loads(&model, &state);
    let fast: DVec3 = loads.iter().filter(|load| load.body == 1).map(|load| load.force).sum();
    let truth = oracle.pushes()[1];
    Ok(BodyRow {
        edge_mm: 1e3 * THICKNESS / cells as f64,
        nodes: model.bodies().iter().map(|body| body.len()).sum(),
        fast_n: fast.z,
        oracle_n: truth.z,
        force_error: (fast - truth).length() / truth.length(),
        field_error: field_error(&model, &state, &exact),
    })
}
