//! The organs of a phantom on their bed.

use crate::bed::Bed;
use crate::noise;
use crate::spec::{Organ, PhantomSpec};

/// The anatomy in front of the camera, in the camera frame.
pub(crate) struct Anatomy {
    pub organs: Vec<Organ>,
    pub bed: Bed,
}

impl Anatomy {
    /// The anatomy of a seed: the specification with random variations.
    pub fn new(spec: &PhantomSpec, seed: u64) -> Self {
        let mut bed = Bed::new(spec.bed, noise::key(&[seed, 1]));
        let mut organs = (spec.organs)(seed, &bed);
        organs.sort_by_key(|o| spec.organ_names.iter().position(|name| *name == o.name));
        bed.imprint(organs.iter().map(|o| o.body.clone()).collect());
        Self { organs, bed }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;
    use crate::body::{Body, gap};
    use crate::{phantom_a, phantom_b, phantom_c, phantom_d};
    use glam::DVec3;
    use std::sync::OnceLock;
    use trocar_camera::Camera;
    use trocar_geometry::{SignedDistance, isosurface, sample_distance};

    const SPECS: [&PhantomSpec; 4] = [&phantom_a::SPEC, &phantom_b::SPEC, &phantom_c::SPEC, &phantom_d::SPEC];
    const SEEDS: std::ops::Range<u64> = 0..6;

    /// A phantom with a seed.
    struct Case {
        spec: &'static PhantomSpec,
        seed: u64,
        anatomy: Anatomy,
        which: String,
    }

    /// All phantoms for all seeds, built once.
    fn cases() -> &'static [Case] {
        static CASES: OnceLock<Vec<Case>> = OnceLock::new();
        CASES.get_or_init(|| {
            let each = SPECS.into_iter().flat_map(|spec| SEEDS.map(move |seed| (spec, seed)));
            let make = |(spec, seed): (&'static PhantomSpec, u64)| Case {
                spec,
                seed,
                anatomy: Anatomy::new(spec, seed),
                which: format!("{} seed {seed}", spec.name),
            };
            each.map(make).collect()
        })
    }

    #[test]
    fn organs_touch_without_overlap_in_listed_order() {
        for Case { spec, anatomy, which, .. } in cases() {
            let names: Vec<&str> = anatomy.organs.iter().map(|o| o.name).collect();
            assert_eq!(names, spec.organ_names);
            for (i, organ) in anatomy.organs.iter().enumerate() {
                let others = anatomy.organs.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, o)| &o.body);
                let gap = gap(&organ.body, others);
                assert!(gap > 0.0, "{which}: {} overlaps by {gap} m", organ.name);
                assert!(gap < 1e-3, "{which}: {} is {gap} m from its neighbours", organ.name);
            }
        }
    }

    #[test]
    fn organs_are_in_view_with_a_margin() {
        const MARGIN: f64 = 20.0;
        let camera = Camera::d405();
        for Case { anatomy, which, .. } in cases() {
            for organ in &anatomy.organs {
                for p in organ.body.samples() {
                    let q = camera.project(p).unwrap();
                    let inside = q.x.min(camera.width as f64 - q.x).min(q.y.min(camera.height as f64 - q.y));
                    assert!(inside > MARGIN, "{which}: {} is at pixel {q}", organ.name);
                }
            }
        }
    }

    #[test]
    fn base_of_each_organ_is_visible() {
        for Case { anatomy, which, .. } in cases() {
            for organ in &anatomy.organs {
                let base = organ.body.base();
                let first = (0..4000)
                    .map(|i| base * (0.5 + 0.5 * f64::from(i) / 4000.0))
                    .find_map(|p| anatomy.organs.iter().find(|o| o.body.distance(p) < 0.0).map(|o| o.name));
                assert_eq!(first, Some(organ.name), "{which}: the base of {} is hidden", organ.name);
            }
        }
    }

    #[test]
    fn organs_rest_on_the_bed() {
        for Case { anatomy, .. } in cases().iter().filter(|c| c.seed == 0) {
            let under = |p: DVec3| p.with_z(anatomy.bed.height(p.x, p.y));
            for organ in &anatomy.organs {
                let gaps = organ.body.samples().into_iter().map(|p| organ.body.distance(under(p)));
                let nearest = gaps.fold(f64::INFINITY, f64::min);
                assert!(nearest > 0.0, "{} reaches {nearest} m into the bed", organ.name);
                // The gallbladder lies on the liver.
                assert!(nearest < 1e-3 || organ.name == "gallbladder", "{} floats {nearest} m up", organ.name);
            }
        }
    }

    #[test]
    fn signed_distance_has_unit_gradient_near_the_surface() {
        for case in cases().iter().filter(|c| c.seed == 3) {
            for organ in &case.anatomy.organs {
                let body = &organ.body;
                let (mut far, mut points) = (0, 0);
                for (i, p) in body.samples().into_iter().enumerate().step_by(37) {
                    let gradient = DVec3::from_array(
                        [DVec3::X, DVec3::Y, DVec3::Z]
                            .map(|e| (body.distance(p + e * 1e-5) - body.distance(p - e * 1e-5)) / 2e-5),
                    );
                    // A crease between loops has no defined gradient.
                    let creased = matches!(body, Body::Blend(_)) && gradient.length() > 0.2;
                    points += 1;
                    far += usize::from((gradient.length() - 1.0).abs() >= 0.4);
                    let close = (gradient.length() - 1.0).abs() < 0.4 || (creased && gradient.length() < 1.4);
                    assert!(close, "{} sample {i}: {}", organ.name, gradient.length());
                    assert!(body.distance(p).abs() < 0.4e-3, "{} sample {i}: {}", organ.name, body.distance(p));
                }
                assert!(far * 20 <= points, "{}: {far} of {points} gradients differ from 1", organ.name);
            }
        }
    }

    #[test]
    fn surfaces_are_closed_connected_and_of_the_papers_volume() {
        for Case { spec, anatomy, which, .. } in cases() {
            let (paper, within): (&[f64], [f64; 5]) = match spec.name {
                "phantom-b" => (&[0.90, 3.40, 14.9, 0.59, 2.72], [0.12; 5]),
                "phantom-c" => (&[phantom_c::LIVER_VOLUME * 1e6, 45.0], [0.02, 0.15, 0.0, 0.0, 0.0]),
                _ => (&[], [0.0; 5]),
            };
            for (i, organ) in anatomy.organs.iter().enumerate() {
                let surface = sample_distance(&organ.body, organ.body.bounds(), 2.0 * spec.resolution.surface);
                let surface = isosurface(&surface, 0.0);
                assert!(surface.is_watertight(), "{which}: {}", organ.name);
                assert_eq!(surface.components().1, 1, "{which}: {}", organ.name);
                let volume = surface.volume() * 1e6;
                let close = paper.get(i).is_none_or(|cm3| (volume / cm3 - 1.0).abs() < within[i]);
                assert!(close, "{which}: {} has {volume} cm3", organ.name);
            }
        }
    }

    #[test]
    fn every_organ_varies_with_the_seed() {
        for (i, case) in cases().iter().enumerate() {
            for other in cases()[..i].iter().filter(|o| o.spec.name == case.spec.name) {
                for (a, b) in case.anatomy.organs.iter().zip(&other.anatomy.organs) {
                    assert!(a.body.samples() != b.body.samples(), "{} is {}'s {}", case.which, other.which, a.name);
                }
            }
        }
    }
}
