//! What a scene must be beyond its form: ranges, units, names, and parts that fit together. The
//! first mistake is reported.

mod anatomy;
mod camera;
mod cell;
mod task;
mod unit;

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
    /// What follows it in the message: " is 3; what would be right".
    pub reason: String,
}

/// Result of a check.
pub(crate) type Checked = Result<(), Problem>;

/// Checks all that can be seen without the specimen's organs.
pub(crate) fn check(scene: &Scene) -> Checked {
    name("name", &scene.name)?;
    anatomy::check(scene)?;
    cell::check(scene)?;
    camera::check(scene)?;
    task::check(scene)
}

/// A mistake of the field `at`.
fn problem(at: impl Into<String>, reason: String) -> Problem {
    Problem { field: at.into(), reason }
}

/// `{at}.{key}`, the key alone at the top.
fn join(at: &str, key: &str) -> String {
    if at.is_empty() { key.to_owned() } else { format!("{at}.{key}") }
}

/// Numbers lie in their ranges; the key's ending is their unit.
fn numbers(at: &str, fields: &[(&str, f64, RangeInclusive<f64>)]) -> Checked {
    fields.iter().try_for_each(|(key, value, range)| number(&join(at, key), *value, range))
}

/// One number lies in its range.
fn number(field: &str, value: f64, range: &RangeInclusive<f64>) -> Checked {
    if range.contains(&value) {
        return Ok(());
    }
    let unit = unit_of(field);
    let (low, high) = (show(*range.start()), show(*range.end()));
    let space = if unit.is_empty() { "" } else { " " };
    Err(problem(field, format!(" is {}; {low} to {high}{space}{unit}{}", show(value), hint(unit, value, range))))
}

/// A point of the cell: no part of it is farther than 5 m from the origin.
fn point(field: &str, value: [f64; 3]) -> Checked {
    const FARTHEST_M: f64 = 5.0;
    let range = -FARTHEST_M..=FARTHEST_M;
    value.iter().enumerate().try_for_each(|(k, v)| number(&format!("{field}[{k}]"), *v, &range))
}

/// How far from 1 the length of what should be a unit may be; typed ones have four decimals or
/// more.
const UNIT_TOLERANCE: f64 = 1e-4;

/// A vector or quaternion of length 1.
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
    Err(problem(field, format!(" has length {}; {what}{right}", show(length))))
}

fn quaternion(field: &str, value: [f64; 4]) -> Checked {
    unit(field, &value, "a unit quaternion, scalar first")
}

/// A name: lower-case letters, digits, `-` and `_`, 1 to 64 of them.
fn name(field: &str, value: &str) -> Checked {
    let legal = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
    if !value.is_empty() && value.len() <= 64 && value.chars().all(legal) {
        return Ok(());
    }
    let shown: String = value.chars().take(70).flat_map(char::escape_default).collect();
    Err(problem(field, format!(" is '{shown}'; lower-case letters, digits, '-' and '_', 1 to 64 of them")))
}

/// Most entries of a list: more cameras, ports or instruments than a cell has room for.
const MOST_ENTRIES: usize = 16;

/// The names of a list are names, each is used once, and there are not too many.
fn names<'a>(list: &str, all: impl Iterator<Item = &'a str>) -> Checked {
    let mut seen: Vec<&str> = Vec::new();
    for (i, value) in all.enumerate() {
        if i == MOST_ENTRIES {
            return Err(problem(list, format!(" has more than {MOST_ENTRIES} entries; {MOST_ENTRIES} or fewer")));
        }
        let field = format!("{list}[{i}].name");
        name(&field, value)?;
        if let Some(first) = seen.iter().position(|s| *s == value) {
            return Err(problem(field, format!(" is '{value}', as that of {list}[{first}] is; names are unique")));
        }
        seen.push(value);
    }
    Ok(())
}

/// `value` is one of the `known`.
fn one_of(field: &str, value: &str, what: &str, known: &[&str]) -> Checked {
    if known.contains(&value) {
        return Ok(());
    }
    let shown: String = value.chars().take(70).flat_map(char::escape_default).collect();
    let hint = nearest(value, known.iter().copied()).map_or_else(String::new, |n| format!("; did you mean '{n}'?"));
    Err(problem(field, format!(" is '{shown}'; {what}: {}{hint}", known.join(", "))))
}
