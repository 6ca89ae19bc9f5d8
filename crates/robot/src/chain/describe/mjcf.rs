//! Arms from MJCF, MuJoCo's format: the bodies from the world to a tip, with the settings of the
//! compiler and the default classes.
//!
//! An element that would change the dynamics and is not supported is an error.

use super::xml::{Source, children, place, shown};
use crate::Result;
use crate::chain::arm::{Joint, JointKind, JointLimits, Segment, SerialArm};
use crate::chain::frames::compose;
use crate::chain::mass::MassProperties;
use glam::{DMat3, DQuat, DVec3};
use roxmltree::Node;
use std::path::Path;
use trocar_core::Pose;

impl SerialArm {
    /// Reads the arm that ends in `tip`, a body or a site, from an MJCF file: joints, limits
    /// (`range`, `actuatorfrcrange`), armature, damping, friction, masses, gravity, and the
    /// keyframe `home` if it fits.
    ///
    /// The base is the world. Bodies that are welded to a link are part of it. Children of the
    /// tip's body are ignored: a payload takes their place. A link's axes are its body's, moved to
    /// the joint's anchor. MJCF has no limits of speed.
    ///
    /// # Errors
    /// A file that cannot be read or is not MJCF; an unknown tip; a body of the chain with more
    /// than one joint, with one that is neither hinge nor slide, or without `<inertial>`; another
    /// moving branch; springs, reference angles, gravity compensation, included files and generated
    /// bodies, which are not supported; and the errors of [`SerialArm::new`].
    pub fn from_mjcf(path: &Path, tip: &str) -> Result<Self> {
        let (source, text) = Source::read(path)?;
        let document = source.parse(&text, "mujoco")?;
        let root = document.root_element();
        if let Some(include) = root.descendants().find(|n| n.has_tag_name("include")) {
            return Err(source
                .fail(format!("{}: included files are not supported; save the model as one file", place(include))));
        }
        let compiler = Compiler::read(&source, root)?;
        Reader { source, root, compiler }.arm(tip)
    }
}

/// The settings of `<compiler>`.
pub(super) struct Compiler {
    degrees: bool,
    autolimits: bool,
    sequence: [u8; 3],
}

impl Compiler {
    pub(super) fn read(source: &Source<'_>, root: Node<'_, '_>) -> Result<Self> {
        let mut compiler = Self { degrees: true, autolimits: true, sequence: *b"xyz" };
        for node in children(root, "compiler") {
            let odd = |name: &str, value: &str| {
                Err(source.fail(format!("{}: {name}=\"{}\" is not supported", place(node), shown(value))))
            };
            for attribute in node.attributes() {
                let (name, value) = (attribute.name(), attribute.value());
                match (name, value) {
                    ("angle", "radian") => compiler.degrees = false,
                    ("angle", "degree") => compiler.degrees = true,
                    ("autolimits", "true") => compiler.autolimits = true,
                    ("autolimits", "false") => compiler.autolimits = false,
                    ("eulerseq", letters) => match <[u8; 3]>::try_from(letters.as_bytes()) {
                        Ok(s) if s.iter().all(|c| b"xyzXYZ".contains(c)) => compiler.sequence = s,
                        _ => return odd(name, value),
                    },
                    ("inertiafromgeom", "auto" | "false") | ("coordinate", "local") => {}
                    ("angle" | "autolimits" | "inertiafromgeom" | "coordinate", _) => return odd(name, value),
                    ("balanceinertia", "true") => return odd(name, value),
                    ("boundmass" | "boundinertia" | "settotalmass", _)
                        if source.number(node, name)?.is_some_and(|v| v > 0.0) =>
                    {
                        return odd(name, value);
                    }
                    _ => {}
                }
            }
        }
        Ok(compiler)
    }
}

pub(super) struct Reader<'p, 'a, 'i> {
    pub(super) source: Source<'p>,
    pub(super) root: Node<'a, 'i>,
    pub(super) compiler: Compiler,
}

