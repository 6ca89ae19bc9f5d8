//! The benchmark of the renderer, and its rays against Embree's. The comparison is skipped, with a
//! message, without Embree.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helper functions of tests")]

use std::path::Path;
use trocar_core::Silent;
use trocar_studies::RenderBench;
use trocar_studies::study::run;

#[test]
fn rays_agree_with_embree() {
    let python = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/tools/bin/python");
    let (scene, phantoms) = ("none".to_owned(), std::path::PathBuf::new());
    let bench = RenderBench { triangles: 20_000, samples: 0, rays: 200, python, picture: None, scene, phantoms };
    let result = run(&bench, Path::new(""), &Silent).unwrap().0.figures;
    assert!((result.triangles as f64 / 20_000.0 - 1.0).abs() < 0.1, "{} triangles", result.triangles);
    assert!(result.preview_224_ms > 0.0 && result.refit_ms > 0.0 && result.path_720p_ms.is_none());
    assert_eq!(result.rays.len(), 2);
    if let Some(why) = result.embree_failure {
        println!("skipped: {why}; `cargo xtask tools` fetches embreex");
        return;
    }
    for row in result.rays {
        assert!(row.compared.unwrap() > row.rays / 2, "{row:?}");
        // One ray in ten thousand may graze an edge.
        assert!(row.differing.unwrap() <= 4, "{row:?}");
        assert!(row.largest_difference_m.unwrap() < 1e-5, "{row:?}");
    }
}
