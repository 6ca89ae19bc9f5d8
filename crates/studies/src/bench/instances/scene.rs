//! The scene of `bench many`: ceca whose lower part is pinned and whose top is lifted by jaws, each
//! with its own modulus, pose and path.

use crate::scenes::{BenchScene, FRAME, GRAVITY, Organs, material};
use crate::{Error, Result};
use glam::{DQuat, DVec3};
use trocar_core::Pose;
use trocar_geometry::TetMesh;
use trocar_lattice::{
    Body, BodyDescription, BodyState, Conditions, EmbeddedPoint, Lattice, LatticeOptions, Law, Newton, Precision,
    Spring,
};
use trocar_tissue::{Backend, Instance, LatticeSettings, Material, ToolMotion};

/// Young's modulus of the first instance and of those alone (Pa), and Poisson's ratio.
const MODULUS: f64 = 12e3;
const POISSON: f64 = 0.45;

/// Young's moduli of the others, over the first one's.
const MODULI: [f64; 2] = [0.55, 1.9];

/// Speed of the tools of the others (m/s), and how far they are aside of the vertical (rad).
const SPEEDS: [f64; 2] = [5e-3, 15e-3];
const ASIDE: f64 = 0.8;

/// How fast the tools of the others turn at most (rad/s), and how far the organs are tilted (rad).
const TURN: f64 = 0.5;
const TILT: f64 = 0.4;

/// Elements of the mesh that the lattice is cut from.
const FINE: usize = 15_000;

/// Stiffness of the empty part of boundary cells over the tissue's, by default.
pub(super) const FILL: f64 = 1e-3;

/// Points that a grasp holds, and the stiffness of each one's spring (N/m): that of a contact with
/// tissue of 12 kPa.
const POINTS: usize = 4;
pub(super) const GRIP: f64 = 240.0;

/// Rounds of the searches for a cell and a mesh of about a number of nodes.
const CELL_ROUNDS: usize = 16;
const MESH_ROUNDS: usize = 6;

/// Gradient at which Newton's method ends, over the weight of the body.
const JUDGE: f64 = 1e-7;

/// The organ on the lattice, and the same organ for those that step alone.
pub(super) struct Scene {
    pub body: Body,
    /// The points that the jaws hold.
    pub grip: Vec<EmbeddedPoint>,
    /// The points whose error is taken: the nodes of the mesh that the lattice is cut from.
    pub points: Vec<EmbeddedPoint>,
    /// Where the tools begin (m).
    jaws: DVec3,
    /// Tetrahedra of about the same number of nodes that can move.
    pub tets: BenchScene,
    /// The nodes of these in the same lattice.
    pub lattice: BenchScene,
}

impl Scene {
    /// With about a number of nodes; empty parts of boundary cells are `fill` as stiff as tissue.
    ///
    /// # Errors
    /// An organ that cannot be meshed so coarsely.
    pub fn new(nodes: usize, fill: f64) -> Result<Self> {
        let undamped = Material { viscosity: 0.0, ..material(MODULUS, POISSON) };
        let fine = BenchScene::drag(&Organs::analytic_largest(FINE)?, undamped)?;
        let organ = &fine.model.bodies()[0];
        let rest = organ.rest_positions();
        let (mesh, kept) = movable(rest, organ.tets(), organ.pinned());
        let lattice = lattice_of(&mesh, nodes, fill)?;
        let cell = lattice.cell();
        let patch: Vec<DVec3> = fine.patches[0].nodes.iter().map(|i| rest[*i as usize]).collect();
        let held = spread(&patch);
        let jaws = held.iter().sum::<DVec3>() / held.len().max(1) as f64;
        let pinned: Vec<u32> = (0..kept.len()).filter(|i| organ.pinned()[kept[*i]]).map(|i| i as u32).collect();
        let (grip, points) = (lattice.embed(&held).map_err(of_lattice)?, lattice.embed_nodes().map_err(of_lattice)?);
        let pins = lattice.embed_held(&pinned).map_err(of_lattice)?;
        let body = body(lattice, pins, MODULUS)?;
        let (coarse, tets) = mesh_of(nodes, undamped)?;
        let settings = LatticeSettings { cell, law: Law::StableNeoHookean };
        Ok(Self {
            body,
            grip,
            points,
            jaws,
            tets,
            lattice: BenchScene::drag_on(&coarse, undamped, Backend::Lattice(settings))?,
        })
    }

