//! Who acts where no operator does.

use crate::error::Result;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use trocar_campaign::PolicySpec;
use trocar_cell::{Action, ActionSpace, Cell, Setpoint};
use trocar_core::Pose;
use trocar_task::policy::{POLICIES, Scripted};
use trocar_task::{Episode, Policy};
use trocar_workflow::Lift;

/// The name of the policy that holds all arms where they are.
pub(crate) const OPERATOR: &str = "operator";

/// Holds all arms where they are, for an operator.
struct Still;

impl Policy for Still {
    fn name(&self) -> &str {
        OPERATOR
    }

    fn begin(&mut self, _: &Episode, _: u64) -> trocar_task::Result<()> {
        Ok(())
    }

    fn act(&mut self, episode: &Episode) -> trocar_task::Result<Vec<Action>> {
        let arms = episode.cell().observe();
        Ok(vec![Action::targets(&arms.iter().map(|arm| arm.commanded).collect::<Vec<_>>())])
    }
}

/// Names of the policies that a page offers, with the one of `--policy`.
pub(crate) fn names(own: &str) -> Vec<String> {
    let mut all: Vec<String> = POLICIES.iter().map(|n| (*n).to_owned()).collect();
    all.push(OPERATOR.to_owned());
    if !all.iter().any(|n| n == own) {
        all.push(own.to_owned());
    }
    all
}

/// The policy of that name for `episode`. With `lift` the scripted one is that of
/// `trocar simulate`.
///
/// # Errors
/// A name that is none, a server that does not answer.
pub(crate) fn make(
    name: &str,
    lift: bool,
    episode: &Episode,
    stop: &Arc<AtomicBool>,
) -> Result<Box<dyn Policy + Send>> {
    if name == OPERATOR {
        return Ok(Box::new(Still));
    }
    if name == "scripted" && lift {
        return Ok(Box::new(Scripted::following(Lift::default().script)));
    }
    let spec = PolicySpec::parse(name)?;
    Ok(trocar_campaign::make_policy(&spec, episode, stop)?)
}

/// The absolute target of each arm by an action.
///
/// # Errors
/// Numbers that are no pose.
pub(crate) fn targets(cell: &Cell, action: &Action) -> Result<Vec<Setpoint>> {
    let mut all = Vec::new();
    for ((side, _), n) in cell.arms().iter().zip(action.numbers.chunks_exact(5)) {
        let arm = side.name();
        all.push(match action.space {
            ActionSpace::Pivots => Setpoint([n[0], n[1], n[2], n[3], n[4]]),
            ActionSpace::Tip => {
                let from = cell.setpoint(arm)?;
                let from = from.with_roll(from.roll() + n[3]).with_jaw(n[4]);
                let tip = cell.workspace(arm)?.tip(&from);
                let to = Pose { translation: tip.translation + glam::DVec3::new(n[0], n[1], n[2]), ..tip };
                cell.workspace(arm)?.clamp(&cell.solve(arm, &to, &from)?.setpoint.with_roll(from.roll()))
            }
        });
    }
    Ok(all)
}
