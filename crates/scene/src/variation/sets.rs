//! The named sets of factors.

use super::{Distribution, Factor, VariationSet};
use Distribution::{LogUniform, Uniform, Within};
use std::collections::BTreeMap;

/// The factors of a set with their distributions.
pub(super) fn factors(set: VariationSet) -> BTreeMap<Factor, Distribution> {
    match set {
        VariationSet::None => BTreeMap::new(),
        VariationSet::Easy => with_starts([
            (Factor::SpecimenShift, Within(3.0)),
            (Factor::SpecimenTurn, Within(8.0)),
            (Factor::Modulus, LogUniform([8.0, 18.0])),
            (Factor::Friction, Uniform([0.4, 0.6])),
            (Factor::CameraShift, Within(2.0)),
            (Factor::CameraTurn, Within(1.0)),
            (Factor::LampScale, Uniform([0.9, 1.1])),
            (Factor::ExposureScale, Uniform([0.9, 1.1])),
        ]),
        VariationSet::Standard => standard(),
        VariationSet::Hard => {
            let mut all = standard();
            all.extend([
                (Factor::SpecimenShift, Within(12.0)),
                (Factor::SpecimenTurn, Within(40.0)),
                (Factor::Modulus, LogUniform([2.0, 96.0])),
                (Factor::Friction, Uniform([0.1, 0.8])),
                (Factor::CameraShift, Within(10.0)),
                (Factor::CameraTurn, Within(6.0)),
                (Factor::LampScale, Uniform([0.5, 1.5])),
                (Factor::ExposureScale, Uniform([0.5, 1.5])),
                (Factor::Density, Uniform([950.0, 1250.0])),
                (Factor::PinScale, Uniform([0.7, 1.3])),
                (Factor::TearForce, Uniform([2.5, 7.5])),
                (Factor::JawForce, Uniform([0.35, 0.8])),
                (Factor::JointFriction, Uniform([0.0, 0.6])),
                (Factor::InstrumentMass, Uniform([0.8, 1.2])),
                (Factor::ControlDelay, Uniform([0.0, 200.0])),
                (Factor::BaseShift, Within(10.0)),
                (Factor::PortShift, Within(4.0)),
                (Factor::PortTilt, Within(5.0)),
                (Factor::FocalScale, Uniform([0.95, 1.05])),
                (Factor::NoiseScale, Uniform([0.5, 2.0])),
                (Factor::GlossScale, Uniform([0.5, 1.5])),
                (Factor::Tint, Uniform([0.8, 1.2])),
            ]);
            all
        }
    }
}

/// The starts of the instruments, as far as in the paper's cell.
pub(super) fn starts() -> BTreeMap<Factor, Distribution> {
    BTreeMap::from([
        (Factor::Tilt, Within(1.0)),
        (Factor::Azimuth, Within(5.0)),
        (Factor::Insertion, Within(5.0)),
        (Factor::Roll, Within(10.0)),
    ])
}

fn with_starts<const N: usize>(more: [(Factor, Distribution); N]) -> BTreeMap<Factor, Distribution> {
    starts().into_iter().chain(more).collect()
}

fn standard() -> BTreeMap<Factor, Distribution> {
    with_starts([
        (Factor::SpecimenShift, Within(8.0)),
        (Factor::SpecimenTurn, Within(20.0)),
        (Factor::Modulus, LogUniform([3.0, 48.0])),
        (Factor::Friction, Uniform([0.2, 0.6])),
        (Factor::CameraShift, Within(5.0)),
        (Factor::CameraTurn, Within(3.0)),
        (Factor::LampScale, Uniform([0.7, 1.3])),
        (Factor::ExposureScale, Uniform([0.7, 1.3])),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_stay_within_the_ranges_of_their_factors() {
        for set in VariationSet::ALL {
            for (factor, distribution) in factors(set) {
                assert!(distribution.mistake().is_none());
                let range = factor.range();
                assert!(distribution.range().iter().all(|v| range.contains(v)), "{}: {}", set.name(), factor.name());
            }
        }
    }
}
