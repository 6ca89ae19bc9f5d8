//! An episode that is shown: its actions so far, states to return to, and the policy or operator
//! that acts at its head.

use crate::encode::Encoder;
use crate::error::Result;
use crate::haptic::haptic;
use crate::hub::Hub;
use crate::operator::{Actor, Operators};
use crate::pace::Pace;
use crate::policy;
use crate::protocol::ArmName;
use crate::readings::{self, Readings};
use crate::snapshot::Taker;
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;
use trocar_cell::{Action, Cell, CellEvent};
use trocar_scene::Scene;
use trocar_sensors::CameraRig;
use trocar_task::{End, Episode, EpisodeFile, EpisodeState, Kept, Policy, Step};
use trocar_workflow::SurfaceWatch;

/// Time between states that are kept (s).
const KEYFRAME_S: f64 = 1.0;

/// Who acts at the head of a live episode.
pub(crate) struct Live {
    pub policy: Box<dyn Policy + Send>,
    pub policy_name: String,
    chunk: VecDeque<Action>,
    pub operators: Operators,
    pub kept: Kept,
    /// The end that the policy chose or that its failure was: no action leads there.
    ended: Option<End>,
    /// Who moved each arm (left, right) in each period.
    pub actors: Vec<[Actor; 2]>,
    /// The surfaces of which its pictures are made, if it may be kept.
    pub surfaces: SurfaceWatch,
}

/// An episode that is shown.
pub(crate) struct Show {
    pub episode: Episode,
    pub taker: Taker,
    /// The scene of the pictures, which is also that of the taker's meshes.
    drawn: Scene,
    /// `None` for an episode file.
    pub live: Option<Live>,
    pub file: Option<EpisodeFile>,
    /// Whether every state so far was the file's, and the first that was not (s).
    pub differs_s: Option<f64>,
    /// Periods done where the episode stands.
    pub at: usize,
    keyframes: Vec<(usize, EpisodeState)>,
    readings: Readings,
    pub lift: bool,
}

/// Everything outside the episode that a period needs.
pub(crate) struct Around<'a> {
    pub hub: &'a Hub,
    pub encoder: &'a Encoder,
    pub pace: &'a mut Pace,
}

impl Around<'_> {
    /// Sends the local models of tissue to haptic devices.
    fn feel(&self, cell: &mut Cell, operators: Option<&Operators>, step: usize, part: u32) -> Result<()> {
        let clients = self.hub.haptic_clients();
        if clients.is_empty() {
            return Ok(());
        }
        for message in haptic(cell, operators, step, part)? {
            clients.iter().for_each(|client| client.reply(message.clone()));
        }
        Ok(())
    }
}

impl Show {
    /// Of an episode that stands at its start; `file` has what is done in it.
    ///
    /// # Errors
    /// Shapes that cannot be read.
    pub fn new(episode: Episode, file: Option<EpisodeFile>, lift: bool) -> Result<Self> {
        let mut made = Self {
            taker: Taker::of(&episode)?,
            drawn: episode.arranged_scene().clone(),
            episode,
            live: None,
            file,
            differs_s: None,
            at: 0,
            keyframes: Vec::new(),
            readings: Readings::default(),
            lift,
        };
        made.begin();
        if let Some(file) = &made.file
            && format!("{:016x}", made.episode.state_hash()) != file.header.start_hash
        {
            made.differs_s = Some(0.0);
        }
        Ok(made)
    }

    fn begin(&mut self) {
        self.at = 0;
        self.keyframes = vec![(0, self.episode.save())];
        self.readings.note(&self.episode);
    }

    /// Begins the live episode of `seed` by the policy of that name; `records` says whether it may
    /// be kept.
    ///
    /// # Errors
    /// A policy that is none or cannot begin, an episode that cannot be built; the show stays as it
    /// was if the policy is none.
    pub fn reset(&mut self, seed: u64, name: &str, records: bool, stop: &Arc<AtomicBool>) -> Result<()> {
        let had = self.live.take();
        let mut made = match had {
            Some(live) if live.policy_name == name => Ok(live.policy),
            had => {
                let made = policy::make(name, self.lift, &self.episode, stop);
                if made.is_err() {
                    self.live = had;
                }
                made
            }
        }?;
        self.episode.reset(seed)?;
        let arranged = self.episode.arranged_scene();
        if !CameraRig::shows_same(arranged, &self.drawn) {
            self.drawn = arranged.clone();
            self.taker = Taker::of(&self.episode)?;
        }
        made.begin(&self.episode, seed)?;
        let kept = Kept::begin(&self.episode, made.name())?;
        let (chunk, operators) = (VecDeque::new(), Operators::default());
        let mut surfaces = SurfaceWatch::new(records);
        surfaces.see(&self.episode, None);
        let (policy_name, actors) = (name.to_owned(), Vec::new());
        self.live = Some(Live { policy: made, policy_name, chunk, operators, kept, ended: None, actors, surfaces });
        self.begin();
        Ok(())
    }

