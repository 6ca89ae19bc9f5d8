//! The conditions of the study: a scene and the seeds of its episodes.

use super::RobustnessExperiment;
use crate::Result;
use trocar_campaign::By;
use trocar_scene::{Distribution, Factor, Scene, SpecimenSource, Split};

/// Names of what is no factor.
pub(super) const AS_WRITTEN: &str = "as written";
pub(super) const TOGETHER: &str = "together";
const SPECIMEN: &str = "specimen";

/// A scene and the seeds of its episodes.
#[derive(Clone, Debug)]
pub(super) struct Condition {
    /// The factor that has the value.
    pub factor: String,
    /// The factor with its unit.
    pub label: String,
    /// The value in words.
    pub value: String,
    /// The value as a number.
    pub number: Option<f64>,
    /// The values are even in the logarithm.
    pub log: bool,
    /// Pictures alone differ from the scene as it is written.
    pub pictures: bool,
    pub scene: Scene,
    pub seeds: Vec<u64>,
}

impl Condition {
    /// A name that no other condition has.
    pub fn key(&self) -> String {
        let number = self.number.map_or_else(String::new, |n| format!(" {n}"));
        format!("{} {}{number} from {} times {}", self.factor, self.value, self.seeds[0], self.seeds.len())
    }

    pub fn specimens(&self) -> Vec<SpecimenSource> {
        let mut all: Vec<SpecimenSource> = self.seeds.iter().map(|seed| self.scene.draw(*seed).specimen).collect();
        all.sort_by_key(SpecimenSource::label);
        all.dedup();
        all
    }
}

/// The conditions: the scene as it is written, each factor at each of its values, and all together.
pub(super) fn conditions(scene: &Scene, own: &RobustnessExperiment) -> Result<Vec<Condition>> {
    let mut varied = scene.clone();
    varied.variation.set = own.variation;
    let seeds = |split: Split, count: usize| (0..count as u64).map(|k| split.seed(own.seed + k)).collect::<Vec<_>>();
    let made = |factor: &str, value: String, scene: Scene| Condition {
        factor: factor.to_owned(),
        label: factor.to_owned(),
        value,
        number: None,
        log: false,
        pictures: false,
        scene,
        seeds: seeds(Split::Unseen, own.episodes),
    };
    let mut all = vec![made(AS_WRITTEN, "all factors".to_owned(), scene.clone())];
    // The set may draw a factor from its own range where the scene names a smaller one.
    let mut ranges = varied.clone();
    ranges.variation.factors.clear();
    for by in By::parse(&own.by, &ranges, Split::Seen)? {
        if by.name == SPECIMEN {
            for source in ranges.specimens() {
                let mut scene = scene.clone();
                (scene.specimen, scene.variation.specimens) = (source.clone(), None);
                all.push(made(SPECIMEN, source.label(), scene));
            }
            continue;
        }
        if let Some(organ) = by.name.strip_prefix("swapped.") {
            for source in ranges.specimens().into_iter().filter(|source| *source != scene.specimen) {
                let mut scene = scene.clone();
                scene.specimen.swapped.insert(organ.to_owned(), source.own_label());
                all.push(made(&by.name, source.own_label(), scene));
            }
            continue;
        }
        let Some((factor, distribution)) =
            Factor::named(&by.name).and_then(|factor| Some((factor, ranges.variation.all_factors().remove(&factor)?)))
        else {
            continue;
        };
        for number in values(&distribution, own.values) {
            let mut scene = scene.clone();
            scene.variation.factors.insert(factor, Distribution::Choice(vec![number]));
            scene.validate().map_err(trocar_workflow::Error::from)?;
            let single = scene.draw(0).values.iter().filter(|v| v.factor == factor).count() == 1;
            let label = if single { by.label(true) } else { format!("{}, each number", by.label(true)) };
            let value = trocar_campaign::significant(number, 3);
            all.push(Condition {
                label,
                number: Some(number),
                log: by.log,
                pictures: factor.is_of_pictures(),
                ..made(factor.name(), value, scene)
            });
        }
    }
    if own.together > 0 {
        for split in [Split::Seen, Split::Unseen] {
            let seeds = seeds(split, own.together);
            all.push(Condition { seeds, ..made(TOGETHER, split.name().to_owned(), varied.clone()) });
        }
    }
    Ok(all)
}

/// `count` values evenly over the range of a distribution, or its choices.
fn values(distribution: &Distribution, count: usize) -> Vec<f64> {
    let [low, high] = distribution.range();
    let share = |k: usize| k as f64 / (count - 1) as f64;
    match distribution {
        Distribution::Choice(values) => values.clone(),
        Distribution::LogUniform(_) => (0..count).map(|k| low * (high / low).powf(share(k))).collect(),
        _ => (0..count).map(|k| low + share(k) * (high - low)).collect(),
    }
}
