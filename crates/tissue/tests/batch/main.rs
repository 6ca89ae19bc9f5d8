//! Instances in lanes: the same bits in any company, and the converged solution of each.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

#[cfg(feature = "gpu")]
mod gpu;

use glam::{DQuat, DVec3};
use trocar_core::Pose;
use trocar_lattice::{
    Body, BodyDescription, BodyState, Conditions, EmbeddedPoint, Lattice, LatticeOptions, Law, Material, Newton,
    Precision, Spring,
};
use trocar_testing::blocks::{FRAME, GRAVITY, appendix, noise};
use trocar_tissue::{Batch, BatchSettings, Error, Instance, InstanceReport, Isa, ToolMotion};

/// Stiffness of a spring of a grasp (N/m).
const GRIP: f64 = 200.0;

/// Cells of `cell` (m) whose empty parts are held as lanes need it.
fn options(cell: f64) -> LatticeOptions {
    LatticeOptions { fill: 1e-3, ..LatticeOptions::new(cell) }
}

/// An appendix that is pinned at its beginning, and points about its middle.
fn organ(young_modulus: f64, law: Law) -> (Body, Vec<EmbeddedPoint>) {
    let mesh = appendix(2.5e-3);
    let lattice = Lattice::of_mesh(&mesh, &options(3.5e-3)).unwrap();
    let held: Vec<u32> = (0..mesh.vertices.len() as u32).filter(|i| mesh.vertices[*i as usize].x < 0.01).collect();
    let pins = lattice.embed_held(&held).unwrap();
    let middle = DVec3::new(0.045, 4.0 * 0.045 * 0.04, 0.003);
    let grip: Vec<DVec3> = mesh.vertices.iter().copied().filter(|p| p.distance(middle) < 0.005).take(5).collect();
    assert!(grip.len() >= 3);
    let grip = lattice.embed(&grip).unwrap();
    let material = Material { law, young_modulus, poisson_ratio: 0.45, density: 1200.0 };
    let description = BodyDescription { name: "appendix".into(), lattice, material, pins, fixed: vec![] };
    (Body::new(description).unwrap(), grip)
}

/// Instance k of any number: modulus, pose and path of its tool.
fn instance(k: usize) -> (Instance, impl Fn(f64) -> Pose) {
    let draw = move |what: u64| noise(8 * k as u64 + what);
    let pose = Pose {
        rotation: DQuat::from_scaled_axis(0.5 * DVec3::new(draw(0), draw(1), 6.0 * draw(2))),
        translation: DVec3::new(draw(3), draw(4), 0.0),
    };
    let own = Instance { young_modulus: 7e3 * 3f64.powf(draw(5)), gravity: GRAVITY, pose };
    let (along, turn) = (DVec3::new(draw(6) - 0.5, draw(7) - 0.5, 1.0) * 0.03, 0.5 * draw(1));
    let tool = move |time: f64| Pose {
        rotation: DQuat::from_rotation_y(turn * time),
        translation: pose.transform(DVec3::new(0.045, 0.007, 0.01)) + pose.rotation * along * time,
    };
    (own, tool)
}

fn motion(tool: &impl Fn(f64) -> Pose, frame: usize) -> ToolMotion {
    ToolMotion { from: tool(frame as f64 * FRAME), to: tool((frame + 1) as f64 * FRAME) }
}

