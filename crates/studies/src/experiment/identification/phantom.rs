//! A phantom of known support and tissue, its lifts, and what is identified from them.

use super::result::{FitRow, ParameterRow};
use crate::{Error, Result};
use glam::DVec3;
use std::path::Path;
use trocar_core::{Progress, Random};
use trocar_geometry::io::{Unit, read_surface};
use trocar_geometry::{LatticeMesher, MeshDistance};
use trocar_identify::{
    FINER, Grip, Identification, Landmark, LiftDistance, Lifted, LoneOrgan, Observation, Pace, Pull, default_priors,
};
use trocar_phantom::RecordOptions;
use trocar_specimen::{
    End, Material, MaterialModel, NINETY, Organ, OrganFacts, Parameter, Pins, Posterior, Prior, Provenance, Scale,
    Specimen,
};

/// The organ.
const ORGAN: &str = "appendix";

/// Cells of the true tissue (m), and its law.
const TRUE_CELL: f64 = 2.5e-3;
const TRUE_MODEL: MaterialModel = MaterialModel::Corotated;

/// Lifts of a phantom: the paper tracks ten throughout.
pub(super) const LIFTS: usize = 10;

/// The even lifts are fitted, the odd ones judged.
fn is_fitted(lift: usize) -> bool {
    lift.is_multiple_of(2)
}

/// Organ coordinates of the grasps, and their ways (m), as of filmed lifts.
const GRASPS: [f64; 2] = [0.56, 0.78];
const WAYS: [f64; 2] = [0.011, 0.038];

/// How far a way may lean, over its height.
const LEAN: f64 = 0.2;

/// Distance between landmarks (m), and from the grasp within which the instrument hides them (m).
const LANDMARKS: f64 = 5e-3;
const HIDDEN: f64 = 5e-3;

/// Standard deviations of the measurement: of a landmark along an axis, of the grasp's motion along
/// an axis, and of its place along the organ (m).
pub(super) const TRACKER: f64 = 0.25e-3;
const WAY: f64 = 0.3e-3;
const PLACE: f64 = 1e-3;

/// Error of a measured force along an axis, over the force.
const FORCE: f64 = 0.05;

/// True values are drawn again so often if they cannot be lifted.
const DRAWS: u64 = 20;

/// The pins that a specimen of phantom A has, and its modulus (Pa).
const OWN_PINS: Pins = Pins::End { end: End::Base, length: 0.05, band_length: 0.3, band_share: 0.93 };
const OWN_MODULUS: f64 = 12e3;

/// A phantom with its true lifts.
pub(super) struct Phantom {
    seed: u64,
    organ: LoneOrgan,
    truth: Vec<(Parameter, f64)>,
    lifts: Vec<Observation>,
    /// By parameter, how well the fitted lifts tell it; see [`distances`].
    distances: Vec<Option<f64>>,
}

impl Phantom {
    /// The phantom A of `seed`, recorded into `folder` for its surface.
    pub fn new(seed: u64, folder: &Path, progress: &dyn Progress) -> Result<Self> {
        let organ = true_organ(seed, folder, progress)?;
        let random = Random::from_keys(&[seed, 501]);
        let ways = ways(&organ, random.stream(2));
        for k in 0..DRAWS {
            let own = random.stream(100 + k);
            let score = |i: usize| own.normal(i as u64);
            let truth: Vec<(Parameter, f64)> = default_priors()
                .iter()
                .enumerate()
                .map(|(i, prior)| (prior.name, prior.name.value(prior.range, score(i))))
                .collect();
            let held = organ.with(|organ| {
                Posterior::apply(&truth, organ);
                organ.material.model = TRUE_MODEL;
            });
            let lifted: Option<Vec<_>> = held.lift(&ways, Pace::QUICK, progress)?.into_iter().collect();
            if let Some(lifted) = lifted {
                let seen = |(number, (pull, lifted))| observed(&held, number, pull, lifted, random.stream(3));
                let lifts: Vec<Observation> = ways.iter().zip(&lifted).enumerate().map(seen).collect();
                let distances = distances(&held, &truth, &lifts, progress)?;
                return Ok(Self { seed, organ, truth, lifts, distances });
            }
        }
        Err(Error::Mismatch(format!("phantom {seed}: none of {DRAWS} draws of its tissue can be lifted")))
    }

