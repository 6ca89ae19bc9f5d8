//! What is thought possible before lifts are seen.

use trocar_specimen::{Parameter, Prior};

/// The default ranges.
///
/// Held base: from the cap of the end to two fifths of the organ. Threads: from a fifth of the
/// organ to its very tip, slack by up to 20 mm, and from so weak that they hold nothing (a tenth of
/// the organ's weight at a lift of 10 mm) to so stiff that they hardly yield. Modulus: from 2 to
/// 100 kPa, around the published values of bowel. Poisson's ratio: that of tissue with much water.
pub fn default_priors() -> Vec<Prior> {
    let range = |name: Parameter| match name {
        Parameter::BaseLength => [0.03, 0.4],
        Parameter::ThreadsFrom => [0.2, 0.97],
        Parameter::ThreadsSlack => [0.0, 0.02],
        Parameter::ThreadsStiffness => [5.0, 2e4],
        Parameter::YoungModulus => [3e3, 1e5],
        Parameter::PoissonRatio => [0.3, 0.49],
    };
    Parameter::ALL.map(|name| Prior { name, range: range(name), interval: [0.0; 3], width: 1.0 }).to_vec()
}
