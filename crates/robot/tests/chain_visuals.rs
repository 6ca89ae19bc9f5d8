//! Visual shapes in descriptions: each on its link, with pose and colour; errors are named.

#![allow(clippy::unwrap_used, reason = "helper functions of tests")]

mod common;

use common::files::{shown_mjcf, shown_urdf};
use glam::DVec3;
use std::path::{Path, PathBuf};
use trocar_robot::Error;
use trocar_robot::chain::{SerialArm, Visual, VisualShape, mjcf_visuals, urdf_visuals};

fn write(name: &str, text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn urdf(text: &str) -> Result<Vec<Vec<Visual>>, Error> {
    let (_folder, path) = write("arm.urdf", text);
    urdf_visuals(&path, None, Some("tool"))
}

fn mjcf(text: &str) -> Result<Vec<Vec<Visual>>, Error> {
    let (_folder, path) = write("arm.xml", text);
    mjcf_visuals(&path, Some("tool"))
}

#[test]
fn both_formats_have_the_same_shapes() {
    let of_mjcf = mjcf(&shown_mjcf()).unwrap();
    for (name, links) in [("urdf", urdf(&shown_urdf()).unwrap()), ("mjcf", of_mjcf)] {
        let counts: Vec<usize> = links.iter().map(Vec::len).collect();
        assert_eq!(counts, [1, 2, 1], "{name}");
        let [foot, mesh, red, rod] = [&links[0][0], &links[1][0], &links[1][1], &links[2][0]];
        assert_eq!(foot.shape, VisualShape::Ball(0.05), "{name}");
        assert!(foot.pose.translation.length() < 1e-12, "{name}: {}", foot.pose.translation);
        let VisualShape::Mesh { file, scale } = &mesh.shape else { panic!("{name}: {mesh:?}") };
        assert!(file.ends_with("meshes/a.stl") && *scale == DVec3::splat(2.0), "{name}: {}", file.display());
        assert_eq!((mesh.link.as_str(), mesh.pose.translation), ("a", DVec3::new(0.0, 0.0, 0.1)), "{name}");
        assert_eq!((red.link.as_str(), red.color), ("box", [1.0, 0.0, 0.0]), "{name}");
        assert_eq!(red.shape, VisualShape::Block(DVec3::new(0.1, 0.2, 0.3)), "{name}");
        assert!((red.pose.translation - DVec3::new(0.3, 0.0, 0.0)).length() < 1e-12, "{name}");
        let VisualShape::Cylinder { radius, half } = rod.shape else { panic!("{name}: {rod:?}") };
        assert!((radius, (half - 0.1).abs() < 1e-12) == (0.01, true), "{name}");
        assert!((rod.pose.rotation * DVec3::Z - DVec3::X).length() < 1e-9, "{name}");
    }
}

#[test]
fn errors_name_file_and_element() {
    let said = |found: Result<Vec<Vec<Visual>>, Error>, words: &[&str]| {
        let said = found.unwrap_err().to_string();
        assert!(words.iter().all(|w| said.contains(w)) && !said.contains('\n'), "{said}");
    };
    said(mjcf(&shown_mjcf().replace(r#"mesh="a""#, r#"mesh="c""#)), &["arm.xml", "the mesh 'c'"]);
    said(mjcf(&shown_mjcf().replace(r#"size="0.1 0.2 0.3""#, r#"size="0.1""#)), &["arm.xml", "3 positive numbers"]);
    said(urdf(&shown_urdf().replace("<box size=\"0.2 0.4 0.6\"/>", "<cone/>")), &["arm.urdf", "link 'box'", "<cone>"]);
    said(urdf(&shown_urdf().replace("meshes/a.stl", "package://nowhere/a.stl")), &["link 'a'", "package 'nowhere'"]);
    said(urdf(&shown_urdf().replace("radius=\"0.01\"", "radius=\"-1\"")), &["link 'b'", "positive radius"]);
}

#[test]
fn default_classes_place_geoms() {
    let placed = |default: &str, own: &str| {
        let text = shown_mjcf()
            .replace(r#"<geom group="2"/>"#, r#"<geom group="2"/><default class="turned"><geom DEFAULT/></default>"#)
            .replace("DEFAULT", default)
            .replace(
                r#"<geom type="mesh" mesh="a" pos="0 0 0.1"/>"#,
                r#"<geom class="turned" type="mesh" mesh="a" OWN/>"#,
            )
            .replace("OWN", own);
        mjcf(&text).map(|links| links[1][0].pose)
    };
    let pose = placed(r#"pos="0 0 0.2" euler="0 90 0""#, "").unwrap();
    assert!((pose.translation - DVec3::new(0.0, 0.0, 0.2)).length() < 1e-12, "{}", pose.translation);
    assert!((pose.rotation * DVec3::Z - DVec3::X).length() < 1e-9);
    let pose = placed(r#"pos="0 0 0.2" euler="0 90 0""#, r#"pos="0 0 0.1" euler="0 0 0""#).unwrap();
    assert!((pose.translation - DVec3::new(0.0, 0.0, 0.1)).length() < 1e-12, "{}", pose.translation);
    assert!((pose.rotation * DVec3::Z - DVec3::Z).length() < 1e-9);
    let said = placed(r#"quat="0 1 0 0""#, r#"euler="0 90 0""#).unwrap_err().to_string();
    assert!(said.contains("arm.xml") && said.contains("quat and euler"), "{said}");
}

#[test]
fn sizes_are_numbers_and_may_have_unused_ones() {
    let ball = |size: &str| mjcf(&shown_mjcf().replace(r#"size="0.05""#, &format!("size=\"{size}\"")));
    assert_eq!(ball("0.05 0 0").unwrap()[0][0].shape, VisualShape::Ball(0.05));
    for (size, word) in [
        ("0.05 wide", "'wide' in size"),
        ("wide 0.05", "'wide' in size"),
        ("nan", "'nan' in size"),
        ("0 0.05", "1 positive"),
        ("", "1 positive"),
        ("1 1 1 1", "1 positive"),
    ] {
        let said = ball(size).unwrap_err().to_string();
        assert!(said.contains(word) && said.contains("arm.xml") && !said.contains('\n'), "{size}: {said}");
    }
}

#[test]
fn paths_do_not_leave_their_package() {
    for path in ["/a.stl", "", "../a.stl", "./a.stl", "two/../../a.stl", "two//etc/a.stl", "two/meshes/.."] {
        let name = format!("package://{path}");
        let said = urdf(&shown_urdf().replace("meshes/a.stl", &name)).unwrap_err().to_string();
        assert!(["arm.urdf", "link 'a'", &name, "without '..'"].iter().all(|w| said.contains(w)), "{said}");
    }
}

#[test]
fn packages_are_found_beside_the_file_or_above_it() {
    let folder = tempfile::tempdir().unwrap();
    let package = folder.path().join("two_description");
    std::fs::create_dir_all(package.join("urdf")).unwrap();
    let file = package.join("urdf/arm.urdf");
    let text = shown_urdf().replace("meshes/a.stl", "package://two_description/meshes/a.stl");
    std::fs::write(&file, text).unwrap();
    let links = urdf_visuals(&file, None, Some("tool")).unwrap();
    let VisualShape::Mesh { file, .. } = &links[1][0].shape else { panic!() };
    assert_eq!(*file, package.join("meshes/a.stl"));
}

#[test]
fn every_link_of_the_menageries_fr3_has_its_meshes() {
    let file = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/franka_fr3/fr3.xml"));
    if !file.is_file() {
        println!("skipped: no {}", file.display());
        return;
    }
    let links = mjcf_visuals(file, None).unwrap();
    assert_eq!(links, mjcf_visuals(file, Some("attachment_site")).unwrap());
    assert_eq!(links.iter().map(Vec::len).collect::<Vec<_>>(), [7, 1, 1, 2, 2, 3, 8, 4]);
    assert_eq!(links.len(), 1 + SerialArm::from_mjcf(file, "attachment_site").unwrap().dof());
    assert!(links.iter().flatten().all(|v| matches!(&v.shape, VisualShape::Mesh { file, .. } if file.is_file())));
}
