//! Checks of a parsed scene: ranges, units, names, and parts that fit together. The first mistake
//! is reported.

mod anatomy;
mod camera;
mod cell;
mod task;
mod unit;
mod variation;

use crate::Scene;
use std::ops::RangeInclusive;
use trocar_specimen::nearest;
use unit::{hint, show, unit_of};

pub(crate) use anatomy::check_organs;

/// A mistake.
#[derive(Debug)]
pub(crate) struct Problem {
    /// Path of the field.
    pub field: String,
    /// The rest of the message: " is 3; it must be ...".
    pub reason: String,
}

/// Result of a check.
pub(crate) type Checked = Result<(), Problem>;

/// Checks everything that does not depend on the specimen's organs.
pub(crate) fn check(scene: &Scene) -> Checked {
    name("name", &scene.name)?;
    anatomy::check(scene)?;
    cell::check(scene)?;
    camera::check(scene)?;
    task::check(scene)?;
    variation::check(scene)
}

/// A mistake in the field `at`.
fn problem(at: impl Into<String>, reason: String) -> Problem {
    Problem { field: at.into(), reason }
}

/// `{at}.{key}`, or the key alone at the top level.
fn join(at: &str, key: &str) -> String {
    if at.is_empty() { key.to_owned() } else { format!("{at}.{key}") }
}

/// Checks that numbers are in their ranges. The end of a key is its unit.
fn numbers(at: &str, fields: &[(&str, f64, RangeInclusive<f64>)]) -> Checked {
    fields.iter().try_for_each(|(key, value, range)| number(&join(at, key), *value, range))
}

/// Checks that a number is in its range.
fn number(field: &str, value: f64, range: &RangeInclusive<f64>) -> Checked {
    if range.contains(&value) {
        return Ok(());
    }
    let unit = unit_of(field);
    let (low, high) = (show(*range.start()), show(*range.end()));
    let space = if unit.is_empty() { "" } else { " " };
    Err(problem(
        field,
        format!(" is {}; it must be in [{low}, {high}]{space}{unit}{}", show(value), hint(unit, value, range)),
    ))
}

/// Checks a point of the cell: its coordinates are within 5 m of the origin.
fn point(field: &str, value: [f64; 3]) -> Checked {
    const MAX_COORDINATE_M: f64 = 5.0;
    let range = -MAX_COORDINATE_M..=MAX_COORDINATE_M;
    value.iter().enumerate().try_for_each(|(k, v)| number(&format!("{field}[{k}]"), *v, &range))
}

/// Tolerance of the length of unit vectors and quaternions. Typed ones have four decimals or more.
const UNIT_TOLERANCE: f64 = 1e-4;

/// Checks that a vector or quaternion has length 1.
fn unit(field: &str, value: &[f64], what: &str) -> Checked {
    let length = value.iter().map(|v| v * v).sum::<f64>().sqrt();
    if (length - 1.0).abs() <= UNIT_TOLERANCE {
        return Ok(());
    }
    let right = if length.is_finite() && length > 1e-9 {
        let parts: Vec<String> = value.iter().map(|v| show((v / length * 1e6).round() / 1e6)).collect();
        format!(": [{}]", parts.join(", "))
    } else {
        String::new()
    };
    Err(problem(field, format!(" has length {}; it must be {what}{right}", show(length))))
}

fn quaternion(field: &str, value: [f64; 4]) -> Checked {
    unit(field, &value, "a unit quaternion, scalar first")
}

/// Checks a name: 1 to 64 lower-case letters, digits, `-` and `_`.
fn name(field: &str, value: &str) -> Checked {
    let legal = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
    if !value.is_empty() && value.len() <= 64 && value.chars().all(legal) {
        return Ok(());
    }
    let shown: String = value.chars().take(70).flat_map(char::escape_default).collect();
    Err(problem(field, format!(" is '{shown}'; it must be 1 to 64 lower-case letters, digits, '-' and '_'")))
}

/// Maximum number of cameras, ports or instruments.
const MAX_ENTRIES: usize = 16;

/// Checks the names of a list: they are valid and unique, and there are not too many.
fn names<'a>(list: &str, all: impl Iterator<Item = &'a str>) -> Checked {
    let mut seen: Vec<&str> = Vec::new();
    for (i, value) in all.enumerate() {
        if i == MAX_ENTRIES {
            return Err(problem(
                list,
                format!(" has more than {MAX_ENTRIES} entries; it must have at most {MAX_ENTRIES}"),
            ));
        }
        let field = format!("{list}[{i}].name");
        name(&field, value)?;
        if let Some(first) = seen.iter().position(|s| *s == value) {
            return Err(problem(
                field,
                format!(" is '{value}', which {list}[{first}] already has; names must be unique"),
            ));
        }
        seen.push(value);
    }
    Ok(())
}

/// Checks that `value` is one of `known`.
fn one_of(field: &str, value: &str, what: &str, known: &[&str]) -> Checked {
    if known.contains(&value) {
        return Ok(());
    }
    let shown: String = value.chars().take(70).flat_map(char::escape_default).collect();
    let hint = nearest(value, known.iter().copied()).map_or_else(String::new, |n| format!("; did you mean '{n}'?"));
    Err(problem(field, format!(" is '{shown}'; {what}: {}{hint}", known.join(", "))))
}
