//! dev
#![allow(clippy::unwrap_used, dead_code, missing_docs)]
mod common;
use common::{FRAME, GRAVITY};
use glam::DVec3;
use trocar_geometry::{Pose, TetMesh};
use trocar_tissue::*;

fn components(mesh: &TetMesh) -> Vec<TetMesh> {
    let mut label: Vec<usize> = (0..mesh.vertices.len()).collect();
    fn find(l: &mut Vec<usize>, mut i: usize) -> usize { while l[i] != i { l[i] = l[l[i]]; i = l[i]; } i }
    for t in &mesh.tets { for k in 1..4 { let (a, b) = (find(&mut label, t[0] as usize), find(&mut label, t[k] as usize)); label[a.max(b)] = a.min(b); } }
    let all: Vec<usize> = (0..label.len()).map(|i| find(&mut label, i)).collect();
    let mut roots = all.clone();
    roots.sort_unstable(); roots.dedup();
    roots.iter().map(|r| {
        let nodes: Vec<usize> = (0..all.len()).filter(|i| all[*i] == *r).collect();
        let mut number = vec![0u32; all.len()];
        nodes.iter().enumerate().for_each(|(k, i)| number[*i] = k as u32);
        TetMesh { vertices: nodes.iter().map(|i| mesh.vertices[*i]).collect(), tets: mesh.tets.iter().filter(|t| all[t[0] as usize] == *r).map(|t| t.map(|i| number[i as usize])).collect() }
    }).collect()
}
fn specimen() -> Vec<TetMesh> {
    components(&trocar_geometry::io::read_msh(std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/peers/meshes/specimen_a.msh"))).unwrap())
}
fn material(visc: f64) -> Material { Material { model: ConstitutiveModel::StableNeoHookean, young_modulus: 12e3, poisson_ratio: 0.45, density: 1200.0, viscosity: visc } }
fn build(meshes: &[TetMesh], visc: f64) -> Model {
    let mut builder = ModelBuilder::new().gravity(GRAVITY);
    for m in meshes {
        builder.body(BodyDescription { name: "x".into(), mesh: m, material: material(visc), pinned: pins::lowest_band(&m.vertices, DVec3::Z, 0.42), supports: vec![] }).unwrap();
    }
    builder.build().unwrap()
}
fn patch(model: &Model, body: usize) -> Vec<u32> {
    let b = &model.bodies()[body];
    let top = (0..b.len() as u32).filter(|i| !b.pinned()[*i as usize]).max_by(|i, j| b.rest_positions()[*i as usize].z.total_cmp(&b.rest_positions()[*j as usize].z)).unwrap();
    let p = b.rest_positions()[top as usize];
    (0..b.len() as u32).filter(|i| !b.pinned()[*i as usize] && (b.rest_positions()[*i as usize] - p).length() < 4e-3).collect()
}
fn schedule() -> Schedule {
    let v: Vec<usize> = std::env::var("SCHED").unwrap_or("2,20,8".into()).split(',').map(|s| s.parse().unwrap()).collect();
    if std::env::var("PAPER").is_ok() { return Schedule::PAPER; }
    let tol = std::env::var("TOL").ok().map_or(3e-8, |s| s.parse().unwrap());
    Schedule::QuasiNewton(QuasiNewton { substeps: v[0], iterations: v[1], memory: v[2], tolerance: tol, relative: std::env::var("REL").ok().map_or(1e-2, |s| s.parse().unwrap()) })
}
fn threads() -> usize { std::env::var("T").ok().map_or(1, |s| s.parse().unwrap()) }

#[test]
#[ignore]
fn drag() {
    let model = build(&specimen(), 0.0);
    for moving in [false, true] {
        let mut state = State::new(&model);
        let mut stepper = Stepper::new(&model, schedule(), FRAME, threads()).unwrap();
        for _ in 0..20 { stepper.step(&model, &mut state, &[]); }
        let at = |z: f64| Pose { translation: DVec3::Z * z, ..Pose::IDENTITY };
        let bodies: Vec<usize> = if moving { (0..model.bodies().len()).collect() } else { vec![model.bodies().len() - 1] };
        for (k, b) in bodies.iter().enumerate() { let n = patch(&model, *b); let g = Grasp::capture(&model, &state, *b, &n, k, &Pose::IDENTITY); state.grasps.push(g); }
        let z = |k: usize| if moving { 1e-3 * (2.0 * std::f64::consts::PI * 7.3 * k as f64 * FRAME).sin() } else { 10e-3 * k as f64 * FRAME };
        let mut times = vec![]; let mut its = 0; let mut falls = 0; let mut inv = 0; let mut lim = 0; let mut minr = 1.0f64;
        for k in 0..60 {
            let tools: Vec<ToolMotion> = bodies.iter().map(|_| ToolMotion { from: at(z(k)), to: at(z(k + 1)) }).collect();
            let t = std::time::Instant::now();
            let r = stepper.step(&model, &mut state, &tools);
            times.push(t.elapsed().as_secs_f64() * 1e3);
            its += r.iterations; falls += r.fallbacks; inv = inv.max(r.inverted); lim += r.grasp_limited; minr = minr.min(r.min_volume_ratio);
            assert_eq!(r.divergence, None);
        }
        times.sort_by(f64::total_cmp);
        println!("moving {moving}: median {:.2} min {:.2} max {:.2} ms = {:.1}x; iterations {} fallbacks {falls} inverted {inv} limited {lim} min ratio {minr:.3}", times[30], times[0], times[59], 16.667 / times[30], its);
    }
}

#[test]
#[ignore]
fn sag() {
    let model = build(&specimen(), 0.0);
    let mut exact = OracleState::new(&model);
    Oracle::new(&model).settle(&model, &mut exact, &[]).unwrap();
    let model2 = build(&specimen(), std::env::var("VISC").ok().map_or(60.0, |s| s.parse().unwrap()));
    let mut state = State::new(&model2);
    let mut stepper = Stepper::new(&model2, schedule(), FRAME, threads()).unwrap();
    let mut r = StepReport::default();
    for k in 0..120 { r = stepper.step(&model2, &mut state, &[]); if k % 20 == 0 { println!("{k} {:?}", r); } }
    let (mut e, mut s) = (0.0, 0.0);
    for b in 0..model.bodies().len() {
        let (x, y, r) = (state.positions(&model, b), exact.positions(b), model.bodies()[b].rest_positions());
        for i in 0..x.len() { e += (x[i] - y[i]).length(); s += (y[i] - r[i]).length(); }
    }
    println!("sag error {:.4}% speed {:e}", 100.0 * e / s, r.max_speed);
}

#[test]
#[ignore]
fn tube() {
    let mesh = specimen().pop().unwrap();
    let axis = trocar_geometry::OrganAxis::of(&mesh, mesh.vertices[0]).unwrap();
    let len = axis.length;
    let pinned: Vec<u32> = (0..mesh.vertices.len() as u32).filter(|i| axis.s[*i as usize] * len < 10e-3).collect();
    let held: Vec<u32> = (0..mesh.vertices.len() as u32).filter(|i| ((axis.s[*i as usize] - 0.5) * len).abs() < 5e-3).collect();
    println!("length {len} pinned {} held {}", pinned.len(), held.len());
    let mut builder = ModelBuilder::new().gravity(GRAVITY);
    builder.body(BodyDescription { name: "x".into(), mesh: &mesh, material: material(0.0), pinned, supports: vec![] }).unwrap();
    let model = builder.build().unwrap();
    let mut state = State::new(&model);
    let n = schedule().substeps();
    let mut stepper = Stepper::new(&model, schedule(), FRAME, threads()).unwrap();
    let g = Grasp::capture(&model, &state, 0, &held, 0, &Pose::IDENTITY);
    state.grasps.push(g.clone());
    let at = |z: f64| Pose { translation: DVec3::Z * z, ..Pose::IDENTITY };
    let mut oracle = Oracle::with_precision(&model, oracle::Precision { gradient: 1e-6, iterations: 100 });
    let mut exact = OracleState::new(&model);
    let (mut its, mut total, mut falls, mut lim) = (0, 0.0, 0, 0);
    for k in 0..60 {
        let m = ToolMotion { from: at(30e-3 * k as f64 * FRAME), to: at(30e-3 * (k + 1) as f64 * FRAME) };
        let t = std::time::Instant::now();
        let r = stepper.step(&model, &mut state, &[m]);
        total += t.elapsed().as_secs_f64();
        its += r.iterations; falls += r.fallbacks; lim += r.grasp_limited;
        for j in 1..=n {
            let h = Held::by(&g, &m.at(j as f64 / n as f64));
            oracle.step(&model, &mut exact, FRAME / n as f64, &h).unwrap();
        }
        if [0, 4, 14, 29, 59].contains(&k) {
            let (x, y, r0) = (state.positions(&model, 0), exact.positions(0), model.bodies()[0].rest_positions());
            let e: f64 = (0..x.len()).map(|i| (x[i] - y[i]).length_squared()).sum();
            let s: f64 = (0..x.len()).map(|i| (y[i] - r0[i]).length_squared()).sum();
            println!("frame {} error {:.3}% (rms displacement {:.2} mm) iterations {its} falls {falls} limited {lim} ms/frame {:.2} min ratio {:.3}", k + 1, 100.0 * (e / s).sqrt(), (s / x.len() as f64).sqrt() * 1e3, total * 1e3 / (k + 1) as f64, r.min_volume_ratio);
        }
    }
}

#[test]
#[ignore]
fn dropped() {
    let mesh = common::block([4, 3, 2], 2e-3);
    for kind in ["dropped", "flight"] {
        for constitutive in [ConstitutiveModel::StableNeoHookean, ConstitutiveModel::Corotated] {
            let mut builder = ModelBuilder::new().gravity(if kind == "dropped" { GRAVITY } else { DVec3::ZERO });
            let plane = SupportPlane { point: DVec3::Z * -1e-3, normal: DVec3::Z, friction: 0.3 };
            builder.body(BodyDescription { name: "b".into(), mesh: &mesh, material: Material { model: constitutive, ..material(0.0) }, pinned: vec![], supports: if kind == "dropped" { vec![plane.into()] } else { vec![] } }).unwrap();
            let model = builder.build().unwrap();
            let mut state = State::new(&model);
            if kind == "flight" {
                let rest = model.bodies()[0].rest_positions();
                let centre = rest.iter().sum::<DVec3>() / rest.len() as f64;
                for (i, p) in rest.iter().enumerate() {
                    let arm = p - centre;
                    let shiver = 6.0 * DVec3::new(arm.x, -arm.y, 0.3 * arm.x);
                    state.set_velocity(&model, 0, i, DVec3::new(0.05, 0.02, -0.03) + 20.0 * DVec3::Z.cross(arm) + shiver);
                }
            }
            let mut stepper = Stepper::new(&model, schedule(), FRAME, 1).unwrap();
            println!("{kind} {constitutive:?}");
            let mut before = Energy::of(&model, &OracleState::from_state(&model, &state)).total();
            for k in 0..30 {
                let r = stepper.step(&model, &mut state, &[]);
                let e = Energy::of(&model, &OracleState::from_state(&model, &state));
                println!("moving {k} total {:.3e} gain {:.2e} kinetic {:.3e} its {} falls {} speed {:.3e}", e.total(), e.total() - before, e.kinetic, r.iterations, r.fallbacks, r.max_speed);
                before = e.total();
            }
        }
    }
}
