//! The laws against finite differences and Hooke's law.

use super::*;

fn materials() -> impl Iterator<Item = Material> {
    Law::ALL.into_iter().flat_map(|law| {
        [0.0, 0.3, 0.45, 0.499].map(|nu| Material { law, young_modulus: 12e3, poisson_ratio: nu, density: 1200.0 })
    })
}

const STRETCHES: [DVec3; 7] = [
    DVec3::new(1.0, 1.0, 1.0),
    DVec3::new(1.3, 1.1, 0.8),
    DVec3::new(2.0, 0.9, 0.2),
    DVec3::new(1.2, 0.9, -0.3),
    DVec3::new(0.9, 0.9, 0.5),
    // Beyond the limits.
    DVec3::new(0.9, 0.5, 0.3),
    DVec3::new(4.2, 0.6, 0.4),
];

#[test]
fn derivatives_are_those_of_the_energy() {
    for material in materials() {
        for part in [Part::Deviatoric, Part::Volumetric] {
            for s in STRETCHES {
                let exact = material.at(part, s);
                let h = 1e-5;
                let scale = 1e-6 * (material.young_modulus + exact.first.length() + material.bulk_modulus());
                for i in 0..3 {
                    let moved = |by: f64| {
                        let mut t = s;
                        t[i] += by;
                        material.at(part, t)
                    };
                    let (more, less) = (moved(h), moved(-h));
                    let first = (more.energy - less.energy) / (2.0 * h);
                    assert!((first - exact.first[i]).abs() < scale, "{material:?} {part:?} {s}");
                    let second = (more.first - less.first) / (2.0 * h);
                    assert!((second - exact.second.col(i)).length() < scale, "{material:?} {part:?} {s}");
                }
                for [i, j, k] in [[1, 2, 0], [2, 0, 1], [0, 1, 2]] {
                    let twist = exact.twist[k] * (s[i] + s[j]);
                    assert!((twist - exact.first[i] - exact.first[j]).abs() < scale);
                    let shear = exact.shear[k] * (s[i] - s[j]);
                    assert!((shear - exact.first[i] + exact.first[j]).abs() < scale);
                }
            }
        }
    }
}

#[test]
fn rest_is_free_of_stress_in_both_parts() {
    for material in materials() {
        for part in [Part::Deviatoric, Part::Volumetric] {
            let rest = material.at(part, DVec3::ONE);
            assert!(rest.energy.abs() < 1e-12 && rest.first.length() < 1e-9, "{material:?}");
        }
    }
}

/// A bar pulled by a small strain, its sides free, shows its modulus.
#[test]
fn small_strains_show_the_moduli() {
    for material in materials() {
        let (strain, nu) = (1e-6, material.poisson_ratio);
        let s = DVec3::new(1.0 + strain, 1.0 - nu * strain, 1.0 - nu * strain);
        let stress = material.at(Part::Deviatoric, s).first + material.at(Part::Volumetric, s).first;
        assert!((stress.x / strain / 12e3 - 1.0).abs() < 1e-3, "{material:?}: {stress}");
        assert!((stress.y / stress.x).abs() < 1e-3, "{material:?}: {stress}");
    }
}

/// The two parts sum to the law as it is published.
#[test]
fn parts_sum_to_the_law() {
    for material in materials() {
        let mu = material.shear_modulus();
        let lambda = material.bulk_modulus() - 2.0 / 3.0 * mu;
        for s in STRETCHES {
            let (strain, j) = (s - DVec3::ONE, s.element_product());
            let law = match material.law {
                Law::Corotated => mu * strain.length_squared() + 0.5 * lambda * strain.element_sum().powi(2),
                Law::StableNeoHookean => {
                    let (volume, alpha) = (lambda + mu, 1.0 + mu / (lambda + mu));
                    let at = |s: f64, j: f64| 0.5 * mu * (s - 3.0) + 0.5 * volume * (j - alpha).powi(2);
                    at(s.length_squared(), j) - at(3.0, 1.0)
                }
            };
            let law = law + material.limits().stress(DMat3::from_diagonal(s)).map_or(0.0, |(energy, _)| energy);
            let sum = material.at(Part::Deviatoric, s).energy + material.at(Part::Volumetric, s).energy;
            assert!((sum - law).abs() < 1e-12 * (material.bulk_modulus() + law.abs()), "{material:?} {s}");
        }
    }
}
