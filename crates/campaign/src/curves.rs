//! Robustness curves: the share of episodes that passed, by the values of a factor.

use crate::by::{By, Value};
use crate::interval::Interval;
use crate::store::EpisodeRecord;
use serde::Serialize;
use std::collections::BTreeMap;

/// Most bins of a number, and the fewest episodes of a policy in one of them.
const MAX_BINS: usize = 5;
const MIN_PER_BIN: usize = 4;

/// The episodes of a policy in a row.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Share {
    /// The policy.
    pub policy: String,
    /// Its episodes.
    pub episodes: usize,
    /// Those that passed.
    pub passed: usize,
    /// Their share.
    pub interval: Interval,
}

/// Episodes with the same or neighbouring values.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bin {
    /// The value in words.
    pub value: String,
    /// The smallest, the median and the largest number in it; `None` of names.
    pub numbers: Option<[f64; 3]>,
    /// The policies in order.
    pub policies: Vec<Share>,
}

/// Success over the values of one thing that varied.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Curve {
    /// Its name, as `--by` takes it.
    pub name: String,
    /// The same with its unit.
    pub label: String,
    /// Each value has its own row. Otherwise bins have equal numbers of episodes.
    pub choice: bool,
    /// Drawn evenly in the logarithm.
    pub log: bool,
    /// The rows, by value.
    pub bins: Vec<Bin>,
}

impl Curve {
    /// The curve of `records` over `by`. All `policies` have the same bins, because they have the
    /// same seeds.
    pub(crate) fn of(by: &By, policies: &[&str], records: &[EpisodeRecord]) -> Self {
        let valued: Vec<(&EpisodeRecord, Value)> = records.iter().filter_map(|k| Some((k, by.value(k)?))).collect();
        let single = records
            .iter()
            .find_map(|k| k.summary.drawn.as_ref())
            .is_some_and(|drawn| drawn.values.iter().filter(|v| v.factor.name() == by.name).count() == 1);
        let rows = |of: &dyn Fn(&Value) -> bool| -> Vec<&EpisodeRecord> {
            valued.iter().filter(|(_, value)| of(value)).map(|(k, _)| *k).collect()
        };
        let mut labels: Vec<&str> = Vec::new();
        let mut numbers: BTreeMap<u64, f64> = BTreeMap::new();
        for (record, value) in &valued {
            match value {
                Value::Label(label) if !labels.contains(&label.as_str()) => labels.push(label),
                Value::Label(_) => {}
                Value::Number(number) => _ = numbers.insert(record.seed, *number),
            }
        }
        labels.sort_unstable_by_key(|label| (label.len(), *label));
        let mut numbers: Vec<f64> = numbers.into_values().collect();
        numbers.sort_by(f64::total_cmp);
        let named = labels.iter().map(|label| Bin {
            value: (*label).to_owned(),
            numbers: None,
            policies: shares(policies, &rows(&|value| matches!(value, Value::Label(own) if own == label))),
        });
        let binned = bins(&numbers, by.choice).into_iter().map(|bin| {
            let [low, middle, high] = [bin[0], bin[(bin.len() - 1) / 2], bin[bin.len() - 1]];
            let within = |value: &Value| matches!(value, Value::Number(own) if (low..=high).contains(own));
            let said = |v: f64| significant(v, 3);
            Bin {
                value: if low == high { said(low) } else { format!("{} to {}", said(low), said(high)) },
                numbers: Some([low, middle, high]),
                policies: shares(policies, &rows(&within)),
            }
        });
        let bins = named.chain(binned).collect();
        Self { name: by.name.clone(), label: by.label(single), choice: by.choice, log: by.log, bins }
    }
}

fn shares(policies: &[&str], of: &[&EpisodeRecord]) -> Vec<Share> {
    let share = |policy: &&str| {
        let own = || of.iter().filter(|k| k.name == **policy);
        let (episodes, passed) = (own().count(), own().filter(|k| k.summary.passed).count());
        Share { policy: (*policy).to_owned(), episodes, passed, interval: Interval::wilson(passed, episodes) }
    };
    policies.iter().map(share).collect()
}

/// Sorted `values` in bins of equal numbers of them; one bin a value where `each`. Equal values are
/// in one bin.
fn bins(values: &[f64], each: bool) -> Vec<&[f64]> {
    let count = if each { values.len() } else { (values.len() / MIN_PER_BIN).clamp(1, MAX_BINS) };
    let (mut all, mut start) = (Vec::new(), 0);
    for k in 1..=count {
        let mut end = (k * values.len()).div_ceil(count.max(1));
        while end > start && end < values.len() && values[end] == values[end - 1] {
            end += 1;
        }
        if end > start {
            all.push(&values[start..end]);
            start = end;
        }
    }
    all
}

/// A number with `digits` significant digits, without an exponent.
pub fn significant(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let decimals = (digits - 1 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_have_equal_numbers_and_do_not_part_equal_values() {
        let values: Vec<f64> = (0..20).map(f64::from).collect();
        let sizes = |bins: Vec<&[f64]>| bins.iter().map(|b| b.len()).collect::<Vec<_>>();
        assert_eq!(sizes(bins(&values, false)), [4; 5]);
        assert_eq!(sizes(bins(&values[..15], false)), [5; 3]);
        assert_eq!(sizes(bins(&values[..3], false)), [3]);
        assert_eq!(sizes(bins(&values[..17], false)).iter().sum::<usize>(), 17);
        assert!(bins(&[], false).is_empty() && bins(&[], true).is_empty());
        let ties = [1.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 3.0, 3.0];
        assert_eq!(sizes(bins(&ties, true)), [3, 2, 4]);
        let all: Vec<f64> = bins(&ties, false).concat();
        assert_eq!(all, ties);
        assert!(bins(&ties, false).windows(2).all(|two| two[0].last() < two[1].first()));
    }

    #[test]
    fn numbers_have_significant_digits() {
        assert_eq!(significant(12.3456, 3), "12.3");
        assert_eq!(significant(-0.012_345, 3), "-0.0123");
        assert_eq!(significant(1234.0, 3), "1234");
        assert_eq!(significant(0.0, 3), "0");
    }
}
