//! What descriptions show of an arm: every shape on the link that carries it, at its pose, in its colour; what is wrong is told.

#![allow(clippy::unwrap_used, reason = "helper functions of tests")]

mod common;

use common::files::{MJCF, URDF};
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

/// The arm of both files with looks: a foot, a mesh on the first link, a red box that is fixed to it, a rod on the second.
fn shown_urdf() -> String {
    let mesh = r#"<link name="a"><visual><origin xyz="0 0 0.1"/><geometry><mesh filename="meshes/a.stl" scale="2 2 2"/></geometry></visual>"#;
    let red =
        r#"<link name="box"><visual><geometry><box size="0.2 0.4 0.6"/></geometry><material name="red"/></visual>"#;
    let rod = r#"<link name="b"><visual><origin rpy="0 1.5707963267948966 0"/><geometry><cylinder radius="0.01" length="0.2"/></geometry></visual>"#;
    URDF.replace(r#"<link name="a">"#, mesh)
        .replace(r#"<link name="box">"#, red)
        .replace(r#"<link name="b">"#, rod)
        .replace(
            r#"<link name="world"/>"#,
            r#"<material name="red"><color rgba="1 0 0 1"/></material>
            <link name="world"><visual><geometry><sphere radius="0.05"/></geometry></visual></link>"#,
        )
}

fn shown_mjcf() -> String {
    MJCF.replace(
        "<worldbody>",
        r#"<asset><mesh file="a.stl" scale="2 2 2"/><material name="red" rgba="1 0 0 1"/></asset><worldbody>"#,
    )
    .replace(r#"angle="degree""#, r#"angle="degree" meshdir="meshes""#)
    .replace(r#"<default><joint damping="0.5"/>"#, r#"<default><joint damping="0.5"/><geom group="2"/>"#)
    .replace(
        r#"childclass="arm">"#,
        r#"childclass="arm"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom size="0.05" pos="0 0 -0.5"/>"#,
    )
    .replace(
        r#"<joint name="j1""#,
        r#"<geom type="mesh" mesh="a" pos="0 0 0.1"/><geom type="mesh" mesh="none" group="3"/><joint name="j1""#,
    )
    .replace(
        r#"<body name="box" pos="0.3 0 0">"#,
        r#"<body name="box" pos="0.3 0 0"><geom type="box" size="0.1 0.2 0.3" material="red"/>"#,
    )
    .replace(r#"<joint name="j2""#, r#"<geom type="cylinder" size="0.01" fromto="-0.1 0 0 0.1 0 0"/><joint name="j2""#)
}

#[test]
fn both_formats_show_the_same() {
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
fn what_is_wrong_names_file_and_place() {
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
fn packages_lie_beside_the_file_or_above_it() {
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
fn every_link_of_the_menageries_fr3_shows_its_meshes() {
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
