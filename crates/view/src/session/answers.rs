//! How a session carries out its clients' requests.

use super::Session;
use super::status::Telling;
use crate::error::Error;
use crate::inbox::{Request, Wish};
use crate::outbox::Outgoing;
use crate::protocol::{ArmName, Mistake, RecordAction, done, error};
use crate::readings::history;
use crate::shapes::channel_names;
use crate::show::Around;
use crate::table::{Folder, no_episodes};
use serde_json::json;
use trocar_core::Progress;

impl Session {
    pub(super) fn answer(&mut self, request: Request) {
        let Request { client, number, wish } = request;
        let (refresh, lost) = (wish == Wish::Refresh, matches!(wish, Wish::Lost(_)));
        let reply = match self.grant(client, number, wish) {
            Ok(reply) => reply,
            Err(mistake) => Some(Outgoing::text(&error(number, &mistake))),
        };
        if let Some(reply) = reply.filter(|_| !refresh && !lost) {
            self.hub.reply(client, reply);
        }
    }

    /// Does what is asked. Returns the reply, unless it is sent later.
    fn grant(
        &mut self,
        client: u32,
        number: Option<i64>,
        wish: Wish,
    ) -> std::result::Result<Option<Outgoing>, Mistake> {
        let done = Some(Outgoing::text(&done(number)));
        match wish {
            Wish::Play => {
                (self.playing, self.note) = (true, None);
                self.pace.restart();
            }
            Wish::Pause => (self.playing, self.steps) = (false, 0),
            Wish::Step(periods) => (self.playing, self.steps) = (false, periods),
            Wish::Speed(factor) => self.pace.set_factor(factor),
            Wish::Reset { seed, policy } => self.reset(seed, policy)?,
            Wish::Seek(time_s) => {
                let to = (time_s / self.show.period()).round().clamp(0.0, self.show.head() as f64) as usize;
                self.show.rewind(to).map_err(internal)?;
                self.goal = Some(to);
            }
            Wish::Open(id) => self.open(id)?,
            Wish::Live => {
                if let Some(live) = self.parked.take() {
                    self.show = *live;
                }
                (self.open, self.goal, self.stale) = (None, None, true);
                if self.show.live.is_none() {
                    return Err(Mistake("state", "there is no live episode: no scene is shown".to_owned()));
                }
            }
            Wish::Record(action) => return self.record(number, action).map(Some),
            Wish::HandBack(arm) => {
                if let Some(live) = &mut self.show.live {
                    live.operators.hand_back(arm);
                }
                self.hub.let_go(arm);
            }
            Wish::History { channels, from_s } => return self.history(number, &channels, from_s).map(Some),
            Wish::Picture { camera, size, quality } => {
                let what = (camera.as_str(), size, quality);
                self.pictures.make(&self.show.episode, what, (&self.hub, client, number))?;
                return Ok(None);
            }
            Wish::Table => {
                let table = match self.folder() {
                    Some(folder) => folder.message(number, self.open.as_deref()),
                    None => no_episodes(number),
                };
                return Ok(Some(Outgoing::text(&table)));
            }
            Wish::Refresh => self.stale = true,
            Wish::Lost(arm) => self.lost(arm),
        }
        Ok(done)
    }

    /// The client that drove an arm has disconnected.
    fn lost(&mut self, arm: ArmName) {
        let had = self.show.live.as_ref().is_some_and(|l| l.operators.actor(arm).name() != "policy");
        if had {
            self.playing = false;
            self.note =
                Some(format!("the operator of the {} arm is gone: paused, the arm holds its place", arm.name()));
        }
    }