/// Steps some instances that grasp at frame 1, every third of which lets go at frame 5. Returns the
/// bits of all positions.
fn run(body: &Body, grip: &[EmbeddedPoint], which: &[usize], threads: usize, broken: Option<usize>) -> Vec<Vec<u64>> {
    let made: Vec<_> = which.iter().map(|k| instance(*k)).collect();
    let own: Vec<Instance> = made.iter().map(|(own, _)| *own).collect();
    let mut batch = Batch::new(body, &own, BatchSettings::default(), threads).unwrap();
    for frame in 0..8 {
        for (i, k) in which.iter().enumerate() {
            if frame == 1 && k % 5 != 4 {
                batch.grasp(i, grip, GRIP, &made[i].1(FRAME)).unwrap();
            }
            if frame == 5 && k % 3 == 0 {
                batch.release(i).unwrap();
            }
        }
        let mut tools: Vec<ToolMotion> = made.iter().map(|(_, tool)| motion(tool, frame)).collect();
        if let Some(broken) = broken.filter(|_| frame > 2) {
            tools[broken].to.translation.x = f64::NAN;
        }
        let reports = batch.step(&tools).unwrap();
        for (i, report) in reports.iter().enumerate() {
            assert_eq!(report.damaged, broken == Some(i) && frame > 2, "instance {i}, frame {frame}");
        }
    }
    let bits = |i: usize| batch.positions(i).unwrap().iter().flat_map(|p| p.to_array().map(f64::to_bits)).collect();
    (0..which.len()).map(bits).collect()
}

/// Instance 11 alone, in a batch of 37, in another place, on two threads and by every instruction
/// set.
#[test]
fn an_instance_has_the_same_bits_in_any_company() {
    let (body, grip) = organ(12e3, Law::StableNeoHookean);
    let all: Vec<usize> = (0..37).collect();
    let together = run(&body, &grip, &all, 1, None);
    assert!(run(&body, &grip, &all, 2, None) == together, "two threads");
    for k in [0, 11, 19, 36] {
        assert!(run(&body, &grip, &[k], 1, None)[0] == together[k], "{k} alone");
    }
    assert!(run(&body, &grip, &[3, 30, 11, 5], 2, None)[2] == together[11], "11 in third place");
    for isa in Isa::ALL {
        Isa::limit(isa);
        assert!(run(&body, &grip, &[4, 11], 1, None)[1] == together[11], "{}", isa.name());
    }
    Isa::limit(Isa::ALL[0]);
}

/// A tool that is nowhere stops its instance and touches no other.
#[test]
fn a_damaged_instance_does_not_change_its_neighbours() {
    let (body, grip) = organ(12e3, Law::StableNeoHookean);
    let all: Vec<usize> = (0..9).collect();
    let sound = run(&body, &grip, &all, 1, None);
    let damaged = run(&body, &grip, &all, 1, Some(5));
    for k in (0..9).filter(|k| *k != 5) {
        assert!(damaged[k] == sound[k], "{k}");
    }
    assert!(damaged[5] != sound[5]);
    assert!(damaged[5].iter().all(|bits| f64::from_bits(*bits).is_finite()));
}

/// An instance that cannot converge in the rounds it has does not change its neighbours either.
#[test]
fn an_instance_that_does_not_converge_does_not_change_its_neighbours() {
    let (body, grip) = organ(12e3, Law::StableNeoHookean);
    let settings = BatchSettings { rounds: 6, ..BatchSettings::default() };
    let go = |which: &[usize], thrown: bool| {
        let made: Vec<_> = which.iter().map(|k| instance(*k)).collect();
        let own: Vec<Instance> = made.iter().map(|(own, _)| *own).collect();
        let mut batch = Batch::new(&body, &own, settings, 1).unwrap();
        (0..own.len()).for_each(|i| batch.grasp(i, &grip, GRIP, &made[i].1(0.0)).unwrap());
        let mut last = Vec::new();
        for frame in 0..4 {
            let mut tools: Vec<ToolMotion> = made.iter().map(|(_, tool)| motion(tool, frame)).collect();
            if thrown {
                // Half a metre in a frame.
                tools[1].to.translation.z += 0.5;
            }
            last = batch.step(&tools).unwrap();
        }
        (batch.positions(0).unwrap(), batch.positions(1).unwrap(), last)
    };
    let (calm, _, _) = go(&[2, 6], false);
    let (beside, thrown, reports) = go(&[2, 6], true);
    assert!(reports[1].unconverged > 0, "{reports:?}");
    assert!(calm == beside);
    assert!(thrown.iter().all(|p| p.is_finite()));
}

