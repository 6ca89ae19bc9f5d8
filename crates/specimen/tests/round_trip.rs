//! A specimen is read as written, and a damaged one is one clear error.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use common::specimen;
use std::fs;
use std::path::Path;
use trocar_specimen::Specimen;

fn failure(dir: &Path) -> String {
    Specimen::read(dir).expect_err("a spoiled specimen was accepted").to_string()
}

#[test]
fn is_read_as_written() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("specimen");
    drop(Specimen::stage(&dir).unwrap());
    assert!(!dir.exists());
    let written = specimen();
    written.write(&dir).unwrap();
    written.write(&dir).unwrap();
    let read = Specimen::read(&dir).unwrap();
    assert_eq!((read.name, read.up, read.camera), (written.name, written.up, written.camera));
    assert_eq!((read.placement, read.background), (written.placement, written.background));
    assert_eq!(read.provenance, written.provenance);
    for (r, w) in read.organs.iter().zip(&written.organs) {
        assert_eq!((&r.name, &r.body, r.material, r.pins), (&w.name, &w.body, w.material, w.pins));
        assert_eq!((r.threads, &r.posterior), (w.threads, &w.posterior));
        assert_eq!((r.base, r.facts, &r.surface.colors), (w.base, w.facts, &w.surface.colors));
        assert_eq!(r.surface.triangles, w.surface.triangles);
        for (a, b) in r.surface.vertices.iter().zip(&w.surface.vertices) {
            assert!((*a - *b).length() < 1e-8);
        }
    }
    assert_eq!(read.organs.len(), 2);
}

#[test]
fn mistakes_are_named() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("specimen");
    assert!(failure(&dir).contains("specimen.toml: the file does not exist"));
    specimen().write(&dir).unwrap();
    let toml = dir.join("specimen.toml");
    let text = fs::read_to_string(&toml).unwrap();
    for (from, to, expected) in [
        ("poisson_ratio", "poissons_ratio", "did you mean `poisson_ratio`?"),
        ("poisson_ratio = 0.45", "poisson_ratio = 0.5", "organ 'appendix': material.poisson_ratio is 0.5"),
        ("band_share = 0.42", "band_share = 1.42", "pins.band_share is 1.42"),
        ("slack_m = 0.008", "slack_m = -1.0", "organ 'appendix': threads.slack_m is -1"),
        ("[0.03, 0.8]", "[0.04, 0.8]", "organ 'appendix': posterior.covariance[1][0] is 0.04"),
        ("[0.03, 0.8]", "[0.03, 0.001]", "posterior.covariance has a negative direction"),
        ("mean = [0.5, -1.0]", "mean = [0.5, nan]", "organ 'appendix': posterior.mean is [0.5, NaN]"),
        ("name = \"young_modulus_pa\"", "name = \"young_modulus\"", "unknown variant `young_modulus`"),
        ("name = \"bowel-1\"", "name = \"appendix\"", "used twice"),
        ("name = \"bowel-1\"", "name = \"bowel-2\"", "bowel-2.msh"),
        ("st-venant-kirchhoff", "neo-hookean", "unknown variant `neo-hookean`"),
    ] {
        assert!(text.contains(from), "{from} is not in {text}");
        fs::write(&toml, text.replacen(from, to, 1)).unwrap();
        let error = failure(&dir);
        assert!(error.contains(expected), "{to}: {error}");
    }
    fs::write(&toml, &text).unwrap();
    fs::write(dir.join("appendix.msh"), "$MeshFormat").unwrap();
    assert!(failure(&dir).contains("appendix.msh"));

    let mut no_organs = specimen();
    no_organs.organs.clear();
    assert!(no_organs.write(&root.path().join("other")).unwrap_err().to_string().contains("no [[organ]]"));
    assert!(!root.path().join("other").exists());
}
