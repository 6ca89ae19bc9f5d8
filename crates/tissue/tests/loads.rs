//! Forces on nodes: Newton's second law, a pulled column against its analytic length, and contact
//! that is repeated by its own forces.

use glam::{DMat3, DQuat, DVec3};
use trocar_core::Pose;
use trocar_testing::blocks::{self, FRAME, GRAVITY, block, model, nodes, schedules, tissue};
use trocar_tissue::{
    BodyContact, BodyDescription, Collider, ConstitutiveModel, Divergence, Load, Material, Model, ModelBuilder, Shape,
    SolverSettings, State, Stepper, ToolMotion,
};

/// A free block whose nodes are pushed by their mass times an acceleration has that acceleration,
/// in every solver.
#[test]
fn a_load_accelerates() {
    let mesh = block([2, 2, 2], 2e-3);
    let model = model(&mesh, tissue(12e3), vec![], DVec3::ZERO);
    let acceleration = DVec3::new(0.3, -0.2, 0.5);
    let body = &model.bodies()[0];
    let loads: Vec<Load> =
        (0..body.len()).map(|node| Load { body: 0, node, force: body.mass(node) * acceleration }).collect();
    for blocks::Judged { name, schedule, .. } in schedules() {
        let mut state = State::new(&model);
        let mut stepper = Stepper::new(&model, schedule, FRAME, 1).unwrap();
        for _ in 0..30 {
            assert_eq!(stepper.step_with_loads(&model, &mut state, &[], &loads).divergence, None);
        }
        for node in 0..body.len() {
            let off = state.velocity(&model, 0, node) - 0.5 * acceleration;
            assert!(off.length() < 1e-4, "{name}: node {node} is {off} m/s off after half a second");
        }
    }
}

/// A column that is pulled at its end is longer by F L / (E A) (nu = 0; 2% strain).
#[test]
fn a_pulled_column_stretches() {
    let (cells, edge, length, side) = ([4, 4, 10], 2e-3, 0.02, 8e-3);
    let mesh = block(cells, edge);
    let material = Material { poisson_ratio: 0.0, viscosity: 40.0, ..tissue(12e3) };
    let model = model(&mesh, material, nodes(&mesh, |p| p.z == 0.0), DVec3::ZERO);
    let top = nodes(&mesh, |p| (p.z - length).abs() < 1e-9);
    let pull = 0.02 * 12e3 * side * side;
    // Each node's part of a uniform traction: its share of the area.
    let share = |i: u32| {
        let part = |x: f64| if x < 1e-9 || x > side - 1e-9 { 0.5 } else { 1.0 };
        let p = mesh.vertices[i as usize];
        part(p.x) * part(p.y) * (edge / side).powi(2)
    };
    let total: f64 = top.iter().map(|i| share(*i)).sum();
    assert!((total - 1.0).abs() < 1e-12);
    let loads: Vec<Load> =
        top.iter().map(|i| Load { body: 0, node: *i as usize, force: DVec3::Z * (pull * share(*i)) }).collect();
    for schedule in [SolverSettings::FAST, blocks::many_sweeps()] {
        let mut state = State::new(&model);
        let mut stepper = Stepper::new(&model, schedule, FRAME, 1).unwrap();
        for _ in 0..120 {
            stepper.step_with_loads(&model, &mut state, &[], &loads);
        }
        let longer = state.centroid(&model, 0, &top).z - length;
        assert!((longer / (0.02 * length) - 1.0).abs() < 0.03, "{schedule:?}: {:.4} mm longer", longer * 1e3);
        // Without loads it goes back.
        for _ in 0..120 {
            stepper.step(&model, &mut state, &[]);
        }
        let left = state.centroid(&model, 0, &top).z - length;
        assert!(left.abs() < 2e-5, "{schedule:?}: {:.4} mm are left", left * 1e3);
    }
}

