//! Many instances of one lattice, stepped together: an instance in each SIMD lane.
//!
//! The instances share the lattice, its pins, Poisson's ratio, the density and the factor of the
//! stiffness at rest. Young's moduli, poses, grasps and paths of the tools differ. Sixteen
//! instances are a group, and a group is one unit of work for a thread. No lane reads another, and
//! which lanes go through the same rounds changes none of them: instance k has the same bits
//! however many there are, wherever it lies, and with any number of threads and any instruction
//! set.
//!
//! A substep minimises the potential of implicit Euler in single precision: inertia, the elastic
//! energy of `trocar-lattice` (stable neo-Hookean, with its limits of strain), pins and the springs
//! of grasps. There is no viscosity and no contact.

mod elastic;
mod factor;
mod frame;
#[cfg(feature = "gpu")]
mod gpu;
mod grasps;
mod group;
mod search;
mod topology;
mod warp;

#[cfg(feature = "gpu")]
pub use gpu::GpuBatch;

use crate::registers::BLOCK;
use crate::{Error, Isa, Result, ToolMotion};
use fearless_simd::Level;
use frame::Schedule;
use glam::DVec3;
use grasps::MAX_POINTS;
use group::Group;
use rayon::prelude::*;
use search::{Ends, Scratch};
use std::sync::Mutex;
use topology::{ModulusFactor, Topology};
use trocar_core::Pose;
use trocar_lattice::{Body as LatticeBody, EmbeddedPoint};

/// How a batch is stepped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchSettings {
    /// Length of a frame (s), 10 us to 1 s.
    pub dt: f64,
    /// Substeps of a frame, 1 to 64.
    pub substeps: usize,
    /// A step of the search ends it if its root mean square by mass is at most this (m).
    pub tolerance: f64,
    /// It ends too if the step is at most this over the way of the substep so far, both as root
    /// mean squares; below 1.
    pub relative: f64,
    /// Greatest number of rounds of a search, 1 to 1000.
    pub rounds: usize,
}

impl Default for BatchSettings {
    /// Frames of 1/60 s in two substeps, steps of a hundredth of the way or 30 nm, 30 rounds.
    fn default() -> Self {
        Self { dt: 1.0 / 60.0, substeps: 2, tolerance: 3e-8, relative: 1e-2, rounds: 30 }
    }
}

/// What an instance has of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Young's modulus (Pa), 1 Pa to 1 GPa. Pins are stiffer in proportion.
    pub young_modulus: f64,
    /// Gravitational acceleration (m/s2) in the world.
    pub gravity: DVec3,
    /// Where the lattice's frame is in the world.
    pub pose: Pose,
}

/// How an instance was stepped in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InstanceReport {
    /// Rounds of the searches of all substeps.
    pub rounds: usize,
    /// Substeps whose search did not end within its tolerance.
    pub unconverged: usize,
    /// The tool or the tissue has numbers that are not finite: in such a substep the instance
    /// stayed where it was.
    pub damaged: bool,
}

/// Many instances of one lattice.
///
/// ```
/// use glam::DVec3;
/// use trocar_core::Pose;
/// use trocar_lattice::{Body, BodyDescription, Lattice, LatticeOptions, Law, Material};
/// use trocar_tissue::{Batch, BatchSettings, Instance, ToolMotion};
///
/// // A tetrahedron of 10 mm whose foot is pinned, three times with other stiffness.
/// let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let mesh =
///     trocar_geometry::TetMesh { vertices: corners.map(|p| 0.01 * p).to_vec(), tets: vec![[0, 1, 2, 3]] };
/// let options = LatticeOptions { fill: 1e-3, ..LatticeOptions::new(0.003) };
/// let lattice = Lattice::of_mesh(&mesh, &options)?;
/// let pins = lattice.embed_held(&[0, 1, 2])?;
/// let material =
///     Material { law: Law::StableNeoHookean, young_modulus: 5e3, poisson_ratio: 0.45, density: 1050.0 };
/// let description = BodyDescription { name: "organ".to_owned(), lattice, material, pins, fixed: vec![] };
/// let body = Body::new(description)?;
/// let tip = body.lattice().embed(&[DVec3::Z * 0.008])?;
///
/// let of = |young_modulus| Instance { young_modulus, gravity: DVec3::Z * -9.81, pose: Pose::IDENTITY };
/// let mut batch = Batch::new(&body, &[4e3, 5e3, 6e3].map(of), BatchSettings::default(), 1)?;
/// for instance in 0..batch.len() {
///     batch.grasp(instance, &tip, 50.0, &Pose::IDENTITY)?;
/// }
/// let lifted = Pose { translation: DVec3::Z * 1e-3, ..Pose::IDENTITY };
/// let reports = batch.step(&[ToolMotion { from: Pose::IDENTITY, to: lifted }; 3])?;
/// assert!(reports.iter().all(|report| report.unconverged == 0));
/// assert!(batch.point(0, &tip[0]).z > batch.point(2, &tip[0]).z);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Batch {
    name: String,
    level: Level,
    topology: Topology,
    factors: Vec<ModulusFactor>,
    schedule: Schedule,
    instances: Vec<Instance>,
    /// Group and lane of each instance.
    seats: Vec<(usize, usize)>,
    /// The instance of each lane of each group.
    seated: Vec<Vec<usize>>,
    groups: Vec<Group>,
    scratch: Vec<Mutex<Scratch>>,
    pool: rayon::ThreadPool,
}

