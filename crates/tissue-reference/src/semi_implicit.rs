//! Semi-implicit (symplectic) Euler: velocities from the forces at the positions, then positions
//! from the velocities.
//!
//! Masses are lumped, and the elastic forces are the material's own. Two parts are stiffer than
//! elements, and their treatment must not limit the step. A dashpot acts as the impulse that
//! implicit Euler gives its pair of vertices alone, one after another (it takes energy at any step
//! and keeps both momenta). Friction stops at most the present sliding. The rest limits the step to
//! 2/omega of the stiffest mode ([`stable_explicit_step`]): beyond it the method grows without
//! limit, whatever its settings.

use crate::mechanics::{Mechanics, Particles, Span, too_fast};
use crate::stable_step::stable_explicit_step;
use glam::{DMat3, DVec3};
use trocar_tissue::{ConstitutiveModel, Corotated, Hyperelastic, Material, Model, StVenantKirchhoff, StableNeoHookean};

/// Settings of semi-implicit Euler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SemiImplicit {
    /// Steps a frame.
    pub substeps: usize,
}

/// Share of the stable step that is used: tissue under load is stiffer than at rest.
const USED_SHARE: f64 = 0.7;

/// Least volume ratio at which a stress is evaluated: the volume barrier is infinite at 0, and an
/// explicit step may go there.
const MIN_VOLUME_RATIO: f64 = 0.02;

impl SemiImplicit {
    /// The paper's substeps: 8 a frame.
    pub const PAPER: Self = Self { substeps: 8 };

    /// As many steps as a frame of `dt` (s) of `model` needs to stay bounded: 0.7 of
    /// [`stable_explicit_step`] each.
    pub fn stable(model: &Model, dt: f64) -> Self {
        let step = USED_SHARE * stable_explicit_step(model);
        Self { substeps: ((dt / step).ceil() as usize).max(1) }
    }
}

/// Advances a body by `span` in `substeps` steps; `force` is scratch. Returns false if a vertex
/// reached the speed limit; the body is then as it was at that instant.
pub(crate) fn advance(
    mechanics: &Mechanics,
    material: &Material,
    particles: &mut Particles,
    span: Span<'_>,
    substeps: usize,
    force: &mut [DVec3],
) -> bool {
    let (mu, lambda) = material.lame();
    let form = Form { mechanics, span, substeps };
    match material.model {
        ConstitutiveModel::StableNeoHookean => form.advance(&Unbarred::new(mu, lambda), particles, force),
        ConstitutiveModel::StVenantKirchhoff => form.advance(&StVenantKirchhoff { mu, lambda }, particles, force),
        ConstitutiveModel::Corotated => form.advance(&Corotated { mu, lambda }, particles, force),
    }
}

/// Stable neo-Hookean tissue whose volume barrier continues with its last slope below a volume
/// ratio of [`MIN_VOLUME_RATIO`]: inverted elements have stresses, too.
struct Unbarred(StableNeoHookean);

impl Unbarred {
    fn new(mu: f64, lambda: f64) -> Self {
        Self(StableNeoHookean::new(mu, lambda))
    }
}

impl Stress for Unbarred {
    fn stress(&self, f: DMat3) -> DMat3 {
        let [a, b, c] = [f.x_axis, f.y_axis, f.z_axis];
        let cofactor = DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b));
        let j = a.dot(cofactor.x_axis);
        let slope = self.0.volume_term(j.max(MIN_VOLUME_RATIO)).1 + self.0.lambda * (j - j.max(MIN_VOLUME_RATIO));
        f * self.0.mu + cofactor * slope
    }
}

/// First Piola-Kirchhoff stress (Pa).
trait Stress {
    fn stress(&self, f: DMat3) -> DMat3;
}

impl Stress for StVenantKirchhoff {
    fn stress(&self, f: DMat3) -> DMat3 {
        Hyperelastic::stress(self, f)
    }
}

impl Stress for Corotated {
    fn stress(&self, f: DMat3) -> DMat3 {
        Hyperelastic::stress(self, f)
    }
}

/// A span of a body in so many steps.
struct Form<'a> {
    mechanics: &'a Mechanics,
    span: Span<'a>,
    substeps: usize,
}

impl Form<'_> {
    fn advance<S: Stress>(&self, law: &S, particles: &mut Particles, force: &mut [DVec3]) -> bool {
        let Span { dt, fixed, targets, .. } = self.span;
        let m = self.mechanics;
        let h = dt / self.substeps as f64;
        let Particles { x, v } = particles;
        for (i, v) in v.iter_mut().enumerate().filter(|(i, _)| fixed[*i]) {
            *v = (targets[i] - x[i]) / dt;
        }
        let mut bounded = true;
        for step in 1..=self.substeps {
            self.elastic_forces(law, x, force);
            self.accelerate(h, x, v, force);
            m.damp(h, x, v, fixed);
            if too_fast(v, fixed) {
                bounded = false;
                break;
            }
            for (i, x) in x.iter_mut().enumerate() {
                *x = if fixed[i] && step == self.substeps { targets[i] } else { *x + h * v[i] };
            }
        }
        v.iter_mut().zip(fixed).filter(|(_, fixed)| **fixed).for_each(|(v, _)| *v = DVec3::ZERO);
        bounded
    }

    fn elastic_forces<S: Stress>(&self, law: &S, x: &[DVec3], force: &mut [DVec3]) {
        let m = self.mechanics;
        force.fill(DVec3::ZERO);
        for (t, tet) in m.tets.iter().enumerate() {
            let stress = law.stress(m.deformation(t, x)) * m.volumes[t];
            let mut sum = DVec3::ZERO;
            for (i, gradient) in tet[1..].iter().zip(&m.gradients[t][1..]) {
                let pull = stress * *gradient;
                force[*i as usize] -= pull;
                sum += pull;
            }
            force[tet[0] as usize] += sum;
        }
    }

    /// Velocities after gravity, loads, elastic forces and supports.
    fn accelerate(&self, h: f64, x: &[DVec3], v: &mut [DVec3], force: &[DVec3]) {
        let (m, span) = (self.mechanics, &self.span);
        for i in (0..x.len()).filter(|i| !span.fixed[*i]) {
            let per_mass = h / m.masses[i];
            v[i] += h * span.accelerations[i] + per_mass * force[i];
            for support in &m.supports {
                let touch = support.contact(x[i] + m.origin);
                let depth = -touch.height;
                if depth > 0.0 {
                    let push = per_mass * m.contact_stiffness[i] * depth;
                    v[i] += push * touch.gradient;
                    let normal = touch.gradient.normalize();
                    let sliding = v[i] - v[i].dot(normal) * normal;
                    let speed = sliding.length();
                    if speed > 0.0 {
                        v[i] -= sliding * (support.friction() * touch.gradient.length() * push / speed).min(1.0);
                    }
                }
            }
        }
    }
}
