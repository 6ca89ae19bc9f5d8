//! A small arm with a turning and a sliding joint, in both formats.

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