impl Batch {
    /// Instances of `body` at rest, stepped on `threads` threads (0: one a core). The body's own
    /// Young's modulus is that of the factor: instances whose moduli are within a half and the
    /// double of it share groups.
    ///
    /// # Errors
    /// [`Error::Body`] for a body whose law is not stable neo-Hookean, whose lattice has a fill
    /// below 0.001, or whose stiffness is singular; [`Error::Model`] for settings and instances out
    /// of range, and threads that cannot start.
    pub fn new(body: &LatticeBody, instances: &[Instance], settings: BatchSettings, threads: usize) -> Result<Self> {
        settings.check()?;
        instances.iter().enumerate().try_for_each(|(k, instance)| instance.check(k))?;
        let level = Isa::detect().level();
        let topology = Topology::new(body)?;
        let h = settings.dt / settings.substeps as f64;
        let which: Vec<i32> = instances.iter().map(|i| topology.factor_of(i.young_modulus)).collect();
        let mut kinds = which.clone();
        kinds.sort_unstable();
        kinds.dedup();
        let (mut factors, mut groups, mut seated) = (Vec::new(), Vec::<Group>::new(), Vec::<Vec<usize>>::new());
        let mut seats = vec![(0, 0); instances.len()];
        for (number, kind) in kinds.into_iter().enumerate() {
            factors.push(topology.factorise(level, kind, h, body)?);
            let own: Vec<usize> = (0..instances.len()).filter(|k| which[*k] == kind).collect();
            for members in own.chunks(BLOCK) {
                let mut group = Group::new(number, topology.len());
                group.members = members.len();
                for (lane, k) in members.iter().enumerate() {
                    let Instance { young_modulus, gravity, pose } = instances[*k];
                    group.inertia.0[lane] = (1.0 / (h * h * young_modulus * topology.cell)) as f32;
                    let gravity = pose.rotation.inverse() * gravity / topology.cell;
                    for (to, g) in group.gravity.iter_mut().zip(gravity.to_array()) {
                        to.0[lane] = g as f32;
                    }
                    seats[*k] = (groups.len(), lane);
                }
                groups.push(group);
                seated.push(members.to_vec());
            }
        }
        let no_threads = |e: rayon::ThreadPoolBuildError| Error::Model(format!("the threads do not start: {e}"));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(no_threads)?;
        let scratch = (0..pool.current_num_threads()).map(|_| Mutex::new(Scratch::new(topology.len()))).collect();
        let ends = Ends {
            tolerance: (settings.tolerance / topology.cell).powi(2) as f32,
            relative: settings.relative.powi(2) as f32,
            rounds: settings.rounds,
        };
        let schedule = Schedule { substeps: settings.substeps, h, ends };
        let (name, instances) = (body.name().to_owned(), instances.to_vec());
        Ok(Self { name, level, topology, factors, schedule, instances, seats, seated, groups, scratch, pool })
    }

    /// Number of instances.
    pub fn len(&self) -> usize {
        self.instances.len()
    }

    /// Whether there is no instance.
    pub fn is_empty(&self) -> bool {
        self.instances.is_empty()
    }

