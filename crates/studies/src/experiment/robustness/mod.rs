//! Where the built-in controllers stop working: one factor at a time over its range with all others
//! as the scene is written, and all factors together.

mod condition;
mod map;
mod page;
mod result;

use crate::names::SceneChoice;
use crate::study::{Job, Kind, Study};
use crate::trials::Outcomes;
use crate::{Error, Result};
use clap::Args;
use condition::{Condition, conditions};
use result::{PolicyOutcome, RobustnessResult, RobustnessRow};
use trocar_core::Progress;
use trocar_report::document::Document;
use trocar_scene::{Measure, Scene, Split, VariationSet};
use trocar_task::policy::{POLICIES, named};
use trocar_task::{Episode, run, scene_hash, specimen_hash};
use trocar_workflow::{SpecimenCache, read_varied};

/// Most values of a factor, and most episodes of a condition.
const MAX_VALUES: usize = 50;
const MAX_EPISODES: usize = 10_000;

/// Success of the six controllers over each factor of variation: one at a time over its range, and
/// all together; resumable, safe to interrupt at any time.
#[derive(Clone, Debug, Args)]
pub struct RobustnessExperiment {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneChoice,
    /// The factors, separated by commas: factors (modulus_kpa), groups (organ, tissue, camera), or
    /// all. By default all.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub by: Vec<String>,
    /// The set whose ranges are covered.
    #[arg(long, value_name = "SET", default_value = "hard", value_parser = set)]
    pub variation: VariationSet,
    /// Values of each factor, evenly over its range.
    #[arg(long, default_value_t = 3)]
    pub values: usize,
    /// Episodes of each controller at each value.
    #[arg(long, default_value_t = 2)]
    pub episodes: usize,
    /// Episodes of each controller with all factors together.
    #[arg(long, default_value_t = 10)]
    pub together: usize,
    /// A quick look: two values, one episode of each, two with all together.
    #[arg(long)]
    pub quick: bool,
    /// Number of the first episode among the unseen ones.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Conditions in parallel; all threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

fn set(name: &str) -> std::result::Result<VariationSet, String> {
    let known: Vec<&str> = VariationSet::ALL[1..].iter().map(|set| set.name()).collect();
    let found = VariationSet::named(name).filter(|set| *set != VariationSet::None);
    found.ok_or_else(|| format!("the sets with ranges are {}", known.join(", ")))
}

impl RobustnessExperiment {
    /// The options with those of a quick look.
    fn options(&self) -> Result<Self> {
        let mut own = self.clone();
        if self.quick {
            (own.values, own.episodes, own.together) = (2, 1, 2);
        }
        for (name, value, range) in [
            ("--values", own.values, 2..=MAX_VALUES),
            ("--episodes", own.episodes, 1..=MAX_EPISODES),
            ("--together", own.together, 0..=MAX_EPISODES),
        ] {
            if !range.contains(&value) {
                let (low, high) = range.into_inner();
                return Err(Error::Mismatch(format!("{name} {value}: it must be in [{low}, {high}]")));
            }
        }
        let most = Split::FIRST_UNSEEN;
        if own.seed >= most {
            return Err(Error::Mismatch(format!("--seed {}: it must be below {most}", own.seed)));
        }
        Ok(own)
    }
}

impl Study for RobustnessExperiment {
    const NAME: &'static str = "robustness";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> = Some("Output folder of the report. Finished conditions in it are used again.");
    const SCHEMA: u32 = 2;
    type Figures = RobustnessResult;

