//! Instances on a graphics card: those of the lanes. Skipped without a card that has a Vulkan
//! driver; Mesa's lavapipe, which runs on the processor, is enough.

use super::{GRIP, Law, instance, motion, organ};
use glam::DVec3;
use trocar_testing::blocks::noise;
use trocar_tissue::{Batch, BatchSettings, Error, GpuBatch, Instance, ToolMotion};

/// Later some of these instances take more rounds than a search has, in lanes too.
const FRAMES: usize = 3;

/// Positions of some instances after some frames, in lanes or on a card. None without a card. One
/// instance's tool may break.
fn run(which: &[usize], lanes: bool, frames: usize, broken: Option<usize>) -> Option<Vec<Vec<DVec3>>> {
    let (body, grip) = organ(9e3, Law::StableNeoHookean);
    let made: Vec<_> = which.iter().map(|k| instance(*k)).collect();
    let own: Vec<Instance> = made.iter().map(|(own, _)| *own).collect();
    let mut batch = Batch::new(&body, &own, BatchSettings::default(), 1).unwrap();
    for (i, k) in which.iter().enumerate().filter(|(_, k)| *k % 5 != 4) {
        // Grasps of three points and more.
        let points = 3 + k % (grip.len() - 2);
        batch.grasp(i, &grip[..points], GRIP * (0.5 + noise(*k as u64)), &made[i].1(0.0)).unwrap();
    }
    let tools = |frame: usize| -> Vec<ToolMotion> {
        let mut tools: Vec<ToolMotion> = made.iter().map(|(_, tool)| motion(tool, frame)).collect();
        if let Some(broken) = broken.filter(|_| frame > 0) {
            tools[broken].to.translation.x = f64::NAN;
        }
        tools
    };
    let positions = |batch: &Batch| (0..which.len()).map(|k| batch.positions(k).unwrap()).collect();
    if lanes {
        (0..frames).for_each(|frame| drop(batch.step(&tools(frame)).unwrap()));
        return Some(positions(&batch));
    }
    let mut gpu = match GpuBatch::new(batch) {
        Ok(gpu) => gpu,
        Err(Error::Gpu(reason)) if reason.starts_with("no graphics card") => {
            println!("skipped: {reason}");
            return None;
        }
        Err(other) => panic!("{other}"),
    };
    for frame in 0..frames {
        let reports = gpu.step(&tools(frame)).unwrap();
        for (k, report) in reports.iter().enumerate() {
            let breaks = broken == Some(k) && frame > 0;
            assert_eq!(report.damaged, breaks, "instance {k}, frame {frame}");
            assert!(breaks || report.unconverged == 0, "instance {k}, frame {frame}: {report:?}");
        }
    }
    println!("{}, {} kB", gpu.card(), gpu.bytes() / 1000);
    Some(positions(gpu.batch().unwrap()))
}

#[test]
fn a_card_steps_what_lanes_step() {
    let which: Vec<usize> = (0..20).collect();
    let Some(card) = run(&which, false, FRAMES, None) else { return };
    let lanes = run(&which, true, FRAMES, None).unwrap();
    let rest = run(&which, true, 0, None).unwrap();
    let mut worst = 0.0f64;
    for k in 0..which.len() {
        let norm = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum::<f64>().sqrt();
        let (off, moved) = (norm(&card[k], &lanes[k]), norm(&lanes[k], &rest[k]));
        assert!(moved > 1e-3, "instance {k} did not move");
        worst = worst.max(off / moved);
    }
    println!("distance over displacement at most {worst:.2e}");
    // The searches end at a step of a hundredth of the way.
    assert!(worst < 5e-3, "{worst}");
}

#[test]
fn a_column_has_the_same_bits_in_any_company() {
    let bits = |p: &[DVec3]| p.iter().flat_map(|p| p.to_array().map(f64::to_bits)).collect::<Vec<_>>();
    let Some(all) = run(&(0..68).collect::<Vec<_>>(), false, FRAMES, None) else { return };
    let some = [66, 3, 17];
    let few = run(&some, false, FRAMES, None).unwrap();
    for (k, few) in some.iter().zip(&few) {
        assert_eq!(bits(&all[*k]), bits(few), "instance {k}");
    }
    let again = run(&some, false, FRAMES, Some(1)).unwrap();
    assert_eq!(bits(&again[0]), bits(&few[0]));
    assert_eq!(bits(&again[2]), bits(&few[2]));
    assert!(again[1].iter().all(|p| p.is_finite()));
}