    /// Advances all instances by a frame. `tools` has the motion of each instance's tool in the
    /// world; without a grasp it is not read.
    ///
    /// # Errors
    /// [`Error::Model`] for another number of tools than of instances.
    pub fn step(&mut self, tools: &[ToolMotion]) -> Result<Vec<InstanceReport>> {
        self.check_tools(tools)?;
        let Self { level, topology, factors, schedule, instances, seated, groups, scratch, pool, .. } = self;
        let reports: Vec<_> = pool.install(|| {
            let step = |(group, seated): (&mut Group, &Vec<usize>)| {
                let own = rayon::current_thread_index().unwrap_or(0);
                // Scratch memory that a panic left is written anew before it is read.
                let mut scratch = scratch[own].lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                let factor = &factors[group.factor];
                let tool = |lane: usize, share: f64| {
                    let k = seated[lane];
                    relative(&instances[k].pose, &tools[k].at(share))
                };
                group.step(*level, topology, factor, schedule, &mut scratch, tool)
            };
            groups.par_iter_mut().with_max_len(1).zip(seated.par_iter()).map(step).collect()
        });
        let of = |(group, lane): &(usize, usize)| {
            let lane = &reports[*group][*lane];
            InstanceReport { rounds: lane.rounds, unconverged: lane.unconverged, damaged: lane.damaged }
        };
        Ok(self.seats.iter().map(of).collect())
    }

    /// Grasps points of an instance where they are now, with a spring of `stiffness` (N/m) each, by
    /// a tool at `tool` in the world. It takes the place of an earlier grasp.
    ///
    /// # Errors
    /// [`Error::Model`] for an instance that does not exist, no points or more than five, points of
    /// another lattice, a pose that is not finite and a stiffness that is not positive.
    pub fn grasp(&mut self, instance: usize, points: &[EmbeddedPoint], stiffness: f64, tool: &Pose) -> Result<()> {
        let (group, lane) = self.seat(instance)?;
        if !(1..=MAX_POINTS).contains(&points.len()) || !points.iter().all(|p| self.belongs(p)) {
            return Err(Error::Model(format!(
                "the grasp of instance {instance} has {} points; must have 1 to {MAX_POINTS}, embedded in the lattice \
                 of '{}'",
                points.len(),
                self.name
            )));
        }
        let sound = tool.translation.is_finite() && tool.rotation.is_finite();
        if !(stiffness > 0.0 && stiffness.is_finite() && sound) {
            return Err(Error::Model(format!(
                "the grasp of instance {instance} has a stiffness of {stiffness} N/m and a tool at {}; the stiffness \
                 must be positive and the pose finite",
                tool.translation
            )));
        }
        let Instance { young_modulus, pose, .. } = self.instances[instance];
        let unit = young_modulus * self.topology.cell;
        let displacements: Vec<DVec3> = points.iter().map(|p| self.displacement(instance, p)).collect();
        let factor = &self.factors[self.groups[group].factor].factor;
        let of =
            |p: &EmbeddedPoint| points.iter().position(|q| q == p).map_or(DVec3::ZERO, |number| displacements[number]);
        let tool = relative(&pose, tool);
        let Self { level, topology, groups, .. } = self;
        let shared = (*level, &*topology, factor);
        groups[group].grasps.begin(lane, shared, (points, (stiffness / unit) as f32), tool, of);
        Ok(())
    }

    /// Ends an instance's grasp.
    ///
    /// # Errors
    /// [`Error::Model`] for an instance that does not exist.
    pub fn release(&mut self, instance: usize) -> Result<()> {
        let (group, lane) = self.seat(instance)?;
        self.groups[group].grasps.end(lane);
        Ok(())
    }

    /// Positions of an instance's nodes in the world (m), in the lattice's order. None for an
    /// instance that does not exist.
    pub fn positions(&self, instance: usize) -> Option<Vec<DVec3>> {
        let pose = self.instances.get(instance)?.pose;
        let at = |place: &u32| pose.transform(self.topology.rest[*place as usize] + self.moved(instance, *place));
        Some(self.topology.places.iter().map(at).collect())
    }

    /// Velocities of an instance's nodes in the world (m/s), in the lattice's order. None for an
    /// instance that does not exist.
    pub fn velocities(&self, instance: usize) -> Option<Vec<DVec3>> {
        let (pose, (group, lane)) = (self.instances.get(instance)?.pose, *self.seats.get(instance)?);
        let v = &self.groups[group].v;
        let at = |place: &u32| {
            let v = &v[*place as usize];
            pose.rotation * (DVec3::from_array([0, 1, 2].map(|k| f64::from(v[k].0[lane]))) * self.topology.cell)
        };
        Some(self.topology.places.iter().map(at).collect())
    }

    /// Position of a point of an instance in the world (m); NaN for an instance that does not exist
    /// and a point of another lattice.
    pub fn point(&self, instance: usize, point: &EmbeddedPoint) -> DVec3 {
        let Some(own) = self.instances.get(instance).filter(|_| self.belongs(point)) else { return DVec3::NAN };
        let rest: DVec3 = self
            .topology
            .nodes_of(point)
            .iter()
            .zip(&point.weights)
            .map(|(place, weight)| *weight * self.topology.rest[*place as usize])
            .sum();
        own.pose.transform(rest + self.displacement(instance, point))
    }