/// Each instance is where Newton's method in double precision, run to convergence, puts it after
/// the same substeps.
#[test]
fn instances_converge_to_newtons_solution() {
    let frames = 12;
    let (body, grip) = organ(12e3, Law::StableNeoHookean);
    let points = body.lattice().embed_nodes().unwrap();
    for (settings, bar) in [
        (BatchSettings::default(), 1e-2),
        (BatchSettings { relative: 1e-3, tolerance: 1e-9, rounds: 100, ..BatchSettings::default() }, 1e-3),
    ] {
        let made: Vec<_> = (0..5).map(instance).collect();
        let own: Vec<Instance> = made.iter().map(|(own, _)| *own).collect();
        let mut batch = Batch::new(&body, &own, settings, 1).unwrap();
        (0..own.len()).for_each(|i| batch.grasp(i, &grip, GRIP, &made[i].1(0.0)).unwrap());
        let mut rounds = 0;
        for frame in 0..frames {
            let tools: Vec<ToolMotion> = made.iter().map(|(_, tool)| motion(tool, frame)).collect();
            rounds += batch.step(&tools).unwrap().iter().map(|r| r.rounds).sum::<usize>();
        }
        println!("{:.1} rounds a substep", rounds as f64 / (5 * frames * settings.substeps) as f64);
        for (i, (own, tool)) in made.iter().enumerate() {
            let truth = newton(own, tool, frames, settings.substeps);
            let (at, rest) = (batch.positions(i).unwrap(), body.lattice().nodes());
            let rest: Vec<DVec3> = rest.iter().map(|p| own.pose.transform(*p)).collect();
            let mean = |from: &[DVec3]| {
                let off = |p: &EmbeddedPoint| p.interpolate(from).distance_squared(p.interpolate(&truth));
                points.iter().map(off).sum::<f64>().sqrt()
            };
            let error = mean(&at) / mean(&rest);
            println!("instance {i}: error {error:.2e}");
            assert!(error < bar, "instance {i}: error {error}");
        }
    }
}

/// World positions by Newton's method.
fn newton(own: &Instance, tool: &impl Fn(f64) -> Pose, frames: usize, substeps: usize) -> Vec<DVec3> {
    let (body, grip) = organ(own.young_modulus, Law::StableNeoHookean);
    let mut state = BodyState::new(&body);
    let mut newton = Newton::new(&body, Precision { gradient: 1e-8, iterations: 200 }).unwrap();
    let (inverse, began) = (own.pose.inverse(), tool(0.0));
    let gravity = inverse.rotation * own.gravity;
    for frame in 0..frames {
        let motion = motion(tool, frame);
        for substep in 1..=substeps {
            let tool = motion.at(substep as f64 / substeps as f64);
            let spring = |point: &EmbeddedPoint| {
                let at = own.pose.transform(point.interpolate(body.lattice().nodes()));
                let local = began.inverse().transform(at);
                Spring { point: *point, target: inverse.transform(tool.transform(local)), stiffness: GRIP }
            };
            let springs: Vec<Spring> = grip.iter().map(spring).collect();
            let conditions = Conditions { gravity, springs: &springs, loads: &[] };
            newton.step(&body, &conditions, FRAME / substeps as f64, &mut state).unwrap();
        }
    }
    state.positions.iter().map(|p| own.pose.transform(*p)).collect()
}

/// A free body falls as implicit Euler's parabola. A body at rest without gravity takes no round
/// and keeps its bits.
#[test]
fn a_free_body_falls_and_a_resting_one_rests() {
    let lattice = Lattice::of_mesh(&appendix(2.5e-3), &options(4e-3)).unwrap();
    let material = Material { law: Law::StableNeoHookean, young_modulus: 9e3, poisson_ratio: 0.4, density: 1100.0 };
    let description = BodyDescription { name: "free".into(), lattice, material, pins: vec![], fixed: vec![] };
    let body = Body::new(description).unwrap();
    let of = |gravity| Instance { young_modulus: 9e3, gravity, pose: Pose::IDENTITY };
    let mut batch = Batch::new(&body, &[GRAVITY, DVec3::ZERO].map(of), BatchSettings::default(), 1).unwrap();
    let still = ToolMotion { from: Pose::IDENTITY, to: Pose::IDENTITY };
    let mut reports = vec![InstanceReport::default(); 2];
    for _ in 0..30 {
        reports = batch.step(&[still; 2]).unwrap();
    }
    assert_eq!(reports[1].rounds, 0);
    let (n, h) = (60.0, FRAME / 2.0);
    let fallen = GRAVITY * (h * h * n * (n + 1.0) / 2.0);
    for (rest, (falls, rests)) in
        body.lattice().nodes().iter().zip(batch.positions(0).unwrap().iter().zip(batch.positions(1).unwrap()))
    {
        assert!(falls.distance(*rest + fallen) < 1e-5, "{}", falls.distance(*rest + fallen));
        assert_eq!(*rest, rests);
    }
}

