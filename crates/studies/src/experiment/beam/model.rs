//! The beam: at rest under a load by statics, and swinging by the solver of the cell.

use super::swing::{Swing, Track};
use crate::experiment::block::block;
use crate::scenes::reference;
use crate::{Error, Result};
use glam::DVec3;
use trocar_geometry::TetMesh;
use trocar_tissue::{
    BodyDescription, ConstitutiveModel, Material, ModelBuilder, QuasiNewton, SolverSettings, State, Stepper,
};
use trocar_tissue_reference::oracle::Precision;
use trocar_tissue_reference::statics::{Elements, Load, Loading};

/// Sides of the beam (m): it is clamped at z = 0, and gravity acts along -x.
const SIZE: DVec3 = DVec3::new(0.03, 0.03, 0.1);

/// Cells along each side.
const CELLS: [usize; 3] = [4, 4, 13];

/// Density of the silicone, Dragon Skin 10 (kg/m3).
const DENSITY: f64 = 1070.0;

/// Poisson's ratio, as the authors of the data have it.
const POISSON_RATIO: f64 = 0.499;

pub(super) const GRAVITY: f64 = 9.81;

/// Length of a simulation (s).
const SIMULATED_S: f64 = 3.0;

/// Relative change of Young's modulus or of viscosity that ends a fit.
const FIT_PRECISION: f64 = 1e-3;

/// Steps of a fit.
const MAX_FIT_STEPS: usize = 12;

/// The silicone: Young's modulus (Pa) and shear viscosity (Pa s).
#[derive(Clone, Copy, Debug)]
pub(super) struct Silicone {
    pub young_modulus: f64,
    pub viscosity: f64,
}

/// The beam's mesh.
pub(super) struct Beam {
    mesh: TetMesh,
    /// Nodes of the free end, with their shares of it.
    end: Vec<(u32, f64)>,
}

impl Beam {
    pub fn new() -> Self {
        let mesh = block(DVec3::ZERO, SIZE, CELLS);
        let share = |p: DVec3| {
            let part = |x: f64, side: f64, cells: usize| {
                let whole = 1.0 / cells as f64;
                if x < 1e-9 || x > side - 1e-9 { 0.5 * whole } else { whole }
            };
            part(p.x, SIZE.x, CELLS[0]) * part(p.y, SIZE.y, CELLS[1])
        };
        let nodes = mesh.vertices.iter().enumerate().filter(|(_, p)| p.z > SIZE.z - 1e-9);
        let end = nodes.map(|(i, p)| (i as u32, share(*p))).collect();
        Self { mesh, end }
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.mesh.vertices.len()
    }

    /// The material of the elements: that of the body, corrected for the stiffness of the mesh.
    fn material(&self, silicone: Silicone) -> Material {
        let body = Material {
            model: ConstitutiveModel::StableNeoHookean,
            young_modulus: silicone.young_modulus,
            poisson_ratio: POISSON_RATIO,
            density: DENSITY,
            viscosity: silicone.viscosity,
        };
        trocar_cell::element_material(body, &self.mesh)
    }

    /// Displacement of the end at rest, with a weight of `load` (N) on it (m).
    pub fn sag(&self, young_modulus: f64, load: f64) -> Result<f64> {
        let elements = Elements::linear(&self.mesh, self.material(Silicone { young_modulus, viscosity: 0.0 }));
        let held = elements.held_by(|p| p.z < 1e-9);
        let place = |i: u32| elements.locate(self.mesh.vertices[i as usize]);
        let loads = self.end.iter().map(|(i, share)| Load { place: place(*i), force: -DVec3::X * (share * load) });
        let loading =
            Loading { body_force: -DVec3::X * (DENSITY * GRAVITY), loads: loads.collect(), moved: Vec::new() };
        let found = elements.settle(&held, &loading, 2, Precision::default()).map_err(reference)?;
        Ok(self.end.iter().map(|(i, share)| -share * found.displacements[*i as usize].x).sum())
    }

