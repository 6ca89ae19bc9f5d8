//! Scissors on an arm of the cell: what they cut, what stops them, and where tissue parts.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]
#![allow(clippy::print_stdout, reason = "what was measured, for those who ask with --nocapture")]

mod common;

use common::{go, over};
use glam::DVec3;
use trocar_cell::{Cell, CellEvent, Severance};
use trocar_scene::Scene;
use trocar_specimen::Pins;
use trocar_testing::tube::{ONE_END, scene, two_tubes};

/// A cell of `scene` with tubes, in which the right cutter is open about the middle of the first.
fn about_the_tube(scene: &Scene, pins: Pins) -> Cell {
    let mut cell = Cell::new(scene, &two_tubes(pins, 2.2e-3), 1).unwrap();
    let at = DVec3::new(0.005, 0.46, 0.045);
    cell.servo_jaw("right", 1.0).unwrap();
    let above = over(&cell, "right", at, -0.03);
    let across = over(&cell, "right", at, 0.0);
    go(&mut cell, "right", &above, 60);
    go(&mut cell, "right", &across, 60);
    assert_eq!(cell.in_jaws("right").unwrap(), Some(0));
    cell
}

/// Steps the cell; the cuts, the opening of the right jaw, and the force on it (N).
fn snip(cell: &mut Cell, jaw: f64, periods: usize) -> (Vec<Severance>, f64, f64) {
    cell.servo_jaw("right", jaw).unwrap();
    let mut cuts = Vec::new();
    for _ in 0..periods {
        let report = cell.step(None).unwrap();
        assert!(report.tissue.divergence.is_none() && report.tissue.inverted == 0, "{:?}", report.tissue);
        cuts.extend(report.events.into_iter().filter_map(|e| match e {
            CellEvent::Cut { parted: Some(cut), .. } => Some(*cut),
            _ => None,
        }));
    }
    let arm = &cell.observe()[1];
    (cuts, arm.measured.jaw(), arm.jaw_force)
}

/// Pinned tissue stops blades that turn, but not those that shear it.
#[test]
fn scissors_close_through_pinned_tissue() {
    let mut cell = about_the_tube(&scene(), Pins::Band { share: 0.6 });
    let (_, jaw, _) = snip(&mut cell, 0.0, 20);
    assert!(jaw < 0.01, "{jaw} open");
}

#[test]
fn scissors_keep_what_they_cut_and_weak_ones_stand() {
    let mut scene = scene();
    scene.task.sever = true;
    let mut cell = about_the_tube(&scene, ONE_END);
    // Half of it, then the rest, for which the work of the first half is not done again.
    let (cuts, jaw, force) = snip(&mut cell, 0.45, 12);
    assert!(cuts.is_empty() && (jaw - 0.45).abs() < 1e-9 && force > 1.0, "{cuts:?}, {force} N");
    let (half, _, force) = snip(&mut cell, 1.0, 12);
    assert_eq!((half.len(), half[0].outcome.as_str(), force), (1, "cut in part", 0.0));
    let (rest, ..) = snip(&mut cell, 0.0, 12);
    assert_eq!((rest.len(), rest[0].outcome.as_str()), (1, "severed"));
    for cut in [&half[0], &rest[0]] {
        println!("{} mJ, {} mm2", cut.work_mj, cut.section_mm2);
    }
    let (work, area) = (half[0].work_mj + rest[0].work_mj, half[0].section_mm2 + rest[0].section_mm2);
    assert!(half[0].work_mj > 0.2 * work && (work / (0.3 * area) - 1.0).abs() < 0.1, "{work} mJ for {area} mm2");
    // Two newtons are not enough.
    scene.instruments.iter_mut().for_each(|i| i.jaw_force_n = 2.0);
    let (cuts, jaw, force) = snip(&mut about_the_tube(&scene, ONE_END), 0.0, 15);
    assert!(cuts.is_empty() && jaw > 0.3 && (force - 2.0).abs() < 1e-9, "{force} N, {jaw} open");
}

#[test]
fn the_cutter_cuts_what_it_closes_on_and_parts_it_where_the_scene_says_so() {
    for sever in [false, true] {
        let mut scene = scene();
        scene.task.sever = sever;
        let mut cell = about_the_tube(&scene, ONE_END);
        cell.servo_jaw("right", 0.0).unwrap();
        let mut events = Vec::new();
        for _ in 0..45 {
            let report = cell.step(None).unwrap();
            assert!(report.tissue.divergence.is_none() && report.tissue.inverted == 0, "{:?}", report.tissue);
            events.extend(report.events);
        }
        let pieces: Vec<usize> = events
            .iter()
            .filter_map(|e| if let CellEvent::Cut { pieces, .. } = e { Some(*pieces) } else { None })
            .collect();
        assert_eq!(pieces, [if sever { 2 } else { 1 }]);
        assert_eq!(cell.world().model.bodies().len(), if sever { 3 } else { 2 });
        let parted =
            events.iter().find_map(|e| if let CellEvent::Cut { parted, .. } = e { parted.clone() } else { None });
        assert_eq!(parted.is_some(), sever);
        if let Some(cut) = parted {
            assert_eq!((cut.outcome.as_str(), cut.pieces.len()), ("severed", 2), "{cut:?}");
            assert!(cut.opened_rad > 0.50 && cut.closed_rad < 0.16 && cut.between_blades_mm3 > 100.0, "{cut:?}");
            assert!(cut.volume_error < 1e-6 && cut.inverted_after == 0, "{cut:?}");
            // At 300 J/m2; less than a tenth of the jaws' force would not be felt.
            assert!((cut.work_mj / (0.3 * cut.section_mm2) - 1.0).abs() < 0.1, "{cut:?}");
            assert!((2.0..20.0).contains(&cut.force_peak_n), "{cut:?}");
            // Its section is a disc of 9 mm, of faces that zigzag.
            assert!((60.0..160.0).contains(&cut.area_mm2), "{cut:?}");
            assert_eq!(cut.pieces.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["tube", "tube.1"]);
        }
        // A state with a cut is restored, and one from before it.
        let saved = cell.save();
        cell.step(None).unwrap();
        let hash = cell.hash();
        cell.restore(&saved).unwrap();
        cell.step(None).unwrap();
        assert_eq!(cell.hash(), hash);
    }
}
