//! Numbers with units in messages, and suggestions for numbers in a wrong unit.

use std::ops::RangeInclusive;

/// End of a key, its unit, and the unit that is most often used by mistake, with its size in the
/// first.
type Unit = (&'static str, &'static str, Option<(&'static str, f64)>);

/// Ends of keys with their units, longer ones first.
#[rustfmt::skip]
const UNITS: [Unit; 11] = [
    ("_kg_m3", "kg/m3", Some(("g/cm3", 1e3))),
    ("_j_m2",  "J/m2",  Some(("kJ/m2", 1e3))),
    ("_mm",    "mm",    Some(("m", 1e3))),
    ("_deg",   "degrees", Some(("rad", 180.0 / std::f64::consts::PI))),
    ("_pa",    "Pa",    Some(("kPa", 1e3))),
    ("_nm",    "N m",   Some(("N mm", 1e-3))),
    ("_kg",    "kg",    Some(("g", 1e-3))),
    ("_hz",    "Hz",    None),
    ("_px",    "px",    None),
    ("_m",     "m",     Some(("mm", 1e-3))),
    ("_s",     "s",     Some(("ms", 1e-3))),
];

/// The unit at the end of the field's key; empty if it has none.
pub(super) fn unit_of(field: &str) -> &'static str {
    let key = field.rsplit('.').next().unwrap_or(field);
    let key = key.split('[').next().unwrap_or(key);
    if key.ends_with("_n") {
        return "N";
    }
    UNITS.iter().find(|(ending, ..)| key.ends_with(ending)).map_or("", |(_, unit, _)| unit)
}

/// "; 0.006 m is 6 mm", if the value would be in its range in the unit that is most often used by
/// mistake.
pub(super) fn hint(unit: &str, value: f64, range: &RangeInclusive<f64>) -> String {
    let mistaken = UNITS.iter().find(|(_, u, _)| *u == unit).and_then(|(.., other)| *other);
    match mistaken {
        Some((other, factor)) if value != 0.0 && range.contains(&(value * factor)) => {
            format!("; {} {other} is {} {unit}", show(value), show(value * factor))
        }
        _ => String::new(),
    }
}

/// A number for people, with six digits.
pub(super) fn show(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".to_owned() } else { value.to_string() };
    }
    let magnitude = value.abs();
    if !(1e-5..1e9).contains(&magnitude) {
        return format!("{value:e}");
    }
    let digits = (5 - libm::log10(magnitude).floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (6.0, "6"),
            (0.006, "0.006"),
            (33.557_309_7, "33.5573"),
            (-0.45, "-0.45"),
            (12_000.0, "12000"),
            (1e308, "1e308"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
            (1e-9, "1e-9"),
        ] {
            assert_eq!(show(value), text);
        }
    }

    #[test]
    fn endings_are_units() {
        for (field, unit) in [
            ("port[0].centre_m[2]", "m"),
            ("a.hole_diameter_mm", "mm"),
            ("joint_friction_nm", "N m"),
            ("jaw_force_n", "N"),
            ("density_kg_m3", "kg/m3"),
            ("toughness_j_m2", "J/m2"),
            ("jaw", ""),
            ("friction", ""),
        ] {
            assert_eq!(unit_of(field), unit, "{field}");
        }
    }
}