    fn reset(&mut self, seed: Option<u64>, policy: Option<String>) -> std::result::Result<(), Mistake> {
        if self.show.live.is_none() {
            if policy.is_some() || seed.is_some_and(|s| s != self.show.episode.seed()) {
                let why = "an episode file is shown; it has its own seed and actions";
                return Err(Mistake("state", why.to_owned()));
            }
            self.show.rewind(0).map_err(internal)?;
            (self.goal, self.stale) = (None, true);
            return Ok(());
        }
        let (seed, policy) = (seed.unwrap_or(self.seed), policy.unwrap_or_else(|| self.policy.clone()));
        let telling = Telling { hub: &self.hub, stop: &self.stop };
        telling.begin("the episode begins", 0);
        for arm in [ArmName::Left, ArmName::Right] {
            self.hub.let_go(arm);
        }
        let made = self.show.reset(seed, &policy, self.recorder.is_some(), &self.stop);
        if let Err(why) = made {
            return Err(Mistake("value", why.to_string()));
        }
        (self.seed, self.policy) = (seed, policy);
        (self.goal, self.stale, self.note) = (None, true, None);
        (self.record_state, self.record_path) = ("none", None);
        if let Some(recorder) = &mut self.recorder {
            recorder.begin();
        }
        self.pace.restart();
        Ok(())
    }

    /// The folder of the table: the one that is shown, or that of the recordings.
    fn folder(&self) -> Option<Folder> {
        self.plan.source.folder().or_else(|| self.recorder.as_ref().map(|r| Folder::Demonstrations(r.folder.clone())))
    }

    fn open(&mut self, id: String) -> std::result::Result<(), Mistake> {
        let folder = self.folder().ok_or_else(no_table)?;
        let path = folder.episode(&id);
        let path = path.ok_or_else(|| Mistake("value", format!("no episode '{id:.60}' in the table")))?;
        let telling = Telling { hub: &self.hub, stop: &self.stop };
        telling.begin("the episode is opened", 0);
        let opened = self.plan.building.episode(&path, &telling).map_err(|why| Mistake("value", why.to_string()))?;
        let before = std::mem::replace(&mut self.show, opened);
        if before.live.is_some() {
            self.parked = Some(Box::new(before));
        }
        (self.open, self.goal, self.stale) = (Some(id), None, true);
        self.hub.tell(&folder.message(None, self.open.as_deref()));
        self.pace.restart();
        Ok(())
    }

    fn record(&mut self, number: Option<i64>, action: RecordAction) -> std::result::Result<Outgoing, Mistake> {
        let Some(recorder) = &mut self.recorder else {
            return Err(Mistake("state", "nothing is recorded: start with --record FOLDER".to_owned()));
        };
        if self.show.live.is_none() {
            return Err(Mistake("state", "an episode file is shown; go back to the live episode".to_owned()));
        }
        let mut reply = done(number);
        if action == RecordAction::Keep {
            if self.show.head() == 0 {
                return Err(Mistake("state", "nothing was done yet".to_owned()));
            }
            recorder.take(&self.hub, self.show.episode.time());
            // A kept recording ends at the head.
            self.show.rewind(self.show.head()).map_err(internal)?;
            while self.show.in_review() {
                let mut around = Around { hub: &self.hub, encoder: &self.encoder, pace: &mut self.pace };
                self.show.advance(&mut around, true).map_err(internal)?;
            }
            let (path, passed) = recorder.keep(&mut self.show).map_err(internal)?;
            reply["path"] = json!(path.display().to_string());
            reply["passed"] = json!(passed);
        }
        let seed = if action == RecordAction::Redo { self.seed } else { self.seed + 1 };
        self.reset(Some(seed), None)?;
        self.record_state = match action {
            RecordAction::Keep => "kept",
            RecordAction::Discard | RecordAction::Redo => "discarded",
        };
        self.record_path = reply["path"].as_str().map(str::to_owned);
        if action == RecordAction::Keep
            && let Some(folder) = self.folder()
        {
            self.hub.tell(&folder.message(None, None));
        }
        Ok(Outgoing::text(&reply))
    }

    fn history(&self, number: Option<i64>, names: &[String], from_s: f64) -> std::result::Result<Outgoing, Mistake> {
        let episode = &self.show.episode;
        history(number, (episode.rows(), &channel_names(episode)), names, from_s)
    }
}

#[allow(clippy::needless_pass_by_value, reason = "what map_err passes")]
fn internal(why: Error) -> Mistake {
    Mistake("internal", why.to_string())
}

fn no_table() -> Mistake {
    Mistake("state", "there is no table: no campaign is shown and nothing is recorded".to_owned())
}
