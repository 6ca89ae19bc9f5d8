//! What is drawn: by the seed alone, one factor without the others, and applied as it says.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::collections::BTreeSet;
use trocar_scene::{Distribution, Drawn, Factor, Scene, SpecimenSource, Specimens, Split, Variation, VariationSet};
use trocar_specimen::Specimen;

fn cell_a(set: VariationSet) -> Scene {
    let mut scene = Scene::builtin("cell-a").unwrap();
    scene.variation.set = set;
    scene.validate().unwrap();
    scene
}

fn nothing() -> Specimen {
    let organs = Vec::new();
    Specimen {
        name: "none".to_owned(),
        up: glam::DVec3::Z,
        placement: trocar_core::Pose::IDENTITY,
        camera: None,
        background: None,
        provenance: trocar_specimen::Provenance::default(),
        organs,
    }
}

#[test]
fn the_starts_of_cell_a_are_those_of_earlier_versions() {
    let scene = cell_a(VariationSet::None);
    let drawn = scene.draw(0);
    assert_eq!(drawn.specimen, scene.specimen);
    assert_eq!(drawn.values.len(), 8);
    let random = trocar_scene::EpisodeRandom::new(0, "start");
    let arranged = scene.with_drawn(&drawn, &nothing());
    for (side, (arm, own)) in arranged.arms.iter().zip(&scene.arms).enumerate() {
        let first = 8 * side as u64;
        assert_eq!(arm.start.tilt_deg, (own.start.tilt_deg + random.aside(first, 1.0)).max(0.0));
        assert_eq!(arm.start.azimuth_deg, own.start.azimuth_deg + random.aside(first + 1, 5.0));
        assert_eq!(arm.start.insertion_mm, own.start.insertion_mm + random.aside(first + 2, 5.0));
        assert_eq!(arm.start.roll_deg, own.start.roll_deg + random.aside(first + 3, 10.0));
    }
    // Nothing else differs.
    let mut same = arranged;
    (same.arms, same.variation) = (scene.arms.clone(), scene.variation.clone());
    assert_eq!(same, scene);
}

#[test]
fn draws_depend_on_the_seed_and_not_on_each_other() {
    let scene = cell_a(VariationSet::Hard);
    assert_eq!(scene.draw(3), scene.draw(3));
    assert_ne!(scene.draw(3), scene.draw(4));
    let names: BTreeSet<String> = scene.draw(3).values.iter().map(|v| v.name()).collect();
    assert_eq!(names.len(), scene.draw(3).values.len(), "names are unique");
    for name in ["modulus_kpa", "left.tilt_deg", "d405.camera_shift_mm.x", "right.port_shift_mm.y", "tint_scale.red"] {
        assert!(names.contains(name), "{name} is not among {names:?}");
    }
    // Without a factor, all others are the same.
    for factor in scene.variation.all_factors().into_keys() {
        let mut without = scene.clone();
        without.variation.set = VariationSet::None;
        without.variation.factors = scene.variation.all_factors();
        without.variation.factors.remove(&factor);
        let expected: Vec<_> = scene.draw(3).values.into_iter().filter(|v| v.factor != factor).collect();
        assert_eq!(without.draw(3).values, expected, "{}", factor.name());
    }
    // Without a camera or an arm, those of the others are the same.
    let mut fewer = scene.clone();
    fewer.cameras.remove(0);
    fewer.arms.remove(0);
    let few = fewer.draw(3).values;
    assert!(few.iter().all(|v| scene.draw(3).values.contains(v)));
}