/// A ball pressed slowly into a pinned block, and the same block under the forces that the ball
/// did: both come to the same dent.
#[test]
fn contact_is_done_over_by_its_forces() {
    let mesh = block([8, 8, 4], 2e-3);
    let build = |ball: bool| {
        let mut builder = ModelBuilder::new().gravity(GRAVITY);
        let (material, pinned) = (Material { viscosity: 4.0, ..tissue(12e3) }, nodes(&mesh, |p| p.z == 0.0));
        builder
            .body(BodyDescription { name: "block".into(), mesh: &mesh, material, pinned, supports: vec![] })
            .unwrap();
        if ball {
            builder
                .collider(Collider {
                    name: "ball".into(),
                    tool: 0,
                    shape: Shape::Sphere { centre: DVec3::ZERO, radius: 5e-3 },
                    rest_offset: 0.0,
                    friction: 0.6,
                })
                .unwrap();
        }
        builder.build().unwrap()
    };
    let (touched, loaded) = (build(true), build(false));
    let (mut a, mut b) = (State::new(&touched), State::new(&loaded));
    let mut with = Stepper::new(&touched, SolverSettings::FAST, FRAME, 1).unwrap();
    let mut under = Stepper::new(&loaded, SolverSettings::FAST, FRAME, 1).unwrap();
    let at = |frame: usize| {
        let depth = 1.5e-3 * (frame as f64 / 60.0).min(1.0);
        Pose { translation: DVec3::new(8e-3, 8e-3, 13e-3 - depth), rotation: DQuat::IDENTITY }
    };
    for frame in 0..90 {
        with.step(&touched, &mut a, &[ToolMotion { from: at(frame), to: at(frame + 1) }]);
        let loads = with.contact_loads(&touched, &a);
        under.step_with_loads(&loaded, &mut b, &[], &loads);
    }
    let loads = with.contact_loads(&touched, &a);
    let sum: DVec3 = loads.iter().map(|load| load.force).sum();
    let told = with.forces()[0].contact.force;
    assert!(told.length() > 0.02 && (sum + told).length() < 1e-3 * told.length(), "{sum} against {told}");
    let place = |model: &Model, state: &State, i: usize| state.position(model, 0, i);
    let dent = (0..mesh.vertices.len()).map(|i| place(&touched, &a, i).distance(mesh.vertices[i])).fold(0.0, f64::max);
    let off =
        (0..mesh.vertices.len()).map(|i| place(&touched, &a, i).distance(place(&loaded, &b, i))).fold(0.0, f64::max);
    assert!(dent > 1e-3 && off < 0.01 * dent, "{:.4} mm off in a dent of {:.4} mm", off * 1e3, dent * 1e3);
}

/// A load on a missing node, or with a force that is not finite, stops the step, and nothing moves.
#[test]
fn a_load_on_no_node_is_refused() {
    let mesh = block([1, 1, 1], 2e-3);
    let model = model(&mesh, tissue(12e3), vec![], GRAVITY);
    let mut state = State::new(&model);
    let mut stepper = Stepper::new(&model, SolverSettings::FAST, FRAME, 1).unwrap();
    let before = state.hash();
    for (body, node, force) in [(1, 0, DVec3::X), (0, 8, DVec3::X), (0, 0, DVec3::NAN)] {
        let report = stepper.step_with_loads(&model, &mut state, &[], &[Load { body, node, force }]);
        assert_eq!(report.divergence, Some(Divergence::WrongLoad));
    }
    assert_eq!(state.hash(), before);
}

/// A block that falls on a pinned one: what they do to each other adds up to nothing, bears the
/// block, and moves both alike as loads.
#[test]
fn what_bodies_do_to_each_other_is_equal_and_opposite() {
    let low = block([6, 6, 3], 2.5e-3);
    let mut high = block([4, 4, 3], 2.5e-3);
    high.vertices.iter_mut().for_each(|p| *p += DVec3::new(2e-3, 1.5e-3, 8.6e-3));
    let build = |contact: Option<BodyContact>| {
        let mut builder = ModelBuilder::new().gravity(GRAVITY);
        if let Some(contact) = contact {
            builder = builder.body_contact(contact);
        }
        let material = Material { viscosity: 40.0, ..tissue(12e3) };
        for (mesh, pinned) in [(&low, nodes(&low, |p| p.z == 0.0)), (&high, vec![])] {
            builder.body(BodyDescription { name: "block".into(), mesh, material, pinned, supports: vec![] }).unwrap();
        }
        builder.build().unwrap()
    };
    let (touching, apart) = (build(Some(BodyContact::default())), build(None));
    let mut a = State::new(&touching);
    let mut with = Stepper::new(&touching, SolverSettings::FAST, FRAME, 1).unwrap();
    let mut under = Stepper::new(&apart, SolverSettings::FAST, FRAME, 1).unwrap();
    for _ in 0..180 {
        with.step(&touching, &mut a, &[]);
    }
    let sum = |loads: &[Load], body: usize| -> DVec3 {
        loads.iter().filter(|load| load.body == body).map(|load| load.force).sum()
    };
    let loads = with.contact_loads(&touching, &a);
    let weight = 9.81 * (0..high.vertices.len()).map(|i| touching.bodies()[1].mass(i)).sum::<f64>();
    let (below, above) = (sum(&loads, 0), sum(&loads, 1));
    assert!((above + below).length() < 1e-4 * weight, "{above} and {below}");
    assert!((above - DVec3::Z * weight).length() < 0.02 * weight, "{above} bears {weight} N");
    // From there, without contact, under the same forces, nothing falls.
    let mut b = State::new(&apart);
    assert!(b.copy_motion(&a));
    let before = a.positions(&touching, 1);
    under.step_with_loads(&apart, &mut b, &[], &loads);
    let most = (0..before.len()).map(|i| b.position(&apart, 1, i).distance(before[i])).fold(0.0, f64::max);
    let fall = 9.81 * FRAME * FRAME;
    assert!(most < 0.01 * fall, "{:.5} mm in a frame; it would fall {:.5} mm", most * 1e3, fall * 1e3);
    let mut other = State::new(&model(&low, tissue(12e3), vec![], GRAVITY));
    assert!(!other.copy_motion(&a), "a state of other bodies is refused");
}

