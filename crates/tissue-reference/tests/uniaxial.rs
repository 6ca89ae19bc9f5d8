//! A bar pulled and pressed against each material's closed form.
//!
//! Under a stretch s along x and t across, F = diag(s, t, t), J = s t^2, and the sides are free of
//! stress:
//!
//! - St. Venant-Kirchhoff: 2 mu E2 + lambda (E1 + 2 E2) = 0 for Green's strains E1 = (s^2 - 1)/2,
//!   E2 = (t^2 - 1)/2, so E2 = -nu E1, t^2 = 1 - nu (s^2 - 1), and P1 = s (2 mu E1 + lambda (E1 + 2
//!   E2)) = E s (s^2 - 1)/2;
//! - stable neo-Hookean: mu t + l (J - a) s t = 0 with l = lambda + mu and a = 1 + mu/l, so J = a -
//!   mu/(l s), t^2 = J/s, and P1 = mu s + l (J - a) t^2 = mu (s - t^2/s);
//! - corotated: 2 mu (t - 1) + lambda (J - 1) s t = 0, a cubic in t with one root between 0 and (1
//!   + 1/s), found by halving, and P1 = 2 mu (s - 1) + lambda (J - 1) t^2.
//!
//! Stretches go from 0.6 to 1.8; of St. Venant-Kirchhoff tissue from 0.8, since a pressed bar of it
//! gives way sideways, element against element, at less than 0.7.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::DVec3;
use trocar_testing::blocks::{block, nodes, tissue};
use trocar_tissue::{BodyDescription, ConstitutiveModel, MassFloor, Material, ModelBuilder};
use trocar_tissue_reference::{Energy, Held, Oracle, OracleState};

/// Stretch across and nominal stress (Pa).
fn closed_form(material: &Material, s: f64) -> (f64, f64) {
    let (mu, lambda) = material.lame();
    match material.model {
        ConstitutiveModel::StVenantKirchhoff => {
            let t = (1.0 - material.poisson_ratio * (s * s - 1.0)).sqrt();
            (t, material.young_modulus * s * (s * s - 1.0) / 2.0)
        }
        ConstitutiveModel::StableNeoHookean => {
            let l = lambda + mu;
            let t2 = (1.0 + mu / l - mu / (l * s)) / s;
            (t2.sqrt(), mu * (s - t2 / s))
        }
        ConstitutiveModel::Corotated => {
            let across = |t: f64| 2.0 * mu * (t - 1.0) + lambda * (s * t * t - 1.0) * s * t;
            let (mut low, mut high) = ((1.0 / (3.0 * s)).sqrt(), 1.0 + 1.0 / s);
            for _ in 0..200 {
                let t = 0.5 * (low + high);
                *(if across(t) < 0.0 { &mut low } else { &mut high }) = t;
            }
            (low, 2.0 * mu * (s - 1.0) + lambda * (s * low * low - 1.0) * low * low)
        }
    }
}

/// The ends are held as the closed form says; the sides and the inside then find it by themselves,
/// and the energy's derivative is the force.
#[test]
fn a_bar_pulls_and_pushes_as_its_energy_says() {
    let (cells, edge) = ([5, 3, 3], 2e-3);
    let (length, section) = (10e-3, 36e-6);
    let mesh = block(cells, edge);
    let ends = nodes(&mesh, |p| p.x == 0.0 || p.x > 0.999 * length);
    for constitutive in ConstitutiveModel::ALL {
        // St. Venant-Kirchhoff tissue of nu 0.45 has no sides left at a stretch of 1.8.
        for poisson_ratio in if constitutive == ConstitutiveModel::StVenantKirchhoff { [0.0, 0.3] } else { [0.3, 0.45] }
        {
            let material = Material { model: constitutive, poisson_ratio, ..tissue(12e3) };
            let mut builder = ModelBuilder::new().mass_floor(MassFloor::None);
            let (name, supports, pinned) = ("bar".into(), vec![], vec![]);
            builder.body(BodyDescription { name, mesh: &mesh, material, pinned, supports }).unwrap();
            let model = builder.build().unwrap();
            let mut oracle = Oracle::new(&model);
            for way in [-1.0, 1.0] {
                let mut state = OracleState::new(&model);
                for step in 1..=if way > 0.0 {
                    8
                } else if constitutive == ConstitutiveModel::StVenantKirchhoff {
                    2
                } else {
                    4
                } {
                    let s = 1.0 + 0.1 * way * f64::from(step);
                    let mut at = |s: f64| {
                        let (t, _) = closed_form(&material, s);
                        let place = |i: usize| mesh.vertices[i] * DVec3::new(s, t, t);
                        let hold = |i: &u32| Held { body: 0, node: *i, target: place(*i as usize) };
                        let held: Vec<Held> = ends.iter().map(hold).collect();
                        oracle.settle(&model, &mut state, &held).unwrap();
                        let off = (0..mesh.vertices.len()).map(|i| state.positions(0)[i].distance(place(i)));
                        let off = off.fold(0.0, f64::max);
                        let what = format!("{constitutive:?}, nu {poisson_ratio}, stretch {s}");
                        assert!(off < 1e-6 * length, "{what}: {off} m from the closed form");
                        Energy::of(&model, &state).elastic
                    };
                    let d = 1e-4;
                    let force = (at(s + d) - at(s - d)) / (2.0 * d * length);
                    let expected = closed_form(&material, s).1 * section;
                    assert!(
                        (force / expected - 1.0).abs() < 1e-5,
                        "{constitutive:?}, nu {poisson_ratio}, stretch {s}: {force} N, {expected} N"
                    );
                }
            }
        }
    }
}