/// The force of the tool equals the weight that hangs on it.
#[test]
fn a_grasp_bears_the_weight() {
    let lattice = Lattice::of_mesh(&appendix(2.5e-3), &options(4e-3)).unwrap();
    let grip = lattice.embed(&[DVec3::new(0.042, 0.006, 0.002), DVec3::new(0.044, 0.008, 0.002)]).unwrap();
    let material = Material { law: Law::StableNeoHookean, young_modulus: 9e3, poisson_ratio: 0.4, density: 1100.0 };
    let description = BodyDescription { name: "hung".into(), lattice, material, pins: vec![], fixed: vec![] };
    let body = Body::new(description).unwrap();
    let of = |young_modulus| Instance { young_modulus, gravity: GRAVITY, pose: Pose::IDENTITY };
    let mut batch = Batch::new(&body, &[9e3, 30e3].map(of), BatchSettings::default(), 1).unwrap();
    (0..2).for_each(|i| batch.grasp(i, &grip, GRIP, &Pose::IDENTITY).unwrap());
    let still = ToolMotion { from: Pose::IDENTITY, to: Pose::IDENTITY };
    for _ in 0..600 {
        batch.step(&[still; 2]).unwrap();
    }
    let weight = body.masses().iter().sum::<f64>() * -GRAVITY;
    for i in 0..2 {
        let force = batch.grasp_force(i);
        println!("instance {i}: {force} N of {weight} N");
        assert!((force - weight).length() < 0.02 * weight.length());
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let (body, grip) = organ(12e3, Law::StableNeoHookean);
    let own = instance(0).0;
    let said = |e: Error| e.to_string();
    let none = BatchSettings { substeps: 0, ..BatchSettings::default() };
    assert!(said(Batch::new(&body, &[own], none, 1).err().unwrap()).contains("substeps"));
    let soft = Instance { young_modulus: 0.0, ..own };
    assert!(said(Batch::new(&body, &[soft], BatchSettings::default(), 1).err().unwrap()).contains("Young's modulus"));
    let (corotated, _) = organ(12e3, Law::Corotated);
    let refused = Batch::new(&corotated, &[own], BatchSettings::default(), 1).err().unwrap();
    assert!(said(refused).contains("StableNeoHookean"));
    let mut batch = Batch::new(&body, &[own], BatchSettings::default(), 1).unwrap();
    assert!(said(batch.step(&[]).unwrap_err()).contains("one for each"));
    assert!(said(batch.grasp(3, &grip, GRIP, &Pose::IDENTITY).unwrap_err()).contains("instance 3"));
    assert!(said(batch.grasp(0, &[], GRIP, &Pose::IDENTITY).unwrap_err()).contains("1 to 5"));
    assert!(said(batch.grasp(0, &grip, -1.0, &Pose::IDENTITY).unwrap_err()).contains("positive"));
    let stranger = EmbeddedPoint { nodes: [1_000_000; 8], ..grip[0] };
    assert!(said(batch.grasp(0, &[stranger], GRIP, &Pose::IDENTITY).unwrap_err()).contains("embedded"));
    assert!(batch.positions(1).is_none());
    assert!(Batch::new(&body, &[], BatchSettings::default(), 1).unwrap().step(&[]).unwrap().is_empty());
}
