//! Painted pictures with misleading features: noise, wet highlights, fat, pale tissue, dark
//! shadows, reflections.

#![allow(clippy::unwrap_used, reason = "helper functions of tests")]

use super::*;
use trocar_camera::DepthImage;

const WIDTH: usize = 424;
const HEIGHT: usize = 240;

/// A bar: both ends, half width (px), depth (m).
type Bar = ([f64; 2], [f64; 2], f64);

/// Uniform in [-1, 1), the same on every machine (splitmix64).
fn noise(key: u64) -> f64 {
    let mut z = key.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (z ^ (z >> 31)) as f64 / u64::MAX as f64 * 2.0 - 1.0
}

/// Distance to a bar's axis over its half width, signed across.
fn across(bar: &Bar, x: f64, y: f64) -> Option<f64> {
    let ([x0, y0], [x1, y1], half) = *bar;
    let (dx, dy) = (x1 - x0, y1 - y0);
    let length = dx.hypot(dy);
    let along = ((x - x0) * dx + (y - y0) * dy) / length;
    let side = ((x - x0) * dy - (y - y0) * dx) / length / half;
    ((0.0..=length).contains(&along) && side.abs() <= 1.0).then_some(side)
}

/// The picture, its depth and the truth.
fn paint(bars: &[Bar], dark_room: f64) -> (ColorImage, DepthImage, Mask) {
    let mut color = ColorImage::new(WIDTH, HEIGHT, [0; 3]);
    let mut depth = DepthImage::new(WIDTH, HEIGHT);
    let mut truth = Mask::new(WIDTH, HEIGHT);
    let spots = [[90.0, 60.0, 4.0], [104.0, 66.0, 2.5], [300.0, 180.0, 6.0], [210.0, 30.0, 3.0], [60.0, 190.0, 5.0]];
    for i in 0..WIDTH * HEIGHT {
        let (x, y) = ((i % WIDTH) as f64, (i / WIDTH) as f64);
        let wave = (0.02 * x).sin() * (0.03 * y + 1.0).cos();
        let mut rgb = [165.0 + 40.0 * wave, 70.0 + 25.0 * wave, 66.0 + 20.0 * wave];
        if (x - 350.0).hypot(y - 60.0) < 40.0 {
            rgb = [222.0, 190.0, 120.0]; // fat
        }
        if ((x - 120.0) / 50.0).hypot((y - 160.0) / 20.0) < 1.0 {
            rgb = [214.0, 160.0, 158.0]; // pale bowel
        }
        if (x - 260.0 - 8.0 * (0.1 * y).sin()).abs() < 4.0 {
            rgb = [52.0, 24.0, 22.0]; // a crevice
        }
        for [cx, cy, r] in spots {
            let d = (x - cx).hypot(y - cy) / r;
            let white = (1.6 - d).clamp(0.0, 1.0);
            rgb = rgb.map(|c| c + (255.0 - c) * white);
        }
        depth.depth[i] = (0.15 - 0.01 * wave) as f32;
        let ridge = ((x - 230.0) / 8.0).hypot((y - 215.0) / 22.0);
        if ridge < 1.0 {
            // A gall bladder: green, near, with a long wet highlight that is almost grey.
            let shine = (1.3 - ((x - 228.0) / 4.0).hypot((y - 215.0) / 18.0)).clamp(0.0, 0.7);
            rgb = [110.0, 120.0, 72.0].map(|c| c + (220.0 - c) * shine);
            depth.depth[i] -= (0.01 * (1.0 - ridge * ridge).sqrt()) as f32;
        }
        for bar in bars {
            if let Some(s) = across(bar, x, y) {
                // Lit from one side: bright line, grey flank, dark edge; red glow of the tissue on
                // the other flank.
                let shine = (-((s + 0.35) / 0.15).powi(2)).exp();
                let flank = 150.0 * (1.0 - 0.75 * s.abs()) - 30.0 * s;
                let glow = 22.0 * (-((s - 0.5) / 0.2).powi(2)).exp();
                rgb = [flank + 90.0 * shine + glow, flank + 92.0 * shine, flank + 97.0 * shine + 3.0];
                depth.depth[i] = 0.138;
                truth.set[i] = true;
            }
        }
        for (c, channel) in rgb.iter().enumerate() {
            let n = 6.0 * noise((3 * i + c) as u64);
            color.pixels[i][c] = (channel * dark_room + n).clamp(0.0, 255.0) as u8;
        }
    }
    (color, depth, truth)
}