    /// Nodes of the lattice.
    pub fn nodes(&self) -> usize {
        self.body.lattice().nodes().len()
    }

    /// Instance k of any number. The first is that of those alone.
    pub fn instance(&self, k: usize) -> Instance {
        let [low, high] = MODULI;
        let young_modulus = if k == 0 { MODULUS } else { MODULUS * low * (high / low).powf(draws(k)[0]) };
        Instance { young_modulus, gravity: DVec3::Z * -GRAVITY, pose: pose(k) }
    }

    /// The motion of an instance's tool in a frame.
    pub fn tool(&self, k: usize, frame: usize) -> ToolMotion {
        let at = |frame: usize| self.tool_at(k, frame as f64 * FRAME);
        ToolMotion { from: at(frame), to: at(frame + 1) }
    }

    /// The pose of an instance's tool at a time (s).
    pub fn tool_at(&self, k: usize, time: f64) -> Pose {
        let begin = pose(k).transform(self.jaws);
        if k == 0 {
            let lifted = self.tets.patches[0].motion.pose(time).translation;
            return Pose { rotation: DQuat::IDENTITY, translation: begin + lifted };
        }
        let draw = draws(k);
        let [slow, fast] = SPEEDS;
        let speed = slow + (fast - slow) * draw[1];
        let aside = DQuat::from_rotation_z(std::f64::consts::TAU * draw[2]) * DQuat::from_rotation_y(ASIDE * draw[3]);
        let turn = TURN * (2.0 * draw[4] - 1.0) * time;
        Pose { rotation: DQuat::from_rotation_x(turn), translation: begin + aside * DVec3::Z * speed * time }
    }

    /// World positions of an instance's points after some frames by Newton's method, run to
    /// convergence in each of `substeps` substeps, and at rest. `stop` may end it.
    ///
    /// # Errors
    /// A step that is not solved; the error of `stop`.
    pub fn converged(
        &self,
        k: usize,
        frames: usize,
        substeps: usize,
        stop: impl Fn() -> Result<()>,
    ) -> Result<[Vec<DVec3>; 2]> {
        let Instance { young_modulus, gravity, pose } = self.instance(k);
        let pins = self.body.pins().iter().map(|pin| pin.point).collect();
        let body = body(self.body.lattice().clone(), pins, young_modulus)?;
        let mut newton = Newton::new(&body, Precision { gradient: JUDGE, iterations: 200 }).map_err(of_lattice)?;
        let mut state = BodyState::new(&body);
        let (inverse, began) = (pose.inverse(), self.tool_at(k, 0.0).inverse());
        let at = |state: &BodyState| -> Vec<DVec3> {
            self.points.iter().map(|p| pose.transform(p.interpolate(&state.positions))).collect()
        };
        let rest = at(&state);
        for frame in 0..frames {
            let motion = self.tool(k, frame);
            for substep in 1..=substeps {
                stop()?;
                let tool = motion.at(substep as f64 / substeps as f64);
                let spring = |point: &EmbeddedPoint| {
                    let at = pose.transform(point.interpolate(body.lattice().nodes()));
                    let target = inverse.transform(tool.transform(began.transform(at)));
                    Spring { point: *point, target, stiffness: GRIP }
                };
                let springs: Vec<Spring> = self.grip.iter().map(spring).collect();
                let conditions = Conditions { gravity: inverse.rotation * gravity, springs: &springs, loads: &[] };
                newton.step(&body, &conditions, FRAME / substeps as f64, &mut state).map_err(of_lattice)?;
            }
        }
        Ok([at(&state), rest])
    }
}

/// Eight numbers in 0..1 for an instance.
fn draws(k: usize) -> [f64; 8] {
    std::array::from_fn(|i| trocar_core::unit(trocar_core::mix((8 * k + i) as u64)))
}

/// Where an instance's organ is.
fn pose(k: usize) -> Pose {
    if k == 0 {
        return Pose::IDENTITY;
    }
    let draw = draws(k);
    let rotation = DQuat::from_rotation_z(std::f64::consts::TAU * draw[5]) * DQuat::from_rotation_x(TILT * draw[6]);
    Pose { rotation, translation: DVec3::new(draw[6], draw[7], 0.0) }
}

