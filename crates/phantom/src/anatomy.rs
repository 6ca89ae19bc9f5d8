//! The organs of a phantom, packed on their bed.

use crate::bed::Bed;
use crate::noise;
use crate::tube::{Shape, Tube};
use glam::DVec3;
use trocar_geometry::SignedDistance;
use trocar_recording::OrganInfo;
use trocar_specimen::{End, Material, Pins};

/// Distance at which two organs touch [m].
const TOUCH: f64 = 0.2e-3;
/// How far above the bed an organ's centreline runs, relative to its height: the rest sinks in.
const LIFT: f64 = 0.45;

/// The organs in the order they are listed in, the paper's; they are laid in another.
const LISTED: [&str; 6] = ["cecum", "bowel-1", "bowel-2", "bowel-3", "stomach", "appendix"];

/// An organ of the phantom.
pub(crate) struct Organ {
    pub name: &'static str,
    pub tube: Tube,
    pub young_modulus: f64,
    pub seed: u64,
}

/// What lies in front of the camera, in its frame.
pub(crate) struct Anatomy {
    pub organs: Vec<Organ>,
    pub bed: Bed,
}

/// A part of the plan: a shape, where it comes from, and the way it slides until it touches what is there.
struct Plan {
    name: &'static str,
    young_modulus: f64,
    shape: Shape,
    /// Where the base should be [mm] if nothing were in the way.
    base: (f64, f64),
    heading_deg: f64,
    slide_deg: f64,
}

/// Sizes give about the mesh sizes of the paper's table I at 1.5 mm voxels.
#[rustfmt::skip]
fn plan() -> [Plan; 6] {
    let shape = |length: f64, across: f64, high: f64, taper, bulge, folds: (f64, f64), bends| Shape {
        length: length * 1e-3, across: across * 1e-3, high: high * 1e-3, taper, bulge,
        folds: (folds.0, folds.1 * 1e-3), bends,
    };
    [
        Plan { name: "cecum", young_modulus: 30e3, base: (-34.0, -20.0), heading_deg: -24.0, slide_deg: 0.0,
               shape: shape(69.88, 8.235, 7.02, 0.80, 0.02, (0.15, 11.0), [0.2, 1.8]) },
        Plan { name: "bowel-1", young_modulus: 30e3, base: (-33.0, 0.0), heading_deg: -16.0, slide_deg: -90.0,
               shape: shape(59.16, 6.0, 4.92, 0.95, 0.0, (0.09, 10.0), [-0.6, 2.0]) },
        Plan { name: "bowel-3", young_modulus: 15e3, base: (-30.0, 20.0), heading_deg: -18.0, slide_deg: -84.0,
               shape: shape(51.34, 5.52, 4.6, 0.95, 0.0, (0.09, 9.0), [0.0, 1.3]) },
        Plan { name: "appendix", young_modulus: 12e3, base: (44.0, -4.0), heading_deg: 78.0, slide_deg: 205.0,
               shape: shape(84.79, 4.55, 4.55, 0.85, 0.0, (0.04, 9.0), [2.9, 2.1]) },
        Plan { name: "stomach", young_modulus: 30e3, base: (-48.0, -14.0), heading_deg: 84.0, slide_deg: 0.0,
               shape: shape(29.24, 5.98, 4.68, 0.70, 0.14, (0.03, 12.0), [-0.9, -0.5]) },
        Plan { name: "bowel-2", young_modulus: 15e3, base: (-4.0, -40.0), heading_deg: -6.0, slide_deg: 96.0,
               shape: shape(20.78, 5.125, 4.5, 0.95, 0.0, (0.08, 9.0), [0.4, 0.4]) },
    ]
}

impl Anatomy {
    /// The anatomy of a seed: the plan, varied, one organ slid against those before it.
    pub fn new(seed: u64) -> Self {
        let mut bed = Bed::new(noise::key(&[seed, 1]));
        let mut organs: Vec<Organ> = Vec::new();
        for (index, mut plan) in plan().into_iter().enumerate() {
            let seed = noise::key(&[seed, 2, index as u64]);
            let vary = |k: u64, by: f64| by * (2.0 * noise::unit(noise::key(&[seed, k])) - 1.0);
            plan.shape.bends[0] += vary(0, 0.12);
            plan.shape.bends[1] += vary(1, 0.12);
            plan.heading_deg += vary(2, 4.0);
            let tube = slide(&plan, seed, &bed, &organs);
            organs.push(Organ { name: plan.name, tube, young_modulus: plan.young_modulus, seed });
        }
        organs.sort_by_key(|o| LISTED.iter().position(|name| *name == o.name));
        bed.imprint(organs.iter().map(|o| o.tube.clone()).collect());
        Self { organs, bed }
    }

