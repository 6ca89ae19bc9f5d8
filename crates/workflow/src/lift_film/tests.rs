//! The drawings lie on the tissue that the panels show.

use super::moment::{Moment, shares};
use super::panel::{Panel, Seen};
use super::simulated::{Simulated, SimulatedView};
use super::{FILMED, SIMULATED, ShownLift};
use crate::measure::measure_recording;
use crate::reconstruct_recording;
use glam::DVec3;
use trocar_camera::{Camera, ColorImage, Mask, draw_triangle};
use trocar_core::Silent;
use trocar_geometry::TriMesh;
use trocar_identify::{Grip, LoneOrgan, SeenLift};
use trocar_measure::{Film, RecordingFilm};
use trocar_phantom::{LiftOptions, LiftsTruth, RecordOptions, Sensor, record};
use trocar_reconstruct::Settings;
use trocar_recording::Recording;
use trocar_specimen::Specimen;

const WHITE: [u8; 3] = [255; 3];

/// The mask as a picture, so that a panel magnifies it like any other.
fn painted(mask: &Mask) -> ColorImage {
    let pixels = mask.set.iter().map(|set| if *set { WHITE } else { [0; 3] }).collect();
    ColorImage { width: mask.width, height: mask.height, pixels }
}

/// The pixels that show a surface which nothing hides.
fn silhouette(surface: &TriMesh, camera: &Camera) -> Mask {
    let mut mask = Mask::new(camera.width, camera.height);
    for triangle in &surface.triangles {
        let corner = |v: u32| {
            let p = surface.vertices[v as usize];
            camera.project(p).unwrap().extend(1.0 / p.z)
        };
        draw_triangle(triangle.map(corner), camera.width, camera.height, |i, _| mask.set[i] = true);
    }
    mask
}

/// How many of the points lie on white of the magnified mask, of how many.
fn on(panel: &Panel, mask: &Mask, points: &[Option<DVec3>]) -> (usize, usize) {
    let large = panel.magnified(&painted(mask));
    let known: Vec<DVec3> = points.iter().flatten().copied().collect();
    let hit = |p: &&DVec3| {
        let at = panel.place(**p).unwrap();
        large.pixels[at.y as usize * large.width + at.x as usize][0] > 127
    };
    (known.iter().filter(hit).count(), known.len())
}

