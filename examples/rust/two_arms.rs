//! The two-arm cell, driven by actions: both instruments move 10 mm deeper while the left one
//! closes.

#![allow(clippy::print_stdout, reason = "an example prints its result")]

use trocar::prelude::*;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = Scene::builtin("cell-a")?;
    let specimen = trocar::workflow::scene_specimen(&scene, "target/phantoms".as_ref(), &Silent)?;
    let mut cell = Cell::new(&scene, &specimen, 0)?;
    let start: Vec<_> = cell.observe().iter().map(|arm| arm.measured).collect();
    let periods = 60;
    for period in 1..=periods {
        let share = f64::from(period) / f64::from(periods);
        let mut targets = start.clone();
        // The five numbers of an arm in a port: two pivots, insertion, roll, jaw opening.
        targets.iter_mut().for_each(|target| target.0[2] += 0.010 * share);
        targets[0] = targets[0].with_jaw(targets[0].jaw() * (1.0 - share));
        cell.step(&Action::targets(&targets))?;
    }
    for arm in cell.observe() {
        println!(
            "{} arm: tip at {:.1} mm, RCM deviation {:.3} mm, force {:.3} N",
            arm.side.name(),
            1e3 * arm.tip.translation,
            1e3 * arm.rcm_deviation,
            arm.force.wrench.force.length()
        );
    }
    Ok(())
}
