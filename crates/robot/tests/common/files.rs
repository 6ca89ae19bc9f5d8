//! A small arm with a revolute and a prismatic joint, in both formats.

pub const URDF: &str = r#"<?xml version="1.0"?>
<robot name="two">
  <link name="world"/>
  <link name="a"><inertial><origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.025"/></inertial></link>
  <link name="box"><inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <link name="b"><inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <link name="tool"/>
  <joint name="j1" type="revolute"><parent link="world"/><child link="a"/><origin xyz="0 0 0.5"/><axis xyz="0 0 2"/>
    <limit lower="-1" upper="2" velocity="3" effort="40"/><dynamics damping="0.1" friction="0.2"/></joint>
  <joint name="fix" type="fixed"><parent link="a"/><child link="box"/><origin xyz="0.3 0 0"/></joint>
  <joint name="j2" type="prismatic"><parent link="a"/><child link="b"/><origin xyz="0.2 0 0"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.3" velocity="1" effort="50"/></joint>
  <joint name="end" type="fixed"><parent link="b"/><child link="tool"/><origin xyz="0.1 0 0"/></joint>
</robot>"#;

pub const MJCF: &str = r#"<mujoco model="two">
  <compiler angle="degree" autolimits="true"/>
  <option gravity="0 0 -9.7"/>
  <default><joint damping="0.5"/><default class="arm"><joint armature="0.1" frictionloss="0.3"/>
    <default class="hand"><joint damping="0.7"/></default></default></default>
  <worldbody>
    <body name="base" pos="0 0 0.5" childclass="arm">
      <body name="a">
        <inertial pos="0.1 0 0" mass="2" diaginertia="0.02 0.01 0.025" euler="0 0 90"/>
        <joint name="j1" axis="0 0 2" range="-60 120" actuatorfrcrange="-40 40"/>
        <body name="box" pos="0.3 0 0"><inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/></body>
        <body name="b" pos="0.2 0 0">
          <inertial pos="0 0 0" mass="1" fullinertia="0.01 0.01 0.01 0 0 0"/>
          <joint name="j2" class="hand" type="slide" axis="1 0 0" range="0 0.3"/>
          <site name="tool" pos="0.1 0 0"/>
        </body>
      </body>
    </body>
  </worldbody>
  <keyframe><key name="home" qpos="0.2 0.1"/></keyframe>
</mujoco>"#;

/// The arm of both files with visual shapes: a foot, a mesh on the first link, a red box fixed to
/// it, a rod on the second.
pub fn shown_urdf() -> String {
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

pub fn shown_mjcf() -> String {
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
