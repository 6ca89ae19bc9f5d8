//! The variation of a campaign, and the drawn values of its episodes.

use crate::manifest::Manifest;
use crate::store::EpisodeRecord;
use serde::Serialize;
use std::collections::BTreeMap;
use trocar_scene::{Distribution, Drawn, Split, Variation};

/// The drawn values of the episodes of a seed, by all policies.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DrawnEpisode {
    /// The seed.
    pub seed: u64,
    /// The specimen, and numbers by their names.
    pub drawn: Drawn,
}

/// The variation between the episodes of a campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VariationResult {
    /// The name of the set.
    pub name: &'static str,
    /// The set and what the scene itself names.
    pub table: Variation,
    /// Which episodes they are.
    pub split: Split,
    /// The drawn values, by seed.
    pub episodes: Vec<DrawnEpisode>,
}

impl VariationResult {
    pub(super) fn of(manifest: &Manifest, records: &[EpisodeRecord]) -> Self {
        let drawn: BTreeMap<u64, &Drawn> =
            records.iter().filter_map(|k| Some((k.seed, k.summary.drawn.as_ref()?))).collect();
        Self {
            name: manifest.variation.set.name(),
            table: manifest.variation.clone(),
            split: manifest.split,
            episodes: drawn.into_iter().map(|(seed, drawn)| DrawnEpisode { seed, drawn: drawn.clone() }).collect(),
        }
    }
}

/// A distribution in words.
pub(super) fn words(distribution: &Distribution) -> String {
    match distribution {
        Distribution::Within(most) => format!("\u{b1}{most}"),
        Distribution::Uniform([low, high]) => format!("{low} to {high}"),
        Distribution::LogUniform([low, high]) => format!("{low} to {high}, evenly in the logarithm"),
        Distribution::Normal([mean, deviation]) => format!("normal, mean {mean}, deviation {deviation}"),
        Distribution::Choice(values) => values.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
    }
}
