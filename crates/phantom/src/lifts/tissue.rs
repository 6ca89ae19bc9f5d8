//! The lifted organ as tissue of another kind than the simulated one: a mesh of half the edge
//! length, corotated elasticity of another modulus, hidden supports, and equilibria by the oracle
//! in double precision.

use super::script::LiftScript;
use super::support::HiddenSupport;
use crate::spec::{Organ, PhantomSpec};
use crate::{Error, Result};
use glam::DVec3;
use trocar_core::{Progress, Random};
use trocar_geometry::{LatticeMesher, MeshDistance, OrganAxis, SignedDistance, Skin, TetMesh, TriMesh};
use trocar_tissue::{BodyDescription, ConstitutiveModel, MassFloor, Material, Model, ModelBuilder, SupportField};
use trocar_tissue_reference::oracle::Precision;
use trocar_tissue_reference::{Held, Oracle, OracleState};

/// Gravitational acceleration (m/s2).
const GRAVITY: f64 = 9.80665;

/// Young's modulus over that of the phantom's description, at least and at most.
const STIFFER: [f64; 2] = [1.4, 1.9];

/// Poisson's ratio.
pub(super) const POISSON_RATIO: f64 = 0.45;

/// Radius of the tissue that the jaws hold (m), and depth of its middle below the surface (m).
const HELD_RADIUS: f64 = 3.5e-3;
const HELD_DEPTH: f64 = 2.5e-3;

/// Cells of the lattice's middle over those at its surface.
const COARSEST: u32 = 2;

/// Distance between the threads of a support along the organ (m).
const THREAD_SPACING: f64 = 2e-3;

/// Longest way of the grasp point between two equilibria (m), and the share of it below which a
/// lift ends where it is.
const STEP: f64 = 4e-3;
const LEAST_STEP_SHARE: f64 = 0.2;

/// A lift is filmed if it reaches this share of its displacement.
const LEAST_SHARE: f64 = 0.5;

/// Half width of the bulge by which the first equilibrium is guessed (m).
const BULGE: f64 = 0.012;

/// How well equilibria are found: to a ten-millionth of the organ's weight.
const PRECISION: Precision = Precision { gradient: 1e-7, iterations: 200 };

/// The organ as tissue.
pub(crate) struct Tissue {
    pub mesh: TetMesh,
    pub axis: OrganAxis,
    pub young_modulus: f64,
    pub density: f64,
    /// Where the organ lies under gravity (m).
    pub settled: Vec<DVec3>,
    up: DVec3,
    model: Model,
    oracle: Oracle,
    state: OracleState,
}

/// A lift as equilibria.
pub(crate) struct SolvedLift {
    /// Where the jaws hold the tissue at rest (m).
    pub grasp: DVec3,
    /// Final displacement of the held tissue (m).
    pub way: DVec3,
    /// Shares of the way at which equilibria are known, from 0 to 1, and the nodes there (m).
    pub keys: Vec<(f64, Vec<DVec3>)>,
}

impl Tissue {
    /// The tissue of `organ`, whose surface is `surface`, with lattice cells of `cell` (m).
    pub fn new(
        organ: &Organ,
        spec: &PhantomSpec,
        surface: &TriMesh,
        support: HiddenSupport,
        cell: f64,
        seed: u64,
    ) -> Result<Self> {
        let up = -DVec3::Z;
        let shape = MeshDistance::new(surface)?;
        let mesher = LatticeMesher { cell, coarsest: COARSEST };
        let mesh = mesher.mesh_shape(&shape, organ.body.bounds())?;
        let axis = OrganAxis::of(&mesh, organ.body.base())?;
        let share = Random::from_keys(&[seed, 302]).uniform(0);
        let young_modulus = organ.young_modulus * (STIFFER[0] + (STIFFER[1] - STIFFER[0]) * share);
        let material = Material {
            model: ConstitutiveModel::Corotated,
            young_modulus,
            poisson_ratio: POISSON_RATIO,
            density: spec.density,
            viscosity: 0.0,
        };
        let bed = SupportField::under(&mesh, up, cell, 0.0).map_err(trocar_tissue_reference::Error::from)?;
        let mut builder = ModelBuilder::new().gravity(-GRAVITY * up).mass_floor(MassFloor::None);
        let body = BodyDescription {
            name: organ.name.to_owned(),
            mesh: &mesh,
            material,
            pinned: HiddenSupport::pinned(&axis),
            supports: vec![bed.into()],
        };
        builder.body(body).map_err(trocar_tissue_reference::Error::from)?;
        let tethers = support.tethers(&mesh, &axis, up, THREAD_SPACING);
        builder.tethers(0, &tethers).map_err(trocar_tissue_reference::Error::from)?;
        let model = builder.build().map_err(trocar_tissue_reference::Error::from)?;
        let mut oracle = Oracle::with_precision(&model, PRECISION);
        let mut state = OracleState::new(&model);
        oracle.settle(&model, &mut state, &[])?;
        let settled = state.positions(0).to_vec();
        Ok(Self { mesh, axis, young_modulus, density: spec.density, settled, up, model, oracle, state })
    }