    /// Young's modulus with which the end sags by `settled` (m) under `load` (N).
    pub fn fit_modulus(&self, settled: f64, load: f64) -> Result<f64> {
        let mut modulus = 2.5e5;
        for _ in 0..MAX_FIT_STEPS {
            // The sag is nearly one over the modulus.
            let next = modulus * self.sag(modulus, load)? / settled;
            let change = (next / modulus - 1.0).abs();
            modulus = next;
            if change < FIT_PRECISION {
                break;
            }
        }
        Ok(modulus)
    }

    /// The swing of the beam that is let go at rest, with a weight of `load` (N) on its end, by
    /// frames of 10 ms.
    pub fn swing(&self, silicone: Silicone, load: f64, substeps: usize) -> Result<(Swing, Track)> {
        let settings = SolverSettings::QuasiNewton(QuasiNewton {
            substeps,
            iterations: 40,
            memory: 8,
            tolerance: 3e-8,
            relative: 1e-2,
        });
        let track = self.track(silicone, load, 1e-2, settings)?;
        Ok((track.swing()?, track))
    }

    /// The same by the default schedule of the cell, in frames of 1/60 s.
    pub fn swing_by_default(&self, silicone: Silicone, load: f64) -> Result<Swing> {
        self.track(silicone, load, 1.0 / 60.0, SolverSettings::FAST)?.swing()
    }

    fn track(&self, silicone: Silicone, load: f64, frame: f64, settings: SolverSettings) -> Result<Track> {
        let masses: Vec<(u32, f64)> = self.end.iter().map(|(i, share)| (*i, share * load / GRAVITY)).collect();
        let mut builder = ModelBuilder::new().gravity(-GRAVITY * DVec3::X).point_masses(&masses);
        let pinned = (0..self.nodes() as u32).filter(|i| self.mesh.vertices[*i as usize].z < 1e-9).collect();
        let (name, material, supports) = ("beam".to_owned(), self.material(silicone), Vec::new());
        builder.body(BodyDescription { name, mesh: &self.mesh, material, pinned, supports }).map_err(study)?;
        let model = builder.build().map_err(study)?;
        let mut stepper = Stepper::new(&model, settings, frame, 1).map_err(study)?;
        let mut state = State::new(&model);
        let end = |state: &State| -> f64 {
            let down = |i: u32| self.mesh.vertices[i as usize].x - state.position(&model, 0, i as usize).x;
            self.end.iter().map(|(i, share)| share * down(*i)).sum()
        };
        let mut places = vec![end(&state)];
        for _ in 0..(SIMULATED_S / frame) as usize {
            stepper.step(&model, &mut state, &[]);
            places.push(end(&state));
        }
        Ok(Track { step: frame, places })
    }

    /// The viscosity with which the beam has this damping ratio.
    pub fn fit_viscosity(&self, young_modulus: f64, load: f64, damping: f64, substeps: usize) -> Result<f64> {
        let ratio = |viscosity: f64| -> Result<f64> {
            Ok(self.swing(Silicone { young_modulus, viscosity }, load, substeps)?.0.damping)
        };
        // Nearly linear, with what the integrator damps by itself at zero.
        let (mut low, mut high) = (0.0, 2e-3 * young_modulus);
        let (mut at_low, mut at_high) = (ratio(low)?, ratio(high)?);
        if at_low >= damping {
            return Ok(0.0);
        }
        for _ in 0..MAX_FIT_STEPS {
            let next = (low + (damping - at_low) * (high - low) / (at_high - at_low)).max(0.0);
            let change = (next / high - 1.0).abs();
            (low, at_low) = (high, at_high);
            (high, at_high) = (next, ratio(next)?);
            if change < 10.0 * FIT_PRECISION {
                break;
            }
        }
        Ok(high)
    }
}

fn study(error: trocar_tissue::Error) -> Error {
    Error::Study(error.into())
}
