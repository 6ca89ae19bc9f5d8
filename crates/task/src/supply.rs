//! Where the specimens of episodes come from.

use crate::Result;
use std::sync::Arc;
use trocar_scene::SpecimenSource;
use trocar_specimen::Specimen;

/// Gives an episode the specimen that was drawn for it.
pub trait SpecimenSupply: Send + Sync {
    /// The specimen that `source` names.
    ///
    /// # Errors
    /// A specimen that is not there or cannot be read.
    fn get(&mut self, source: &SpecimenSource) -> Result<Arc<Specimen>>;
}

/// The same specimen for every episode, whatever it is called.
#[derive(Clone, Debug)]
pub struct OneSpecimen(pub Arc<Specimen>);

impl SpecimenSupply for OneSpecimen {
    fn get(&mut self, _: &SpecimenSource) -> Result<Arc<Specimen>> {
        Ok(Arc::clone(&self.0))
    }
}
