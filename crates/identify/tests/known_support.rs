//! What holds a tube is found from lifts that were made with known values.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may panic and tell their figures")]

use glam::DVec3;
use trocar_core::{Random, Silent};
use trocar_identify::{
    Error, FINER, Grip, Identification, Identified, Landmark, LoneOrgan, Observation, Pace, Pull, default_priors,
};
use trocar_specimen::{NINETY, Parameter, Posterior, Prior};
use trocar_testing::tube::{ONE_END, meshed};

const TRUTH: [(Parameter, f64); 3] =
    [(Parameter::BaseLength, 0.2), (Parameter::ThreadsStiffness, 900.0), (Parameter::YoungModulus, 15e3)];

/// The tube with some values that are not identified.
fn tube(edge: f64) -> LoneOrgan {
    let organ = LoneOrgan::of(&meshed(ONE_END, edge), "tube").unwrap();
    organ.with(|organ| {
        Parameter::ThreadsFrom.apply(0.7, organ);
        Parameter::ThreadsSlack.apply(3e-3, organ);
    })
}

/// Two lifts of the tube with the true values, seen with the noise of a tracker.
fn lifts(organ: &LoneOrgan, force: bool) -> Vec<Observation> {
    let true_organ = organ.with(|organ| Posterior::apply(&TRUTH, organ));
    let up = true_organ.up();
    let pulls = [(0.55, 10e-3), (0.7, 16e-3)].map(|(s, way)| Pull { s, displacement: way * up, grip: Grip::Place });
    let lifted = true_organ.lift(&pulls, Pace::QUICK, &Silent).unwrap();
    let places: Vec<f64> = (2..11).map(|k| f64::from(k) / 12.0).collect();
    let seen = |(number, (pull, lifted)): (usize, (&Pull, &Option<_>))| {
        let lifted: &trocar_identify::Lifted = lifted.as_ref().unwrap();
        let fronts: Vec<DVec3> = places.iter().map(|s| true_organ.front_at(*s)).collect();
        let moved = true_organ.motions(lifted, fronts.clone());
        let noise = Random::from_keys(&[7, number as u64]);
        let landmark = |(k, ((s, rest), moved)): (usize, ((&f64, &DVec3), &DVec3))| {
            let own = noise.stream(k as u64);
            let off = 0.2e-3 * DVec3::new(own.normal(0), own.normal(1), own.normal(2));
            Landmark { along: s * true_organ.length(), rest: *rest, moved: *moved + off }
        };
        let landmarks = places.iter().zip(&fronts).zip(&moved).enumerate().map(landmark).collect();
        Observation { number, pull: *pull, landmarks, force: force.then_some(lifted.force) }
    };
    pulls.iter().zip(&lifted).enumerate().map(seen).collect()
}

fn identification(lifts: Vec<Observation>, edge: f64, threads: usize) -> Identification {
    let known = |prior: &Prior| TRUTH.iter().any(|(name, _)| *name == prior.name);
    let priors = default_priors().into_iter().filter(known).collect();
    let [organ, finer] = [edge, FINER * edge].map(tube);
    Identification { organ, finer, lifts, priors, seed: 3, recording: "tube".into(), threads }
}

/// Scores of the truth from the mean, in deviations.
fn off(found: &Identified) -> Vec<f64> {
    let posterior = &found.posterior;
    let one = |(k, (name, value)): (usize, &(Parameter, f64))| {
        let prior = posterior.parameters.iter().position(|p| p.name == *name).unwrap();
        assert_eq!(k, prior);
        (name.score(posterior.parameters[k].range, *value) - posterior.mean[k]) / posterior.covariance[k][k].sqrt()
    };
    TRUTH.iter().enumerate().map(one).collect()
}

#[test]
fn a_known_support_is_found() {
    let seen = lifts(&tube(3e-3), true);
    let found = identification(seen.clone(), 4e-3, 2).run(&Silent).unwrap();
    println!("{:?}\n{:?}\noff {:?}, rmse {}", found.posterior.parameters, found.best, off(&found), found.rmse);
    assert_eq!(found.posterior.validate(), Ok(()));
    assert!(off(&found).iter().all(|z| z.abs() < NINETY), "{:?}", off(&found));
    // The stiffness in the meshes of the fit is that in the mesh of the truth.
    let stiffness = found.posterior.parameters[1].interval[1] / TRUTH[1].1;
    assert!((0.75..1.3).contains(&stiffness), "{stiffness}");
    assert!(found.posterior.parameters.iter().all(Posterior::is_identified), "{:?}", found.posterior.parameters);
    assert!(found.rmse < 1.5e-3, "{} m", found.rmse);

    // Bits do not depend on threads.
    let again = identification(seen, 4e-3, 1).run(&Silent).unwrap();
    assert_eq!((again.posterior, again.best), (found.posterior, found.best));
}

#[test]
fn too_few_landmarks_are_refused() {
    let mut few = lifts(&tube(4e-3), false);
    few.iter_mut().for_each(|lift| lift.landmarks.truncate(2));
    let why = identification(few, 4e-3, 1).run(&Silent).unwrap_err();
    assert!(matches!(why, Error::Lifts(_)) && why.to_string().contains("4 landmarks"), "{why}");
    let missing = LoneOrgan::of(&meshed(ONE_END, 4e-3), "tail").unwrap_err().to_string();
    assert_eq!(missing, "the specimen has no organ 'tail'; it has tube");
}