impl<'a, 'i> Reader<'_, 'a, 'i> {
    fn arm(&self, tip: &str) -> Result<SerialArm> {
        let (chain, site) = self.chain(tip)?;
        let mut segments: Vec<Segment> = Vec::new();
        // Pose of the body in the axes of the last link, or of the world.
        let mut here = Pose::IDENTITY;
        for (k, &body) in chain.iter().enumerate() {
            here = compose(&here, &self.pose(body)?);
            let joints: Vec<_> =
                body.children().filter(|c| c.has_tag_name("joint") || c.has_tag_name("freejoint")).collect();
            match joints[..] {
                [] => {}
                [joint] => {
                    let (joint, anchor) = self.joint(joint, &here, segments.len())?;
                    segments.push(Segment {
                        link: name(body, "link", segments.len()),
                        joint,
                        mass: MassProperties::NONE,
                    });
                    here = Pose { translation: -anchor, ..Pose::IDENTITY };
                }
                _ => return Err(self.at(body, "has several joints; it must have one")),
            }
            let Some(segment) = segments.last_mut() else { continue };
            match self.mass(body)? {
                Some(mass) => segment.mass = segment.mass.joined(&mass.placed(&here)),
                None if !joints.is_empty() => {
                    return Err(self.at(body, "has no <inertial>; add its mass, centre and inertia"));
                }
                None => {}
            }
            if k + 1 < chain.len() {
                self.weld(body, chain[k + 1], &here, segment)?;
            }
        }
        if segments.is_empty() {
            return Err(self.source.fail(format!("there is no joint between the world and '{}'", shown(tip))));
        }
        let flange = match site {
            Some(site) => compose(&here, &self.pose(site)?),
            None => here,
        };
        let model = self.root.attribute("model").unwrap_or("mjcf");
        let explain = |e| self.source.explain(e);
        let mut arm = SerialArm::new(shown(model), segments, flange).map_err(explain)?;
        for option in children(self.root, "option") {
            if let Some(gravity) = self.source.vector(option, "gravity")? {
                arm = arm.with_gravity(gravity).map_err(explain)?;
            }
        }
        let keys = children(self.root, "keyframe").flat_map(|k| children(k, "key"));
        let home = keys.filter(|k| k.attribute("name") == Some("home")).find_map(|k| k.attribute("qpos"));
        // Keyframes of a larger model or outside the limits are ignored.
        let home = home.and_then(|text| text.split_whitespace().map(|w| w.parse().ok()).collect::<Option<Vec<f64>>>());
        if let Some(home) = home.filter(|h| arm.posture(h).is_ok()) {
            arm = arm.with_home(&home).map_err(explain)?;
        }
        Ok(arm)
    }

    pub(super) fn at(&self, node: Node<'_, '_>, complaint: &str) -> crate::Error {
        self.source.fail(format!("{} {complaint}", place(node)))
    }

    /// The bodies from the world to the tip, and the tip if it is a site.
    pub(super) fn chain(&self, tip: &str) -> Result<(Vec<Node<'a, 'i>>, Option<Node<'a, 'i>>)> {
        let find = |kind: &str| {
            let all = children(self.root, "worldbody").flat_map(|w| w.descendants());
            all.into_iter().find(|n| n.has_tag_name(kind) && n.attribute("name") == Some(tip))
        };
        let Some(end) = find("body").or_else(|| find("site")) else {
            let bodies = self.root.descendants().filter(|n| n.has_tag_name("body"));
            let names: Vec<_> = bodies.filter_map(|n| n.attribute("name")).take(20).map(shown).collect();
            let known = if names.is_empty() { "none".into() } else { names.join(", ") };
            return Err(self
                .source
                .fail(format!("there is no body or site '{}'; the bodies are: {known}", shown(tip))));
        };
        let site = end.has_tag_name("site").then_some(end);
        let mut chain = Vec::new();
        for node in end.ancestors() {
            if node.has_tag_name("worldbody") {
                break;
            }
            if node.has_tag_name("body") {
                chain.push(node);
            } else if Some(node) != site {
                return Err(self.at(node, "around bodies is not supported; save the model with MuJoCo first"));
            }
        }
        chain.reverse();
        Ok((chain, site))
    }

    /// Adds the bodies that are welded to `body`, outside the chain, to the segment.
    fn weld(&self, body: Node<'a, 'i>, next: Node<'a, 'i>, here: &Pose, segment: &mut Segment) -> Result<()> {
        // Open children, with their parent's pose.
        let mut open: Vec<(Node<'a, 'i>, Pose)> = body.children().filter(|c| *c != next).map(|c| (c, *here)).collect();
        while let Some((node, parent)) = open.pop() {
            match node.tag_name().name() {
                "frame" | "replicate" | "attach" | "composite" | "flexcomp" => {
                    return Err(self.at(node, "is not supported; save the model with MuJoCo first"));
                }
                "body" => {
                    if node.children().any(|c| c.has_tag_name("joint") || c.has_tag_name("freejoint")) {
                        return Err(self.at(node, "moves and is not between base and tip: the tree must not branch"));
                    }
                    let pose = compose(&parent, &self.pose(node)?);
                    if let Some(mass) = self.mass(node)? {
                        segment.mass = segment.mass.joined(&mass.placed(&pose));
                    }
                    open.extend(node.children().map(|c| (c, pose)));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// A body's mass properties in its own axes; `None` if it has none.
    fn mass(&self, body: Node<'a, 'i>) -> Result<Option<MassProperties>> {
        if self.source.number(body, "gravcomp")?.is_some_and(|g| g != 0.0) {
            return Err(self.at(body, "has gravcomp, which is not supported"));
        }
        let Some(node) = children(body, "inertial").next() else {
            if body.children().any(|c| c.has_tag_name("geom")) {
                return Err(self.at(body, "has no <inertial>, and masses of geoms are not supported; add one"));
            }
            return Ok(None);
        };
        let need = |name: &str| self.at(node, &format!("lacks '{name}'"));
        let mass = self.source.number(node, "mass")?.ok_or_else(|| need("mass"))?;
        let center = self.source.vector(node, "pos")?.ok_or_else(|| need("pos"))?;
        let inertia = if let Some([xx, yy, zz, xy, xz, yz]) = self.source.numbers::<6>(node, "fullinertia")? {
            DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz])
        } else {
            let diagonal =
                self.source.vector(node, "diaginertia")?.ok_or_else(|| need("diaginertia or fullinertia"))?;
            let r = DMat3::from_quat(self.rotation(node)?);
            r * DMat3::from_diagonal(diagonal) * r.transpose()
        };
        if mass <= 0.0 {
            return Err(self.at(node, &format!("has a mass of {mass} kg; it must be positive")));
        }
        // Rounding of the rotation makes it asymmetric in the last bit.
        let inertia = 0.5 * (inertia + inertia.transpose());
        Ok(Some(MassProperties { mass, center, inertia }))
    }

    pub(super) fn pose(&self, node: Node<'a, 'i>) -> Result<Pose> {
        let translation = self.pose_numbers::<3>(node, "pos")?.map_or(DVec3::ZERO, DVec3::from_array);
        Ok(Pose { rotation: self.rotation(node)?, translation })
    }

    /// Numbers of an element's pose; those of a geom may come from its default classes, which
    /// bodies and inertias do not have.
    fn pose_numbers<const N: usize>(&self, node: Node<'a, 'i>, name: &str) -> Result<Option<[f64; N]>> {
        if node.has_tag_name("geom") { self.numbers(node, name) } else { self.source.numbers(node, name) }
    }

    fn radians(&self, angle: f64) -> f64 {
        if self.compiler.degrees { angle.to_radians() } else { angle }
    }

    fn rotation(&self, node: Node<'a, 'i>) -> Result<DQuat> {
        let unit = |v: DVec3, name: &str| v.try_normalize().ok_or_else(|| self.at(node, &format!("has a zero {name}")));
        if let Some([w, x, y, z]) = self.pose_numbers::<4>(node, "quat")? {
            let q = DQuat::from_xyzw(x, y, z, w);
            let length = q.length();
            if !(length.is_finite() && length > 1e-10) {
                return Err(self.at(node, "has a quat of zero length"));
            }
            return Ok(q * (1.0 / length));
        }
        if let Some(angles) = self.pose_numbers::<3>(node, "euler")? {
            let mut q = DQuat::IDENTITY;
            for (letter, angle) in self.compiler.sequence.into_iter().zip(angles) {
                let axis = match letter.to_ascii_lowercase() {
                    b'x' => DVec3::X,
                    b'y' => DVec3::Y,
                    _ => DVec3::Z,
                };
                let turn = DQuat::from_axis_angle(axis, self.radians(angle));
                // Lower-case letters rotate about body axes, upper-case ones about parent axes.
                q = if letter.is_ascii_lowercase() { q * turn } else { turn * q };
            }
            return Ok(q);
        }
        if let Some([x, y, z, angle]) = self.pose_numbers::<4>(node, "axisangle")? {
            return Ok(DQuat::from_axis_angle(unit(DVec3::new(x, y, z), "axisangle")?, self.radians(angle)));
        }
        if let Some([a, b, c, d, e, f]) = self.pose_numbers::<6>(node, "xyaxes")? {
            let x = unit(DVec3::new(a, b, c), "xyaxes")?;
            let y = DVec3::new(d, e, f);
            let y = unit(y - x * x.dot(y), "y axis")?;
            return Ok(DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))).normalize());
        }
        if let Some(z) = self.pose_numbers::<3>(node, "zaxis")? {
            return Ok(DQuat::from_rotation_arc(DVec3::Z, unit(DVec3::from_array(z), "zaxis")?));
        }
        Ok(DQuat::IDENTITY)
    }

    /// An attribute of an element with defaults: its own, or that of its default class or of an
    /// enclosing class.
    pub(super) fn attribute(&self, joint: Node<'a, 'i>, name: &str) -> Result<Option<&'a str>> {
        if let Some(own) = joint.attribute(name) {
            return Ok(Some(own));
        }
        let around = || joint.ancestors().skip(1).find_map(|n| n.attribute("childclass"));
        let class = joint.attribute("class").or_else(around);
        let mut all = self.root.descendants().filter(|n| n.has_tag_name("default"));
        let kind = if joint.has_tag_name("freejoint") { "joint" } else { joint.tag_name().name() };
        let in_class = |d: Node<'a, 'i>| children(d, kind).filter_map(|j| j.attribute(name)).last();
        if let Some(class) = class {
            match all.find(|d| d.attribute("class") == Some(class)) {
                Some(d) => {
                    let chain = d.ancestors().take_while(|n| n.has_tag_name("default"));
                    if let Some(value) = chain.into_iter().find_map(in_class) {
                        return Ok(Some(value));
                    }
                }
                None if class == "main" => {}
                None => {
                    return Err(
                        self.at(joint, &format!("has the class '{}', which no <default> defines", shown(class)))
                    );
                }
            }
        }
        let top: Vec<_> = children(self.root, "default").collect();
        Ok(top.into_iter().rev().find_map(in_class))
    }

    pub(super) fn numbers<const N: usize>(&self, joint: Node<'a, 'i>, name: &str) -> Result<Option<[f64; N]>> {
        let text = self.attribute(joint, name)?;
        text.map(|t| self.source.parse_numbers(t, &place(joint), name)).transpose()
    }

    pub(super) fn number(&self, joint: Node<'a, 'i>, name: &str) -> Result<f64> {
        Ok(self.numbers::<1>(joint, name)?.map_or(0.0, |[v]| v))
    }

    /// The limits in the attribute `range`, if the attribute `word` enables them.
    fn range(&self, joint: Node<'a, 'i>, range: &str, word: &str) -> Result<Option<[f64; 2]>> {
        let limits = self.numbers::<2>(joint, range)?.filter(|r| *r != [0.0, 0.0]);
        match self.attribute(joint, word)?.unwrap_or("auto") {
            "false" => Ok(None),
            "auto" if self.compiler.autolimits || limits.is_none() => Ok(limits),
            "true" => limits.map(Some).ok_or_else(|| self.at(joint, &format!("is limited, but has no {range}"))),
            "auto" => Err(self.at(joint, &format!("has a {range}, but no {word}, which autolimits=\"false\" needs"))),
            other => Err(self.at(joint, &format!("has {word}=\"{}\"; it must be true, false or auto", shown(other)))),
        }
    }

    /// The joint of a body at `here`, and its anchor in the body's axes.
    pub(super) fn joint(&self, node: Node<'a, 'i>, here: &Pose, number: usize) -> Result<(Joint, DVec3)> {
        let kind = match self.attribute(node, "type")?.unwrap_or("hinge") {
            "hinge" if node.has_tag_name("joint") => JointKind::Revolute,
            "slide" => JointKind::Prismatic,
            other => {
                let complaint = format!("has the type '{}'; it must be hinge or slide", shown(other));
                return Err(self.at(node, &complaint));
            }
        };
        for unknown in ["stiffness", "ref"] {
            if self.number(node, unknown)? != 0.0 {
                return Err(self.at(node, &format!("has {unknown}, which is not supported")));
            }
        }
        let axis = DVec3::from_array(self.numbers::<3>(node, "axis")?.unwrap_or([0.0, 0.0, 1.0]));
        let anchor = DVec3::from_array(self.numbers::<3>(node, "pos")?.unwrap_or([0.0; 3]));
        let mut limits = JointLimits::NONE;
        if let Some(range) = self.range(node, "range", "limited")? {
            limits.position = if kind == JointKind::Revolute { range.map(|a| self.radians(a)) } else { range };
        }
        if let Some([low, high]) = self.range(node, "actuatorfrcrange", "actuatorfrclimited")? {
            if low != -high {
                return Err(self.at(node, "has an actuatorfrcrange that is not symmetric"));
            }
            limits.effort = high;
        }
        let joint = Joint {
            name: name(node, "joint", number),
            kind,
            placement: Pose { translation: here.transform(anchor), ..*here },
            axis,
            limits,
            armature: self.number(node, "armature")?,
            damping: self.number(node, "damping")?,
            friction: self.number(node, "frictionloss")?,
        };
        Ok((joint, anchor))
    }
}

fn name(node: Node<'_, '_>, kind: &str, number: usize) -> String {
    node.attribute("name").map_or_else(|| format!("{kind}{}", number + 1), shown)
}
