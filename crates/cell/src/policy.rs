//! What moves a cell: a policy sees it and says what its arms are to do next.

use crate::{Action, Cell, Result};

/// Says what the arms do, one control period after the other.
pub trait Policy {
    /// The action of the next period; `None` when there is nothing left to do. Scripts may look at
    /// the tissue ([`Cell::world`]); what is to be scored looks at [`Cell::observe`] alone.
    ///
    /// # Errors
    /// What the policy meant to do cannot be done.
    fn act(&mut self, cell: &Cell) -> Result<Option<Action>>;
}
