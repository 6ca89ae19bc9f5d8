//! Description files: valid ones are read, errors in others are named.

#![allow(clippy::unwrap_used, reason = "helper functions of tests")]

mod common;

use common::files::{MJCF, URDF};
use glam::DVec3;
use std::path::Path;
use trocar_robot::Error;
use trocar_robot::chain::{JointKind, Joints, SerialArm};

fn write(name: &str, text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn urdf(text: &str) -> Result<SerialArm, Error> {
    let (_folder, path) = write("arm.urdf", text);
    SerialArm::from_urdf(&path, None, Some("tool"))
}

fn mjcf(text: &str) -> Result<SerialArm, Error> {
    let (_folder, path) = write("arm.xml", text);
    SerialArm::from_mjcf(&path, "tool")
}

#[test]
fn both_formats_give_the_described_arm() {
    let (a, b) = (urdf(URDF).unwrap(), mjcf(MJCF).unwrap());
    for arm in [&a, &b] {
        assert_eq!(arm.dof(), 2);
        let [turn, slide] = arm.segments() else { panic!() };
        assert_eq!((turn.joint.kind, slide.joint.kind), (JointKind::Revolute, JointKind::Prismatic));
        assert_eq!((turn.joint.axis, turn.joint.limits.effort), (DVec3::Z, 40.0));
        // The box is part of the link to which it is fixed.
        assert!((turn.mass.mass - 3.0).abs() < 1e-12 && (turn.mass.center.x - 0.5 / 3.0).abs() < 1e-12);
        let q = Joints::new(&[std::f64::consts::FRAC_PI_2, 0.2]).unwrap();
        let tool = arm.frames(&q).flange().translation;
        assert!((tool - DVec3::new(0.0, 0.5, 0.5)).length() < 1e-12, "{tool}");
    }
    let q = Joints::new(&[0.3, 0.2]).unwrap();
    let off = |i: usize, j: usize| {
        let armature = if i == j { 0.1 } else { 0.0 };
        (a.mass_matrix(&q).row(i)[j] + armature - b.mass_matrix(&q).row(i)[j]).abs()
    };
    assert!((0..2).all(|i| (0..2).all(|j| off(i, j) < 1e-12)));
    assert_eq!((a.segments()[0].joint.damping, a.segments()[0].joint.friction), (0.1, 0.2));
    let joint = |i: usize| &b.segments()[i].joint;
    assert_eq!([joint(0).damping, joint(0).friction, joint(0).armature], [0.5, 0.3, 0.1]);
    assert_eq!([joint(1).damping, joint(1).friction, joint(1).armature], [0.7, 0.3, 0.1]);
    assert!((joint(0).limits.position[1] - 120f64.to_radians()).abs() < 1e-15);
    assert_eq!((&b.home()[..], b.gravity().z), (&[0.2, 0.1][..], -9.7));
    // Without names there are several ends.
    let (_folder, path) = write("arm.urdf", URDF);
    assert!(SerialArm::from_urdf(&path, None, None).unwrap_err().to_string().contains("several ends"));
    assert_eq!(SerialArm::from_urdf(&path, Some("a"), Some("tool")).unwrap().dof(), 1);
    assert!(SerialArm::from_urdf(&path, Some("box"), Some("tool")).is_err());
}

#[test]
fn errors_are_named() {
    let cases = [
        (r#"<robot name="two">"#, r#"<robots>"#, "expected"),
        (r#"type="prismatic""#, r#"type="planar""#, "planar"),
        (r#"type="prismatic""#, r#"type="floating""#, "must be revolute"),
        (r#"<axis xyz="1 0 0"/>"#, r#"<axis xyz="0 0 0"/>"#, "axis"),
        (r#"<axis xyz="1 0 0"/>"#, r#"<axis xyz="nan 0 0"/>"#, "not a finite number"),
        (r#"<axis xyz="1 0 0"/>"#, r#"<axis xyz="1 0"/>"#, "must have 3"),
        (r#"<axis xyz="1 0 0"/>"#, r#"<mimic joint="j1"/>"#, "mimics"),
        (r#"name="fix" type="fixed""#, r#"name="fix" type="continuous""#, "must not branch"),
        (r#"<mass value="2"/>"#, "", "without <mass>"),
        (r#"<mass value="2"/>"#, r#"<mass value="-2"/>"#, "must be positive"),
        (r#"<mass value="2"/>"#, r#"<mass value="2e999"/>"#, "not a finite number"),
        (
            r#"ixx="0.01" ixy="0" ixz="0" iyy="0.02""#,
            r#"ixx="9" ixy="0" ixz="0" iyy="0.02""#,
            "no body has this inertia",
        ),
        (r#"ixx="0.01" ixy="0" ixz="0" iyy="0.02""#, r#"ixx="0.01" ixz="0" iyy="0.02""#, "ixy"),
        (r#"<parent link="b"/>"#, r#"<parent link="tool"/>"#, "loop"),
        (r#"<parent link="b"/>"#, r#"<parent link="bb"/>"#, "not a link"),
        (r#"<child link="box"/>"#, r#"<child link="b"/>"#, "has two parents"),
        (r#"<link name="tool"/>"#, r#"<link name="tool"/><link name="tool"/>"#, "twice"),
        (r#"lower="-1" upper="2""#, r#"lower="2" upper="-1""#, "limits"),
        (r#"effort="40""#, r#"effort="0""#, "effort"),
    ];
    for (good, bad, word) in cases {
        assert!(URDF.contains(good), "{good}");
        let message = urdf(&URDF.replacen(good, bad, 1)).unwrap_err().to_string();
        assert!(message.contains(word) && message.contains("arm.urdf") && !message.contains('\n'), "{bad}: {message}");
    }
    let start = URDF.find(r#"<link name="a">"#).unwrap();
    let end = start + URDF[start..].find("</link>").unwrap() + 7;
    let message = urdf(&URDF.replace(&URDF[start..end], r#"<link name="a"/>"#)).unwrap_err().to_string();
    assert!(message.contains("'a'") && message.contains("no <inertial>"), "{message}");

    let cases = [
        (r#"<mujoco model="two">"#, r#"<mujoco model="two"><include file="a.xml"/>"#, "included"),
        (r#"type="slide""#, r#"type="ball""#, "must be hinge or slide"),
        (r#"class="hand" type"#, r#"class="fist" type"#, "fist"),
        (r#"axis="0 0 2""#, r#"axis="0 0 0""#, "axis"),
        (r#"axis="0 0 2""#, r#"stiffness="3""#, "stiffness"),
        (r#"<inertial pos="0.1 0 0" mass="2" diaginertia="0.02 0.01 0.025" euler="0 0 90"/>"#, "", "no <inertial>"),
        (r#"mass="2""#, r#"mass="0""#, "must be positive"),
        (r#"mass="2""#, r#"mass="two""#, "not a finite number"),
        (r#"diaginertia="0.02 0.01 0.025" euler"#, r#"euler"#, "diaginertia"),
        (r#"euler="0 0 90""#, r#"quat="0 0 0 0""#, "zero length"),
        (r#"<body name="box" pos="0.3 0 0">"#, r#"<body name="box"><joint/>"#, "must not branch"),
        (r#"name="tool""#, r#"name="tools""#, "no body or site 'tool'"),
        (r#"actuatorfrcrange="-40 40""#, r#"actuatorfrcrange="-40 30""#, "not symmetric"),
        (r#"range="-60 120""#, r#"range="120 -60""#, "limits"),
        (r#"<joint name="j2""#, r#"<joint name="j3"/><joint name="j2""#, "several joints"),
        (r#"<body name="a">"#, r#"<body name="a" gravcomp="1">"#, "gravcomp"),
        (r#"angle="degree""#, r#"angle="grad""#, "not supported"),
    ];
    for (good, bad, word) in cases {
        assert!(MJCF.contains(good), "{good}");
        let message = mjcf(&MJCF.replacen(good, bad, 1)).unwrap_err().to_string();
        assert!(message.contains(word) && message.contains("arm.xml") && !message.contains('\n'), "{bad}: {message}");
    }
    assert!(urdf(MJCF).unwrap_err().to_string().contains("must be <robot>"));
    assert!(mjcf(URDF).unwrap_err().to_string().contains("must be <mujoco>"));
    assert!(matches!(SerialArm::from_urdf(Path::new("/no/such"), None, None), Err(Error::Io { .. })));
}

#[test]
fn malicious_files_are_refused() {
    let bomb = format!(
        "<!DOCTYPE robot [<!ENTITY a \"{}\"><!ENTITY b \"{}\">]><robot name=\"&b;\"/>",
        "x".repeat(1000),
        "&a;".repeat(1000)
    );
    assert!(urdf(&bomb).unwrap_err().to_string().contains("DTD"));
    assert!(mjcf(&bomb).is_err());
    let deep = format!("<mujoco>{}{}</mujoco>", "<body>".repeat(200_000), "</body>".repeat(200_000));
    assert!(mjcf(&deep).unwrap_err().to_string().contains("nested"));
    let hidden = format!("<mujoco>{}", "<a b='/>' >".repeat(200_000));
    assert!(mjcf(&hidden).is_err());
    let wide = format!("<mujoco>{}</mujoco>", "<b/>".repeat(1_000_000));
    assert!(mjcf(&wide).is_err());
    let huge = format!("<mujoco>{}</mujoco>", " ".repeat(17 << 20));
    assert!(mjcf(&huge).unwrap_err().to_string().contains("MiB"));
    assert!(urdf("").is_err() && mjcf("\u{feff}").is_err());
    let many = URDF
        .replace("<limit lower", &"x".repeat(10_000))
        .replace("friction=\"0.2\"", &format!("friction=\"{}\"", "9".repeat(10_000)));
    assert!(urdf(&many).unwrap_err().to_string().len() < 500);
}
