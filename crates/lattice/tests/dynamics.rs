//! Steps of implicit Euler: laws of motion, determinism, restoring, errors.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use glam::DVec3;
use trocar_lattice::{
    Body, BodyDescription, BodyState, Conditions, EmbeddedPoint, Lattice, LatticeOptions, Law, Material, Newton,
    PointLoad, Precision, Spring,
};
use trocar_testing::blocks::{GRAVITY, appendix, block, noise};

const FRAME: f64 = 1.0 / 60.0;

fn material(law: Law) -> Material {
    Material { law, young_modulus: 12e3, poisson_ratio: 0.45, density: 1200.0 }
}

/// The appendix, with its nodes below `pinned_below` (m) along x pinned.
fn organ(law: Law, pinned_below: f64) -> (Body, Vec<EmbeddedPoint>) {
    let mesh = appendix(3e-3);
    let lattice = Lattice::of_mesh(&mesh, &LatticeOptions::new(4e-3)).unwrap();
    let points = lattice.embed_nodes().unwrap();
    let pinned = mesh.vertices.iter().zip(&points).filter(|(p, _)| p.x < pinned_below);
    let pins = pinned.map(|(_, point)| *point).collect();
    let description =
        BodyDescription { name: "appendix".into(), lattice, material: material(law), pins, fixed: vec![] };
    (Body::new(description).unwrap(), points)
}

fn momentum(body: &Body, state: &BodyState) -> (DVec3, DVec3) {
    let parts = body.masses().iter().zip(&state.velocities).zip(&state.positions);
    parts.fold((DVec3::ZERO, DVec3::ZERO), |(p, l), ((m, v), x)| (p + *m * *v, l + *m * x.cross(*v)))
}

/// A free body falls as implicit Euler's parabola, without strain.
#[test]
fn a_free_body_falls() {
    for law in Law::ALL {
        let (body, points) = organ(law, -1.0);
        let mut state = BodyState::new(&body);
        let mut newton = Newton::new(&body, Precision::default()).unwrap();
        let steps = 30;
        for _ in 0..steps {
            newton.step(&body, &Conditions::gravity(GRAVITY), FRAME, &mut state).unwrap();
        }
        let fallen = 0.5 * GRAVITY * FRAME * FRAME * f64::from(steps * (steps + 1));
        for (p, point) in body.lattice().mesh().vertices.iter().zip(&points) {
            assert!((point.interpolate(&state.positions) - *p - fallen).length() < 1e-9, "{law:?}");
        }
    }
}

/// Linear momentum is kept.
#[test]
fn momentum_is_kept() {
    for law in Law::ALL {
        let (body, _) = organ(law, -1.0);
        let mut state = BodyState::new(&body);
        let middle = DVec3::new(0.04, 0.005, 0.0);
        for (i, (v, p)) in state.velocities.iter_mut().zip(body.lattice().nodes()).enumerate() {
            let number = |k: u64| 0.02 * (noise(3 * i as u64 + k) - 0.5);
            *v =
                DVec3::new(0.1, -0.2, 0.05) + DVec3::Z.cross(*p - middle) + DVec3::new(number(0), number(1), number(2));
        }
        let before = momentum(&body, &state);
        let mut newton = Newton::new(&body, Precision::default()).unwrap();
        for _ in 0..20 {
            newton.step(&body, &Conditions::default(), FRAME / 2.0, &mut state).unwrap();
        }
        let after = momentum(&body, &state);
        println!("{law:?}: momentum {} and {}", before.0, after.0);
        assert!((after.0 - before.0).length() < 1e-7 * before.0.length());
    }
}

/// A pinned organ that falls comes to rest in the static equilibrium.
#[test]
fn motion_ends_in_the_static_equilibrium() {
    for law in Law::ALL {
        let (body, points) = organ(law, 12e-3);
        let conditions = Conditions::gravity(GRAVITY);
        let mut newton = Newton::new(&body, Precision::default()).unwrap();
        let mut moved = BodyState::new(&body);
        for _ in 0..40 {
            newton.step(&body, &conditions, 0.5, &mut moved).unwrap();
        }
        let mut settled = BodyState::new(&body);
        let solution = newton.settle(&body, &conditions, &mut settled).unwrap();
        let off = moved.positions.iter().zip(&settled.positions).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
        let sag = points.iter().map(|point| point.interpolate(&settled.positions).z).fold(0.0, f64::min);
        println!("{law:?}: sag {:.1} mm, off by {off:.1e} m, {solution:?}", 1e3 * sag);
        assert!(sag < -0.02 && off < 1e-6, "{law:?}: {sag}, {off}");
        assert!(body.least_volume_ratio(&settled.positions) > 0.0);
    }
}

