//! Newton's method for a static equilibrium.

use super::elements::{Elements, Place, Sample};
use crate::oracle::element::projected;
use crate::oracle::factor::Factor;
use crate::oracle::{Failure, Precision};
use crate::{Error, Result};
use glam::{DMat3, DVec3};
use trocar_tissue::Hyperelastic;
use trocar_tissue::assembly::{Stiffness, Tangent, tangent};

/// Share of the linear decrease that a step must bring (Armijo).
const ARMIJO: f64 = 1e-4;

/// Greatest number of halvings of a step.
const MAX_HALVINGS: usize = 40;

/// Rounding of the energy, over the stiffness of the whole body and the energy itself.
const ENERGY_ROUNDING: f64 = 1e-13;

/// Shifts of the diagonal that are tried, over its mean.
const SHIFTS: [f64; 5] = [0.0, 1e-10, 1e-8, 1e-6, 1e-4];

/// Share of the held nodes' way by which the change of the forces is found.
const DIFFERENCE: f64 = 1e-4;

/// Acceleration that makes a mass a weight on earth (m/s2).
const EARTH: f64 = 9.81;

/// A force at a place (N).
#[derive(Clone, Debug)]
pub struct Load {
    /// Where.
    pub place: Place,
    /// The force (N).
    pub force: DVec3,
}

/// The load on a body.
#[derive(Clone, Debug, Default)]
pub struct Loading {
    /// Force per volume (N/m3).
    pub body_force: DVec3,
    /// Forces at places.
    pub loads: Vec<Load>,
    /// Displacement (m) of nodes that are held, by node; held nodes that are not here stay.
    pub moved: Vec<(u32, DVec3)>,
}

/// Where a body comes to rest.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// Displacements of the nodes (m).
    pub displacements: Vec<DVec3>,
    /// Force that holds each held node (N); 0 at the others.
    pub reactions: Vec<DVec3>,
    /// Newton steps.
    pub iterations: usize,
}

impl Elements {
    /// The equilibrium of a body, of which some nodes are held, found in so many equal parts of the
    /// loading.
    ///
    /// # Errors
    /// [`Error::Unsolved`] if the body is not held enough or Newton's method does not converge.
    pub fn settle(&self, held: &[bool], loading: &Loading, parts: usize, precision: Precision) -> Result<Equilibrium> {
        let failed = |failure| Error::Unsolved { body: "of statics".to_owned(), failure };
        let mut solver = Solver::new(self, held);
        let mut u = vec![DVec3::ZERO; self.rest.len()];
        let mut iterations = 0;
        let shares = self.shares();
        let mut force = vec![DVec3::ZERO; u.len()];
        for part in 1..=parts.max(1) {
            let share = part as f64 / parts.max(1) as f64;
            force.iter_mut().zip(&shares).for_each(|(f, s)| *f = share * *s * loading.body_force);
            for load in &loading.loads {
                load.place.nodes.iter().for_each(|(i, weight)| force[*i as usize] += share * *weight * load.force);
            }
            if !loading.moved.is_empty() {
                solver.move_held(&loading.moved, share, &mut u).map_err(failed)?;
            }
            iterations += solver.minimise(&force, precision, &mut u).map_err(failed)?;
        }
        let mut reactions = solver.gradient(&u).1;
        for (i, reaction) in reactions.iter_mut().enumerate() {
            *reaction = if held[i] { *reaction - force[i] } else { DVec3::ZERO };
        }
        Ok(Equilibrium { displacements: u, reactions, iterations })
    }
}

struct Solver<'a> {
    elements: &'a Elements,
    held: &'a [bool],
    psi: Vec<Box<dyn Hyperelastic>>,
    matrix: Stiffness,
    factor: Factor,
    /// Weight on earth (N), and Young's modulus times volume (J).
    weight: f64,
    stiffness: f64,
}

impl<'a> Solver<'a> {
    fn new(elements: &'a Elements, held: &'a [bool]) -> Self {
        let mut pairs: Vec<[u32; 2]> = Vec::new();
        for sample in &elements.samples {
            let nodes = &sample.nodes;
            pairs.extend((0..nodes.len()).flat_map(|a| (0..a).map(move |b| [nodes[a], nodes[b]])));
        }
        let matrix = Stiffness::with_pairs(&[], &pairs, held);
        let factor = Factor::new(&matrix);
        let volume: f64 = elements.shares().iter().sum();
        let stiffest =
            |value: &dyn Fn(&trocar_tissue::Material) -> f64| elements.materials.iter().map(value).fold(0.0, f64::max);
        Self {
            psi: elements.materials.iter().map(|m| m.hyperelastic()).collect(),
            weight: stiffest(&|m| m.density) * EARTH * volume,
            stiffness: stiffest(&|m| m.young_modulus) * volume,
            elements,
            held,
            matrix,
            factor,
        }
    }

    /// Moves held nodes to a share of their way, and the free ones with them as the tangent says:
    /// if they stayed, elements between them would be turned inside out.
    fn move_held(&mut self, moved: &[(u32, DVec3)], share: f64, u: &mut [DVec3]) -> std::result::Result<(), Failure> {
        let mut way = vec![DVec3::ZERO; u.len()];
        for (i, by) in moved {
            way[*i as usize] = share * *by - u[*i as usize];
        }
        let along = |by: f64| u.iter().zip(&way).map(|(u, way)| *u + by * *way).collect::<Vec<_>>();
        let [before, after] = [-DIFFERENCE, DIFFERENCE].map(|by| self.gradient(&along(by)).1);
        let change: Vec<DVec3> = before.iter().zip(&after).map(|(a, b)| (*b - *a) / (2.0 * DIFFERENCE)).collect();
        self.factorise(u)?;
        let mut step = vec![DVec3::ZERO; u.len()];
        self.factor.newton_step(&self.matrix, &change, &mut step);
        u.iter_mut().zip(&step).for_each(|(u, step)| *u += *step);
        for (i, by) in moved {
            u[*i as usize] = share * *by;
        }
        Ok(())
    }

