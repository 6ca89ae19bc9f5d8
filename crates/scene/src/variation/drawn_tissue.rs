//! Drawn values of the support and the tissue of organs, and their names in tables.

use std::collections::BTreeMap;
use trocar_specimen::Parameter;

/// Values of the support and the tissue of organs, by organ and parameter.
pub type DrawnTissue = BTreeMap<(String, Parameter), f64>;

/// The name in tables of a value of an organ, such as `appendix.young_modulus_pa`.
pub(super) fn tissue_name((organ, parameter): &(String, Parameter)) -> String {
    format!("{organ}.{}", parameter.name())
}

/// The organ and the parameter of that name in tables.
pub(super) fn tissue_named(name: &str) -> Option<(String, Parameter)> {
    let (organ, parameter) = name.rsplit_once('.')?;
    Some((organ.to_owned(), Parameter::named(parameter)?))
}
