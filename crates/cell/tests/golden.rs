//! Golden hashes of a cell: arms with dynamics grasp a tube and lift it, on both backends.
//!
//! They hold on x86-64 and on 64-bit ARM (`cargo xtask aarch64`). A change of a method changes
//! them; then record them again (the failing test prints them) and say why in the commit.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

mod common;

use common::{close, shift};
use glam::DVec3;
use trocar_cell::Cell;
use trocar_scene::BackendName;
use trocar_testing::tube::{ONE_END, meshed, scene};

/// The middle of the tube's free half in the cell (m).
const HELD: DVec3 = DVec3::new(0.006, 0.46, 0.045);

#[test]
fn a_grasp_lift_keeps_its_bits() {
    let specimen = meshed(ONE_END, 4e-3);
    let run = |backend: BackendName| {
        let mut scene = scene();
        scene.tissue = scene.tissue.on(backend);
        let mut cell = Cell::new(&scene, &specimen, 1).unwrap();
        let way = HELD - cell.measured_cp("left").unwrap().translation;
        let mut hashes = vec![cell.hash()];
        shift(&mut cell, "left", way, 60);
        hashes.push(cell.hash());
        close(&mut cell, 30);
        assert!(cell.held("left").unwrap().is_some(), "the jaws hold the tube");
        shift(&mut cell, "left", 0.005 * DVec3::Z, 20);
        hashes.push(cell.hash());
        hashes
    };
    let found = [BackendName::Tetrahedra, BackendName::Lattice].map(run).concat();
    let golden: [u64; 6] = [
        0x94a7442a6457c387,
        0xd7d1fcf3ea58b414,
        0x60ea6df7d0e4197f,
        0x382f46d42801cc52,
        0x7ca01c39a254c296,
        0x18e23fe0af035775,
    ];
    assert_eq!(found, golden, "{found:#018x?}");
}