    /// Moves free nodes to balance `force`; returns the number of steps.
    fn minimise(
        &mut self,
        force: &[DVec3],
        precision: Precision,
        u: &mut Vec<DVec3>,
    ) -> std::result::Result<usize, Failure> {
        let tolerance = precision.gradient * self.weight;
        let value = |solver: &Self, u: &[DVec3]| {
            let (energy, mut gradient) = solver.gradient(u);
            let work: f64 = force.iter().zip(u).map(|(f, u)| f.dot(*u)).sum();
            for (i, g) in gradient.iter_mut().enumerate() {
                *g = if solver.held[i] { DVec3::ZERO } else { *g - force[i] };
            }
            let size = gradient.iter().map(|g| g.length_squared()).sum::<f64>().sqrt();
            (energy - work, gradient, size)
        };
        let (mut energy, mut gradient, mut size) = value(self, u);
        let mut step = vec![DVec3::ZERO; u.len()];
        for iteration in 0.. {
            if size <= tolerance {
                return Ok(iteration);
            }
            if iteration == precision.iterations {
                return Err(Failure::NotConverged { iterations: iteration, gradient: size, tolerance });
            }
            self.factorise(u)?;
            self.factor.newton_step(&self.matrix, &gradient, &mut step);
            let slope: f64 = gradient.iter().zip(&step).map(|(g, d)| g.dot(*d)).sum();
            if slope.is_nan() || slope >= 0.0 {
                return Err(Failure::Singular);
            }
            let rounding = ENERGY_ROUNDING * (self.stiffness + energy.abs());
            let mut share = 1.0;
            let mut found = None;
            for _ in 0..MAX_HALVINGS {
                let next: Vec<DVec3> = u.iter().zip(&step).map(|(u, d)| *u + share * *d).collect();
                let at = value(self, &next);
                let decreases = at.0 <= energy + ARMIJO * share * slope;
                let nearer = (at.0 - energy).abs() <= rounding && at.2 < size;
                if at.2.is_finite() && at.0.is_finite() && (decreases || nearer) {
                    found = Some((next, at));
                    break;
                }
                share *= 0.5;
            }
            let Some((next, at)) = found else { return Err(Failure::Stuck { gradient: size, tolerance }) };
            *u = next;
            (energy, gradient, size) = at;
        }
        Ok(0)
    }

    fn deformation(&self, sample: &Sample, u: &[DVec3]) -> DMat3 {
        // Displacements instead of positions: no rounding far from the origin.
        let mut f = DMat3::IDENTITY;
        for (i, m) in sample.nodes.iter().zip(&sample.gradients) {
            let u = u[*i as usize];
            f.x_axis += u * m.x;
            f.y_axis += u * m.y;
            f.z_axis += u * m.z;
        }
        f
    }

    /// Elastic energy (J) and its gradient by the displacements (N).
    fn gradient(&self, u: &[DVec3]) -> (f64, Vec<DVec3>) {
        let mut energy = 0.0;
        let mut gradient = vec![DVec3::ZERO; u.len()];
        for sample in &self.elements.samples {
            let (f, psi) = (self.deformation(sample, u), &self.psi[sample.material]);
            energy += sample.volume * psi.energy(f);
            let stress = psi.stress(f) * sample.volume;
            for (i, m) in sample.nodes.iter().zip(&sample.gradients) {
                gradient[*i as usize] += stress * *m;
            }
        }
        (energy, gradient)
    }

    /// Factorises the Hessian at `u`, made positive if it has to be.
    fn factorise(&mut self, u: &[DVec3]) -> std::result::Result<(), Failure> {
        self.assemble(u, false)?;
        if self.factor.factorise(&self.matrix) {
            return Ok(());
        }
        self.assemble(u, true)?;
        let mean = self.matrix.mean_diagonal();
        for shift in SHIFTS {
            self.matrix.shift(shift * mean);
            if self.factor.factorise(&self.matrix) {
                return Ok(());
            }
        }
        Err(Failure::Singular)
    }

    fn assemble(&mut self, u: &[DVec3], project: bool) -> std::result::Result<(), Failure> {
        self.matrix.clear();
        for sample in &self.elements.samples {
            let f = self.deformation(sample, u);
            let mut change = tangent(self.psi[sample.material].as_ref(), f);
            if project {
                change = projected(&change).ok_or(Failure::Singular)?;
            }
            for (b, j) in sample.nodes.iter().enumerate() {
                let columns = columns(&change, sample.gradients[b]);
                for (i, m) in sample.nodes.iter().zip(&sample.gradients) {
                    // The matrix keeps one of (i, j) and (j, i).
                    if i >= j {
                        let block = DMat3::from_cols(columns[0] * *m, columns[1] * *m, columns[2] * *m);
                        self.matrix.add(*i as usize, *j as usize, block * sample.volume);
                        if i != j {
                            self.matrix.add(*j as usize, *i as usize, block.transpose() * sample.volume);
                        }
                    }
                }
            }
        }
        Ok(())
    }
}

/// Stress when a node of gradient `m` moves along each axis.
fn columns(change: &Tangent, m: DVec3) -> [DMat3; 3] {
    std::array::from_fn(|axis| {
        let mut stress = [0.0; 9];
        for (k, along) in m.to_array().into_iter().enumerate() {
            stress.iter_mut().zip(&change[3 * k + axis]).for_each(|(sum, value)| *sum += along * value);
        }
        DMat3::from_cols_array(&stress)
    })
}
