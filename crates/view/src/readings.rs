//! Readings of an episode for frames and plots: its rows, its stages, and the header of a frame.

use crate::message::{Binary, Data};
use crate::operator::arm_of;
use crate::outbox::Outgoing;
use crate::protocol::{ArmName, Mistake};
use serde_json::{Map, Value, json};
use trocar_task::{Channels, Episode};

/// The last row and the stages, as frames have them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Readings {
    pub row: Vec<f32>,
    pub stages: Vec<f32>,
}

impl Readings {
    /// Takes those of `episode` as it stands.
    pub fn note(&mut self, episode: &Episode) {
        self.row.clear();
        let measures = episode.program().measures.len();
        if let Some(row) = episode.rows().last() {
            self.row.extend(numbers(row, measures).map(|x| x as f32));
        }
        self.stages.clear();
        for stage in &episode.progress().stages {
            let passed = f32::from(u8::from(stage.passed));
            self.stages.extend([passed, stage.share as f32, stage.time_s.map_or(-1.0, |t| t as f32)]);
        }
    }
}

/// Channels, then what the task measures beside.
fn numbers(row: &Channels, measures: usize) -> impl Iterator<Item = f64> {
    row.to_row().into_iter().chain(row.measures.into_iter().take(measures))
}

/// The message `history`: columns of `rows`, by the names of every column, from `from_s` on.
///
/// # Errors
/// A name that is none.
pub(crate) fn history(
    number: Option<i64>,
    (rows, all): (&[Channels], &[String]),
    names: &[String],
    from_s: f64,
) -> Result<Outgoing, Mistake> {
    let unknown = |name: &String| Mistake("value", format!("no channel '{name:.60}'; the scene's message lists them"));
    let place = |name: &String| all.iter().position(|own| own == name).ok_or_else(|| unknown(name));
    let places: Vec<usize> = names.iter().map(place).collect::<Result<_, _>>()?;
    let measures = all.len().saturating_sub(Channels::COUNT);
    let (mut times, mut values) = (Vec::new(), Vec::new());
    for row in rows.iter().filter(|r| r.time_s >= from_s) {
        let numbers: Vec<f64> = numbers(row, measures).collect();
        times.push(row.time_s as f32);
        values.extend(places.iter().map(|k| numbers[*k] as f32));
    }
    let header = json!({"type": "history", "request": number, "channels": names, "from_s": from_s});
    let (mut message, count) = (Binary::new(header), times.len());
    message.add("time".to_owned(), &[count], Data::F32(times));
    message.add("rows".to_owned(), &[count, names.len()], Data::F32(values));
    Ok(Outgoing::Binary(message.into_bytes().into()))
}

/// Who moves each arm, by its name.
pub(crate) fn actors(episode: &Episode, actor: impl Fn(ArmName) -> &'static str) -> Map<String, Value> {
    let arms = episode.cell().arms();
    arms.iter().map(|(side, _)| (side.name().to_owned(), json!(actor(arm_of(*side))))).collect()
}

/// The fields of a frame's header that do not change within a period, of which `step` are done.
pub(crate) fn header(episode: &Episode, step: usize, mode: &str, actor: impl Fn(ArmName) -> &'static str) -> Value {
    json!({
        "step": step, "parts": episode.cell().frames(), "mode": mode, "stage": episode.progress().name(),
        "actors": actors(episode, actor), "value": null, "commands": {"left": null, "right": null},
    })
}
