//! One organ of a specimen, alone on its bed, and how it is lifted.

use crate::{Error, Result};
use glam::DVec3;
use trocar_cell::{Cluster, Surroundings, World, clusters};
use trocar_core::interpolate::smoothstep;
use trocar_core::{Pose, Progress};
use trocar_geometry::{LatticeMesher, MeshDistance, OrganAxis, Skin, TetQuality, TriMesh};
use trocar_measure::{LiftProfile, SPACING};
use trocar_specimen::{Organ, Specimen};
use trocar_tissue::{Grasp, SolverSettings, State, ToolMotion};

/// Nodes nearer to the grasp along the organ than this are held (m).
const HELD: f64 = 3.5e-3;

/// Fewest nodes that are held, if the organ has as many free ones.
const LEAST_HELD: usize = 8;

/// An organ of a specimen, alone.
#[derive(Clone, Debug)]
pub struct LoneOrgan {
    specimen: Specimen,
    axis: OrganAxis,
}

/// Frames of 1/60 s in which the organ comes to rest, is lifted, and is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pace {
    /// Frames until it has come to rest.
    pub settle: usize,
    /// Frames of the rise.
    pub rise: usize,
    /// Frames at the top.
    pub hold: usize,
}

impl Pace {
    /// That of compared lifts.
    pub const SLOW: Self = Self { settle: 60, rise: 100, hold: 60 };
    /// That of many lifts.
    pub const QUICK: Self = Self { settle: 40, rise: 40, hold: 25 };

    /// Share of the way that is gone in a frame of the rise.
    fn share(self, frame: usize) -> f64 {
        smoothstep((frame as f64 / self.rise as f64).min(1.0))
    }
}

/// Which nodes a grasp holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grip {
    /// The cluster nearest to the place, as an instrument of a cell would.
    Cluster,
    /// All tissue within 3.5 mm of the place along the organ.
    Place,
}

/// A lift: the tissue at a place is moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pull {
    /// Organ coordinate of the grasp.
    pub s: f64,
    /// How far the held tissue is moved (m).
    pub displacement: DVec3,
    /// What is held.
    pub grip: Grip,
}

/// Where an organ was at rest and where it is lifted.
#[derive(Clone, Debug)]
pub struct Lifted {
    rest: Vec<DVec3>,
    top: Vec<DVec3>,
    /// Force of the instrument on the tissue at the top (N).
    pub force: DVec3,
}

/// An organ at rest on its bed.
struct Settled {
    world: World,
    state: State,
    rest: Vec<DVec3>,
}

impl Lifted {
    /// Where the organ is now, and the force on it.
    fn of(rest: &[DVec3], now: &World) -> Self {
        let force = now.forces().first().map_or(DVec3::ZERO, |f| -f.constraint.force);
        Self { rest: rest.to_vec(), top: now.state.positions(&now.model, 0), force }
    }
}

impl LoneOrgan {
    /// The organ `name` of `specimen`.
    ///
    /// # Errors
    /// A specimen without that organ, an organ without an axis.
    pub fn of(specimen: &Specimen, name: &str) -> Result<Self> {
        let mut alone = specimen.clone();
        alone.organs.retain(|o| o.name == name);
        let Some(organ) = alone.organs.first() else {
            let known: Vec<&str> = specimen.organs.iter().map(|o| o.name.as_str()).collect();
            return Err(Error::NoOrgan { organ: name.to_owned(), known: known.join(", ") });
        };
        let axis = OrganAxis::of(&organ.body, organ.base)?;
        Ok(Self { specimen: alone, axis })
    }

