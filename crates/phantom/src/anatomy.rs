//! The organs of a phantom on their bed.

use crate::bed::Bed;
use crate::noise;
use crate::plan::{Organ, Plan};

/// What lies in front of the camera, in its frame.
pub(crate) struct Anatomy {
    pub organs: Vec<Organ>,
    pub bed: Bed,
}

impl Anatomy {
    /// The anatomy of a seed: the plan, varied.
    pub fn new(plan: &Plan, seed: u64) -> Self {
        let mut bed = Bed::new(plan.bed, noise::key(&[seed, 1]));
        let mut organs = (plan.organs)(seed, &bed);
        organs.sort_by_key(|o| plan.listed.iter().position(|name| *name == o.name));
        bed.imprint(organs.iter().map(|o| o.body.clone()).collect());
        Self { organs, bed }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed test is a failed test")]

    use super::*;
    use crate::body::{Body, gap};
    use crate::{phantom_a, phantom_b, phantom_c};
    use glam::DVec3;
    use trocar_camera::Camera;
    use trocar_geometry::{SignedDistance, isosurface, sample_distance};

    const PLANS: [&Plan; 3] = [&phantom_a::PLAN, &phantom_b::PLAN, &phantom_c::PLAN];
    const SEEDS: std::ops::Range<u64> = 0..6;

    fn every(mut check: impl FnMut(&Plan, &Anatomy, &str)) {
        for plan in PLANS {
            for seed in SEEDS {
                check(plan, &Anatomy::new(plan, seed), &format!("{} seed {seed}", plan.name));
            }
        }
    }

    fn volumes(anatomy: &Anatomy, spacing: f64) -> Vec<f64> {
        anatomy.organs.iter().map(|o| o.body.volume(spacing)).collect()
    }

    #[test]
    fn organs_touch_but_do_not_overlap_and_are_listed_in_order() {
        every(|plan, anatomy, which| {
            let names: Vec<&str> = anatomy.organs.iter().map(|o| o.name).collect();
            assert_eq!(names, plan.listed);
            for (i, organ) in anatomy.organs.iter().enumerate() {
                let others = anatomy.organs.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, o)| &o.body);
                let gap = gap(&organ.body, others);
                assert!(gap > 0.0, "{which}: {} overlaps by {gap} m", organ.name);
                assert!(gap < 1e-3, "{which}: {} is {gap} m from its neighbours", organ.name);
            }
        });
    }

    #[test]
    fn organs_are_in_view_with_a_margin() {
        const MARGIN: f64 = 20.0;
        let camera = Camera::d405();
        every(|_, anatomy, which| {
            for organ in &anatomy.organs {
                for p in organ.body.samples() {
                    let q = camera.project(p).unwrap();
                    let inside = q.x.min(camera.width as f64 - q.x).min(q.y.min(camera.height as f64 - q.y));
                    assert!(inside > MARGIN, "{which}: {} is at pixel {q}", organ.name);
                }
            }
        });
    }

    #[test]
    fn the_camera_sees_where_each_organ_begins() {
        every(|_, anatomy, which| {
            for organ in &anatomy.organs {
                let base = organ.body.base();
                let first = (0..4000)
                    .map(|i| base * (0.5 + 0.5 * f64::from(i) / 4000.0))
                    .find_map(|p| anatomy.organs.iter().find(|o| o.body.distance(p) < 0.0).map(|o| o.name));
                assert_eq!(first, Some(organ.name), "{which}: the base of {} is hidden", organ.name);
            }
        });
    }

    #[test]
    fn organs_rest_on_the_bed() {
        for plan in PLANS {
            let anatomy = Anatomy::new(plan, 0);
            let under = |p: DVec3| p.with_z(anatomy.bed.height(p.x, p.y));
            for organ in &anatomy.organs {
                let gaps = organ.body.samples().into_iter().map(|p| organ.body.distance(under(p)));
                let nearest = gaps.fold(f64::INFINITY, f64::min);
                assert!(nearest > 0.0, "{} reaches {nearest} m into the bed", organ.name);
                // A gallbladder lies on its liver.
                assert!(nearest < 1e-3 || organ.name == "gallbladder", "{} floats {nearest} m up", organ.name);
            }
        }
    }

    #[test]
    fn distance_is_a_distance_near_the_surface() {
        for plan in PLANS {
            for organ in &Anatomy::new(plan, 3).organs {
                let body = &organ.body;
                let (mut far, mut points) = (0, 0);
                for (i, p) in body.samples().into_iter().enumerate().step_by(37) {
                    let gradient = DVec3::from_array(
                        [DVec3::X, DVec3::Y, DVec3::Z]
                            .map(|e| (body.distance(p + e * 1e-5) - body.distance(p - e * 1e-5)) / 2e-5),
                    );
                    // A crease between loops has no slope to speak of.
                    let creased = matches!(body, Body::Blend(_)) && gradient.length() > 0.2;
                    points += 1;
                    far += usize::from((gradient.length() - 1.0).abs() >= 0.4);
                    let close = (gradient.length() - 1.0).abs() < 0.4 || (creased && gradient.length() < 1.4);
                    assert!(close, "{} sample {i}: {}", organ.name, gradient.length());
                    assert!(body.distance(p).abs() < 0.4e-3, "{} sample {i}: {}", organ.name, body.distance(p));
                }
                assert!(far * 20 <= points, "{}: {far} of {points} slopes are off", organ.name);
            }
        }
    }

    #[test]
    fn volumes_are_the_papers() {
        let near = |volume: f64, cm3: f64, share: f64| (volume * 1e6 / cm3 - 1.0).abs() < share;
        for seed in SEEDS {
            let b = volumes(&Anatomy::new(&phantom_b::PLAN, seed), 0.6e-3);
            // Cecum, small bowel, bloc, stomach, appendix.
            for (volume, cm3) in b.iter().zip([0.90, 3.40, 14.9, 0.59, 2.72]) {
                assert!(near(*volume, cm3, 0.12), "B seed {seed}: {} cm3 for {cm3}", volume * 1e6);
            }
            let c = volumes(&Anatomy::new(&phantom_c::PLAN, seed), 2e-3);
            assert!(near(c[0], phantom_c::LIVER * 1e6, 0.02), "seed {seed}: the liver has {} cm3", c[0] * 1e6);
            assert!(near(c[1], 45.0, 0.15), "seed {seed}: the gallbladder has {} cm3", c[1] * 1e6);
        }
    }

    #[test]
    fn surfaces_are_closed_and_of_one_piece_and_seeds_vary_them() {
        for plan in PLANS {
            let mut bounds = Vec::new();
            for seed in SEEDS {
                for organ in Anatomy::new(plan, seed).organs {
                    let surface = sample_distance(&organ.body, organ.body.bounds(), 2.0 * plan.fineness.surface);
                    let surface = isosurface(&surface, 0.0);
                    assert!(surface.is_watertight(), "{} of {} seed {seed}", organ.name, plan.name);
                    assert_eq!(surface.components().1, 1, "{} of {} seed {seed}", organ.name, plan.name);
                    bounds.push(surface.bounds().unwrap());
                }
            }
            let organs = plan.listed.len();
            for (i, organ) in bounds.iter().enumerate().skip(organs) {
                assert!(!bounds[i % organs..i].iter().step_by(organs).any(|b| b == organ), "seeds repeat");
            }
        }
    }
}
