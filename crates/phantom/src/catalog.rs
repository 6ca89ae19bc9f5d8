//! The available phantoms.

use crate::spec::PhantomSpec;
use crate::{Error, Result, phantom_a, phantom_b, phantom_c, phantom_d};
use trocar_specimen::nearest;

/// The specifications of all phantoms.
pub(crate) const SPECS: [&PhantomSpec; 4] = [&phantom_a::SPEC, &phantom_b::SPEC, &phantom_c::SPEC, &phantom_d::SPEC];

/// Names of the phantoms: `phantom-a` and `phantom-b` are rabbits, `phantom-c` is a porcine liver
/// with its gallbladder, `phantom-d` a small liver with a folded gallbladder.
pub const NAMES: [&str; 4] = [SPECS[0].name, SPECS[1].name, SPECS[2].name, SPECS[3].name];

/// The specification of the phantom `name`.
pub(crate) fn named(name: &str) -> Result<&'static PhantomSpec> {
    let unknown = || Error::Unknown { name: name.to_owned(), nearest: nearest(name, NAMES), known: NAMES.join(", ") };
    SPECS.into_iter().find(|p| p.name == name).ok_or_else(unknown)
}