fn detect(color: &ColorImage, depth: Option<&DepthImage>) -> Mask {
    let picture = Picture { color, depth, name: "painting" };
    MetalDetector::default().segment(&picture, &Target::default()).unwrap()
}

/// Recall and precision; precision allows the margin that the detector adds on purpose.
fn figures(found: &Mask, truth: &Mask) -> (f64, f64) {
    let wide = grow(&truth.set, WIDTH, HEIGHT, 3.0);
    let hits = found.set.iter().zip(&truth.set).filter(|(f, t)| **f && **t).count() as f64;
    let near = found.set.iter().zip(&wide).filter(|(f, w)| **f && **w).count() as f64;
    (hits / truth.count().max(1) as f64, near / found.count().max(1) as f64)
}

const SHAFTS: [Bar; 2] = [([-20.0, 130.0], [190.0, 100.0], 7.0), ([440.0, 200.0], [230.0, 130.0], 5.0)];

#[test]
fn shafts_are_found_among_misleading_features() {
    for light in [1.0, 0.55] {
        let (color, depth, truth) = paint(&SHAFTS, light);
        for depth in [None, Some(&depth)] {
            let (recall, precision) = figures(&detect(&color, depth), &truth);
            let shown = format!("light {light}, depth {}: recall {recall}, precision {precision}", depth.is_some());
            assert!(recall > 0.985 && precision > 0.95, "{shown}");
        }
    }
}

#[test]
fn tissue_alone_has_no_metal() {
    for light in [1.0, 0.55, 0.25] {
        let (color, depth, _) = paint(&[], light);
        assert_eq!(detect(&color, None).count(), 0, "light {light}");
        assert_eq!(detect(&color, Some(&depth)).count(), 0, "light {light}, with depth");
    }
}

#[test]
fn depth_tells_a_loose_jaw_from_a_stain() {
    // Short and away from the rim: a jaw whose shaft is hidden. The same patch in the tissue is not
    // one.
    let jaw: [Bar; 1] = [([200.0, 80.0], [228.0, 84.0], 8.0)];
    let (mut color, mut depth, truth) = paint(&jaw, 1.0);
    for (p, t) in color.pixels.iter_mut().zip(&truth.set) {
        if *t {
            *p = [96, 98, 100];
        }
    }
    assert!(figures(&detect(&color, Some(&depth)), &truth).0 > 0.98);
    for (d, t) in depth.depth.iter_mut().zip(&truth.set) {
        if *t {
            *d = 0.15;
        }
    }
    assert_eq!(detect(&color, Some(&depth)).count(), 0);
}

#[test]
fn thick_regions_are_not_instruments() {
    let (mut color, _, _) = paint(&[], 1.0);
    for (i, p) in color.pixels.iter_mut().enumerate() {
        if i % WIDTH < 120 {
            *p = [120, 122, 124]; // a drape over a quarter of the picture
        }
    }
    let found = detect(&color, None).count();
    assert!(found < 700, "{found} pixels of a drape");
}

#[test]
fn odd_pictures_and_parameters_do_not_panic() {
    for (width, height) in [(1, 1), (1, 50), (50, 1), (2, 3)] {
        for grey in [0, 90, 255] {
            let color = ColorImage::new(width, height, [grey; 3]);
            let mut depth = DepthImage::new(width, height);
            depth.depth.fill(f32::NAN);
            let found = detect(&color, Some(&depth));
            assert_eq!(found.set.len(), width * height);
        }
    }
    let picture = |color| Picture { color, depth: None, name: "frame 3" };
    let empty = ColorImage::new(0, 4, [0; 3]);
    assert!(MetalDetector::default().segment(&picture(&empty), &Target::default()).is_err());
    let mut wild = MetalDetector::default();
    wild.parameters.margin = f64::NAN;
    let color = ColorImage::new(9, 9, [0; 3]);
    assert!(wild.segment(&picture(&color), &Target::default()).unwrap_err().to_string().contains("margin"));
}
