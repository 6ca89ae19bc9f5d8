//! A good policy made worse: by noise, by delay, by a constant offset.

use super::{CHUNK, Policy};
use crate::{Episode, Result};
use std::collections::VecDeque;
use trocar_cell::{Action, ActionSpace, Setpoint, Workspace};
use trocar_scene::EpisodeRandom;

/// Standard deviation of the noise on pivots (rad): about 3 mm at the tip. On roll ten times as
/// much.
pub const NOISE_RAD: f64 = 0.03;
/// And on the insertion (m).
pub const NOISE_M: f64 = 0.003;
/// The noise is drawn so often a second (Hz) and goes straight in between: a hand's tremor and
/// drift, not a buzz that arms filter out.
const NOISE_HZ: f64 = 2.0;
/// How late actions come (s).
pub const DELAY_S: f64 = 0.5;
/// How far each arm goes astray (mm) at the organ, to a side of the seed's choice.
pub const OFFSET_MM: f64 = 5.0;

/// Distance from port to organ that turns millimetres into pivots (m).
const ARM: f64 = 0.12;

/// Changes each arm's targets and keeps them within the limits; other action spaces are left as
/// they are. `change` gets the arm's place, and its first three numbers and roll.
fn changed(episode: &Episode, action: Action, mut change: impl FnMut(usize, &Workspace, &mut [f64])) -> Result<Action> {
    if action.space != ActionSpace::Pivots {
        return Ok(action);
    }
    let mut all = Vec::new();
    for (k, (side, _)) in episode.cell().arms().into_iter().enumerate() {
        let n = &action.numbers[5 * k..5 * k + 5];
        let mut target = Setpoint([n[0], n[1], n[2], n[3], n[4]]);
        let workspace = episode.cell().workspace(side.name())?;
        change(k, workspace, &mut target.0);
        all.push(workspace.clamp(&target));
    }
    Ok(Action::targets(&all))
}

/// A policy with noise on its pivots, insertion and roll.
#[derive(Clone, Debug)]
pub struct Noise<P> {
    inner: P,
    random: EpisodeRandom,
    count: u64,
}

impl<P: Policy> Noise<P> {
    /// Of `inner`.
    pub fn new(inner: P) -> Self {
        Self { inner, random: EpisodeRandom::new(0, "noise"), count: 0 }
    }
}

impl<P: Policy> Policy for Noise<P> {
    fn name(&self) -> &str {
        "noise"
    }

    fn finished(&self) -> bool {
        self.inner.finished()
    }

    fn begin(&mut self, episode: &Episode, seed: u64) -> Result<()> {
        (self.random, self.count) = (EpisodeRandom::new(seed, "noise"), 0);
        self.inner.begin(episode, seed)
    }

    fn act(&mut self, episode: &Episode) -> Result<Vec<Action>> {
        let mut chunk = Vec::with_capacity(CHUNK);
        for action in self.inner.act(episode)? {
            let at = self.count as f64 * episode.cell().period() * NOISE_HZ;
            let (knot, share) = (at as u64, at.fract());
            let draw = |k: usize, n: u64| {
                let index = |knot: u64| 16 * knot + 4 * k as u64 + n;
                // Zero at first: the start stays unchanged.
                let value = |knot: u64| if knot == 0 { 0.0 } else { self.random.normal(index(knot)) };
                value(knot) + share * (value(knot + 1) - value(knot))
            };
            chunk.push(changed(episode, action, |k, workspace, n| {
                let aside = if workspace.as_port().is_some() { NOISE_RAD } else { NOISE_M };
                n[0] += aside * draw(k, 0);
                n[1] += aside * draw(k, 1);
                n[2] += NOISE_M * draw(k, 2);
                n[3] += 10.0 * NOISE_RAD * draw(k, 3);
            })?);
            self.count += 1;
        }
        Ok(chunk)
    }
}

/// A policy whose actions come [`DELAY_S`] late; before the first the arms stay.
#[derive(Clone, Debug)]
pub struct Delay<P> {
    inner: P,
    late: VecDeque<Action>,
}

impl<P: Policy> Delay<P> {
    /// Of `inner`.
    pub fn new(inner: P) -> Self {
        Self { inner, late: VecDeque::new() }
    }
}

impl<P: Policy> Policy for Delay<P> {
    fn name(&self) -> &str {
        "delay"
    }

    fn finished(&self) -> bool {
        self.inner.finished()
    }

    fn begin(&mut self, episode: &Episode, seed: u64) -> Result<()> {
        self.inner.begin(episode, seed)?;
        let stay: Vec<Setpoint> = episode.cell().observe().iter().map(|arm| arm.commanded).collect();
        let count = (DELAY_S / episode.cell().period()).round() as usize;
        self.late = std::iter::repeat_n(Action::targets(&stay), count).collect();
        Ok(())
    }

    fn act(&mut self, episode: &Episode) -> Result<Vec<Action>> {
        let new = self.inner.act(episode)?;
        let count = new.len();
        self.late.extend(new);
        Ok(self.late.drain(..count).collect())
    }
}

/// A policy that believes its instruments elsewhere than they are, by the same way all the time.
#[derive(Clone, Debug)]
pub struct Offset<P> {
    inner: P,
    /// Pivots (rad) and insertion (m) of each arm.
    by: [[f64; 3]; 2],
}

impl<P: Policy> Offset<P> {
    /// Of `inner`.
    pub fn new(inner: P) -> Self {
        Self { inner, by: [[0.0; 3]; 2] }
    }
}

impl<P: Policy> Policy for Offset<P> {
    fn name(&self) -> &str {
        "offset"
    }

    fn finished(&self) -> bool {
        self.inner.finished()
    }

    fn begin(&mut self, episode: &Episode, seed: u64) -> Result<()> {
        let random = EpisodeRandom::new(seed, "offset");
        self.by = [0_u64, 1].map(|k| {
            let way = glam::DVec3::from([0, 1, 2].map(|n| random.normal(4 * k + n)));
            let way = 1e-3 * OFFSET_MM * way.normalize_or(glam::DVec3::X);
            [way.x / ARM, way.y / ARM, way.z]
        });
        self.inner.begin(episode, seed)
    }

    fn act(&mut self, episode: &Episode) -> Result<Vec<Action>> {
        let by = self.by;
        let moved = |action| {
            changed(episode, action, |k, workspace, n| {
                let [a, b, deeper] = by[k.min(1)];
                let arm = if workspace.as_port().is_some() { 1.0 } else { ARM };
                n[0] += arm * a;
                n[1] += arm * b;
                n[2] += deeper;
            })
        };
        self.inner.act(episode)?.into_iter().map(moved).collect()
    }
}
