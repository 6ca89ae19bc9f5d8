//! Drawing: the values of one episode by its seed.

use super::drawn_tissue::{DrawnTissue, tissue_name, tissue_named};
use super::{Factor, Per, Specimens, Split, VariationSet};
use crate::{EpisodeRandom, Error, Lens, Result, Scene, SpecimenSource, Tool};
use serde::de::{Error as _, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt;

/// The name of an organ's other specimen in tables begins so.
const SWAPPED: &str = "swapped.";

/// The name in tables of the specimen that an organ is of.
fn swapped_name(organ: &str) -> String {
    format!("{SWAPPED}{organ}")
}

/// The organ whose other specimen has that name in tables.
fn swapped_organ(name: &str) -> Option<&str> {
    name.strip_prefix(SWAPPED).filter(|_| DrawnValue::named(name, 0.0).is_none())
}

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
        axes(self.factor).get(self.axis).copied().unwrap_or_default()
    }

    /// The number `value` of that name in tables; `None` of a name that no number has.
    pub fn named(name: &str, value: f64) -> Option<Self> {
        let steps: Vec<&str> = name.split('.').collect();
        let (at, factor) = steps.iter().enumerate().find_map(|(at, step)| Some((at, Factor::named(step)?)))?;
        let (part, axis) = (steps[..at].join("."), steps[at + 1..].join("."));
        let axis = axes(factor).iter().position(|name| *name == axis)?;
        Some(Self { factor, part, axis, value })
    }
}

/// The names of a factor's numbers. An arm without a port has three coordinates instead of an
/// insertion.
fn axes(factor: Factor) -> &'static [&'static str] {
    if factor == Factor::Insertion { &["", "x", "y", "z"] } else { factor.axes() }
}

/// The drawn values of an episode. In files they are a table of numbers by their names, and
/// `specimen`.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// The specimen.
    pub specimen: SpecimenSource,
    /// The numbers, in the order of the factors, then by part and axis.
    pub values: Vec<DrawnValue>,
    /// Support and tissue of organs, where they are drawn from posteriors. In tables a value has
    /// the name `ORGAN.PARAMETER`.
    pub tissue: DrawnTissue,
}

impl Drawn {
    fn new(specimen: SpecimenSource, mut values: Vec<DrawnValue>, tissue: DrawnTissue) -> Self {
        let order = |v: &DrawnValue| (v.factor, v.part.clone(), v.axis);
        values.sort_by_cached_key(order);
        Self { specimen, values, tissue }
    }

    /// The words beside the numbers, by their names in tables: the specimen, and those that single
    /// organs are of (`swapped.ORGAN`).
    pub fn words(&self) -> Vec<(String, String)> {
        let specimen = (super::SPECIMEN.to_owned(), self.specimen.own_label());
        let swapped = self.specimen.swapped.iter().map(|(organ, other)| (swapped_name(organ), other.clone()));
        std::iter::once(specimen).chain(swapped).collect()
    }

    /// As TOML, for files that it is read back from to the bit.
    ///
    /// # Errors
    /// A value that has no place in TOML.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(|e| Error::Write(e.to_string()))
    }

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
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (name, word) in self.words() {
            map.serialize_entry(&name, &word)?;
        }
        for value in &self.values {
            map.serialize_entry(&value.name(), &value.value)?;
        }
        for (of, value) in &self.tissue {
            map.serialize_entry(&tissue_name(of), value)?;
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for Drawn {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Numbers;
        impl<'de> Visitor<'de> for Numbers {
            type Value = Drawn;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table of drawn numbers by name")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> std::result::Result<Drawn, A::Error> {
                let (mut specimen, mut swapped, mut values) = (None, BTreeMap::new(), Vec::new());
                let mut tissue = DrawnTissue::new();
                while let Some(name) = map.next_key::<String>()? {
                    if name == super::SPECIMEN {
                        specimen = Some(SpecimenSource::labelled(&map.next_value::<String>()?));
                        continue;
                    }
                    if let Some(organ) = swapped_organ(&name) {
                        swapped.insert(organ.to_owned(), map.next_value()?);
                        continue;
                    }
                    let number = map.next_value()?;
                    if let (Some(of), None) = (tissue_named(&name), DrawnValue::named(&name, 0.0)) {
                        tissue.insert(of, number);
                        continue;
                    }
                    let value = DrawnValue::named(&name, number);
                    values.push(value.ok_or_else(|| A::Error::custom(format!("'{name}' is no drawn number")))?);
                }
                let specimen = specimen.ok_or_else(|| A::Error::missing_field(super::SPECIMEN))?;
                Ok(Drawn::new(SpecimenSource { swapped, ..specimen }, values, tissue))
            }
        }
        deserializer.deserialize_map(Numbers)
    }
}