/// Stretch of a bar whose sides are free, under a nominal stress (Pa), by the material's textbook
/// form: nested halving.
fn stretch_under(material: &Material, nominal: f64) -> f64 {
    let psi = material.hyperelastic();
    let halve = |mut low: f64, mut high: f64, beyond: &dyn Fn(f64) -> bool| {
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            *(if beyond(middle) { &mut high } else { &mut low }) = middle;
        }
        0.5 * (low + high)
    };
    let stress = |s: f64| {
        let at = |t: f64| psi.stress(DMat3::from_diagonal(DVec3::new(t, t, s)));
        let t = halve(0.05, 1.2, &|t| at(t).x_axis.x > 0.0);
        at(t).z_axis.z
    };
    halve(1.0, 12.0, &|s| stress(s) > nominal)
}

/// Soft tissue that is pulled with hundreds of times its shear modulus stretches as the limit of
/// stretch says, and no element inverts. Without the limit it would be 200 times as long.
#[test]
fn stretch_is_limited() {
    let edge = 2e-3;
    // Sweeps see every element once for each corner, so their bar is thin.
    for (schedule, width) in [(SolverSettings::FAST, 3), (blocks::adaptive(), 1)] {
        let mesh = block([width, width, 8], edge);
        let (length, side) = (8.0 * edge, width as f64 * edge);
        let share = |p: DVec3| {
            let part = |x: f64| if x < 1e-9 || x > side - 1e-9 { 0.5 } else { 1.0 };
            part(p.x) * part(p.y) * edge * edge
        };
        let top = nodes(&mesh, |p| (p.z - length).abs() < 1e-9);
        let [low, high] = [3.0, 6.0].map(|level| nodes(&mesh, |p| (p.z - level * edge).abs() < 1e-9));
        for law in [ConstitutiveModel::StableNeoHookean, ConstitutiveModel::Corotated] {
            let material = Material { model: law, viscosity: 40.0, ..tissue(3e3) };
            let model = model(&mesh, material, nodes(&mesh, |p| p.z == 0.0), DVec3::ZERO);
            let nominal = 200.0 * material.lame().0;
            let expected = stretch_under(&material, nominal);
            assert!((4.5..6.5).contains(&expected), "{law:?}: a stretch of {expected}");
            let mut state = State::new(&model);
            let mut stepper = Stepper::new(&model, schedule, FRAME, 1).unwrap();
            for frame in 0..120 {
                let pull = nominal * (f64::from(frame) / 60.0).min(1.0);
                let force = |i: &u32| DVec3::Z * (pull * share(mesh.vertices[*i as usize]));
                let loads: Vec<Load> =
                    top.iter().map(|i| Load { body: 0, node: *i as usize, force: force(i) }).collect();
                let report = stepper.step_with_loads(&model, &mut state, &[], &loads);
                assert_eq!((report.divergence, report.inverted), (None, 0), "{law:?} {schedule:?} frame {frame}");
                assert_eq!(report.fallbacks, 0, "{law:?} {schedule:?} frame {frame}");
            }
            let apart = state.centroid(&model, 0, &high).z - state.centroid(&model, 0, &low).z;
            let stretch = apart / (3.0 * edge);
            println!("{law:?} {schedule:?}: {stretch:.3}, expected {expected:.3}");
            assert!((stretch / expected - 1.0).abs() < 0.02, "{law:?} {schedule:?}: {stretch}, not {expected}");
        }
    }
}