    /// Force of an instance's tool on the tissue in the world (N), at the end of the frame.
    pub fn grasp_force(&self, instance: usize) -> DVec3 {
        let (Some(own), Some((group, lane))) = (self.instances.get(instance), self.seats.get(instance)) else {
            return DVec3::ZERO;
        };
        let group = &self.groups[*group];
        own.pose.rotation * (group.grasps.force(*lane, &group.u) * own.young_modulus * self.topology.cell.powi(2))
    }

    /// Memory of the batch (bytes): states, grasps, factors, and the scratch of its threads.
    pub fn bytes(&self) -> usize {
        let states = |g: &Group| 2 * size_of_val(&g.u[..]) + g.grasps.bytes();
        let scratch = |s: &Mutex<Scratch>| s.lock().map_or(0, |s| s.bytes());
        self.groups.iter().map(states).sum::<usize>()
            + self.factors.iter().map(|f| f.factor.bytes()).sum::<usize>()
            + self.scratch.iter().map(scratch).sum::<usize>()
    }

    /// Young's moduli of the factors (Pa), one for instances of similar moduli.
    pub fn factor_moduli(&self) -> Vec<f64> {
        self.factors.iter().map(|f| f.young_modulus).collect()
    }

    fn check_tools(&self, tools: &[ToolMotion]) -> Result<()> {
        let (given, count) = (tools.len(), self.len());
        if given == count {
            return Ok(());
        }
        Err(Error::Model(format!(
            "there are {given} motions of tools for the {count} instances of '{}'; give one for each",
            self.name
        )))
    }

    fn seat(&self, instance: usize) -> Result<(usize, usize)> {
        let none = || Error::Model(format!("instance {instance} does not exist; there are {}", self.len()));
        self.seats.get(instance).copied().ok_or_else(none)
    }

    fn belongs(&self, point: &EmbeddedPoint) -> bool {
        let count = self.topology.len();
        point.nodes.iter().all(|node| (*node as usize) < count) && point.weights.iter().all(|w| w.is_finite())
    }

    /// Displacement of a point in the lattice's frame (m).
    fn displacement(&self, instance: usize, point: &EmbeddedPoint) -> DVec3 {
        let nodes = self.topology.nodes_of(point);
        nodes.iter().zip(&point.weights).map(|(place, weight)| *weight * self.moved(instance, *place)).sum()
    }

    /// Displacement of a node in the lattice's frame (m).
    fn moved(&self, instance: usize, place: u32) -> DVec3 {
        let (group, lane) = self.seats[instance];
        let u = &self.groups[group].u[place as usize];
        DVec3::from_array([0, 1, 2].map(|k| f64::from(u[k].0[lane]))) * self.topology.cell
    }
}

/// The pose `of` in the frame of `frame`.
fn relative(frame: &Pose, of: &Pose) -> Pose {
    let inverse = frame.inverse();
    Pose { rotation: inverse.rotation * of.rotation, translation: inverse.transform(of.translation) }
}

impl BatchSettings {
    fn check(&self) -> Result<()> {
        let Self { dt, substeps, tolerance, relative, rounds } = *self;
        let sound = (1e-5..=1.0).contains(&dt)
            && (1..=64).contains(&substeps)
            && (0.0..1.0).contains(&tolerance)
            && (0.0..1.0).contains(&relative)
            && (1..=1000).contains(&rounds);
        if sound {
            return Ok(());
        }
        Err(Error::Model(format!(
            "a batch with frames of {dt} s, {substeps} substeps, tolerance {tolerance} m, relative {relative} and \
             {rounds} rounds; these must be in [1e-5, 1] s, [1, 64], [0, 1) m, [0, 1) and [1, 1000]"
        )))
    }
}

impl Instance {
    fn check(&self, number: usize) -> Result<()> {
        let Self { young_modulus, gravity, pose } = *self;
        let sound = (1.0..=1e9).contains(&young_modulus)
            && gravity.is_finite()
            && pose.translation.is_finite()
            && pose.rotation.is_finite()
            && (pose.rotation.length() - 1.0).abs() < 1e-6;
        if sound {
            return Ok(());
        }
        Err(Error::Model(format!(
            "instance {number} has Young's modulus {young_modulus} Pa, gravity {gravity} m/s2 and its frame at {}; the \
             modulus must be in [1, 1e9] Pa, gravity and pose finite, the rotation of length 1",
            pose.translation
        )))
    }
}
