//! Hyperelastic materials.
//!
//! Each model gives its energy and stress in double precision, in the textbook form that tests
//! compare the fast kernels with. The kernels of the sweeps are in `descent`, those of the
//! quasi-Newton solver in `quasi_newton`.

mod corotated;
mod st_venant_kirchhoff;
mod stable_neo_hookean;
mod stretch;
mod volume;

pub use corotated::Corotated;
pub use st_venant_kirchhoff::StVenantKirchhoff;
pub use stable_neo_hookean::StableNeoHookean;
pub(crate) use stretch::{MAX_FREE_STRETCH_SQUARED, StretchEnergy, Stretches};
pub(crate) use volume::VolumeEnergy;

use glam::DMat3;

/// A hyperelastic material: a stored energy of the deformation gradient F.
pub trait Hyperelastic: Send + Sync {
    /// Energy density at F (J/m3); 0 and smallest at rest.
    fn energy(&self, f: DMat3) -> f64;

    /// First Piola-Kirchhoff stress P = dPsi/dF (Pa).
    fn stress(&self, f: DMat3) -> DMat3;

    /// First-order change of the stress when F changes by `change`: d2Psi/dF2 applied to `change`
    /// (Pa); symmetric as a map.
    fn stress_change(&self, f: DMat3, change: DMat3) -> DMat3;
}

/// Constitutive model by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ConstitutiveModel {
    /// Stable neo-Hookean; the default.
    #[default]
    StableNeoHookean,
    /// St. Venant-Kirchhoff, the paper's.
    StVenantKirchhoff,
    /// Fixed corotated.
    Corotated,
}

impl ConstitutiveModel {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::StableNeoHookean, Self::StVenantKirchhoff, Self::Corotated];
}

/// Material of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Constitutive model.
    pub model: ConstitutiveModel,
    /// Young's modulus (Pa).
    pub young_modulus: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Density (kg/m3).
    pub density: f64,
    /// Shear viscosity eta (Pa s); rigid motion is not damped.
    ///
    /// Each edge of rest length L has a dashpot of 15 eta V/L^2, V being its share of the volume (a
    /// sixth of each element at it). Along edges of all directions the mean of (n'Dn)^2 is (2 D:D +
    /// tr(D)^2)/15 for a rate of strain D, so that an isotropic mesh dissipates eta (2 D:D +
    /// tr(D)^2) per volume: a Newtonian fluid of shear viscosity eta and bulk viscosity 5/3 eta. A
    /// mesh whose edges prefer directions deviates: that of the lattice mesher by up to 11% with
    /// the direction of the shear (3% in the mean), a regular grid of six tetrahedra a cube by 30%.
    /// The strain of an edge is the change of its squared length over a substep, which no rotation
    /// changes.
    pub viscosity: f64,
}

impl Material {
    /// Lame's parameters (mu, lambda) (Pa): mu = E/(2(1+nu)), lambda = E nu/((1+nu)(1-2nu)).
    pub fn lame(&self) -> (f64, f64) {
        let (e, nu) = (self.young_modulus, self.poisson_ratio);
        (e / (2.0 * (1.0 + nu)), e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)))
    }

    /// The part of the energy that limits large stretches; None if the material stiffens by itself.
    pub(crate) fn stretch_energy(&self) -> Option<StretchEnergy> {
        let stiffens = self.model == ConstitutiveModel::StVenantKirchhoff;
        (!stiffens).then(|| StretchEnergy { mu: self.lame().0 })
    }

    /// The material's energy.
    pub fn hyperelastic(&self) -> Box<dyn Hyperelastic> {
        let (mu, lambda) = self.lame();
        match self.model {
            ConstitutiveModel::StableNeoHookean => Box::new(StableNeoHookean::new(mu, lambda)),
            ConstitutiveModel::StVenantKirchhoff => Box::new(StVenantKirchhoff { mu, lambda }),
            ConstitutiveModel::Corotated => Box::new(Corotated { mu, lambda }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn material(model: ConstitutiveModel) -> Material {
        Material { model, young_modulus: 12e3, poisson_ratio: 0.45, density: 1200.0, viscosity: 0.0 }
    }

    /// Some deformation gradients: near rest, sheared, squeezed, stretched, squeezed into the
    /// volume barrier, stretched beyond the limit.
    fn deformations() -> [DMat3; 6] {
        let skew =
            DMat3::from_cols(DVec3::new(1.1, 0.2, -0.1), DVec3::new(-0.3, 0.8, 0.25), DVec3::new(0.05, -0.2, 1.3));
        [
            DMat3::from_diagonal(DVec3::new(1.001, 0.999, 1.0)),
            skew,
            DMat3::from_diagonal(DVec3::new(0.4, 1.2, 1.1)) * skew,
            DMat3::from_diagonal(DVec3::new(2.5, 0.7, 0.6)),
            DMat3::from_diagonal(DVec3::new(0.3, 0.4, 1.0)) * skew,
            DMat3::from_diagonal(DVec3::new(5.0, 0.5, 0.6)) * skew,
        ]
    }

    #[test]
    fn stress_is_the_derivative_of_the_energy() {
        for model in ConstitutiveModel::ALL {
            let psi = material(model).hyperelastic();
            for f in deformations() {
                let stress = psi.stress(f);
                for column in 0..3 {
                    for row in 0..3 {
                        let h = 1e-6;
                        let moved = |by: f64| {
                            let mut f = f;
                            f.col_mut(column)[row] += by;
                            psi.energy(f)
                        };
                        let difference = (moved(h) - moved(-h)) / (2.0 * h);
                        assert!(
                            (difference - stress.col(column)[row]).abs() < 1e-4 * (1.0 + difference.abs()),
                            "{model:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn the_stresss_change_is_its_derivative() {
        for model in ConstitutiveModel::ALL {
            let psi = material(model).hyperelastic();
            for f in deformations() {
                for k in 0..9 {
                    let mut along = [0.0; 9];
                    along[k] = 1.0;
                    let along = DMat3::from_cols_array(&along);
                    let h = 1e-6;
                    let difference = (psi.stress(f + along * h) - psi.stress(f - along * h)) * (0.5 / h);
                    let error = psi.stress_change(f, along) - difference;
                    let norm = |m: DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
                    assert!(norm(error) < 1e-7 * (12e3 + norm(difference)), "{model:?} at {f}: {error}");
                }
            }
        }
    }

    #[test]
    fn rest_is_free_of_stress() {
        for model in ConstitutiveModel::ALL {
            let stress = material(model).hyperelastic().stress(DMat3::IDENTITY);
            assert!(stress.to_cols_array().iter().all(|s| s.abs() < 1e-9 * 12e3), "{model:?}");
        }
    }

    /// A bar pulled by a small strain shows its Young's modulus and, sides left free, its Poisson
    /// ratio.
    #[test]
    fn small_strains_show_the_moduli() {
        for model in ConstitutiveModel::ALL {
            let psi = material(model).hyperelastic();
            let strain = 1e-5;
            let stress =
                psi.stress(DMat3::from_diagonal(DVec3::new(1.0 + strain, 1.0 - 0.45 * strain, 1.0 - 0.45 * strain)));
            assert!(
                (stress.x_axis.x / strain / 12e3 - 1.0).abs() < 1e-3,
                "{model:?}: E = {}",
                stress.x_axis.x / strain
            );
            assert!((stress.y_axis.y / stress.x_axis.x).abs() < 1e-3, "{model:?}: the sides are not free");
        }
    }
}
