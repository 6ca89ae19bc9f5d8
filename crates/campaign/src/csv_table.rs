//! `table.csv`: one line per episode.

use crate::store::EpisodeRecord;
use trocar_workflow::{Error, Result};

/// A column: its name, and its text for an episode.
type Column = (&'static str, fn(&EpisodeRecord) -> String);

/// The columns that all tasks have. The times of the stages follow.
const COLUMNS: [Column; 26] = [
    ("policy", |k| k.name.clone()),
    ("episode", |k| k.index.to_string()),
    ("seed", |k| k.seed.to_string()),
    ("passed", |k| k.summary.passed.to_string()),
    ("stages", |k| k.summary.stage.to_string()),
    ("score", |k| k.summary.score.to_string()),
    ("end", |k| k.summary.end.as_ref().map_or_else(String::new, |e| e.name().to_owned())),
    ("why", why),
    ("duration_s", |k| k.summary.duration_s.to_string()),
    ("attached", |k| k.summary.attached.to_string()),
    ("grasp_at", |k| or_empty(k.summary.grasp_at)),
    ("held_to_end", |k| k.summary.held_to_end.to_string()),
    ("lift_mm", |k| or_empty(k.summary.lift_mm)),
    ("slip_mm", |k| or_empty(k.summary.slip_mm)),
    ("rcm_peak_mm", |k| k.summary.rcm_peak_mm.to_string()),
    ("rcm_loaded_median_mm", |k| or_empty(k.loaded_rcm_mm())),
    ("lag_ms", |k| or_empty(k.lag_ms())),
    ("peak_contact_n", |k| k.peak(|a| a.peak_contact_n).to_string()),
    ("peak_constraint_n", |k| k.peak(|a| a.peak_constraint_n).to_string()),
    ("peak_jaw_n", |k| k.peak(|a| a.peak_jaw_n).to_string()),
    ("inverted_peak", |k| k.summary.inverted_peak.to_string()),
    ("punctures", |k| k.summary.warnings.punctures.to_string()),
    ("pierced", |k| k.summary.warnings.pierced.to_string()),
    ("overstretched", |k| k.summary.warnings.overstretched.to_string()),
    ("folded", |k| k.summary.warnings.folded.to_string()),
    ("state_hash", |k| k.state_hash.clone()),
];

fn or_empty(value: Option<f64>) -> String {
    value.map_or_else(String::new, |v| v.to_string())
}

/// The reason of an episode that did not pass.
fn why(k: &EpisodeRecord) -> String {
    let s = &k.summary;
    if s.passed {
        return String::new();
    }
    s.why.clone().or_else(|| s.end.as_ref().map(ToString::to_string)).unwrap_or_default()
}

/// The drawn values of an episode: names with their values.
fn drawn(k: &EpisodeRecord) -> Vec<(String, String)> {
    let Some(drawn) = &k.summary.drawn else { return Vec::new() };
    drawn.words().into_iter().chain(drawn.values.iter().map(|v| (v.name(), v.value.to_string()))).collect()
}

/// The table of `records`. Its last columns are the times at which the stages of the task passed
/// (s), empty if they did not, and what was drawn for the episode.
pub(super) fn csv_table(records: &[EpisodeRecord]) -> Result<String> {
    let format = |e: csv::Error| Error::Format(e.to_string());
    let stages = records.first().map_or(&[][..], |k| &k.summary.progress.stages);
    let times = stages.iter().map(|s| format!("{}_time_s", s.stage));
    let drawn = records.first().map(drawn).unwrap_or_default();
    let names = drawn.iter().map(|(name, _)| format!("drawn.{name}"));
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record(COLUMNS.iter().map(|(name, _)| (*name).to_owned()).chain(times).chain(names)).map_err(format)?;
    for k in records {
        let times = (0..stages.len()).map(|n| or_empty(k.summary.progress.stages.get(n).and_then(|p| p.time_s)));
        let own = self::drawn(k);
        let value = |name: &String| own.iter().find(|(n, _)| n == name).map(|(_, v)| v.clone()).unwrap_or_default();
        let values = drawn.iter().map(|(name, _)| value(name));
        table.write_record(COLUMNS.iter().map(|(_, text)| text(k)).chain(times).chain(values)).map_err(format)?;
    }
    let bytes = table.into_inner().map_err(|e| Error::Format(e.to_string()))?;
    String::from_utf8(bytes).map_err(|e| Error::Format(e.to_string()))
}
