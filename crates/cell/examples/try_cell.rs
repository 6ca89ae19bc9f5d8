use trocar_cell::*;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let mut scene = trocar_scene::Scene::read("cell-a").unwrap();
    let specimen = trocar_specimen::Specimen::read(std::path::Path::new(&args[1])).unwrap();
    if std::env::var("NOBODY").is_ok() {
        let n: Vec<String> = specimen.organs.iter().map(|o| o.name.clone()).collect();
        for i in 0..n.len() {
            for k in 0..i {
                scene.tissue.filtered_pairs.push([n[i].clone(), n[k].clone()]);
            }
        }
    }
    let t = std::time::Instant::now();
    let mut cell = Cell::with_contact(&scene, &specimen, 2, std::env::var("NONE").is_err()).unwrap();
    println!("built in {:.2} s", t.elapsed().as_secs_f64());
    for a in ["left", "right"] {
        println!("{a} {:?} {:?}", cell.limits(a).unwrap(), cell.setpoint(a).unwrap());
    }
    let design = args[2].parse().unwrap();
    let regrasp = args.get(3).map(|r| r.parse::<f64>().unwrap() * 1e-3);
    let run = CellLift { design: Some(design), regrasp, ..CellLift::default() }
        .run(&mut cell, &trocar_progress::Silent)
        .unwrap();
    for s in run.samples.iter().step_by(6) {
        println!(
            "{:6.2} {:9} rcm {:.3}/{:.3} behind {:.2} jaw {:.3} f {:.3} contact {:.3} constr {:.3} lift {:.2} {:.2} slip {:.3} v {:.3} inv {}",
            s.time_s,
            s.phase,
            s.rcm_mm,
            s.rcm_peak_mm,
            s.behind_mm,
            s.jaw,
            s.jaw_force_n,
            s.contact_n,
            s.constraint_n,
            s.jaw_lift_mm,
            s.tissue_lift_mm,
            s.slip_mm,
            s.max_speed_m_s,
            s.inverted
        );
    }
    println!("{:#?}\n{:?}", run.summary, run.events);
    println!("{:?}", cell.timing());
}