    /// Periods that are known.
    pub fn head(&self) -> usize {
        self.steps().len()
    }

    fn steps(&self) -> &[(Action, u64)] {
        match (&self.live, &self.file) {
            (Some(live), _) => live.kept.steps(),
            (None, Some(file)) => &file.steps,
            (None, None) => &[],
        }
    }

    /// Whether it stands before its head.
    pub fn in_review(&self) -> bool {
        self.at < self.head()
    }

    /// Whether nothing comes after where it stands.
    pub fn is_over(&self) -> bool {
        !self.in_review() && (self.live.is_none() || self.episode.end().is_some())
    }

    pub fn mode(&self) -> &'static str {
        if self.in_review() {
            "review"
        } else if self.is_over() {
            "ended"
        } else {
            "live"
        }
    }

    /// Length of a period (s).
    pub fn period(&self) -> f64 {
        self.episode.cell().period()
    }

    /// Puts back the state that is kept before the period `to`, unless it is on the way from here.
    ///
    /// # Errors
    /// A state that does not fit, which is a mistake of the program.
    pub fn rewind(&mut self, to: usize) -> Result<()> {
        let kept = self.keyframes.iter().rev().find(|(at, _)| *at <= to);
        if let Some((at, state)) = kept.filter(|(at, _)| self.at > to || *at > self.at) {
            self.episode.restore(state)?;
            self.at = *at;
            self.end_again();
            self.readings.note(&self.episode);
        }
        Ok(())
    }

    /// At the head the episode ends as it had ended, if its policy or a failure ended it.
    fn end_again(&mut self) {
        let of_file = || self.file.as_ref().and_then(|file| file.header.end.as_ref());
        let end = self.live.as_ref().and_then(|live| live.ended.as_ref()).or_else(of_file).cloned();
        if let Some(end) = end.filter(|_| !self.in_review()) {
            self.episode.end_again(&end);
        }
    }

    /// Keeps the end that came without an action.
    fn note_end(&mut self) {
        if let Some(live) = &mut self.live {
            live.ended = self.episode.end().cloned();
        }
    }

    /// Who moves an arm.
    pub fn actor(&self, arm: ArmName) -> &'static str {
        match &self.live {
            Some(live) if !self.in_review() => live.operators.actor(arm).name(),
            _ => "replay",
        }
    }

    fn header(&self, step: usize) -> Value {
        readings::header(&self.episode, step, self.mode(), |arm| self.actor(arm))
    }

    /// Does one period, and gives frames of it unless it is `quiet`. Returns what happened; `None`
    /// where nothing comes after.
    ///
    /// # Errors
    /// A policy or an action that fails ends the episode and is none; what is left is a mistake of
    /// the program.
    pub fn advance(&mut self, around: &mut Around<'_>, quiet: bool) -> Result<Option<Vec<CellEvent>>> {
        let tick = Instant::now();
        let recorded = self.steps().get(self.at).map(|(action, hash)| (action.clone(), *hash));
        let action = match &recorded {
            Some((action, _)) => Some(action.clone()),
            None => self.choose(around.hub, tick)?,
        };
        let Some(action) = action else {
            self.note_end();
            if !quiet {
                self.show(around, 0)?;
            }
            return Ok(None);
        };
        let step = self.step(&action, around, quiet)?;
        let Some(step) = step else {
            self.note_end();
            return Ok(None);
        };
        let hash = self.episode.state_hash();
        match (&recorded, &mut self.live) {
            (Some((_, expected)), _) => {
                if hash != *expected && self.differs_s.is_none() {
                    self.differs_s = Some(self.episode.time());
                }
            }
            (None, Some(live)) => {
                live.kept.add(action, hash);
                live.surfaces.see(&self.episode, Some(&step));
                live.actors.push([ArmName::Left, ArmName::Right].map(|arm| live.operators.actor(arm)));
            }
            (None, None) => {}
        }
        self.at += 1;
        self.end_again();
        self.readings.note(&self.episode);
        let every = (KEYFRAME_S / self.period()).round().max(1.0) as usize;
        if self.at.is_multiple_of(every) && self.keyframes.last().is_none_or(|(at, _)| *at < self.at) {
            self.keyframes.push((self.at, self.episode.save()));
        }
        if !quiet {
            let parts = self.episode.cell().frames();
            self.show(around, parts)?;
        }
        Ok(Some(step.events))
    }

    /// The next action of the policy and the operator; `None` if the episode ends instead.
    fn choose(&mut self, hub: &Hub, tick: Instant) -> Result<Option<Action>> {
        let Self { episode, live: Some(live), .. } = self else { return Ok(None) };
        if episode.end().is_some() {
            return Ok(None);
        }
        let planned = live.operators.plan(episode.cell(), episode.scene(), &hub.commands(), tick)?;
        if planned.iter().all(Option::is_some) && !planned.is_empty() {
            // The policy starts from the present state when it gets an arm back.
            live.chunk.clear();
            return Ok(Some(Action::targets(&planned.into_iter().flatten().collect::<Vec<_>>())));
        }
        if live.chunk.is_empty() {
            match live.policy.act(episode) {
                Ok(chunk) if chunk.is_empty() && live.policy.finished() => episode.finish(),
                Ok(chunk) if chunk.is_empty() => episode.fail("it gave no action"),
                Ok(chunk) => live.chunk.extend(chunk),
                Err(why) => episode.fail(&why.to_string()),
            }
        }
        let Some(action) = live.chunk.pop_front() else { return Ok(None) };
        if planned.iter().all(Option::is_none) {
            return Ok(Some(action));
        }
        let mut targets = policy::targets(episode.cell(), &action)?;
        for (target, own) in targets.iter_mut().zip(planned) {
            *target = own.unwrap_or(*target);
        }
        Ok(Some(Action::targets(&targets)))
    }

    /// Steps the episode; `None` if its action could not be done, which ends it.
    fn step(&mut self, action: &Action, around: &mut Around<'_>, quiet: bool) -> Result<Option<Step>> {
        let begin = around.pace.due();
        let frame_s = trocar_cell::FRAME;
        let (mut part, mut failed, at) = (0, None, self.at);
        let head = self.header(self.at);
        let Self { episode, taker, live, readings, .. } = self;
        let operators = live.as_ref().map(|l| &l.operators);
        let stepped = episode.step_watched(action, &mut |cell: &mut Cell| {
            part += 1;
            if quiet {
                return;
            }
            if failed.is_none() {
                failed = around.feel(cell, operators, at, part).err();
            }
            if part == cell.frames() {
                // The frame of a whole period has its row.
                return;
            }
            if failed.is_none() && around.hub.wants_frame() {
                let mut header = head.clone();
                header["part"] = json!(part);
                header["time_s"] = json!(cell.time() + f64::from(part) * frame_s);
                add_commands(&mut header, operators);
                match taker.take(cell, around.hub.wants(), header, readings) {
                    Ok(snapshot) => around.encoder.give(snapshot),
                    Err(why) => failed = Some(why),
                }
            }
            // The next frame is due after its share of the period. A request is not kept waiting.
            around.hub.inbox.wait(around.pace.due_after(begin, f64::from(part) * frame_s));
        });
        if let Some(why) = failed {
            return Err(why);
        }
        match stepped {
            Ok(step) => Ok(Some(step)),
            Err(why @ trocar_task::Error::Cell(trocar_cell::Error::Action { .. })) => {
                self.episode.fail(&why.to_string());
                Ok(None)
            }
            Err(why) => Err(why.into()),
        }
    }

    /// Gives a frame of the state as it is, after `part` tissue frames of the last period.
    ///
    /// # Errors
    /// A cell of another scene, which is a mistake of the program.
    pub fn show(&mut self, around: &Around<'_>, part: u32) -> Result<()> {
        if part > 0 && !around.hub.wants_frame() {
            return Ok(());
        }
        let parts = self.episode.cell().frames();
        let mut header = self.header(self.at);
        header["part"] = json!(parts);
        header["time_s"] = json!(self.episode.time());
        add_commands(&mut header, self.live.as_ref().map(|l| &l.operators));
        let Self { episode, taker, readings, .. } = self;
        around.encoder.give(taker.take(episode.cell(), around.hub.wants(), header, readings)?);
        Ok(())
    }
}

fn add_commands(header: &mut Value, operators: Option<&Operators>) {
    let shown = |arm: ArmName| {
        let shown = operators?.shown(arm)?;
        let step_ms = 1e3 * shown.tick.elapsed().as_secs_f64();
        Some(json!({"seq": shown.seq, "time_s": shown.time_s, "waited_ms": shown.waited_ms, "step_ms": step_ms}))
    };
    header["commands"] = json!({"left": shown(ArmName::Left), "right": shown(ArmName::Right)});
}