    /// The point of the organ's front above its centreline at `s`, where it lies (m): what the
    /// camera sees of the centreline.
    pub fn front_at(&self, surface: &dyn SignedDistance, s: f64) -> DVec3 {
        let point = self.axis.point_at(s);
        let ray = point.normalize_or(DVec3::Z);
        // From outside towards the centreline, by the distance to the surface.
        let mut along = point.length() - 0.03;
        for _ in 0..60 {
            along += 0.9 * surface.distance(ray * along);
        }
        ray * along
    }

    /// The equilibria of a lift whose grasp is below the point `front` of the surface (m).
    pub fn lift(&mut self, script: &LiftScript, front: DVec3, progress: &dyn Progress) -> Result<SolvedLift> {
        let grasp = front - HELD_DEPTH * self.up;
        let held: Vec<u32> = (0..self.settled.len() as u32)
            .filter(|i| self.settled[*i as usize].distance(grasp) < HELD_RADIUS)
            .collect();
        if held.is_empty() {
            return Err(Error::Option(format!("no tissue lies at the grasp at {:.2} of the organ", script.at)));
        }
        let whole = script.way(self.up, self.axis.point_at(0.0) - grasp);
        let step = STEP / whole.length();
        let mut keys = vec![(0.0, self.settled.clone())];
        let (mut reached, mut next) = (0.0, step);
        while reached < 1.0 {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            let share = (reached + next).min(1.0);
            let target =
                |node: &u32| Held { body: 0, node: *node, target: self.settled[*node as usize] + share * whole };
            let targets: Vec<Held> = held.iter().map(target).collect();
            let guess = self.guess(&keys, share, script.at, whole, &targets);
            // A guess that turns an element inside out is left for the slower way.
            let mut state = self.state.clone().with_positions(0, &guess);
            let mut found = self.oracle.settle(&self.model, &mut state, &targets);
            if found.is_err() {
                state = self.state.clone().with_positions(0, &keys[keys.len() - 1].1);
                found = self.oracle.settle(&self.model, &mut state, &targets);
            }
            match found {
                Ok(_) => {
                    reached = share;
                    keys.push((share, state.positions(0).to_vec()));
                }
                Err(_) if next > LEAST_STEP_SHARE * step => next *= 0.5,
                // The tissue follows no further: the lift ends here.
                Err(_) if reached >= LEAST_SHARE => break,
                Err(error) => return Err(error.into()),
            }
        }
        keys.iter_mut().for_each(|key| key.0 /= reached);
        Ok(SolvedLift { grasp, way: reached * whole, keys })
    }

    /// Where the nodes may be at a share of the way (m): as far as the last two equilibria
    /// continue, or moved as a bulge about the grasp, if there is only one.
    fn guess(&self, keys: &[(f64, Vec<DVec3>)], share: f64, at: f64, whole: DVec3, held: &[Held]) -> Vec<DVec3> {
        let (last, here) = &keys[keys.len() - 1];
        let mut guess: Vec<DVec3> = match keys.len().checked_sub(2).map(|k| &keys[k]) {
            Some((before, there)) => {
                let further = (share - last) / (last - before);
                here.iter().zip(there).map(|(x, before)| *x + further * (*x - *before)).collect()
            }
            None => {
                let bulge = |i: usize| libm::exp(-((self.axis.s[i] - at) * self.axis.length / BULGE).powi(2));
                (0..here.len()).map(|i| here[i] + share * bulge(i) * whole).collect()
            }
        };
        for i in (0..guess.len()).filter(|i| self.model.bodies()[0].pinned()[*i]) {
            guess[i] = here[i];
        }
        held.iter().for_each(|h| guess[h.node as usize] = h.target);
        guess
    }

    /// Points that are bound to the tissue as it lies on the camera's picture.
    pub fn bind(&self, points: Vec<DVec3>) -> Skin {
        let points = TriMesh { vertices: points, ..TriMesh::default() };
        Skin::bind(&points, &self.mesh)
    }
}

impl SolvedLift {
    /// Nodes at a share of the way (m), on straight lines between equilibria.
    pub fn nodes(&self, share: f64) -> Vec<DVec3> {
        let share = share.clamp(0.0, 1.0);
        let after = self.keys.iter().position(|key| key.0 >= share).unwrap_or(self.keys.len() - 1).max(1);
        let ((a, from), (b, to)) = (&self.keys[after - 1], &self.keys[after]);
        let t = (share - a) / (b - a);
        from.iter().zip(to).map(|(p, q)| p.lerp(*q, t)).collect()
    }
}