    /// Name of an organ and what the paper's materials and pins are for it. `pixel` projects into the image.
    pub fn info(organ: &Organ, pixel: impl Fn(DVec3) -> Option<[f64; 2]>) -> OrganInfo {
        let pins = if organ.name == "appendix" {
            // The left arm grasps: the end on the right is held, and most of the 30% next to it. 0.14 + 0.30 * 0.93 = 0.42 of the
            // length; the free part begins before the middle.
            let end = if organ.tube.base().x > organ.tube.tip().x { End::Base } else { End::Tip };
            Pins::End { end, length: 0.14, band_length: 0.30, band_share: 0.93 }
        } else {
            Pins::Band { share: 0.42 }
        };
        OrganInfo {
            name: organ.name.to_owned(),
            polygon: Vec::new(),
            points: Vec::new(),
            points_outside: Vec::new(),
            base_px: pixel(organ.tube.base()),
            material: Material { young_modulus_pa: organ.young_modulus, ..Material::default() },
            pins,
        }
    }
}

/// Distance between `tube`'s surface and the nearest of `others` [m], negative where they overlap. Sampled on both.
pub(crate) fn gap<'a>(tube: &Tube, others: impl Iterator<Item = &'a Tube>) -> f64 {
    let least = |of: &Tube, to: &Tube| of.samples().into_iter().map(|p| to.distance(p)).fold(f64::INFINITY, f64::min);
    others.map(|o| least(tube, o).min(least(o, tube))).fold(f64::INFINITY, f64::min)
}

/// Starts far off and moves by as much as the gap allows until it closes.
fn slide(plan: &Plan, seed: u64, bed: &Bed, organs: &[Organ]) -> Tube {
    const START: f64 = 0.12;
    const STEPS: usize = 200;
    let (sin, cos) = plan.slide_deg.to_radians().sin_cos();
    let lift = LIFT * plan.shape.high;
    let at = |along: f64| {
        let base = (plan.base.0 * 1e-3 + along * cos, plan.base.1 * 1e-3 + along * sin);
        Tube::lay(plan.shape, seed, base, plan.heading_deg.to_radians(), |x, y| bed.smooth_height(x, y) - lift)
    };
    if organs.is_empty() {
        return at(0.0);
    }
    let mut along = -START;
    for _ in 0..STEPS {
        let gap = gap(&at(along), organs.iter().map(|o| &o.tube));
        if gap < 1.5 * TOUCH || along > START {
            break;
        }
        // Less than the gap: the distance is only an estimate.
        along += (0.7 * (gap - TOUCH)).max(0.02e-3);
    }
    at(along)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn organs_touch_but_do_not_overlap() {
        for seed in 0..6 {
            let anatomy = Anatomy::new(seed);
            for (i, organ) in anatomy.organs.iter().enumerate() {
                let others = anatomy.organs.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, o)| &o.tube);
                let gap = gap(&organ.tube, others);
                assert!(gap > 0.0, "seed {seed}: {} overlaps by {gap} m", organ.name);
                assert!(gap < 1e-3, "seed {seed}: {} is {gap} m from its neighbours", organ.name);
            }
        }
    }

    #[test]
    fn organs_rest_on_the_bed() {
        let anatomy = Anatomy::new(0);
        for organ in &anatomy.organs {
            let under = |p: DVec3| p.with_z(anatomy.bed.height(p.x, p.y));
            let gaps = organ.tube.samples().into_iter().map(|p| organ.tube.distance(under(p)));
            let nearest = gaps.fold(f64::INFINITY, f64::min);
            assert!(nearest > 0.0, "{} reaches {nearest} m into the bed", organ.name);
            assert!(nearest < 1e-3, "{} floats {nearest} m above the bed", organ.name);
        }
    }

    #[test]
    fn distance_is_a_distance_near_the_surface() {
        for organ in &Anatomy::new(3).organs {
            let tube = &organ.tube;
            for (i, p) in tube.samples().into_iter().enumerate().step_by(37) {
                let gradient = DVec3::from_array(
                    [DVec3::X, DVec3::Y, DVec3::Z]
                        .map(|e| (tube.distance(p + e * 1e-5) - tube.distance(p - e * 1e-5)) / 2e-5),
                );
                assert!((gradient.length() - 1.0).abs() < 0.4, "{} sample {i}: {}", organ.name, gradient.length());
                assert!(tube.distance(p).abs() < 0.4e-3, "{} sample {i}: {}", organ.name, tube.distance(p));
            }
        }
    }
}
