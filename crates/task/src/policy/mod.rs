//! Policies: they choose the actions of an episode. Six controllers come with the program: a
//! scripted one that passes, and five that are worse in one way each.

mod aim;
mod cut_place;
mod grip;
mod perturbed;
mod phase;
mod random_actions;
mod random_walk;
mod script;
mod scripted;
mod steps;

pub use perturbed::{DELAY_S, Delay, NOISE_M, NOISE_RAD, Noise, OFFSET_MM, Offset};
pub use random_actions::RandomActions;
pub use random_walk::RandomWalk;
pub use script::{AfterHold, CutAt, Script};
pub use scripted::{Scripted, Style};
pub use steps::Baseline;

use crate::{Episode, Error, Result};
use trocar_cell::Action;

/// Actions in a chunk.
pub const CHUNK: usize = 8;

/// Chooses the actions of the arms, one chunk after another.
pub trait Policy {
    /// Its name in files.
    fn name(&self) -> &str;

    /// An episode begins: forgets the one before. `seed` is for the policy's own chance.
    ///
    /// # Errors
    /// An episode that it cannot do.
    fn begin(&mut self, episode: &Episode, seed: u64) -> Result<()>;

    /// The next 1 to [`CHUNK`] actions, one a control period. A policy that is scored must use
    /// [`Episode::observe`] alone; scripts may also read the tissue.
    ///
    /// # Errors
    /// Ends the episode as [`crate::End::PolicyError`].
    fn act(&mut self, episode: &Episode) -> Result<Vec<Action>>;

    /// Whether it has finished. An episode whose policy gives no action and has finished ends as
    /// [`crate::End::Finished`]; one whose policy gives none and has not, as a failure of the
    /// policy.
    fn finished(&self) -> bool {
        false
    }
}

/// Names of the controllers.
pub const POLICIES: [&str; 6] = ["scripted", "noise", "delay", "offset", "greedy", "random"];

/// The controller of that name.
///
/// # Errors
/// A name that is none.
pub fn named(name: &str) -> Result<Box<dyn Policy + Send>> {
    let scripted = Baseline::default;
    Ok(match name {
        "scripted" => Box::new(scripted()),
        "noise" => Box::new(Noise::new(scripted())),
        "delay" => Box::new(Delay::new(scripted())),
        "offset" => Box::new(Offset::new(scripted())),
        "greedy" => Box::new(Scripted::new(Style::Greedy)),
        "random" => Box::new(RandomWalk::default()),
        _ => {
            return Err(Error::Option(format!("no policy '{name}'; there are {}", POLICIES.join(", "))));
        }
    })
}
