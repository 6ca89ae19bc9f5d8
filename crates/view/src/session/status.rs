//! The status messages of a session to all clients.

use super::Session;
use crate::hub::Hub;
use crate::readings::actors;
use serde_json::json;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use trocar_core::Progress;

/// Tells clients how the building goes.
pub(super) struct Telling<'a> {
    pub hub: &'a Hub,
    pub stop: &'a AtomicBool,
}

impl Progress for Telling<'_> {
    fn begin(&self, stage: &str, _: u64) {
        self.hub.tell_status(&json!({"type": "status", "phase": "building", "message": stage}));
    }
    fn advance(&self, _: u64) {}
    fn end(&self) {}
    fn interrupted(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

impl Session {
    /// Tells all how it stands.
    pub(super) fn tell(&mut self) {
        self.told = Instant::now();
        let (show, period) = (&self.show, self.show.period());
        let file = show.file.as_ref();
        let actors = actors(&show.episode, |arm| show.actor(arm));
        let end = show.episode.end().filter(|_| !show.in_review());
        let progress = show.episode.progress();
        let folder = self.recorder.as_ref().map(|r| r.folder.display().to_string());
        let policy = show.live.as_ref().map(|l| l.policy_name.clone());
        let length_s = file.map_or(show.episode.scene().task.episode_s, |_| show.head() as f64 * period);
        self.hub.tell_status(&json!({
            "type": "status", "phase": "ready", "message": "", "scene": show.taker.topology.scene,
            "seed": show.episode.seed(), "policy": policy.or(file.map(|f| f.header.policy.clone())),
            "playing": self.playing && !show.is_over(), "mode": show.mode(), "seeking": self.goal.is_some(),
            "speed_target": self.pace.factor(), "speed_actual": if self.playing { self.pace.actual() } else { 0.0 },
            "time_s": show.episode.time(), "head_s": show.head() as f64 * period, "length_s": length_s,
            "seekable_s": show.head() as f64 * period,
            "end": end.map(|e| json!({"kind": e.name(), "text": e.to_string()})),
            "passed": progress.passed(), "score": progress.score(), "stage": progress.name(), "actors": actors,
            "exact": file.map(|_| show.differs_s.is_none()), "differs_s": show.differs_s, "open": self.open,
            "record": {"folder": folder, "state": self.record_state, "path": self.record_path},
            "seats": self.hub.seats(), "note": self.note,
        }));
    }
}