    /// Fits the even lifts with a coarse mesh of cells of `cell` (m) and a finer one, with the
    /// measured forces or without.
    pub fn fit(&self, cell: f64, forces: bool, progress: &dyn Progress) -> Result<FitRow> {
        let [coarse, organ] = [cell, FINER * cell].map(|cell| self.organ.meshed(cell));
        let (coarse, organ) = (coarse?, organ?);
        let mut lifts = self.lifts.clone();
        if !forces {
            lifts.iter_mut().for_each(|lift| lift.force = None);
        }
        let (fitted, judged): (Vec<_>, Vec<_>) = lifts.into_iter().partition(|lift| is_fitted(lift.number));
        let priors = default_priors();
        let recording = format!("phantom {}", self.seed);
        let identification = Identification {
            organ: coarse.clone(),
            finer: organ.clone(),
            lifts: fitted,
            priors: priors.clone(),
            seed: self.seed,
            recording,
            threads: 1,
        };
        let found = identification.run(progress)?;
        let parameters = priors.iter().zip(&self.truth).enumerate().map(|(k, (prior, (name, value)))| {
            let told = &found.posterior.parameters[k];
            let (mean, deviation) = (found.posterior.mean[k], found.posterior.covariance[k][k].sqrt());
            let score = name.score(prior.range, *value);
            ParameterRow {
                parameter: name.name().to_owned(),
                truth: *value,
                interval: told.interval,
                width: told.width,
                holds: (score - mean).abs() <= NINETY * deviation,
                distance: self.distances[k],
            }
        });
        let parameters = parameters.collect();
        let error = |change: &dyn Fn(&mut Organ)| -> Result<Option<f64>> {
            let organ = organ.with(change);
            let pulls: Vec<Pull> = judged.iter().map(|lift| lift.pull).collect();
            let lifted = organ.lift(&pulls, Pace::QUICK, progress)?;
            let each =
                judged.iter().zip(&lifted).map(|(lift, lifted)| Some(1e3 * lift.error(&organ, lifted.as_ref()?)));
            Ok(trocar_core::median(each.flatten().collect::<Vec<_>>()))
        };
        Ok(FitRow {
            phantom: self.seed,
            cell_mm: 1e3 * cell,
            forces,
            nodes: coarse.organ().body.vertices.len(),
            parameters,
            diverged: found.diverged,
            fitted_rmse_mm: 1e3 * found.rmse,
            model_error: found.model_error,
            held_out_mm: error(&|organ| Posterior::apply(&found.best, organ))?,
            without_threads_mm: error(&|organ| {
                Posterior::apply(&found.best, organ);
                organ.threads = None;
            })?,
            own_pins_mm: error(&|organ| {
                (organ.pins, organ.threads) = (OWN_PINS, None);
                organ.material.young_modulus_pa = OWN_MODULUS;
            })?,
            lift_mm: trocar_core::median(judged.iter().map(|l| 1e3 * l.pull.displacement.length()).collect::<Vec<_>>()),
        })
    }
}

/// By parameter, how far the fitted lifts are from those of the ends of an interval half as wide as
/// the prior's about the true value, in deviations of their measurement: of the nearer end. Ends
/// beyond the prior's range, and those that cannot be simulated, do not count; None if none is
/// left.
fn distances(
    held: &LoneOrgan,
    truth: &[(Parameter, f64)],
    lifts: &[Observation],
    progress: &dyn Progress,
) -> Result<Vec<Option<f64>>> {
    let fitted: Vec<Observation> = lifts.iter().filter(|lift| is_fitted(lift.number)).cloned().collect();
    let Some(from_truth) = LiftDistance::from(held, &fitted, progress)? else { return Ok(vec![None; truth.len()]) };
    let to = |k: usize, value: f64| {
        let mut values = truth.to_vec();
        values[k].1 = value;
        from_truth.to(&held.with(|organ| Posterior::apply(&values, organ)), progress)
    };
    let nearer = |(k, prior): (usize, &Prior)| {
        let mut both = Vec::new();
        for end in ends(prior, truth[k].1).into_iter().flatten() {
            both.extend(to(k, end)?);
        }
        Ok(both.into_iter().min_by(f64::total_cmp))
    };
    default_priors().iter().enumerate().map(nearer).collect()
}

/// The ends of an interval half as wide as the prior's about a value; None where that is beyond the
/// prior's range.
fn ends(prior: &Prior, value: f64) -> [Option<f64>; 2] {
    let [least, most] = [-NINETY, NINETY].map(|score| prior.name.value(prior.range, score));
    let ends = match prior.name.scale() {
        Scale::Linear => [-0.25, 0.25].map(|share| value + share * (most - least)),
        Scale::Log => [-0.25, 0.25].map(|share| value * (most / least).powf(share)),
    };
    let [low, high] = prior.range;
    ends.map(|end| Some(end).filter(|end| low < *end && *end < high))
}

