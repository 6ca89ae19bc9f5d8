//! Arms from URDF, ROS's format: the links from a base to a tip.

use super::xml::{Source, children, place, shown};
use crate::chain::arm::{Joint, JointKind, JointLimits, Segment, SerialArm};
use crate::chain::frames::compose;
use crate::chain::mass::MassProperties;
use crate::{Error, Result};
use glam::{DMat3, DQuat, DVec3, EulerRot};
use roxmltree::Node;
use std::collections::BTreeMap;
use std::path::Path;
use trocar_core::Pose;

impl SerialArm {
    /// Reads the arm from the link `base` to the link `tip` from a URDF file. Without `base` it
    /// starts at the root, without `tip` it ends at the only link without a child.
    ///
    /// Links that are fixed to a moving link are part of it. Children of the tip are ignored: a
    /// payload takes their place. URDF has no rotor inertia, so the armature is zero; gravity is
    /// 9.81 m/s2 along -z.
    ///
    /// # Errors
    /// A file that cannot be read, is not URDF or is an unexpanded xacro; an unknown base or tip,
    /// several ends, a loop; a joint that is neither revolute, continuous, prismatic nor fixed, or
    /// mimics another; a moving link without `<inertial>`; another moving branch; and the errors of
    /// [`SerialArm::new`].
    pub fn from_urdf(path: &Path, base: Option<&str>, tip: Option<&str>) -> Result<Self> {
        let (source, text) = Source::read(path)?;
        let document = source.parse(&text, "robot")?;
        let root = document.root_element();
        let is_xacro = |n: &Node<'_, '_>| n.tag_name().namespace().is_some_and(|s| s.contains("xacro"));
        if let Some(node) = root.descendants().find(is_xacro) {
            return Err(source.fail(format!("{} is xacro; expand the file first", place(node))));
        }
        let reader = Reader::new(source, root)?;
        reader.build(&reader.joints(base, tip)?)
    }
}

pub(super) struct Reader<'p, 'a, 'i> {
    pub(super) source: Source<'p>,
    pub(super) root: Node<'a, 'i>,
    pub(super) links: BTreeMap<&'a str, Node<'a, 'i>>,
    /// Joints by child link, and by parent link.
    pub(super) by_child: BTreeMap<&'a str, Node<'a, 'i>>,
    pub(super) by_parent: BTreeMap<&'a str, Vec<Node<'a, 'i>>>,
}

impl<'p, 'a, 'i> Reader<'p, 'a, 'i> {
    pub(super) fn new(source: Source<'p>, root: Node<'a, 'i>) -> Result<Self> {
        let mut reader =
            Self { source, root, links: BTreeMap::new(), by_child: BTreeMap::new(), by_parent: BTreeMap::new() };
        for link in children(root, "link") {
            let name = source.required(link, "name")?;
            if reader.links.insert(name, link).is_some() {
                return Err(source.fail(format!("{} occurs twice", place(link))));
            }
        }
        for joint in children(root, "joint") {
            let (parent, child) = (reader.end(joint, "parent")?, reader.end(joint, "child")?);
            if reader.by_child.insert(child, joint).is_some() {
                return Err(source.fail(format!("link '{}' has two parents; it must have one", shown(child))));
            }
            reader.by_parent.entry(parent).or_default().push(joint);
        }
        Ok(reader)
    }

    pub(super) fn at(&self, node: Node<'_, '_>, complaint: &str) -> Error {
        self.source.fail(format!("{} {complaint}", place(node)))
    }