    /// The same organ with a mesh of cells of `cell` (m) within its surface.
    ///
    /// # Errors
    /// A surface that cannot be filled so.
    pub fn meshed(&self, cell: f64) -> Result<Self> {
        let mut specimen = self.specimen.clone();
        let organ = &mut specimen.organs[0];
        let shape = MeshDistance::new(&organ.surface)?;
        let around = |(low, high): (DVec3, DVec3), p: &DVec3| (low.min(*p), high.max(*p));
        let bounds = organ.surface.vertices.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), around);
        organ.body = LatticeMesher::uniform(cell).mesh_shape(&shape, bounds)?;
        let axis = OrganAxis::of(&organ.body, organ.base)?;
        Ok(Self { specimen, axis })
    }

    /// The organ.
    pub fn organ(&self) -> &Organ {
        &self.specimen.organs[0]
    }

    /// The organ with other properties.
    #[must_use]
    pub fn with(&self, change: impl Fn(&mut Organ)) -> Self {
        let mut changed = self.clone();
        change(&mut changed.specimen.organs[0]);
        changed
    }

    /// Median edge of its mesh (m).
    pub fn edge(&self) -> f64 {
        TetQuality::of(&self.organ().body).median_edge
    }

    /// Unit vector against gravity.
    pub fn up(&self) -> DVec3 {
        self.specimen.up.normalize()
    }

    /// Length of its centreline (m).
    pub fn length(&self) -> f64 {
        self.axis.length
    }

    /// The point of its centreline at organ coordinate `s` (m).
    pub fn point_at(&self, s: f64) -> DVec3 {
        self.axis.point_at(s)
    }

    /// Points of the centreline, [`SPACING`] apart (m).
    pub fn centreline(&self) -> Vec<DVec3> {
        let count = (self.axis.length / SPACING).floor() as usize;
        (0..=count).map(|i| self.axis.point_at(i as f64 * SPACING / self.axis.length)).collect()
    }

    /// The point of the surface above the centreline at organ coordinate `s` (m).
    pub fn front_at(&self, s: f64) -> DVec3 {
        let middle = self.axis.point_at(s);
        let up = self.up();
        // The vertex that is highest above the centreline's point and at most 2 mm beside it.
        let beside = |p: &DVec3| (*p - middle - up * (*p - middle).dot(up)).length();
        let near = self.organ().surface.vertices.iter().filter(|p| beside(p) < 2e-3 && p.distance(middle) < 0.02);
        near.copied().max_by(|a, b| a.dot(up).total_cmp(&b.dot(up))).unwrap_or(middle)
    }

    /// Lifts the organ from rest in each of these ways. `None` where the simulation diverges.
    ///
    /// # Errors
    /// An organ that cannot be simulated or has no free part; an interruption.
    pub fn lift(&self, pulls: &[Pull], pace: Pace, progress: &dyn Progress) -> Result<Vec<Option<Lifted>>> {
        let Some(mut course) = self.settled(pace)? else { return Ok(pulls.iter().map(|_| None).collect()) };
        pulls.iter().map(|pull| self.pulled(&mut course, pull, pace, &mut |_, _| {}, progress)).collect()
    }

    /// Lifts the organ from rest, and returns it at `shares` of the way, which rise from 0. At 1 it
    /// is where [`lift`](Self::lift) leaves it. `None` if the simulation diverges.
    ///
    /// # Errors
    /// As [`lift`](Self::lift).
    pub fn lift_at(
        &self,
        pull: &Pull,
        pace: Pace,
        shares: &[f64],
        progress: &dyn Progress,
    ) -> Result<Option<Vec<Lifted>>> {
        let Some(mut course) = self.settled(pace)? else { return Ok(None) };
        let frame = |share: &f64| match *share {
            all if all >= 1.0 => pace.rise + pace.hold,
            share => (0..pace.rise).find(|f| pace.share(*f) >= share).unwrap_or(pace.rise),
        };
        let frames: Vec<usize> = shares.iter().map(frame).collect();
        let mut shown: Vec<Option<Lifted>> = vec![None; shares.len()];
        let rest = course.rest.clone();
        let mut show = |frame: usize, now: &World| {
            for (_, lifted) in frames.iter().zip(&mut shown).filter(|(wanted, _)| **wanted == frame) {
                *lifted = Some(Lifted::of(&rest, now));
            }
        };
        let last = self.pulled(&mut course, pull, pace, &mut show, progress)?;
        Ok(last.and_then(|_| shown.into_iter().collect()))
    }

    /// The organ at rest on its bed; `None` if the simulation diverges.
    fn settled(&self, pace: Pace) -> Result<Option<Settled>> {
        let surroundings = Surroundings { body_contact: None, ..Surroundings::default() };
        let mut world = World::surrounded(&self.specimen, &surroundings, Vec::new(), SolverSettings::FAST, 1)?;
        for _ in 0..pace.settle {
            world.step(&[]);
        }
        let rest = world.state.positions(&world.model, 0);
        let finite = rest.iter().all(|p| p.is_finite());
        Ok(finite.then(|| Settled { state: world.state.clone(), world, rest }))
    }

    /// One lift from rest; `show` sees frame 0, in which the organ is at rest, and all others.
    fn pulled(
        &self,
        Settled { world, state, rest }: &mut Settled,
        pull: &Pull,
        pace: Pace,
        show: &mut dyn FnMut(usize, &World),
        progress: &dyn Progress,
    ) -> Result<Option<Lifted>> {
        world.state = state.clone();
        let held = self.held(world, pull)?;
        let grasp = Grasp::capture(&world.model, &world.state, 0, &held, 0, &Pose::IDENTITY);
        world.state.grasps.push(grasp);
        show(0, world);
        let at = |frame: usize| Pose { translation: pace.share(frame) * pull.displacement, ..Pose::IDENTITY };
        for frame in 0..pace.rise + pace.hold {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            let report = world.step(&[ToolMotion { from: at(frame), to: at(frame + 1) }]);
            if report.divergence.is_some() {
                return Ok(None);
            }
            show(frame + 1, world);
        }
        let lifted = Lifted::of(rest, world);
        Ok(lifted.top.iter().all(|p| p.is_finite()).then_some(lifted))
    }

    /// The nodes that a grasp holds.
    fn held(&self, world: &World, pull: &Pull) -> Result<Vec<u32>> {
        let nothing = || Error::Lifts(format!("organ '{}' has no free part to grasp", self.organ().name));
        match pull.grip {
            Grip::Cluster => {
                let near = |c: &Cluster| (c.s - pull.s).abs();
                let all = clusters(world, 0).into_iter();
                Ok(all.min_by(|a, b| near(a).total_cmp(&near(b))).ok_or_else(nothing)?.nodes)
            }
            Grip::Place => {
                let body = &world.model.bodies()[0];
                // An element with all nodes prescribed cannot deform.
                let mut free: Vec<bool> = body.pinned().iter().map(|p| !p).collect();
                for tet in body.tets().iter().filter(|tet| tet.iter().any(|i| body.pinned()[*i as usize])) {
                    tet.iter().for_each(|i| free[*i as usize] = false);
                }
                let away = |i: u32| (self.axis.s[i as usize] - pull.s).abs() * self.axis.length;
                let mut nodes: Vec<u32> = (0..body.len() as u32).filter(|i| free[*i as usize]).collect();
                nodes.sort_by(|a, b| away(*a).total_cmp(&away(*b)).then(a.cmp(b)));
                let within = nodes.iter().filter(|i| away(**i) <= HELD).count();
                nodes.truncate(within.max(LEAST_HELD));
                nodes.sort_unstable();
                if nodes.is_empty() { Err(nothing()) } else { Ok(nodes) }
            }
        }
    }

    /// Binds points of the recorded pose (m) to the organ.
    pub fn bind(&self, points: Vec<DVec3>) -> Skin {
        Skin::bind(&TriMesh { vertices: points, ..TriMesh::default() }, &self.organ().body)
    }

    /// Motions of bound points from rest to the top (m).
    pub fn motions_of(&self, lifted: &Lifted, skin: &Skin) -> Vec<DVec3> {
        let count = skin.bindings.len();
        let (mut rest, mut top) = (vec![DVec3::ZERO; count], vec![DVec3::ZERO; count]);
        skin.deform(&self.organ().body, &lifted.rest, &mut rest);
        skin.deform(&self.organ().body, &lifted.top, &mut top);
        top.iter().zip(&rest).map(|(top, rest)| *top - *rest).collect()
    }

    /// Where bound points are at the top (m).
    pub fn places_of(&self, lifted: &Lifted, skin: &Skin) -> Vec<DVec3> {
        let mut top = vec![DVec3::ZERO; skin.bindings.len()];
        skin.deform(&self.organ().body, &lifted.top, &mut top);
        top
    }

    /// Motions of points of the recorded pose from rest to the top (m).
    pub fn motions(&self, lifted: &Lifted, points: Vec<DVec3>) -> Vec<DVec3> {
        self.motions_of(lifted, &self.bind(points))
    }

    /// The profile of its centreline.
    pub fn profile(&self, lifted: &Lifted) -> Option<LiftProfile> {
        let up = self.up();
        let rises: Vec<Option<f64>> =
            self.motions(lifted, self.centreline()).into_iter().map(|d| Some(d.dot(up))).collect();
        LiftProfile::of(&rises, SPACING)
    }
}
