//! Materials: isotropic laws, split into a deviatoric and a volumetric part.
//!
//! Both parts are free of stress at rest, and the deviatoric one limits strain. Their sum
//! at the same F is the whole law. The linear deviatoric part is mu |dev e|^2, which no change of
//! volume enters; the linear volumetric part is K/2 tr(e)^2. So the first is integrated at eight
//! points and the second at one, without hourglass modes and without locking (Malkus and Hughes,
//! "Mixed finite element methods - reduced and selective integration techniques", 1978).
//!
//! A law is a function of the signed singular values s of F. Its second derivative is diagonal in
//! known modes, which allows an exact projection (Smith, De Goes and Kim, "Analytic eigensystems
//! for isotropic distortion energies", 2019).

mod corotated;
mod limits;
mod stable_neo_hookean;

use crate::points::{Lanes, Matrix, add_at_points, dot};
use fearless_simd::{Simd, SimdBase, SimdMask};
use glam::{DMat3, DVec3};
use limits::{BARRIER_BEGINS, Limits, MAX_FREE_STRETCH_SQUARED};
use trocar_geometry::symmetric::{cofactor, eigen};

/// Constitutive law.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Law {
    /// Rotated linear elasticity, mu |S - I|^2 + lambda/2 tr(S - I)^2 with F = R S. The rotation is
    /// that of each integration point, and its change is part of the derivatives, so that forces
    /// are the gradient of an energy. McAdams and others, "Efficient elasticity for character
    /// skinning with contact and collisions", 2011, equation 1; Chao and others, "A simple
    /// geometric model for elastic deformations", 2010. The default.
    #[default]
    Corotated,
    /// mu/2 (tr(F'F) - 3) - mu (J - 1) + (lambda + mu)/2 (J - 1)^2. Smith, De Goes and Kim, "Stable
    /// neo-Hookean flesh simulation", 2018, without the logarithmic term.
    StableNeoHookean,
}

impl Law {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Corotated, Self::StableNeoHookean];
}

/// Material of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Constitutive law.
    pub law: Law,
    /// Young's modulus (Pa), 1 Pa to 1 GPa.
    pub young_modulus: f64,
    /// Poisson's ratio, 0 to 0.4999.
    pub poisson_ratio: f64,
    /// Density (kg/m3), 1 to 30,000.
    pub density: f64,
}

impl Material {
    /// Shear modulus mu (Pa): E/(2(1 + nu)).
    pub fn shear_modulus(&self) -> f64 {
        self.young_modulus / (2.0 * (1.0 + self.poisson_ratio))
    }

    /// Bulk modulus K (Pa): E/(3(1 - 2 nu)) = lambda + 2/3 mu.
    pub fn bulk_modulus(&self) -> f64 {
        self.young_modulus / (3.0 * (1.0 - 2.0 * self.poisson_ratio))
    }

    /// What limits its strain.
    fn limits(&self) -> Limits {
        let mu = self.shear_modulus();
        Limits { mu, strength: self.bulk_modulus() + mu / 3.0 }
    }

    /// The part of the stress (Pa) at F that limits strain: the barrier below a fifth of the rest
    /// volume and the stiffness of stretches above 4. None where neither acts. It acts at the
    /// points of the deviatoric part.
    pub fn limit_stress(&self, f: DMat3) -> Option<DMat3> {
        self.limits().stress(f).map(|(_, stress)| stress)
    }

    /// What is out of range, and the range.
    pub(crate) fn check(&self) -> Result<(), String> {
        let ranges = [
            ("Young's modulus", self.young_modulus, [1.0, 1e9], " Pa"),
            ("Poisson's ratio", self.poisson_ratio, [0.0, 0.4999], ""),
            ("density", self.density, [1.0, 30_000.0], " kg/m3"),
        ];
        for (name, value, [least, most], unit) in ranges {
            if !(least..=most).contains(&value) {
                return Err(format!("{name} is {value}{unit}; must be in [{least}, {most}]{unit}"));
            }
        }
        Ok(())
    }

