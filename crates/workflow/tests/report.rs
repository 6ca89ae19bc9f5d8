//! Reports of made-up organs: what must hold for any page. The pages are left in the target's tmp
//! folder to look at.
#![allow(clippy::unwrap_used, clippy::expect_used)] // the helpers are test code too

use base64::{Engine, engine::general_purpose::STANDARD};
use glam::DVec3;
use std::path::Path;
use trocar_camera::{Camera, ColorImage, DepthImage, Distortion, Mask};
use trocar_core::Pose;
use trocar_geometry::{RepairReport, TetMesh, TetQuality, TriMesh};
use trocar_reconstruct::truth::Truth;
use trocar_reconstruct::{Composite, CompositeTimes, OrganView, Reconstruction};
use trocar_render::phong::{Instance, PhongScene, Shading};
use trocar_specimen::{Material, Organ, OrganFacts, Pins, Provenance, Specimen};
use trocar_workflow::pages as report;

/// A name that would break a page that does not escape it.
const HOSTILE: &str = "<script>alert('x')</script>&\"";

/// An ellipsoid as cubes of six tetrahedra each.
fn body(centre: DVec3, radii: DVec3, cells: i32) -> TetMesh {
    const CORNERS: [[[i32; 3]; 4]; 6] = [
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1]],
        [[0, 0, 0], [1, 1, 0], [0, 1, 0], [1, 1, 1]],
        [[0, 0, 0], [0, 1, 0], [0, 1, 1], [1, 1, 1]],
        [[0, 0, 0], [0, 1, 1], [0, 0, 1], [1, 1, 1]],
        [[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1]],
        [[0, 0, 0], [1, 0, 1], [1, 0, 0], [1, 1, 1]],
    ];
    let mut mesh = TetMesh::default();
    let mut index = std::collections::BTreeMap::new();
    let at = |c: [i32; 3]| centre + radii * (2.0 * DVec3::from_array(c.map(f64::from)) / f64::from(cells) - 1.0);
    for x in 0..cells {
        for y in 0..cells {
            for z in 0..cells {
                let middle =
                    (DVec3::new(f64::from(x), f64::from(y), f64::from(z)) + 0.5) * 2.0 / f64::from(cells) - 1.0;
                if middle.length() > 1.0 {
                    continue;
                }
                for tet in CORNERS {
                    mesh.tets.push(tet.map(|[i, j, k]| {
                        let corner = [x + i, y + j, z + k];
                        *index.entry(corner).or_insert_with(|| {
                            mesh.vertices.push(at(corner));
                            mesh.vertices.len() as u32 - 1
                        })
                    }));
                }
            }
        }
    }
    mesh
}

