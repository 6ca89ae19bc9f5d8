//! Gives organs the values of identified parameters.

use crate::{End, Organ, Parameter, Pins, Posterior, Threads};

impl Parameter {
    /// Gives an organ the value. A held base replaces the organ's pins; threads hold it up to its
    /// tip.
    pub fn apply(self, value: f64, organ: &mut Organ) {
        let threads = organ.threads.unwrap_or(Threads { from: 0.5, to: 1.0, slack_m: 0.0, stiffness_n_m2: 0.0 });
        match self {
            Self::BaseLength => {
                organ.pins = Pins::End { end: End::Base, length: value, band_length: 0.0, band_share: 0.0 };
            }
            Self::ThreadsFrom => organ.threads = Some(Threads { from: value, to: 1.0, ..threads }),
            Self::ThreadsSlack => organ.threads = Some(Threads { slack_m: value, ..threads }),
            Self::ThreadsStiffness => organ.threads = Some(Threads { stiffness_n_m2: value, ..threads }),
            Self::YoungModulus => organ.material.young_modulus_pa = value,
            Self::PoissonRatio => organ.material.poisson_ratio = value,
        }
    }
}

impl Posterior {
    /// Gives an organ these values.
    pub fn apply(values: &[(Parameter, f64)], organ: &mut Organ) {
        values.iter().for_each(|(parameter, value)| parameter.apply(*value, organ));
    }
}