/// The appendix of phantom A with the true mesh.
fn true_organ(seed: u64, folder: &Path, progress: &dyn Progress) -> Result<LoneOrgan> {
    let recording = folder.join(format!("phantom-a-{seed}"));
    let options = RecordOptions { frames: 1, seed, ..RecordOptions::default() };
    trocar_workflow::phantoms::recorded("phantom-a", &options, &recording, progress)?;
    let surface = read_surface(&recording.join("truth").join(format!("{ORGAN}.ply")), Unit::Metre)?;
    let shape = MeshDistance::new(&surface)?;
    let around = |(low, high): (DVec3, DVec3), p: &DVec3| (low.min(*p), high.max(*p));
    let bounds = surface.vertices.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), around);
    let body = LatticeMesher::uniform(TRUE_CELL).mesh_shape(&shape, bounds)?;
    let organ = Organ {
        name: ORGAN.to_owned(),
        // Either end does for the base.
        base: surface.vertices.first().copied().unwrap_or_default(),
        body,
        surface,
        material: Material::default(),
        pins: OWN_PINS,
        threads: None,
        posterior: None,
        facts: OrganFacts::default(),
    };
    let specimen = Specimen {
        name: format!("phantom {seed}"),
        up: -DVec3::Z,
        placement: trocar_core::Pose::IDENTITY,
        camera: None,
        organs: vec![organ],
        background: None,
        provenance: Provenance::default(),
    };
    Ok(LoneOrgan::of(&specimen, ORGAN)?)
}

/// The true lifts: places and ways cover their ranges evenly.
fn ways(organ: &LoneOrgan, random: Random) -> Vec<Pull> {
    let up = organ.up();
    let level = up.any_orthonormal_vector();
    let within = |[low, high]: [f64; 2], rank: usize, at: u64| {
        low + (high - low) * (rank as f64 + random.uniform(at)) / LIFTS as f64
    };
    let pull = |k: usize| {
        let lean = |at: u64| LEAN * random.symmetric(at + k as u64);
        let direction = up + lean(200) * level + lean(300) * up.cross(level);
        // Places rise, ways jump: low and high ones are among the fitted and among the judged.
        let way = within(WAYS, 3 * k % LIFTS, 100 + k as u64);
        Pull { s: within(GRASPS, k, k as u64), displacement: way * direction.normalize(), grip: Grip::Place }
    };
    (0..LIFTS).map(pull).collect()
}

/// A true lift as it is measured.
fn observed(organ: &LoneOrgan, number: usize, pull: &Pull, lifted: &Lifted, random: Random) -> Observation {
    let random = random.stream(number as u64);
    let noise = |stream: u64, deviation: f64| {
        let own = random.stream(stream);
        deviation * DVec3::new(own.normal(0), own.normal(1), own.normal(2))
    };
    let length = organ.length();
    let places: Vec<f64> = (1..(length / LANDMARKS) as usize)
        .map(|k| k as f64 * LANDMARKS)
        .filter(|along| (along - pull.s * length).abs() > HIDDEN)
        .collect();
    let fronts: Vec<DVec3> = places.iter().map(|along| organ.front_at(along / length)).collect();
    let moved = organ.motions(lifted, fronts.clone());
    let landmark = |(k, ((along, rest), moved)): (usize, ((&f64, &DVec3), &DVec3))| Landmark {
        along: *along,
        rest: *rest,
        moved: *moved + noise(10 + k as u64, TRACKER),
    };
    Observation {
        number,
        pull: Pull {
            s: (pull.s + PLACE / length * random.stream(1).normal(0)).clamp(0.0, 1.0),
            displacement: pull.displacement + noise(2, WAY),
            grip: Grip::Place,
        },
        landmarks: places.iter().zip(&fronts).zip(&moved).enumerate().map(landmark).collect(),
        force: Some(lifted.force + noise(3, FORCE * lifted.force.length())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_those_of_an_interval_half_as_wide_as_the_priors() {
        for prior in default_priors() {
            let middle = prior.name.value(prior.range, 0.0);
            let [low, high] = ends(&prior, middle).map(Option::unwrap);
            let [least, most] = [-NINETY, NINETY].map(|score| prior.name.value(prior.range, score));
            let width = match prior.name.scale() {
                Scale::Linear => (high - low) / (most - least),
                Scale::Log => (high / low).ln() / (most / least).ln(),
            };
            assert!((width - 0.5).abs() < 1e-9, "{}: {width}", prior.name.name());
            // Near an end of the range there is only one of them.
            assert!(matches!(ends(&prior, prior.name.value(prior.range, 2.5)), [Some(_), None]));
        }
    }
}