#[test]
fn landmarks_lie_on_the_tissue_of_both_panels() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("lifted");
    let lifts = LiftOptions { count: 1, cell: 3e-3, ..LiftOptions::default() };
    let options = RecordOptions { frames: 31, seed: 2, sensor: Sensor::Stereo, lifts };
    record("phantom-a", &options, &folder, &Silent).unwrap();
    let recording = Recording::open(&folder).unwrap();
    let measured = measure_recording(&recording, &Silent).unwrap();
    let lift = measured.lifts.into_iter().next().unwrap().unwrap();
    let specimen = dir.path().join("specimen");
    reconstruct_recording(&folder, &Settings { max_tets: 4000, ..Settings::default() }, &specimen, &Silent).unwrap();
    let specimen = Specimen::read(&specimen).unwrap();
    let camera = recording.camera();
    assert_eq!(Simulated::not_shown(&specimen, &camera), None);

    let frames = [lift.info.rest, lift.peak];
    let moments = frames.map(|frame| Moment::measured(&lift, frame));
    let size = [540, 405];
    let panel = Panel::around(camera, &lift, &moments, size);
    // A camera that sees everything 20 pixels aside: with it, landmarks must miss.
    let aside = Panel::around(Camera { cx: camera.cx + 20.0, cy: camera.cy + 20.0, ..camera }, &lift, &moments, size);
    let lie = |mask: &Mask, points: &[Option<DVec3>], least: usize| {
        let ((hit, all), (missing, _)) = (on(&panel, mask, points), on(&aside, mask, points));
        assert!(hit == all && all > least, "{hit} of {all} lie on the tissue");
        assert!(2 * missing < all, "{missing} of {all} lie on the tissue through another camera");
    };

    // Filmed: at rest on the recording's mask, at the peak on the true surface.
    let at_rest = Mask::read(&recording.organ_mask_file("appendix")).unwrap();
    lie(&at_rest, &moments[0].landmarks, 10);
    let truth = LiftsTruth::read(&folder.join("truth")).unwrap().unwrap();
    let surfaces = truth.lifts[0].surfaces(&folder.join("truth"), 0).unwrap();
    let (a, b, t) = truth.lifts[0].between(lift.peak);
    let mix = surfaces[a].vertices.iter().zip(&surfaces[b].vertices).map(|(p, q)| p.lerp(*q, t)).collect();
    let at_peak = silhouette(&TriMesh { vertices: mix, ..surfaces[a].clone() }, &camera);
    lie(&at_peak, &moments[1].landmarks, 6);

    // Simulated: on the pixels that are rendered of the organ.
    let organ = LoneOrgan::of(&specimen, "appendix").unwrap();
    let seen = SeenLift::of(lift.clone(), &organ).unwrap();
    let made = Simulated { specimen: &specimen, organ: &organ, seen: &seen, grip: Grip::Place };
    assert_eq!(shares(&lift, &frames), [0.0, 1.0]);
    let mut view = SimulatedView::new(&made, (&frames, &[0.0, 1.0]), &Silent).unwrap();
    let simulated = view.moments().to_vec();
    for k in 0..2 {
        let seen = view.picture(k).unwrap().clone();
        let set = seen.labels.iter().map(|label| *label == view.label()).collect();
        lie(&Mask { width: seen.depth.width, height: seen.depth.height, set }, &simulated[k].landmarks, 10);
    }
    let moved = |k: usize| simulated[k].landmarks[10].unwrap();
    assert!(moved(1).distance(moved(0)) > 3e-3, "{} m", moved(1).distance(moved(0)));
    assert_eq!(simulated[0].error.map(|e| e < 1e-3), Some(true), "{:?}", simulated[0].error);

    // The colours are at the places of the landmarks.
    let frame = RecordingFilm::new(&recording).frame(lift.info.rest).unwrap();
    let shown = panel.filmed(Seen { color: &frame.color, depth: &frame.depth }, &moments[0]).unwrap();
    // Without the circles of the filmed landmarks, which may lie over the simulated ones.
    let bare = Moment { landmarks: Vec::new(), ..moments[1].clone() };
    let right = view.panel(&panel, 1, &bare).unwrap();
    let drawn = |picture: &ColorImage, moment: &Moment, color: [u8; 3]| {
        let held = moment.grasp.and_then(|[_, now]| panel.place(now)).unwrap();
        let places = moment.landmarks.iter().flatten().filter_map(|p| panel.place(*p));
        let free: Vec<_> = places.filter(|p| p.distance(held) > 20.0).collect();
        let colored = |p: &&glam::DVec2| picture.pixels[p.y as usize * picture.width + p.x as usize] == color;
        assert_eq!((free.iter().filter(colored).count(), free.len() > 6), (free.len(), true));
    };
    drawn(&shown, &moments[0], FILMED);
    drawn(&right, &simulated[1], SIMULATED);

    // A film of the first frames, and the same bytes again.
    let mut lift = lift;
    lift.tracks.frames.truncate(12);
    let lift = ShownLift { number: 0, rate_hz: recording.info.rate_hz, lift: &lift };
    let film = || lift.film(&mut RecordingFilm::new(&recording), Some(&made), &Silent).unwrap();
    let (one, other) = (film(), film());
    assert!(one.bytes == other.bytes && one.frames == 12, "{} frames", one.frames);
    let back = webp::AnimDecoder::new(&one.bytes).decode().unwrap();
    // Frames that are alike may be one.
    assert!(back.has_animation() && (2..=13).contains(&back.len()), "{} frames", back.len());
    assert!(one.figure("a lift", "moves").contains("image/webp"));
}