    fn run(&self, job: &Job<'_>) -> Result<(RobustnessResult, Document)> {
        let own = self.options()?;
        let scene = read_varied(&own.scene.scene, Some(VariationSet::None), VariationSet::None)?;
        let all = conditions(&scene, &own)?;
        job.claim()?;
        let specimens = SpecimenCache::new(&scene, &own.scene.phantoms);
        let needed: Vec<_> = {
            let mut needed: Vec<_> = all.iter().flat_map(Condition::specimens).collect();
            needed.sort_by_key(trocar_scene::SpecimenSource::label);
            needed.dedup();
            needed
        };
        specimens.make_all(&needed, job.progress)?;
        let hash = |condition: &Condition| -> Result<String> {
            let sources = condition.specimens();
            let read = |source| Ok(specimen_hash(&*specimens.read(source, &trocar_core::Silent)?));
            let contents: Vec<u64> = sources.iter().map(read).collect::<Result<_>>()?;
            Ok(format!("{:016x} {contents:016x?}", scene_hash(&condition.scene, 0)?))
        };
        // The controllers see no pictures: unless the task is judged by one, their episodes would
        // be those of the scene as it is written, and counted again.
        let judged = scene.program()?.measures.iter().any(|measure| matches!(measure, Measure::Visible(..)));
        let run = all.iter().filter(|condition| judged || !condition.pictures);
        // Each condition is identified by its own scene and specimens: a run with more factors
        // reuses those of an earlier one.
        let keyed = run.map(|c| Ok((format!("{} {}", c.key(), hash(c)?), c)));
        let keyed: Vec<(String, &Condition)> = keyed.collect::<Result<_>>()?;
        let Outcomes { rows, resumed } = job.trials(
            "conditions",
            "",
            &keyed,
            |(key, _)| key.clone(),
            own.threads,
            |(_, condition), progress| row(condition, &specimens, progress),
        )?;
        let result = RobustnessResult {
            scene: scene.name,
            variation: own.variation.name(),
            episodes: own.episodes,
            together: own.together,
            seed: own.seed,
            rows,
            resumed,
        };
        let document = page::document(&result)?;
        Ok((result, document))
    }
}

/// Runs the episodes of all controllers at a condition.
fn row(condition: &Condition, specimens: &SpecimenCache, progress: &dyn Progress) -> Result<RobustnessRow> {
    let mut policies: Vec<PolicyOutcome> = POLICIES.iter().map(|name| PolicyOutcome::new(name)).collect();
    let mut built: Option<Episode> = None;
    for seed in &condition.seeds {
        // Controllers take turns, so that the cell of a seed is built once.
        for (name, outcome) in POLICIES.iter().zip(&mut policies) {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            let made = match &mut built {
                Some(episode) => attempt(episode, name, *seed, progress),
                None => begin(&condition.scene, specimens, *seed)
                    .and_then(|episode| attempt(built.insert(episode), name, *seed, progress)),
            };
            match made {
                Ok(recording) => outcome.add(&recording.summary),
                Err(_) if progress.interrupted() => return Err(Error::Interrupted),
                // A cell that cannot be built, or a start out of reach, is a result here.
                Err(why) => {
                    outcome.add_refused(&why.to_string());
                    built = None;
                }
            }
        }
    }
    Ok(with_outcomes(condition, policies))
}

fn with_outcomes(condition: &Condition, policies: Vec<PolicyOutcome>) -> RobustnessRow {
    RobustnessRow {
        factor: condition.factor.clone(),
        label: condition.label.clone(),
        value: condition.value.clone(),
        number: condition.number,
        log: condition.log,
        policies,
    }
}

fn begin(scene: &Scene, specimens: &SpecimenCache, seed: u64) -> trocar_task::Result<Episode> {
    Episode::begun(scene, Box::new(specimens.clone()), 1, seed, scene.draw(seed))
}

fn attempt(
    episode: &mut Episode,
    name: &str,
    seed: u64,
    progress: &dyn Progress,
) -> trocar_task::Result<trocar_task::Recording> {
    let mut policy = named(name)?;
    run(episode, policy.as_mut(), seed, &mut |_| !progress.interrupted())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        study: RobustnessExperiment,
    }

    fn options(words: &[&str]) -> RobustnessExperiment {
        Command::try_parse_from(std::iter::once(&"robustness").chain(words)).unwrap().study
    }

    #[test]
    fn a_quick_look_is_small_and_options_are_checked() {
        let quick = options(&["--quick"]).options().unwrap();
        assert_eq!((quick.values, quick.episodes, quick.together), (2, 1, 2));
        for (words, said) in [
            (["--values", "1"], "--values 1: it must be in [2, 50]"),
            (["--episodes", "0"], "--episodes 0: "),
            (["--seed", "1000000"], "--seed 1000000: "),
        ] {
            let why = options(&words).options().unwrap_err().to_string();
            assert!(why.starts_with(said), "{why}");
        }
        assert!(Command::try_parse_from(["robustness", "--variation", "none"]).is_err());
    }

    #[test]
    fn one_factor_has_its_values_and_all_others_are_as_written() {
        let scene = Scene::builtin("cell-a").unwrap();
        let words = ["--by", "modulus,light", "--together", "0", "--values", "5", "--episodes", "5"];
        let own = options(&words).options().unwrap();
        let all = conditions(&scene, &own).unwrap();
        let of = |factor: &str| -> Vec<&Condition> { all.iter().filter(|c| c.factor == factor).collect() };
        assert_eq!((of("as written").len(), of("modulus_kpa").len(), of("tint_scale").len()), (1, 5, 5));
        let modulus: Vec<f64> = of("modulus_kpa").iter().map(|c| c.number.unwrap()).collect();
        assert!((modulus[0] - 2.0).abs() < 1e-9 && (modulus[4] - 96.0).abs() < 1e-9, "{modulus:?}");
        assert!((modulus[2] - (2.0_f64 * 96.0).sqrt()).abs() < 1e-9, "in the logarithm");
        for condition in &all {
            let pictures = ["lamp_scale", "exposure_scale", "noise_scale", "gloss_scale", "tint_scale"];
            assert_eq!(condition.pictures, pictures.contains(&condition.factor.as_str()));
            assert_eq!(condition.seeds, [1_000_000, 1_000_001, 1_000_002, 1_000_003, 1_000_004]);
            let drawn = condition.scene.draw(1_000_000);
            let of = drawn.values.iter().filter(|v| v.factor.name() == condition.factor);
            assert!(of.clone().all(|v| Some(v.value) == condition.number));
            let others = drawn.values.iter().filter(|v| v.factor.name() != condition.factor);
            assert_eq!(others.count(), scene.draw(0).values.len(), "the starts of the scene");
        }
        // All together, with seen and unseen specimens.
        let own = options(&["--by", "modulus", "--quick"]).options().unwrap();
        let together: Vec<Condition> =
            conditions(&scene, &own).unwrap().into_iter().filter(|c| c.factor == "together").collect();
        assert_eq!(together.iter().map(|c| c.value.as_str()).collect::<Vec<_>>(), ["seen", "unseen"]);
        assert!(together.iter().all(|c| c.seeds.len() == 2));
        assert!(together[0].seeds[0] < Split::FIRST_UNSEEN && together[1].seeds[0] >= Split::FIRST_UNSEEN);
    }
}