    /// The link at one end of a joint.
    pub(super) fn end(&self, joint: Node<'a, 'i>, kind: &str) -> Result<&'a str> {
        let node = children(joint, kind).next().ok_or_else(|| self.at(joint, &format!("has no <{kind}>")))?;
        let name = self.source.required(node, "link")?;
        if !self.links.contains_key(name) {
            return Err(self.at(joint, &format!("has the {kind} '{}', which is not a link", shown(name))));
        }
        Ok(name)
    }

    fn link(&self, name: &str) -> Result<&'a str> {
        let known = || self.links.keys().take(20).map(|n| shown(n)).collect::<Vec<_>>().join(", ");
        let found = self.links.get_key_value(name).map(|(name, _)| *name);
        found.ok_or_else(|| self.source.fail(format!("there is no link '{}'; the links are: {}", shown(name), known())))
    }

    /// The joints from `base` to `tip`.
    pub(super) fn joints(&self, base: Option<&str>, tip: Option<&str>) -> Result<Vec<Node<'a, 'i>>> {
        let tip = match tip {
            Some(tip) => self.link(tip)?,
            None => {
                let ends: Vec<_> = self.links.keys().copied().filter(|l| !self.by_parent.contains_key(l)).collect();
                match ends[..] {
                    [end] => end,
                    [] => return Err(self.source.fail("every link has a child; name the tip")),
                    _ => {
                        let names = ends.iter().take(10).map(|n| shown(n)).collect::<Vec<_>>().join(", ");
                        return Err(self.source.fail(format!("there are several ends; name the tip: {names}")));
                    }
                }
            }
        };
        let base = base.map(|b| self.link(b)).transpose()?;
        let mut joints = Vec::new();
        let mut at = tip;
        while Some(at) != base {
            let Some(&joint) = self.by_child.get(at) else {
                match base {
                    Some(b) => {
                        return Err(self.source.fail(format!(
                            "'{}' is not between '{}' and the root",
                            shown(b),
                            shown(tip)
                        )));
                    }
                    None => break,
                }
            };
            joints.push(joint);
            if joints.len() > self.links.len() {
                return Err(self
                    .source
                    .fail(format!("the links around '{}' form a loop; they must form a tree", shown(tip))));
            }
            at = self.end(joint, "parent")?;
        }
        joints.reverse();
        Ok(joints)
    }

    fn build(&self, joints: &[Node<'a, 'i>]) -> Result<SerialArm> {
        let mut segments: Vec<Segment> = Vec::new();
        // Pose of the link in the axes of the last moving link, or of the base.
        let mut here = Pose::IDENTITY;
        for (k, &node) in joints.iter().enumerate() {
            here = compose(&here, &self.origin(node)?);
            let child = self.end(node, "child")?;
            let mass = self.mass(child)?;
            if let Some(joint) = self.joint(node, &here)? {
                let mass = mass.ok_or_else(|| {
                    self.source.fail(format!("link '{}' is moved by a joint and has no <inertial>", shown(child)))
                })?;
                segments.push(Segment { link: shown(child), joint, mass });
                here = Pose::IDENTITY;
            } else if let (Some(segment), Some(mass)) = (segments.last_mut(), mass) {
                segment.mass = segment.mass.joined(&mass.placed(&here));
            }
            if let (Some(segment), Some(&next)) = (segments.last_mut(), joints.get(k + 1)) {
                self.weld(child, next, &here, segment)?;
            }
        }
        if segments.is_empty() {
            return Err(self.source.fail("there is no moving joint between base and tip"));
        }
        let name = self.root.attribute("name").unwrap_or("urdf");
        SerialArm::new(shown(name), segments, here).map_err(|e| self.source.explain(e))
    }

    /// Adds the links that are fixed to `link`, outside the chain, to the segment.
    fn weld(&self, link: &'a str, next: Node<'a, 'i>, here: &Pose, segment: &mut Segment) -> Result<()> {
        let mut open = vec![(link, *here)];
        while let Some((link, parent)) = open.pop() {
            for &joint in self.by_parent.get(link).into_iter().flatten().filter(|j| **j != next) {
                if joint.attribute("type") != Some("fixed") {
                    return Err(self.at(joint, "moves and is not between base and tip: the tree must not branch"));
                }
                let pose = compose(&parent, &self.origin(joint)?);
                let child = self.end(joint, "child")?;
                if let Some(mass) = self.mass(child)? {
                    segment.mass = segment.mass.joined(&mass.placed(&pose));
                }
                open.push((child, pose));
            }
        }
        Ok(())
    }

    pub(super) fn origin(&self, node: Node<'a, 'i>) -> Result<Pose> {
        let Some(origin) = children(node, "origin").next() else { return Ok(Pose::IDENTITY) };
        let translation = self.source.vector(origin, "xyz")?.unwrap_or(DVec3::ZERO);
        let [roll, pitch, yaw] = self.source.numbers::<3>(origin, "rpy")?.unwrap_or([0.0; 3]);
        Ok(Pose { rotation: DQuat::from_euler(EulerRot::ZYX, yaw, pitch, roll), translation })
    }

    fn mass(&self, link: &str) -> Result<Option<MassProperties>> {
        let Some(&link) = self.links.get(link) else { return Ok(None) };
        let Some(inertial) = children(link, "inertial").next() else { return Ok(None) };
        let part = |kind: &str| {
            let node = children(inertial, kind).next();
            node.ok_or_else(|| self.at(link, &format!("has an <inertial> without <{kind}>")))
        };
        let need = |node: Node<'a, 'i>, name: &str| {
            let value = self.source.number(node, name)?;
            value.ok_or_else(|| self.at(link, &format!("has an <inertial> without '{name}'")))
        };
        let mass = need(part("mass")?, "value")?;
        let node = part("inertia")?;
        let [mut xx, mut xy, mut xz, mut yy, mut yz, mut zz] = [0.0; 6];
        let names = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
        for (name, value) in names.iter().zip([&mut xx, &mut xy, &mut xz, &mut yy, &mut yz, &mut zz]) {
            *value = need(node, name)?;
        }
        if mass <= 0.0 {
            return Err(
                self.at(link, &format!("has a mass of {mass} kg; it must be positive, or <inertial> must be left out"))
            );
        }
        let inertia = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        let placed = MassProperties { mass, center: DVec3::ZERO, inertia }.placed(&self.origin(inertial)?);
        // Rounding of the rotation makes it asymmetric in the last bit.
        Ok(Some(MassProperties { inertia: 0.5 * (placed.inertia + placed.inertia.transpose()), ..placed }))
    }

    /// The joint whose link is at `here` at position zero; `None` for a fixed joint.
    pub(super) fn joint(&self, node: Node<'a, 'i>, here: &Pose) -> Result<Option<Joint>> {
        let (kind, bounded) = match self.source.required(node, "type")? {
            "fixed" => return Ok(None),
            "revolute" => (JointKind::Revolute, true),
            "continuous" => (JointKind::Revolute, false),
            "prismatic" => (JointKind::Prismatic, true),
            other => {
                let complaint =
                    format!("has the type '{}'; it must be revolute, continuous, prismatic or fixed", shown(other));
                return Err(self.at(node, &complaint));
            }
        };
        if children(node, "mimic").next().is_some() {
            return Err(self.at(node, "mimics another joint, which is not supported"));
        }
        let mut axis = DVec3::X;
        if let Some(a) = children(node, "axis").next() {
            axis = self.source.vector(a, "xyz")?.unwrap_or(axis);
        }
        let mut limits = JointLimits::NONE;
        let limit = children(node, "limit").next();
        if bounded {
            let limit = limit.ok_or_else(|| self.at(node, "has no <limit>"))?;
            let bound = |name: &str| Ok::<f64, Error>(self.source.number(limit, name)?.unwrap_or(0.0));
            limits.position = [bound("lower")?, bound("upper")?];
        }
        if let Some(limit) = limit {
            let most = |name: &str| Ok::<f64, Error>(self.source.number(limit, name)?.unwrap_or(f64::INFINITY));
            limits.velocity = most("velocity")?;
            limits.effort = most("effort")?;
            limits.acceleration = most("acceleration")?;
        }
        let (mut damping, mut friction) = (0.0, 0.0);
        if let Some(d) = children(node, "dynamics").next() {
            damping = self.source.number(d, "damping")?.unwrap_or(0.0);
            friction = self.source.number(d, "friction")?.unwrap_or(0.0);
        }
        let name = shown(self.source.required(node, "name")?);
        Ok(Some(Joint { name, kind, placement: *here, axis, limits, armature: 0.0, damping, friction }))
    }
}
