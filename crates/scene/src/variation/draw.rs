//! Drawing: the values of one episode by its seed.

use super::{Factor, Per, Specimens, VariationSet};
use crate::{EpisodeRandom, Scene, SpecimenSource, Tool};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// One drawn number.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnValue {
    /// What it is of.
    pub factor: Factor,
    /// The arm, port or camera; empty for the whole cell.
    pub part: String,
    /// Place among the factor's axes.
    pub axis: usize,
    /// The number.
    pub value: f64,
}

impl DrawnValue {
    /// Its name in tables, such as `modulus_kpa`, `left.tilt_deg` or `d405.camera_shift_mm.x`.
    pub fn name(&self) -> String {
        let axis = self.axis_name();
        let (dot, stop) = (if self.part.is_empty() { "" } else { "." }, if axis.is_empty() { "" } else { "." });
        format!("{}{dot}{}{stop}{axis}", self.part, self.factor.name())
    }

    fn axis_name(&self) -> &'static str {
        // An arm without a port has three coordinates instead of an insertion.
        let axes = if self.factor == Factor::Insertion && self.axis > 0 { &["", "x", "y", "z"][..] } else { self.factor.axes() };
        axes.get(self.axis).copied().unwrap_or_default()
    }
}

/// What was drawn for an episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// The specimen.
    pub specimen: SpecimenSource,
    /// The numbers, in the order of the factors.
    pub values: Vec<DrawnValue>,
}

impl Drawn {
    /// The number of a factor of the whole cell.
    pub(super) fn one(&self, factor: Factor) -> Option<f64> {
        self.values.iter().find(|v| v.factor == factor).map(|v| v.value)
    }

    /// The numbers of a factor for a part, one an axis; `None` where it is not drawn.
    pub(super) fn axes<const N: usize>(&self, factor: Factor, part: &str) -> Option<[f64; N]> {
        let of_part = |axis| self.values.iter().find(|v| v.factor == factor && v.part == part && v.axis == axis);
        let mut all = [0.0; N];
        for (axis, value) in all.iter_mut().enumerate() {
            *value = of_part(axis)?.value;
        }
        Some(all)
    }
}

impl Serialize for Drawn {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(1 + self.values.len()))?;
        map.serialize_entry("specimen", &self.specimen.label())?;
        for value in &self.values {
            map.serialize_entry(&value.name(), &value.value)?;
        }
        map.end()
    }
}

impl Scene {
    /// What the episode of `seed` has. Each number depends on the seed, the factor and the part
    /// only: a further factor changes no other.
    pub fn draw(&self, seed: u64) -> Drawn {
        let mut values = Vec::new();
        for (factor, distribution) in self.variation.all_factors() {
            let mut draw = |random: &EpisodeRandom, part: &str, axis: usize, index: u64| {
                let value = distribution.draw(random, index);
                values.push(DrawnValue { factor, part: part.to_owned(), axis, value });
            };
            match start_index(factor) {
                Some(index) => {
                    let random = EpisodeRandom::new(seed, "start");
                    for tool in self.tools() {
                        // An arm's numbers do not depend on how many arms there are.
                        let first = 8 * tool.arm.name as u64;
                        match (factor, tool.port) {
                            (Factor::Insertion, None) => {
                                (0..3).for_each(|k| draw(&random, tool.arm.name.name(), 1 + k as usize, first + 4 + k));
                            }
                            _ => draw(&random, tool.arm.name.name(), 0, first + index),
                        }
                    }
                }
                None => {
                    for part in self.parts(factor.per()) {
                        let (purpose, first) = purpose(factor, part);
                        let random = EpisodeRandom::new(seed, &purpose);
                        (0..factor.axes().len()).for_each(|k| draw(&random, part, k, first + k as u64));
                    }
                }
            }
        }
        Drawn { specimen: self.draw_specimen(seed), values }
    }

    /// The names of the parts that a factor is drawn for.
    fn parts(&self, per: Per) -> Vec<&str> {
        match per {
            Per::Cell => vec![""],
            Per::Arm => self.tools().iter().map(|tool: &Tool<'_>| tool.arm.name.name()).collect(),
            Per::Port => self.ports.iter().map(|port| port.name.as_str()).collect(),
            Per::Camera => self.cameras.iter().map(|camera| camera.name.as_str()).collect(),
        }
    }

    fn draw_specimen(&self, seed: u64) -> SpecimenSource {
        let all = self.specimens();
        let at = EpisodeRandom::new(seed, "variation/specimen").unit(0) * all.len() as f64;
        all.get(at as usize).unwrap_or(&self.specimen).clone()
    }

    /// The specimens that episodes have, in a fixed order.
    pub fn specimens(&self) -> Vec<SpecimenSource> {
        let drawn = match (&self.variation.specimens, self.variation.set, &self.specimen.phantom) {
            (Some(drawn), _, _) => drawn.clone(),
            (None, VariationSet::Standard | VariationSet::Hard, Some(phantom)) => {
                Specimens { paths: Vec::new(), phantoms: vec![phantom.clone()], seeds: super::SEEDS }
            }
            _ => return vec![self.specimen.clone()],
        };
        let [first, last] = drawn.seeds;
        let phantoms = drawn.phantoms.iter().flat_map(|name| (first..=last).map(|s| SpecimenSource::phantom(name, s)));
        let paths = drawn.paths.iter().map(|path| SpecimenSource::folder(path));
        phantoms.chain(paths).collect()
    }
}

/// The index of a factor of the start among the random numbers of an arm's start.
fn start_index(factor: Factor) -> Option<u64> {
    match factor {
        Factor::Tilt => Some(0),
        Factor::Azimuth => Some(1),
        Factor::Insertion => Some(2),
        Factor::Roll => Some(3),
        _ => None,
    }
}

/// The purpose that the random numbers of a factor have, and the index of the first.
fn purpose(factor: Factor, part: &str) -> (String, u64) {
    match factor {
        Factor::SpecimenShift => ("specimen".to_owned(), 0),
        Factor::SpecimenTurn => ("specimen".to_owned(), 2),
        _ => (format!("variation/{}/{part}", factor.name()), 0),
    }
}
