//! Visual shapes in URDF: `<visual>` of each link from base to tip, and of links fixed to them.

use super::urdf::Reader;
use super::visual::{DEFAULT_COLOR, Visual, VisualShape, opaque};
use super::xml::{Source, children, place, shown};
use crate::Result;
use crate::chain::frames::compose;
use glam::DVec3;
use roxmltree::Node;
use std::path::{Component, Path, PathBuf};
use trocar_core::Pose;

/// The visual shapes of the arm between `base` and `tip` of a URDF file, as
/// [`SerialArm::from_urdf`](crate::chain::SerialArm::from_urdf) reads it: first those of the base,
/// then those of each moving link. `package://NAME/...` is searched in folders NAME beside the file
/// or above it.
///
/// # Errors
/// As [`SerialArm::from_urdf`](crate::chain::SerialArm::from_urdf); an unsupported shape, a missing
/// package, a path outside its package.
pub fn urdf_visuals(path: &Path, base: Option<&str>, tip: Option<&str>) -> Result<Vec<Vec<Visual>>> {
    let (source, text) = Source::read(path)?;
    let document = source.parse(&text, "robot")?;
    let reader = Reader::new(source, document.root_element())?;
    let joints = reader.joints(base, tip)?;
    let mut links = vec![Vec::new()];
    let mut here = Pose::IDENTITY;
    if let Some(first) = joints.first() {
        reader.fixed_visuals(reader.end(*first, "parent")?, Some(*first), &here, &mut links[0])?;
    }
    for (k, &node) in joints.iter().enumerate() {
        here = compose(&here, &reader.origin(node)?);
        if reader.joint(node, &here)?.is_some() {
            links.push(Vec::new());
            here = Pose::IDENTITY;
        }
        let child = reader.end(node, "child")?;
        let Some(of) = links.last_mut() else { continue };
        match joints.get(k + 1) {
            Some(next) => reader.fixed_visuals(child, Some(*next), &here, of)?,
            None => reader.visuals(child, &here, of)?,
        }
    }
    Ok(links)
}

impl<'a, 'i> Reader<'_, 'a, 'i> {
    /// Adds the shapes of a link, and of links fixed to it except by the joint `next`.
    fn fixed_visuals(
        &self,
        link: &'a str,
        next: Option<Node<'a, 'i>>,
        here: &Pose,
        into: &mut Vec<Visual>,
    ) -> Result<()> {
        let mut open = vec![(link, *here)];
        let mut count = 0;
        while let Some((link, pose)) = open.pop() {
            self.visuals(link, &pose, into)?;
            for &joint in self.by_parent.get(link).into_iter().flatten().filter(|j| Some(**j) != next) {
                // More joints than links are a loop.
                count += 1;
                if joint.attribute("type") == Some("fixed") && count <= self.links.len() {
                    open.push((self.end(joint, "child")?, compose(&pose, &self.origin(joint)?)));
                }
            }
        }
        Ok(())
    }

    fn visuals(&self, name: &'a str, here: &Pose, into: &mut Vec<Visual>) -> Result<()> {
        let Some(&link) = self.links.get(name) else { return Ok(()) };
        for visual in children(link, "visual") {
            let at = |complaint: String| self.source.fail(format!("link '{}': {complaint}", shown(name)));
            let shape = children(visual, "geometry").next().and_then(|g| g.children().find(Node::is_element));
            let shape = shape.ok_or_else(|| at("a <visual> has no shape in its <geometry>".to_owned()))?;
            let number = |key: &str| -> Result<f64> {
                let value = self.source.number(shape, key)?;
                value.filter(|v| *v > 0.0).ok_or_else(|| at(format!("{} needs a positive {key}", place(shape))))
            };
            let shape = match shape.tag_name().name() {
                "mesh" => {
                    let file = self.file(self.source.required(shape, "filename")?).map_err(at)?;
                    VisualShape::Mesh { file, scale: self.source.vector(shape, "scale")?.unwrap_or(DVec3::ONE) }
                }
                "box" => {
                    let size = self.source.vector(shape, "size")?;
                    VisualShape::Block(0.5 * size.ok_or_else(|| at("a <box> has no size".to_owned()))?.abs())
                }
                "cylinder" => VisualShape::Cylinder { radius: number("radius")?, half: 0.5 * number("length")? },
                "sphere" => VisualShape::Ball(number("radius")?),
                other => {
                    return Err(at(format!(
                        "a <visual> has a <{}>; it must have a mesh, box, cylinder or sphere",
                        shown(other)
                    )));
                }
            };
            let Some(color) = self.color(visual)? else { continue };
            into.push(Visual { link: shown(name), shape, pose: compose(here, &self.origin(visual)?), color });
        }
        Ok(())
    }

    /// The colour of a visual: its own, or that of its named material; `None` if it is fully
    /// transparent.
    fn color(&self, visual: Node<'a, 'i>) -> Result<Option<[f64; 3]>> {
        let Some(own) = children(visual, "material").next() else { return Ok(Some(DEFAULT_COLOR)) };
        let of = |material: Node<'a, 'i>| children(material, "color").next();
        let name = own.attribute("name");
        let named = || children(self.root, "material").find(|m| name.is_some() && m.attribute("name") == name);
        let Some(node) = of(own).or_else(|| named().and_then(of)) else { return Ok(Some(DEFAULT_COLOR)) };
        Ok(self.source.numbers::<4>(node, "rgba")?.map_or(Some(DEFAULT_COLOR), opaque))
    }

    fn file(&self, name: &str) -> std::result::Result<PathBuf, String> {
        let folder = self.source.path.parent().unwrap_or(Path::new(""));
        let Some(inside) = name.strip_prefix("package://") else {
            return Ok(folder.join(name.strip_prefix("file://").unwrap_or(name)));
        };
        let (package, rest) = inside.split_once('/').unwrap_or((inside, ""));
        // Only paths inside the package are allowed.
        let plain = Path::new(inside).components().all(|c| matches!(c, Component::Normal(_)));
        if package.is_empty() || rest.starts_with('/') || !plain {
            let right = "it must be package://NAME/PATH with a PATH inside the package, without '..'";
            return Err(format!("its mesh is '{}'; {right}", shown(name)));
        }
        let full = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
        let found = full.ancestors().find(|f| f.join(package).is_dir());
        found.map(|f| f.join(inside)).ok_or_else(|| {
            format!("its mesh is in the package '{}', which has no folder beside the file or above it", shown(package))
        })
    }
}