#[test]
fn what_is_drawn_comes_back_from_its_table() {
    let mut scene = cell_a(VariationSet::Hard);
    scene.arms[0].port = None;
    let drawn = scene.draw(7);
    let again: Drawn = trocar_specimen::parse_toml(&drawn.to_toml().unwrap()).unwrap();
    assert_eq!(again, drawn);
    let json = serde_json::to_string(&drawn).unwrap();
    assert_eq!(serde_json::from_str::<Drawn>(&json).unwrap(), drawn);
    let coarse = SpecimenSource::phantom("phantom-c", 2).with_max_elements(Some(14_000));
    for source in [SpecimenSource::phantom("phantom-b", 9), SpecimenSource::folder("../a:b/c"), coarse] {
        assert_eq!(SpecimenSource::labelled(&source.label()), source);
    }
    assert!(serde_json::from_str::<Drawn>(r#"{"specimen": "phantom-a:1", "modulus_mpa": 1.0}"#).is_err());
}

#[test]
fn specimens_are_drawn_evenly() {
    let mut scene = cell_a(VariationSet::Standard);
    assert_eq!(scene.specimens().len(), 8);
    let drawn = |scene: &Scene, split: Split| -> BTreeSet<String> {
        (0..200).map(|k| scene.draw(split.seed(k)).specimen.label()).collect()
    };
    let (seen, unseen) = (drawn(&scene, Split::Seen), drawn(&scene, Split::Unseen));
    assert_eq!((seen.len(), unseen.len(), drawn(&scene, Split::Both).len()), (6, 2, 8), "{seen:?} {unseen:?}");
    assert!(seen.is_disjoint(&unseen) && unseen.contains("phantom-a:8"), "{unseen:?}");
    scene.variation.specimens =
        Some(Specimens { paths: Vec::new(), phantoms: vec!["phantom-a".into(), "phantom-c".into()], seeds: [4, 6] });
    let (seen, unseen) = (drawn(&scene, Split::Seen), drawn(&scene, Split::Unseen));
    assert_eq!((seen.len(), unseen.len()), (4, 2), "{seen:?} {unseen:?}");
    assert!(seen.contains("phantom-c:4") && unseen.contains("phantom-c:5"));
    assert_eq!(cell_a(VariationSet::Easy).specimens(), [SpecimenSource::phantom("phantom-a", 1)]);
}

#[test]
fn organs_are_drawn_from_another_of_the_specimens() {
    let mut scene = cell_a(VariationSet::Standard);
    let plain = scene.clone();
    scene.variation.swapped = vec!["appendix".to_owned()];
    scene.validate().unwrap();
    let mut others = BTreeSet::new();
    for seed in (0..60).chain(Split::FIRST_UNSEEN..Split::FIRST_UNSEEN + 20) {
        let (drawn, own) = (scene.draw(seed), plain.draw(seed));
        assert_eq!((drawn.specimen.own(), &drawn.values), (own.specimen, &own.values), "nothing else changes");
        let other = drawn.specimen.swapped["appendix"].clone();
        assert_ne!(other, drawn.specimen.own_label());
        let part = Split::of_seed(seed).of_specimens(&scene.specimens()).to_vec();
        assert!(part.contains(&SpecimenSource::labelled(&other)), "{seed}: {other} is of the other split");
        let toml: Drawn = trocar_specimen::parse_toml(&drawn.to_toml().unwrap()).unwrap();
        let json: Drawn = serde_json::from_str(&serde_json::to_string(&drawn).unwrap()).unwrap();
        assert_eq!((&toml, &json), (&drawn, &drawn));
        assert_eq!(drawn.words()[1], ("swapped.appendix".to_owned(), other.clone()));
        assert_eq!(scene.with_drawn(&drawn, &nothing()).specimen, drawn.specimen);
        others.insert(other);
    }
    assert_eq!(others.len(), 8, "each as likely: {others:?}");
    // One specimen has no other.
    scene.variation.set = VariationSet::None;
    assert!(scene.draw(0).specimen.swapped.is_empty());
}

#[test]
fn a_scene_may_name_an_organ_of_another_specimen() {
    let text = "name = 'a'\n[specimen]\nphantom = 'phantom-a'\nseed = 3\nswapped = { appendix = 'phantom-a:7' }\n";
    let parse = |text: &str| Scene::parse(text, "a", "".as_ref()).map_err(|e| e.to_string());
    let scene = parse(text).unwrap();
    assert_eq!(scene.specimen.label(), "phantom-a:3 with appendix of phantom-a:7");
    assert_eq!(parse(&scene.to_toml().unwrap()).unwrap(), scene);
    let drawn = scene.draw(0);
    assert_eq!(trocar_specimen::parse_toml::<Drawn>(&drawn.to_toml().unwrap()).unwrap(), drawn);
    // Every anatomy has it, and the one that it is of has its own.
    let mut varied = scene.clone();
    varied.variation.set = VariationSet::Standard;
    let all = varied.specimens();
    assert!(all.len() == 8 && all.iter().all(|s| s.swapped == scene.specimen.swapped));
    assert_eq!((all[6].label(), all[6].organs_of_others().count()), ("phantom-a:7".to_owned(), 0));
    for (from, to, said) in [
        ("appendix =", "liver =", "specimen.swapped.liver names 'liver'; the specimen's organs are: cecum"),
        ("'phantom-a:7'", "'phantom-z:7'", "specimen.swapped.appendix is 'phantom-z:7'; it must be a specimen folder"),
    ] {
        let why = parse(&text.replace(from, to)).unwrap_err();
        assert!(why.contains(said), "{why}");
    }
    for (organs, said) in [
        ("['liver']", "variation.swapped[0] is 'liver'; the specimen's organs are: cecum"),
        ("['appendix', 'appendix']", "variation.swapped[1] is 'appendix' again"),
    ] {
        let why = parse(&format!("{text}[variation]\nswapped = {organs}\n")).unwrap_err();
        assert!(why.contains(said), "{why}");
    }
}

#[test]
fn the_default_set_is_for_scenes_without_one() {
    let standard = |scene: &Scene, given| scene.variation.chosen(given, VariationSet::Standard).set;
    assert_eq!(standard(&cell_a(VariationSet::None), None), VariationSet::Standard);
    assert_eq!(standard(&cell_a(VariationSet::Easy), None), VariationSet::Easy);
    assert_eq!(standard(&cell_a(VariationSet::Easy), Some(VariationSet::None)), VariationSet::None);
    // What the scene names stays as it is named.
    let chosen = cell_a(VariationSet::None).variation.chosen(None, VariationSet::Standard);
    assert_eq!(chosen.factors, cell_a(VariationSet::None).variation.factors);
}

#[test]
fn every_factor_changes_what_it_names() {
    let mut scene = cell_a(VariationSet::None);
    scene.variation = Variation::default();
    let mut specimen = nothing();
    specimen.organs.clear();
    for factor in Factor::ALL {
        let range = factor.range();
        let value = 0.4 * range.start() + 0.6 * range.end();
        let mut varied = scene.clone();
        varied.variation.factors.insert(*factor, Distribution::Choice(vec![value]));
        let drawn = varied.draw(0);
        assert!(!drawn.values.is_empty() && drawn.values.iter().all(|v| v.value == value), "{}", factor.name());
        let arranged = varied.with_drawn(&drawn, &specimen);
        // These change organs of the specimen, of which there are none here.
        let of_organs = [Factor::Modulus, Factor::Poisson, Factor::Density, Factor::PinScale];
        assert_eq!(arranged != scene, !of_organs.contains(factor), "{}", factor.name());
    }
}