fn body(lattice: Lattice, pins: Vec<EmbeddedPoint>, young_modulus: f64) -> Result<Body> {
    let density = material(MODULUS, POISSON).density;
    let material =
        trocar_lattice::Material { law: Law::StableNeoHookean, young_modulus, poisson_ratio: POISSON, density };
    Body::new(BodyDescription { name: "cecum".to_owned(), lattice, material, pins, fixed: Vec::new() })
        .map_err(of_lattice)
}

/// The elements that can move, and which node of the whole each of their nodes is.
fn movable(nodes: &[DVec3], tets: &[[u32; 4]], pinned: &[bool]) -> (TetMesh, Vec<usize>) {
    let moves = |tet: &&[u32; 4]| !tet.iter().all(|i| pinned[*i as usize]);
    let mut kept: Vec<usize> = tets.iter().filter(moves).flatten().map(|i| *i as usize).collect();
    kept.sort_unstable();
    kept.dedup();
    let mut numbers = vec![0; nodes.len()];
    kept.iter().enumerate().for_each(|(number, i)| numbers[*i] = number as u32);
    let tets = tets.iter().filter(moves).map(|tet| tet.map(|i| numbers[i as usize])).collect();
    (TetMesh { vertices: kept.iter().map(|i| nodes[*i]).collect(), tets }, kept)
}

/// Some points, far from each other, from the highest on (m).
fn spread(points: &[DVec3]) -> Vec<DVec3> {
    let mut chosen: Vec<DVec3> = points.iter().copied().max_by(|a, b| a.z.total_cmp(&b.z)).into_iter().collect();
    while chosen.len() < POINTS.min(points.len()) {
        let near = |p: &DVec3| chosen.iter().map(|q| p.distance(*q)).fold(f64::INFINITY, f64::min);
        let farthest = points.iter().copied().max_by(|a, b| near(a).total_cmp(&near(b)));
        chosen.extend(farthest);
    }
    chosen
}

/// The lattice with the number of nodes nearest to `nodes`, by halving the interval of its cell.
fn lattice_of(mesh: &TetMesh, nodes: usize, fill: f64) -> Result<Lattice> {
    let cut =
        |cell: f64| Lattice::of_mesh(mesh, &LatticeOptions { fill, ..LatticeOptions::new(cell) }).map_err(of_lattice);
    let size = (mesh.volume() / nodes.max(1) as f64).cbrt();
    let (mut small, mut large) = (0.8 * size, 4.0 * size);
    let mut best = cut(large)?;
    for _ in 0..CELL_ROUNDS {
        let lattice = cut(0.5 * (small + large))?;
        let count = lattice.nodes().len();
        *(if count > nodes { &mut small } else { &mut large }) = lattice.cell();
        if count.abs_diff(nodes) < best.nodes().len().abs_diff(nodes) {
            best = lattice;
        }
    }
    Ok(best)
}

/// The organ of tetrahedra of which nearest to `nodes` nodes can move, of those that were tried.
/// Pinned nodes are no unknowns; all of the lattice's are.
fn mesh_of(nodes: usize, material: Material) -> Result<(Organs, BenchScene)> {
    let mut tets = 5 * nodes;
    let mut best: Option<(Organs, BenchScene)> = None;
    for _ in 0..MESH_ROUNDS {
        let organs = Organs::analytic_largest(tets)?;
        let scene = BenchScene::drag(&organs, material)?;
        let count = moving(&scene);
        tets = (tets * nodes).div_ceil(count.max(1));
        if best.as_ref().is_none_or(|(_, best)| count.abs_diff(nodes) < moving(best).abs_diff(nodes)) {
            best = Some((organs, scene));
        }
    }
    best.ok_or_else(|| Error::Mismatch(format!("a cecum of {nodes} nodes cannot be meshed")))
}

/// Nodes that can move.
pub(super) fn moving(scene: &BenchScene) -> usize {
    scene.model.bodies().iter().flat_map(|body| body.pinned()).filter(|pinned| !**pinned).count()
}

/// An error of the lattice, as one of a study.
pub(super) fn of_lattice(error: trocar_lattice::Error) -> Error {
    Error::Study(error.into())
}