impl Scene {
    /// The drawn values of the episode of `seed`. Each number depends on the seed, the factor and
    /// the part only: a further factor changes no other.
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
                    for part in self.parts(factor) {
                        let (purpose, first) = purpose(factor, part);
                        let random = EpisodeRandom::new(seed, &purpose);
                        (0..factor.axes().len()).for_each(|k| draw(&random, part, k, first + k as u64));
                    }
                }
            }
        }
        Drawn::new(self.draw_specimen(seed), values, DrawnTissue::new())
    }

    /// The names of the parts that a factor is drawn for. An arm without a base has none to shift,
    /// and the lens of a recording is that of its camera.
    fn parts(&self, factor: Factor) -> Vec<&str> {
        let has_base = |tool: &&Tool<'_>| factor != Factor::BaseShift || tool.arm.base.is_some();
        match factor.per() {
            Per::Cell => vec![""],
            Per::Arm => self.tools().iter().filter(has_base).map(|tool| tool.arm.name.name()).collect(),
            Per::Port => self.ports.iter().map(|port| port.name.as_str()).collect(),
            Per::Camera => {
                let own_lens = |lens: &Lens| factor != Factor::FocalScale || !matches!(lens, Lens::Recording {});
                self.cameras.iter().filter(|c| own_lens(&c.lens)).map(|c| c.name.as_str()).collect()
            }
        }
    }

    fn draw_specimen(&self, seed: u64) -> SpecimenSource {
        let all = self.specimens();
        let all = Split::of_seed(seed).of_specimens(&all);
        let one = |purpose: &str, all: &[&SpecimenSource]| {
            let at = EpisodeRandom::new(seed, purpose).unit(0) * all.len() as f64;
            all.get(at as usize).map(|source| (*source).clone())
        };
        let mut drawn = one("variation/specimen", &all.iter().collect::<Vec<_>>()).unwrap_or(self.specimen.clone());
        let others: Vec<&SpecimenSource> = all.iter().filter(|s| s.own() != drawn.own()).collect();
        for organ in &self.variation.swapped {
            if let Some(other) = one(&format!("variation/swapped/{organ}"), &others) {
                drawn.swapped.insert(organ.clone(), other.own_label());
            }
        }
        drawn
    }

    /// The specimens that episodes have, but for organs that are drawn from another of them, in a
    /// fixed order; the last quarter of them is for unseen ones ([`Split`]).
    pub fn specimens(&self) -> Vec<SpecimenSource> {
        let drawn = match (&self.variation.specimens, self.variation.set, &self.specimen.phantom) {
            (Some(drawn), _, _) => drawn.clone(),
            (None, VariationSet::Standard | VariationSet::Hard, Some(phantom)) => {
                Specimens { paths: Vec::new(), phantoms: vec![phantom.clone()], seeds: super::SEEDS }
            }
            _ => return vec![self.specimen.clone()],
        };
        let [first, last] = drawn.seeds;
        let made = |name: &str, seed| SpecimenSource::phantom(name, seed).with_max_elements(self.specimen.max_elements);
        let phantoms = drawn.phantoms.iter().flat_map(|name| (first..=last).map(move |seed| made(name, seed)));
        let paths = drawn.paths.iter().map(|path| SpecimenSource::folder(path));
        let swapped = &self.specimen.swapped;
        phantoms.chain(paths).map(|source| SpecimenSource { swapped: swapped.clone(), ..source }).collect()
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
