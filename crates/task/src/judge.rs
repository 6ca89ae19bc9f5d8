//! Evaluates a task's checked expressions over rows.

use crate::Channels;
use trocar_scene::{Comparison, Condition, HintPart, Number, Operation};

/// Rounding of times (s).
const TICK: f64 = 1e-6;

/// The memory of a condition between rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Memory {
    /// Time since which the condition of a `for` has held without a break (s).
    pub since: Vec<Option<f64>>,
    /// The first part of a `then` has held, and its `during` part ever since.
    pub armed: Vec<bool>,
}

impl Memory {
    pub fn new(timers: usize, marks: usize) -> Self {
        Self { since: vec![None; timers], armed: vec![false; marks] }
    }
}

/// A row, those up to it, and the task's constants.
#[derive(Clone, Copy)]
pub(crate) struct Context<'a> {
    pub row: &'a Channels,
    /// For hints; empty otherwise.
    pub rows: &'a [Channels],
    pub constants: &'a [(String, f64)],
}

impl Context<'_> {
    /// Whether `condition` holds in this row. Every part is evaluated in every row: the memory of
    /// one part does not depend on the others.
    pub fn holds(&self, condition: &Condition, memory: &mut Memory) -> bool {
        match condition {
            Condition::Flag(number) => self.value(number, memory) > 0.0,
            Condition::Compare(a, comparison, b) => {
                let (a, b) = (self.value(a, memory), self.value(b, memory));
                match comparison {
                    Comparison::Less => a < b,
                    Comparison::AtMost => a <= b,
                    Comparison::Greater => a > b,
                    Comparison::AtLeast => a >= b,
                }
            }
            Condition::Within(number, low, high) => {
                let (low, high) = (self.value(low, memory), self.value(high, memory));
                (low..=high).contains(&self.value(number, memory))
            }
            Condition::All(all) => {
                let mut holds = true;
                for condition in all {
                    holds &= self.holds(condition, memory);
                }
                holds
            }
            Condition::Any(all) => {
                let mut holds = false;
                for condition in all {
                    holds |= self.holds(condition, memory);
                }
                holds
            }
            Condition::Not(of) => !self.holds(of, memory),
            Condition::Lasts { what, seconds, timer } => {
                let (holds, now) = (self.holds(what, memory), self.row.time_s);
                let long = self.value(seconds, memory);
                let since = &mut memory.since[*timer];
                *since = holds.then(|| since.unwrap_or(now));
                since.is_some_and(|since| now - since >= long - TICK)
            }
            Condition::Sequence { first, last, during, mark } => {
                let first = self.holds(first, memory);
                let last = self.holds(last, memory);
                let during = during.as_ref().is_none_or(|c| self.holds(c, memory));
                let armed = &mut memory.armed[*mark];
                if last {
                    return std::mem::take(armed);
                }
                *armed = during && (first || *armed);
                false
            }
        }
    }

    /// The value of `number` in this row.
    pub fn value(&self, number: &Number, memory: &mut Memory) -> f64 {
        match number {
            Number::Literal(value) => *value,
            Number::Channel(place) => self.row.at(*place),
            Number::Measure(place) => self.row.measures[*place],
            Number::Constant(place) => self.constants[*place].1,
            Number::Force(side) => {
                let arm = self.row.arms()[*side];
                let all = [
                    arm.contact_x_n + arm.constraint_x_n,
                    arm.contact_y_n + arm.constraint_y_n,
                    arm.contact_z_n + arm.constraint_z_n,
                ];
                glam::DVec3::from_array(all).length()
            }
            Number::Negative(of) => -self.value(of, memory),
            Number::Magnitude(of) => self.value(of, memory).abs(),
            Number::Arithmetic(operation, sides) => {
                let (a, b) = (self.value(&sides[0], memory), self.value(&sides[1], memory));
                match operation {
                    Operation::Add => a + b,
                    Operation::Subtract => a - b,
                    Operation::Multiply => a * b,
                    Operation::Divide => a / b,
                    Operation::Least => a.min(b),
                    Operation::Most => a.max(b),
                }
            }
            Number::Clamp(of) => {
                let [x, low, high] = [0, 1, 2].map(|k| self.value(&of[k], memory));
                if low <= high { x.clamp(low, high) } else { low }
            }
            Number::Near(of) => {
                let [x, within, far] = [0, 1, 2].map(|k| self.value(&of[k], memory));
                (1.0 - (x - within).max(0.0) / far).clamp(0.0, 1.0)
            }
            Number::Choose(condition, sides) => {
                let holds = self.holds(condition, memory);
                self.value(&sides[usize::from(!holds)], memory)
            }
            Number::Lasted(seconds) => {
                let long = self.value(seconds, memory).max(TICK);
                let since = memory.since.first().copied().flatten();
                since.map_or(0.0, |since| ((self.row.time_s - since) / long).clamp(0.0, 1.0))
            }
            Number::Armed => f64::from(u8::from(memory.armed.first().copied().unwrap_or(false))),
            Number::LeastOf(of) => self.over_rows(of).fold(f64::INFINITY, f64::min),
            Number::MostOf(of) => self.over_rows(of).fold(f64::NEG_INFINITY, f64::max),
        }
    }

    fn over_rows<'b>(&'b self, of: &'b Number) -> impl Iterator<Item = f64> + 'b {
        self.rows.iter().map(move |row| Context { row, rows: &[], ..*self }.value(of, &mut Memory::default()))
    }

    /// A hint as a sentence.
    pub fn said(&self, hint: &[HintPart]) -> String {
        let part = |part: &HintPart| match part {
            HintPart::Text(text) => text.clone(),
            HintPart::Value(number, decimals) => {
                let value = self.value(number, &mut Memory::default());
                decimals.map_or_else(|| value.to_string(), |n| format!("{value:.n$}"))
            }
        };
        hint.iter().map(part).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use trocar_scene::{Definition, Gates, InstrumentKind, Program, Side, Stage, TaskContext};

    fn program(when: &str) -> Program {
        let stage = Stage { name: "it".into(), when: when.into(), share: 1.0, ..Stage::default() };
        let context = TaskContext {
            definition: Definition { stages: vec![stage], ..Definition::default() },
            organ: "appendix".into(),
            arms: vec![(Side::Left, InstrumentKind::Grasper), (Side::Right, InstrumentKind::Cutter)],
            constants: BTreeMap::from([("most_n".to_owned(), 2.0)]),
            ..TaskContext::default()
        };
        context.program(&Gates::default()).unwrap()
    }

    /// In which of the rows, one a tenth of a second, `when` holds.
    fn held(when: &str, rows: &[Channels]) -> Vec<bool> {
        let program = program(when);
        let stage = &program.stages[0];
        let mut memory = Memory::new(stage.timers, stage.marks);
        let context = |row| Context { row, rows: &[], constants: &program.constants };
        rows.iter().map(|row| context(row).holds(&stage.when, &mut memory)).collect()
    }

    fn lifts(all: &[f64]) -> Vec<Channels> {
        let row = |(k, lift): (usize, &f64)| {
            let mut row = Channels { time_s: 0.1 * (k + 1) as f64, ..Channels::default() };
            (row.task.lift_mm, row.left.contact_x_n, row.left.constraint_y_n) = (*lift, 3.0, 4.0);
            row
        };
        all.iter().enumerate().map(row).collect()
    }

    #[test]
    fn operators_and_units() {
        let row = lifts(&[9.0]);
        for (when, holds) in [
            ("lift_mm >= 8", true),
            ("lift_mm >= 9 mm and lift_mm <= 0.009 m", true),
            ("lift_mm > 1 m", false),
            ("lift_mm >= gates.lift_mm", true),
            ("lift_mm in [8, 8.5 mm]", false),
            ("not lift_mm < 8 and not not lift_mm > 8", true),
            ("lift_mm < 8 or lift_mm > 8 and lift_mm > 100", false),
            ("(lift_mm < 8 or lift_mm > 8) and lift_mm < 100", true),
            ("force(left) > 4.9 N and force(grasper) < 5.1 N", true),
            ("force(left) > constants.most_n * 2", true),
            ("2 * lift_mm - 10 mm > 7 mm and -lift_mm < -8", true),
            ("lift_mm / 3 mm > 2.9 and abs(-lift_mm) > 8", true),
            ("min(lift_mm, 3 mm) < 4 and clamp(lift_mm, 0, 5) <= 5", true),
            ("choose(grasped, 1, 2) > 1.5", true),
            ("attached(left)", false),
        ] {
            assert_eq!(held(when, &row), [holds], "{when}");
        }
    }

    #[test]
    fn a_time_is_without_a_break() {
        let rows = lifts(&[9.0, 9.0, 9.0, 0.0, 9.0, 9.0, 9.0, 9.0]);
        let t = |when: &str| held(when, &rows).iter().map(|h| u8::from(*h)).collect::<Vec<_>>();
        assert_eq!(t("lift_mm > 8 for 0.3 s"), [0, 0, 0, 0, 0, 0, 0, 1]);
        assert_eq!(t("lift_mm > 8 for 200 ms"), [0, 0, 1, 0, 0, 0, 1, 1]);
        assert_eq!(t("(lift_mm > 8 for 0.1 s) and (lift_mm > 8 for 0.2 s)"), [0, 0, 1, 0, 0, 0, 1, 1]);
    }

    #[test]
    fn one_after_the_other() {
        let rows = lifts(&[1.0, 9.0, 5.0, 1.0, 5.0, 1.0, 9.0, -1.0, 1.0]);
        let t = |when: &str| held(when, &rows).iter().map(|h| u8::from(*h)).collect::<Vec<_>>();
        assert_eq!(t("lift_mm > 8 then lift_mm in [0, 2]"), [0, 0, 0, 1, 0, 0, 0, 0, 1]);
        assert_eq!(t("lift_mm > 8 then lift_mm in [0, 2] while lift_mm > 0"), [0, 0, 0, 1, 0, 0, 0, 0, 0]);
    }
}
