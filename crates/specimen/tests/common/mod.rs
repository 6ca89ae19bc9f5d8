//! A small specimen.

use glam::{DQuat, DVec3};
use trocar_camera::{Camera, ColorImage};
use trocar_core::Pose;
use trocar_geometry::{TetMesh, TriMesh};
use trocar_specimen::{
    End, Material, MaterialModel, Organ, OrganFacts, Parameter, Pins, Posterior, Prior, Provenance, Specimen, Threads,
};

fn posterior() -> Posterior {
    let prior = |name, range| Prior { name, range, interval: [0.0; 3], width: 0.0 };
    let mut made = Posterior {
        recording: "film".into(),
        lifts: vec![0, 2],
        landmark_rmse_mm: 1.25,
        mean: vec![0.5, -1.0],
        covariance: vec![vec![0.04, 0.03], vec![0.03, 0.8]],
        parameters: vec![prior(Parameter::BaseLength, [0.02, 0.4]), prior(Parameter::YoungModulus, [3e3, 1e5])],
    };
    made.summarise();
    made
}

pub fn specimen() -> Specimen {
    let vertices = vec![DVec3::ZERO, DVec3::X * 0.01, DVec3::Y * 0.01, DVec3::Z * 0.01];
    let organ = |name: &str, pins| Organ {
        name: name.into(),
        body: TetMesh { vertices: vertices.clone(), tets: vec![[0, 1, 2, 3]] },
        surface: TriMesh {
            vertices: vertices.clone(),
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
            colors: vec![[1, 2, 3], [4, 5, 6], [7, 8, 9], [200, 100, 50]],
        },
        material: Material { model: MaterialModel::StVenantKirchhoff, ..Material::default() },
        pins,
        base: DVec3::new(0.1, 1.0 / 3.0, -2e-7),
        threads: (name == "appendix").then_some(Threads { from: 0.5, to: 1.0, slack_m: 8e-3, stiffness_n_m2: 600.0 }),
        posterior: (name == "appendix").then(posterior),
        facts: OrganFacts { nodes: 4, tets: 1, depth_error_median_mm: Some(0.7), ..OrganFacts::default() },
    };
    Specimen {
        name: "rabbit A".into(),
        up: DVec3::NEG_Z,
        placement: Pose { rotation: DQuat::from_rotation_x(0.3), translation: DVec3::new(0.1, 0.2, 0.3) },
        camera: Some(Camera::d405()),
        organs: vec![
            organ("appendix", Pins::End { end: End::Tip, length: 0.2, band_length: 0.3, band_share: 0.42 }),
            organ("bowel-1", Pins::None),
        ],
        background: Some(ColorImage::new(5, 4, [9, 8, 7])),
        provenance: Provenance {
            source: "phantom".into(),
            input_hash: "0123".into(),
            program: "0.1.0".into(),
            settings: vec!["window = 90".into()],
        },
    }
}
