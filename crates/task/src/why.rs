//! Why an episode did not pass, in one line.

use crate::facts::Facts;
use crate::judge::Context;
use crate::{Channels, End, Progress};
use trocar_cell::CellEvent;
use trocar_scene::Side;

/// Jaws open less than this are closed.
const CLOSED_JAW: f64 = 0.05;

/// Jaws that never come nearer to the organ than this are out of reach (mm): half of a blade.
const OUT_OF_REACH_MM: f64 = 10.0;

/// Why the episode of `rows` with the end `end` did not pass; `None` if it passed or still runs.
pub(crate) fn why(rows: &[Channels], facts: &Facts<'_>, progress: &Progress, end: Option<&End>) -> Option<String> {
    match end? {
        End::Passed => None,
        End::RcmAbort { .. } | End::Diverged { .. } | End::Aborted { .. } | End::PolicyError { .. } => {
            Some(end?.to_string())
        }
        End::TimeOut | End::Finished => Some(Reason { rows, facts }.of(progress.next()?)),
    }
}

struct Reason<'a, 'b> {
    rows: &'a [Channels],
    facts: &'a Facts<'b>,
}

impl Reason<'_, '_> {
    /// Why the stage at `place` did not pass. Of a grasp that is needed and is not there more is
    /// known than a hint can say.
    fn of(&self, place: usize) -> String {
        let program = self.facts.program;
        let Some(stage) = program.stages.get(place) else { return String::new() };
        let last = self.rows.last().copied().unwrap_or_default();
        if stage.needs_grasp {
            if !program.stages[..place].iter().any(|s| s.needs_grasp) {
                return self.no_grasp();
            }
            if last.task.grasped == 0.0 {
                return self.lost_grasp();
            }
        }
        Context { row: &last, rows: self.rows, constants: &program.constants }.said(&stage.hint)
    }

    /// The jaws never held the organ where the gate wants it.
    fn no_grasp(&self) -> String {
        let (organ, gates) = (&self.facts.task.organ, &self.facts.task.gates);
        let attached = self.facts.events.iter().rev().find_map(|(time, e)| match e {
            CellEvent::Attached { arm, organ, s, .. } if Some(*arm) == self.facts.grasper => Some((*time, organ, *s)),
            _ => None,
        });
        if let Some((time, held, s)) = attached {
            if !held.starts_with(organ.as_str()) {
                return format!("wrong organ: at {time:.1} s the jaws took hold of the {held} instead of the {organ}");
            }
            let (from, to) = (gates.grasp_from, gates.grasp_to);
            return format!("wrong place: the jaws took hold of the {organ} at s = {s:.2}; the gate is {from} to {to}");
        }
        let nearest = self.rows.iter().map(|c| c.task.grasp_distance_mm).fold(f64::INFINITY, f64::min);
        if nearest > OUT_OF_REACH_MM {
            return format!("out of reach: the jaws came no nearer than {nearest:.0} mm to the {organ}");
        }
        let jaw = |c: &&Channels| self.grasper(c).is_some_and(|arm| arm.jaw < CLOSED_JAW && arm.attached == 0.0);
        if let Some(closed) = self.rows.iter().find(jaw) {
            let (time, mm) = (closed.time_s, closed.task.grasp_distance_mm);
            let strained = self.facts.events.iter().rev().find_map(|(at, e)| match e {
                CellEvent::Pierced { arm, organ } | CellEvent::Overstretched { arm, organ, .. }
                    if self.grasps(*arm) && *at <= time + 1e-9 =>
                {
                    Some((*at, organ))
                }
                _ => None,
            });
            let before = strained.map_or_else(String::new, |(at, organ)| {
                format!("; at {at:.1} s the grasper had pierced or overstretched the {organ}")
            });
            return format!("empty jaws: they closed on nothing at {time:.1} s, {mm:.0} mm from the {organ}{before}");
        }
        format!("no grasp: the jaws came within {nearest:.0} mm of the {organ} and did not close on it")
    }

    /// The jaws held the organ and do not any more.
    fn lost_grasp(&self) -> String {
        let organ = &self.facts.task.organ;
        let events = self.facts.events;
        let attached = |e: &CellEvent| matches!(e, CellEvent::Attached { arm, .. } if self.grasps(*arm));
        let from = events.iter().rposition(|(_, e)| attached(e)).map_or(0, |k| k + 1);
        let slid = events[from..].iter().find_map(|(time, e)| match e {
            CellEvent::Slipped { arm } if self.grasps(*arm) => Some(*time),
            _ => None,
        });
        let ended = events[from..].iter().find_map(|(time, e)| match e {
            CellEvent::Torn { arm, force_n } if self.grasps(*arm) => {
                Some(format!("torn: the {organ} tore out of the jaws at {time:.1} s, at {force_n:.1} N"))
            }
            CellEvent::Released { arm } if self.grasps(*arm) => {
                // Jaws that open after tissue has slid in them did not lose it by opening.
                Some(match slid.filter(|first| first < time) {
                    Some(first) => format!(
                        "slipped: the {organ} slid in the jaws from {first:.1} s on; they opened at {time:.1} s"
                    ),
                    None => format!("let go: the jaws opened at {time:.1} s"),
                })
            }
            _ => None,
        });
        let slipped = || slid.map(|first| format!("slipped: the {organ} slid out of the jaws from {first:.1} s on"));
        ended.or_else(slipped).unwrap_or_else(|| format!("the jaws do not hold the {organ}"))
    }

    /// Whether `arm` is the one with the first grasper.
    fn grasps(&self, arm: Side) -> bool {
        Some(arm) == self.facts.grasper
    }

    fn grasper<'c>(&self, row: &'c Channels) -> Option<&'c crate::ArmChannels> {
        self.facts.grasper.map(|side| row.arms()[side as usize])
    }
}