/// The ellipsoid itself, coloured.
fn surface(centre: DVec3, radii: DVec3, color: [u8; 3]) -> TriMesh {
    let (rings, spokes) = (40_u32, 64_u32);
    let mut mesh = TriMesh::default();
    for i in 0..=rings {
        for j in 0..spokes {
            let (a, b) = (
                std::f64::consts::PI * f64::from(i) / f64::from(rings),
                std::f64::consts::TAU * f64::from(j) / f64::from(spokes),
            );
            let n = DVec3::new(a.sin() * b.cos(), a.sin() * b.sin(), a.cos());
            mesh.vertices.push(centre + radii * n);
            let vein = 0.85 + 0.15 * (9.0 * a + 2.0 * (5.0 * b).sin()).sin();
            mesh.colors.push(color.map(|c| (f64::from(c) * vein) as u8));
        }
    }
    for i in 0..rings {
        for j in 0..spokes {
            let k = (j + 1) % spokes;
            let [a, b, c, d] = [i * spokes + j, (i + 1) * spokes + j, (i + 1) * spokes + k, i * spokes + k];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

fn organ(name: &str, centre: DVec3, radii: DVec3, color: [u8; 3], cells: i32) -> Organ {
    let body = body(centre, radii, cells);
    let quality = TetQuality::of(&body);
    let facts = OrganFacts {
        nodes: body.vertices.len(),
        tets: body.tets.len(),
        watertight: true,
        inverted: quality.inverted,
        min_dihedral_deg: quality.min_dihedral_deg,
        median_dihedral_deg: quality.median_min_dihedral_deg,
        median_edge_mm: quality.median_edge * 1e3,
        volume_cm3: quality.volume * 1e6,
        depth_error_median_mm: Some(0.42),
        depth_error_signed_mm: Some(-0.11),
        covered: Some(0.97),
    };
    Organ {
        name: name.to_owned(),
        body,
        surface: surface(centre, radii, color),
        material: Material::default(),
        pins: Pins::None,
        base: centre,
        threads: None,
        posterior: None,
        facts,
    }
}

fn specimen() -> Specimen {
    let mm = |x: f64, y: f64, z: f64| DVec3::new(x, y, z) * 1e-3;
    Specimen {
        name: format!("made-up {HOSTILE}"),
        up: DVec3::new(0.0, -0.25, -1.0).normalize(),
        placement: Pose::IDENTITY,
        camera: Some(Camera {
            width: 424,
            height: 240,
            fx: 223.0,
            fy: 223.0,
            cx: 211.5,
            cy: 119.5,
            distortion: Distortion::default(),
        }),
        organs: vec![
            organ("cecum", mm(-35.0, 0.0, 190.0), mm(30.0, 26.0, 16.0), [214, 140, 128], 14),
            organ("stomach", mm(45.0, -10.0, 195.0), mm(34.0, 22.0, 18.0), [198, 110, 104], 14),
            organ("appendix", mm(5.0, 26.0, 178.0), mm(36.0, 7.0, 7.0), [226, 160, 140], 12),
            organ(HOSTILE, mm(0.0, -32.0, 196.0), mm(22.0, 14.0, 10.0), [230, 190, 120], 8),
        ],
        background: None,
        provenance: Provenance {
            source: format!("recording {HOSTILE}"),
            input_hash: "0123abcd".into(),
            program: "trocar 0.1.0".into(),
            settings: vec!["window = 90".into(), HOSTILE.into()],
        },
    }
}

fn reconstruction() -> Reconstruction {
    let specimen = specimen();
    let camera = specimen.camera.unwrap();
    let instances = specimen.organs.iter().enumerate().map(|(i, o)| Instance {
        mesh: o.surface.clone(),
        label: i as u16 + 1,
        shading: Shading { color: [200; 3], gloss: 0.3, wireframe: false },
    });
    let frame = PhongScene::new(instances.collect(), None, [120, 60, 50]).render(&camera, &Pose::IDENTITY, 2);
    let mut depth = frame.depth.clone();
    for (i, d) in depth.depth.iter_mut().enumerate() {
        *d = if *d > 0.0 { *d + 0.002 * (i as f32 * 0.013).sin() } else { 0.21 };
    }
    let mask = |label: u16| Mask { width: 424, height: 240, set: frame.labels.iter().map(|l| *l == label).collect() };
    let view = |i: usize, name: &str| OrganView {
        name: name.to_owned(),
        mask: mask(i as u16 + 1),
        depth_error: (frame.depth.depth.iter().zip(&depth.depth))
            .map(|(a, b)| if *a > 0.0 { a - b } else { 0.0 })
            .collect(),
        compared: mask(i as u16 + 1),
        moving_share: 0.0,
    };
    let organs = specimen.organs.iter().enumerate().map(|(i, o)| view(i, &o.name)).collect();
    let mut input = frame.color.clone();
    let mut instruments = Mask::new(424, 240);
    for y in 90..150 {
        for x in 0..(230 - y / 2) {
            instruments.set[y * 424 + x] = true;
            input.pixels[y * 424 + x] = [150, 155, 160];
        }
    }
    Reconstruction {
        specimen,
        composite: Composite {
            input,
            instruments,
            color: frame.color,
            colored: mask(0),
            depth,
            frames_used: 91,
            recovered_share: 0.034,
            coverage: 0.903,
            depth_range_median: 0.0019,
            moving: mask(0),
            hash: 0,
            times: CompositeTimes::default(),
        },
        warnings: Vec::new(),
        organs,
        notes: vec![format!("frame 12 of {HOSTILE} dropped")],
    }
}

fn keep(name: &str, html: &str) {
    std::fs::write(Path::new(env!("CARGO_TARGET_TMPDIR")).join(name), html).unwrap();
}

/// What holds for every page; returns its number of pictures.
fn check(html: &str) -> usize {
    assert!(html.starts_with("<!DOCTYPE html>") && html.trim_end().ends_with("</html>"));
    for forbidden in ["<script", "http://", "https://", "<link", "@import", "url(", "<iframe", "javascript:"] {
        assert!(!html.contains(forbidden), "the page has {forbidden}");
    }
    assert!(html.len() < 8_000_000, "{} bytes", html.len());
    let mut pictures = 0;
    for source in html.split("src=\"").skip(1) {
        let data = source.split('"').next().unwrap().strip_prefix("data:image/").expect("only data URIs");
        let (kind, base64) = data.split_once(";base64,").unwrap();
        let bytes = STANDARD.decode(base64).unwrap();
        let signature: &[u8] = match kind {
            "png" => b"\x89PNG\r\n\x1a\n",
            "jpeg" => b"\xff\xd8\xff",
            "gif" => b"GIF89a",
            other => panic!("a picture of type {other}"),
        };
        assert!(bytes.starts_with(signature), "{kind}");
        pictures += 1;
    }
    for tag in ["section", "figure", "figcaption", "table", "svg", "span", "div", "main", "dl", "ul", "p"] {
        let open = html.matches(&format!("<{tag}>")).count() + html.matches(&format!("<{tag} ")).count();
        assert_eq!(open, html.matches(&format!("</{tag}>")).count(), "<{tag}>");
    }
    pictures
}

/// The page of `r`, compared with the truth in a folder.
fn page(r: &Reconstruction, truth: Option<&Path>) -> trocar_workflow::Result<String> {
    let truth = truth.map_or(Ok(None), |dir| Truth::read(r, dir))?;
    report::reconstruction(r, &report::reconstruction_sections(r)?, truth.as_ref())
}

#[test]
fn a_reconstruction_is_shown_whole() {
    let r = reconstruction();
    let dir = tempfile::tempdir().unwrap();
    let truth = dir.path().join("truth");
    std::fs::create_dir(&truth).unwrap();
    r.composite.color.write_png(&truth.join("color.png")).unwrap();
    r.composite.depth.write_png(&truth.join("depth.png"), 1e-4).unwrap();

    let html = page(&r, Some(dir.path())).unwrap();
    keep("reconstruction.html", &html);
    // 4 of the camera, 2 side by side, 2 of the truth, 4 of the bodies, 1 + 4 of the depth error.
    assert_eq!(check(&html), 17);
    for text in ["Composite against the truth", "(mm)", "90.3", "&lt;script&gt;"] {
        assert!(html.contains(text), "{text}");
    }
    let mut named = r.clone();
    named.specimen.name = "phantom-a".into();
    let beside_paper = page(&named, None).unwrap();
    assert!(
        beside_paper.contains("8\u{202f}072") && !html.contains("8\u{202f}072"),
        "Table I stands beside its phantom"
    );
    let without = page(&r, None).unwrap();
    assert!(!without.contains("Composite against the truth"));
}

#[test]
fn a_truth_of_another_size_is_named() {
    let r = reconstruction();
    let dir = tempfile::tempdir().unwrap();
    DepthImage::new(20, 10).write_png(&dir.path().join("depth.png"), 1e-4).unwrap();
    let message = page(&r, Some(dir.path())).unwrap_err().to_string();
    assert!(message.contains("depth.png") && message.contains("20 x 10"), "{message}");
}

#[test]
fn images_that_do_not_fit_are_an_error() {
    let mut r = reconstruction();
    r.organs[1].depth_error.pop();
    assert!(page(&r, None).unwrap_err().to_string().contains("stomach"));
    r.composite.color = ColorImage::new(3, 3, [0; 3]);
    assert!(report::reconstruction_sections(&r).is_err());
}

#[test]
fn a_surface_and_its_repair_are_shown() {
    let mut s = specimen();
    s.camera = None;
    s.up = DVec3::Z;
    s.organs.truncate(1);
    let repair = RepairReport { components: 2, open_edges: 1234, rebuilt: true, ..RepairReport::default() };
    let html = report::surface(&s, &repair).unwrap();
    keep("surface.html", &html);
    assert_eq!(check(&html), 4);
    assert!(html.contains("1\u{202f}234 edges") && html.contains("rebuilt"));
    assert!(!html.contains("14\u{202f}914"), "the paper's figures belong to recordings only");
}

/// Beside a warning nothing is shown as good, and the warning stands out above the figures.
#[test]
fn a_warning_stands_above_the_figures_and_nothing_is_green_beside_it() {
    let good = "card good";
    let section = |html: &str| {
        html[html.find("From the recording").unwrap()..html.find("What the camera saw").unwrap()].to_owned()
    };
    let mut r = reconstruction();
    assert!(section(&page(&r, None).unwrap()).contains(good));
    r.warnings = vec!["Tissue moves during the window: appendix <1>.".to_owned()];
    let doubtful = section(&page(&r, None).unwrap());
    let warning =
        doubtful.find("<p class=\"warning\"><b>Warning.</b> Tissue moves during the window: appendix &lt;1&gt;.</p>");
    assert!(warning.unwrap() < doubtful.find("Watertight").unwrap());
    assert!(!doubtful.contains(good), "{doubtful}");
}
