//! Support and tissue that are drawn from what lifts tell about organs.

use super::Drawn;
use super::drawn_tissue::DrawnTissue;
use crate::{EpisodeRandom, Error, PinEnd, PinRule, Result, Scene, ThreadRule};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use trocar_specimen::{Parameter, Specimen};

/// Where support and tissue of organs come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TissueSource {
    /// From the specimen and the scene.
    #[default]
    Specimen,
    /// Drawn for each episode from the posteriors that `trocar identify` wrote into the specimen.
    Posterior,
}

impl TissueSource {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Specimen, Self::Posterior];

    /// Its name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Specimen => "specimen",
            Self::Posterior => "posterior",
        }
    }

    /// The source of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|source| source.name() == name)
    }
}

impl Scene {
    /// What was `drawn` for the episode of `seed`, with support and tissue from the posteriors of
    /// its `specimen`, where the scene draws from them and `drawn` has none yet.
    ///
    /// # Errors
    /// A specimen of which no organ has a posterior.
    pub fn with_tissue_drawn(&self, drawn: Drawn, seed: u64, specimen: &Specimen) -> Result<Drawn> {
        if self.variation.tissue == TissueSource::Specimen || !drawn.tissue.is_empty() {
            return Ok(drawn);
        }
        let mut tissue = DrawnTissue::new();
        for organ in &specimen.organs {
            let Some(posterior) = &organ.posterior else { continue };
            let random = EpisodeRandom::new(seed, &format!("variation/posterior/{}", organ.name));
            let normal = |k: usize| {
                let at = 2 * k as u64;
                trocar_core::standard_normal(random.unit(at), random.unit(at + 1))
            };
            let normals: Vec<f64> = (0..posterior.mean.len()).map(normal).collect();
            let values = posterior.draw(&normals).into_iter();
            tissue.extend(values.map(|(parameter, value)| ((organ.name.clone(), parameter), value)));
        }
        if tissue.is_empty() {
            return Err(Error::Invalid {
                file: self.label(),
                reason: format!(
                    "no organ of specimen '{}' has a posterior to draw from; make one with `trocar identify`, or leave out \
                     variation.tissue (--tissue posterior)",
                    specimen.name
                ),
            });
        }
        Ok(Drawn { tissue, ..drawn })
    }

    /// Gives organs their drawn support and tissue.
    pub(super) fn vary_posterior(&mut self, drawn: &Drawn, specimen: &Specimen) {
        for ((name, parameter), value) in &drawn.tissue {
            let threads = specimen.organs.iter().find(|organ| organ.name == *name).and_then(|organ| organ.threads);
            let own = self.organs.entry(name.clone()).or_default();
            let held = own.threads.or(threads.map(ThreadRule::of)).unwrap_or_default();
            match parameter {
                Parameter::BaseLength => {
                    let end = PinEnd::Base;
                    own.pins = Some(PinRule::End { end, length: *value, band_length: 0.0, band_share: 0.0 });
                }
                Parameter::ThreadsFrom => own.threads = Some(ThreadRule { from: *value, to: 1.0, ..held }),
                Parameter::ThreadsSlack => own.threads = Some(ThreadRule { slack_m: *value, ..held }),
                Parameter::ThreadsStiffness => own.threads = Some(ThreadRule { stiffness_n_m2: *value, ..held }),
                Parameter::YoungModulus => own.material.young_modulus_pa = Some(*value),
                Parameter::PoissonRatio => own.material.poisson_ratio = Some(*value),
            }
        }
    }
}