    /// Energy density and stress dPsi/dF (Pa) of the volumetric part at F, without singular values.
    pub(crate) fn volumetric(&self, f: DMat3) -> (f64, DMat3) {
        let bulk = self.bulk_modulus();
        match self.law {
            Law::Corotated => {
                let (turn, trace) = corotated::stretch(f);
                (0.5 * bulk * trace * trace, turn * (bulk * trace))
            }
            Law::StableNeoHookean => {
                let areas = cofactor(f);
                let change = f.x_axis.dot(areas.x_axis) - 1.0;
                (0.5 * bulk * change * change, areas * (bulk * change))
            }
        }
    }

    /// Energy density and stress of the deviatoric part at the eight points of a cell, limits of
    /// strain included, at F with the cofactor `areas` and the determinant `ratio`.
    #[inline(always)]
    pub(crate) fn deviatoric<S: Simd>(
        &self,
        simd: S,
        f: &Matrix<Lanes<S>>,
        areas: &Matrix<Lanes<S>>,
        ratio: Lanes<S>,
    ) -> (Lanes<S>, Matrix<Lanes<S>>) {
        let zero = Lanes::<S>::splat(simd, 0.0);
        let (mut density, mut stress) = (zero, [[zero; 3]; 3]);
        let squares = dot(&f[0], &f[0]) + dot(&f[1], &f[1]) + dot(&f[2], &f[2]);
        match self.law {
            Law::Corotated => {
                let mu = self.shear_modulus();
                add_at_points(simd, f, (&mut density, &mut stress), |f| Some(corotated::shear(mu, f)));
            }
            Law::StableNeoHookean => {
                let (mu, change) = (self.shear_modulus(), ratio - 1.0);
                density = ((squares - 3.0) * 0.5 - change + change * change * (1.0 / 6.0)) * mu;
                let by = (change * (1.0 / 3.0) - 1.0) * mu;
                for column in 0..3 {
                    for row in 0..3 {
                        stress[column][row] = f[column][row] * mu + areas[column][row] * by;
                    }
                }
            }
        }
        let limited = squares.simd_gt(Lanes::<S>::splat(simd, MAX_FREE_STRETCH_SQUARED))
            | ratio.simd_lt(Lanes::<S>::splat(simd, BARRIER_BEGINS));
        if limited.any_true() {
            add_at_points(simd, f, (&mut density, &mut stress), |f| self.limits().stress(f));
        }
        (density, stress)
    }

    /// The energy density of a part at the singular values `s` of F, with its derivatives.
    pub(crate) fn at(&self, part: Part, s: DVec3) -> Principal {
        let mut at = match (self.law, part) {
            (Law::Corotated, Part::Deviatoric) => corotated::deviatoric(self.shear_modulus(), s),
            (Law::Corotated, Part::Volumetric) => corotated::volumetric(self.bulk_modulus(), s),
            (Law::StableNeoHookean, Part::Deviatoric) => stable_neo_hookean::deviatoric(self.shear_modulus(), s),
            (Law::StableNeoHookean, Part::Volumetric) => stable_neo_hookean::volumetric(self.bulk_modulus(), s),
        };
        if part == Part::Deviatoric {
            self.limits().add(s, &mut at);
        }
        at
    }
}

/// The two parts of a law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    Deviatoric,
    Volumetric,
}

/// An energy density psi(s) and its derivatives in the frame of the singular vectors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Principal {
    /// psi (J/m3).
    pub energy: f64,
    /// Derivatives psi_i (Pa).
    pub first: DVec3,
    /// Second derivatives psi_ij (Pa).
    pub second: DMat3,
    /// Of the pair of axes other than k: (psi_i - psi_j)/(s_i - s_j), the eigenvalue of symmetric
    /// shear (Pa).
    pub shear: DVec3,
    /// Of the pair of axes other than k: (psi_i + psi_j)/(s_i + s_j), the eigenvalue of rotation
    /// (Pa).
    pub twist: DVec3,
}

impl Principal {
    /// The nearest positive semidefinite second derivative.
    pub fn projected(self) -> Self {
        let (values, axes) = eigen(self.second);
        let second = axes * DMat3::from_diagonal(values.max(DVec3::ZERO)) * axes.transpose();
        Self { second, shear: self.shear.max(DVec3::ZERO), twist: self.twist.max(DVec3::ZERO), ..self }
    }
}

#[cfg(test)]
mod tests;
