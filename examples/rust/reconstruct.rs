//! A phantom is filmed by a simulated depth camera, and the recording becomes tetrahedral organs.

#![allow(clippy::print_stdout, reason = "an example prints its result")]

use trocar::phantom::RecordOptions;
use trocar::reconstruct::{Settings, reconstruct};
use trocar::recording::Recording;
use trocar::{phantom, prelude::*};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::path::Path::new("target/recordings/phantom-b");
    let options = RecordOptions { frames: 31, ..RecordOptions::default() };
    if !folder.exists() {
        phantom::record("phantom-b", &options, folder, &Silent)?;
    }
    let recording = Recording::open(folder)?;
    let made = reconstruct(&recording, &Settings::default(), &Silent)?;
    for organ in &made.specimen.organs {
        println!(
            "{}: {} nodes, {} elements, {:.1} cm3, watertight: {}",
            organ.name,
            organ.body.vertices.len(),
            organ.body.tets.len(),
            1e6 * organ.body.volume(),
            organ.surface.is_watertight()
        );
    }
    Ok(())
}