/// Springs draw points to their targets, and loads equal the springs' forces.
#[test]
fn springs_and_loads_are_equivalent() {
    let (body, points) = organ(Law::Corotated, 12e-3);
    let grasped = points.iter().zip(&body.lattice().mesh().vertices).filter(|(_, p)| p.x > 0.08);
    let springs: Vec<Spring> = grasped
        .map(|(point, p)| Spring { point: *point, target: *p + DVec3::new(-5e-3, 0.0, 15e-3), stiffness: 20.0 })
        .collect();
    let mut newton = Newton::new(&body, Precision::default()).unwrap();
    let mut held = BodyState::new(&body);
    newton.settle(&body, &Conditions { gravity: GRAVITY, springs: &springs, loads: &[] }, &mut held).unwrap();
    let force = |spring: &Spring| spring.stiffness * (spring.target - spring.point.interpolate(&held.positions));
    let loads: Vec<PointLoad> =
        springs.iter().map(|spring| PointLoad { point: spring.point, force: force(spring) }).collect();
    let mut loaded = held.clone();
    let conditions = Conditions { gravity: GRAVITY, springs: &[], loads: &loads };
    let solution = newton.settle(&body, &conditions, &mut loaded).unwrap();
    assert_eq!(solution.iterations, 0, "{solution:?}");
}

/// The same steps give the same bits with any number of threads, from a copy of the state, and from
/// a solver that solved something else.
#[test]
fn steps_repeat_to_the_bit() {
    let (body, _) = organ(Law::Corotated, 12e-3);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut state = BodyState::new(&body);
            let mut newton = Newton::new(&body, Precision::default()).unwrap();
            let mut copies = vec![state.clone()];
            for _ in 0..4 {
                newton.step(&body, &Conditions::gravity(GRAVITY), FRAME, &mut state).unwrap();
                copies.push(state.clone());
            }
            copies
        })
    };
    let one = run(1);
    assert_eq!(one, run(4));
    let mut newton = Newton::new(&body, Precision::default()).unwrap();
    let mut other = BodyState::new(&body);
    newton.settle(&body, &Conditions::gravity(-GRAVITY), &mut other).unwrap();
    let mut again = one[2].clone();
    newton.step(&body, &Conditions::gravity(GRAVITY), FRAME, &mut again).unwrap();
    assert_eq!(again, one[3]);
}

#[test]
fn unusable_bodies_and_steps_are_refused() {
    let lattice = Lattice::of_mesh(&block([2, 2, 2], 3e-3), &LatticeOptions::new(2e-3)).unwrap();
    let other = Lattice::of_mesh(&block([9, 9, 9], 3e-3), &LatticeOptions::new(2e-3)).unwrap();
    let good = BodyDescription {
        name: "liver".into(),
        lattice,
        material: material(Law::Corotated),
        pins: vec![],
        fixed: vec![],
    };
    let refused = |description: BodyDescription, words: &[&str]| {
        let message = Body::new(description).unwrap_err().to_string();
        assert!(message.contains("'liver'") && words.iter().all(|word| message.contains(word)), "{message}");
    };
    let with = |material: Material| BodyDescription { material, ..good.clone() };
    refused(with(Material { poisson_ratio: 0.5, ..good.material }), &["Poisson's ratio is 0.5", "[0, 0.4999]"]);
    refused(with(Material { young_modulus: f64::NAN, ..good.material }), &["Young's modulus is NaN"]);
    refused(with(Material { density: 0.0, ..good.material }), &["density is 0 kg/m3"]);
    refused(BodyDescription { fixed: vec![900], ..good.clone() }, &["fixed node 900"]);
    let far = other.embed(&[DVec3::splat(0.026)]).unwrap();
    refused(BodyDescription { pins: far.clone(), ..good.clone() }, &["pin 0", "not embedded"]);

    let body = Body::new(good).unwrap();
    assert!(Newton::new(&body, Precision { gradient: 0.0, ..Precision::default() }).is_err());
    let mut newton = Newton::new(&body, Precision::default()).unwrap();
    let mut state = BodyState::new(&body);
    let before = state.clone();
    let refused = |result: trocar_lattice::Result<trocar_lattice::Solution>, words: &str| {
        let message = result.unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    };
    let none = Conditions::default();
    refused(newton.step(&body, &none, 0.0, &mut state), "time step is 0 s");
    refused(newton.settle(&body, &Conditions::gravity(DVec3::NAN), &mut state), "gravity is");
    let loads = [PointLoad { point: far[0], force: DVec3::Z }];
    refused(newton.settle(&body, &Conditions { loads: &loads, ..none }, &mut state), "load 0");
    let springs =
        [Spring { point: body.lattice().embed(&[DVec3::ZERO]).unwrap()[0], target: DVec3::Z, stiffness: -1.0 }];
    refused(newton.settle(&body, &Conditions { springs: &springs, ..none }, &mut state), "spring 0");
    // Nothing holds it against gravity.
    refused(newton.settle(&body, &Conditions::gravity(GRAVITY), &mut state), "body 'liver'");
    assert_eq!(state, before);
    state.positions.pop();
    refused(newton.settle(&body, &none, &mut state), "63 positions");
    let mut state = BodyState::new(&body);
    state.velocities[3].z = f64::NAN;
    refused(newton.step(&body, &none, 0.01, &mut state), "not finite");
}
