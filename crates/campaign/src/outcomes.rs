//! How many episodes differ from each other: the figures of the others say nothing new.

use crate::store::EpisodeRecord;
use std::collections::BTreeMap;

/// Smallest difference of a length (mm) and of a force (N) that a real cell can measure.
pub const LENGTH_MM: f64 = 0.01;
pub const FORCE_N: f64 = 0.001;

/// The figures of an episode that are compared.
struct Outcome<'a> {
    /// How it ended, and counts; these are compared exactly.
    counts: (&'a str, [usize; 6]),
    lengths_mm: Vec<Option<f64>>,
    forces_n: Vec<Option<f64>>,
    times_s: Vec<Option<f64>>,
}

impl<'a> Outcome<'a> {
    fn of(record: &'a EpisodeRecord) -> Self {
        let s = &record.summary;
        let (mut lengths_mm, mut forces_n) = (vec![s.lift_mm, s.slip_mm, s.details.gap_mm], Vec::new());
        forces_n.push(s.details.closing_force_n);
        for arm in &s.arms {
            let lengths = [arm.rcm_median_mm, arm.rcm_max_mm, Some(arm.rcm_peak_mm), arm.tracking_rms_mm];
            lengths_mm.extend(lengths);
            forces_n.extend([arm.peak_contact_n, arm.peak_constraint_n, arm.peak_jaw_n].map(Some));
        }
        let stages = s.progress.stages.iter().map(|stage| stage.time_s);
        Self {
            counts: (
                s.end.as_ref().map_or("", |end| end.name()),
                [s.stage, usize::from(s.attached), s.torn, s.cuts, s.details.slipped, s.inverted_peak],
            ),
            lengths_mm,
            forces_n,
            times_s: std::iter::once(Some(s.duration_s)).chain(stages).collect(),
        }
    }

    /// Whether no figure differs by more than can be measured. `period` is the control period (s).
    fn equals(&self, other: &Self, period: f64) -> bool {
        let near = |a: &[Option<f64>], b: &[Option<f64>], most: f64| {
            // Times are whole periods. Rounding must not make a difference of one period look
            // larger.
            let near = |(a, b): (&Option<f64>, &Option<f64>)| match (a, b) {
                (Some(a), Some(b)) => (a - b).abs() <= most * (1.0 + 1e-9),
                (a, b) => a.is_none() == b.is_none(),
            };
            a.len() == b.len() && a.iter().zip(b).all(near)
        };
        self.counts == other.counts
            && near(&self.times_s, &other.times_s, period)
            && near(&self.lengths_mm, &other.lengths_mm, LENGTH_MM)
            && near(&self.forces_n, &other.forces_n, FORCE_N)
    }
}

/// The number of episodes of one policy that differ from each other: by more than 0.01 mm, 0.001 N
/// or one control period (`period_s`) in any figure, or by their end. In the order of `records`, an
/// episode counts if it differs from all that count before it.
pub fn distinct_outcomes(records: &[&EpisodeRecord], period_s: f64) -> usize {
    // By the duration in periods, because equal outcomes are in the same or in neighbouring cells.
    let mut found: BTreeMap<i64, Vec<Outcome<'_>>> = BTreeMap::new();
    let mut count = 0;
    for record in records {
        let cell = (record.summary.duration_s / period_s.max(1e-9)).floor() as i64;
        let outcome = Outcome::of(record);
        // Two cells to either side, because of rounding.
        let beside = cell.saturating_sub(2)..=cell.saturating_add(2);
        if !found.range(beside).flat_map(|(_, of)| of).any(|known| known.equals(&outcome, period_s)) {
            found.entry(cell).or_default().push(outcome);
            count += 1;
        }
    }
    count
}

/// The warning about episodes that repeat others; `None` where all differ.
pub fn repeats(distinct: usize, episodes: usize) -> Option<String> {
    (distinct < episodes).then(|| {
        format!(
            "only {distinct} of {episodes} episodes differ from each other; the others repeat one of them to within \
             {LENGTH_MM} mm, {FORCE_N} N and one control period, so the intervals are too narrow"
        )
    })
}
