#![allow(clippy::unwrap_used, missing_docs, clippy::print_stdout)]
use std::path::Path;
use std::time::Instant;
use trocar_task::{Episode, policy};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let (from, to): (u64, u64) = (a[2].parse().unwrap(), a[3].parse().unwrap());
    let verbose = a.get(4).is_some_and(|v| v == "v");
    let scene = trocar_scene::Scene::builtin("cell-a").unwrap();
    let mut scene = scene;
    if let Ok(f) = std::env::var("FORCE") { scene.instruments[1].jaw_force_n = f.parse().unwrap(); }
    if std::env::var("SEVER").is_ok() { scene.task.sever = true; }
    if let Ok(n) = std::env::var("TASK") { scene.task.name = match n.as_str() { "reach" => trocar_scene::TaskName::PortReach, _ => trocar_scene::TaskName::GraspLift }; }

    let specimen = trocar_specimen::Specimen::read(Path::new("/tmp/task/specimen")).unwrap();
    let t = Instant::now();
    let mut e = Episode::new(&scene, &specimen, 1).unwrap();
    println!("new {:.2} s", t.elapsed().as_secs_f64());
    if verbose {
        let w = e.cell().world();
        let b = e.bodies()[0];
        let axis = &w.axes[b];
        println!("length {:.4} base {:?} tip {:?}", axis.length, axis.point_at(0.0), axis.point_at(1.0));
        let body = &w.model.bodies()[b];
        for c in trocar_cell::clusters(w, b) { println!("cluster s {:.3} nodes {} clear {} at {:?}", c.s, c.nodes.len(), c.clear, c.centroid(w, b)); }
        let _ = body;
    }
    let mut p = policy::named(&a[1]).unwrap();
    for seed in from..to {
        let t = Instant::now();
        e.reset(seed).unwrap();
        let reset = t.elapsed().as_secs_f64();
        p.begin(&e, seed).unwrap();
        let t = Instant::now();
        let mut n = 0;
        'run: loop {
            for action in p.act(&e).unwrap() {
                let s = e.step(&action).unwrap();
                n += 1;
                let k = &s.channels.task;
                if verbose && (n % 6 == 0 || k.cut_mouth > 0.0 || !s.events.is_empty()) {
                    println!("{:.2} {} gd {:.1} gr {} s {:.2} lift {:.2} slip {:.2} pos {:.1} jaw {:.3} mouth {} {:.2} cf {:.2} jf {:.2} L {:.2} rcm {:.2} {:.2} inv {} vol {:.3} y {} {:?}",
                      s.channels.time_s, s.progress.name(), k.grasp_distance_mm, k.grasped, k.grasp_s, k.lift_mm, k.slip_mm, k.position_mm, k.cut_jaw, k.cut_mouth, k.cut_share,
                      s.channels.right.contact_n(), s.channels.right.jaw_force_n, s.channels.left.constraint_n(), s.channels.left.rcm_peak_mm, s.channels.right.rcm_peak_mm, k.inverted, k.min_volume, k.yielded, s.events);
                }
                if s.end.is_some() { break 'run; }
            }
        }
        let u = e.summary();
        println!("seed {seed} {:?} stage {} {} score {:.2} at {:.2} lift {:.1} slip {:.2} held {} rcm L {:.2}/{:.2}/{:.2} R {:.2}/{:.2}/{:.2} peaks contact {:.1} {:.1} constr {:.2} jaw {:.1} inv {} vol {:.3} y {} unh {} {} cuts {} lag {:.0} {:.0} track {:.3} {:.3} dur {:.1} wall {:.1} reset {:.4}",
          u.end.as_ref().map(|x| x.name()), u.stage, u.next, u.score, u.grasp_at.unwrap_or(-1.0), u.lift_mm, u.slip_mm, u.held_to_end,
          u.arms[0].rcm_median_mm, u.arms[0].rcm_p95_mm, u.arms[0].rcm_peak_mm, u.arms[1].rcm_median_mm, u.arms[1].rcm_p95_mm, u.arms[1].rcm_peak_mm,
          u.arms[0].peak_contact_n, u.arms[1].peak_contact_n, u.arms[0].peak_constraint_n, u.arms[1].peak_jaw_n, u.inverted_peak, u.min_volume_ratio, u.yielded_substeps, u.arms[0].unhooked, u.arms[1].unhooked, u.cuts,
          u.arms[0].lag_ms, u.arms[1].lag_ms, u.arms[0].tracking_rms_mm, u.arms[1].tracking_rms_mm, u.duration_s, t.elapsed().as_secs_f64(), reset);
    }
}
