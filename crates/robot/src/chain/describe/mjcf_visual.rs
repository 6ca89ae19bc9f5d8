//! Visual shapes in MJCF: the geoms of groups 0 to 2, which MuJoCo's viewer shows, of each body
//! from the world to the tip and of bodies welded to them.

use super::mjcf::{Compiler, Reader};
use super::visual::{DEFAULT_COLOR, Visual, VisualShape, opaque};
use super::xml::{Source, children, place, shown};
use crate::Result;
use crate::chain::frames::compose;
use glam::{DQuat, DVec3};
use roxmltree::Node;
use std::path::{Path, PathBuf};
use trocar_core::Pose;

/// Last group of visible geoms.
const MAX_VISIBLE_GROUP: f64 = 2.0;

/// The visual shapes of the arm that ends in `tip`, as
/// [`SerialArm::from_mjcf`](crate::chain::SerialArm::from_mjcf) reads it: first those of the base,
/// then those of each moving link. Without `tip` it ends at the last moving body of the file.
///
/// # Errors
/// As [`SerialArm::from_mjcf`](crate::chain::SerialArm::from_mjcf); a mesh without an asset, a geom
/// without a size.
pub fn mjcf_visuals(path: &Path, tip: Option<&str>) -> Result<Vec<Vec<Visual>>> {
    let (source, text) = Source::read(path)?;
    let document = source.parse(&text, "mujoco")?;
    let root = document.root_element();
    let compiler = Compiler::read(&source, root)?;
    let reader = Reader { source, root, compiler };
    let moved = |n: &Node<'_, '_>| n.has_tag_name("body") && children(*n, "joint").next().is_some();
    let last = || root.descendants().filter(moved).filter_map(|n| n.attribute("name")).next_back();
    let tip = tip.or_else(last).ok_or_else(|| source.fail("there is no moving body with a name"))?;
    reader.visuals(tip)
}

impl<'a, 'i> Reader<'_, 'a, 'i> {
    fn visuals(&self, tip: &str) -> Result<Vec<Vec<Visual>>> {
        let (chain, _) = self.chain(tip)?;
        let mut links = vec![Vec::new()];
        let mut here = Pose::IDENTITY;
        for (k, &body) in chain.iter().enumerate() {
            here = compose(&here, &self.pose(body)?);
            if let Some(joint) = children(body, "joint").next() {
                let (_, anchor) = self.joint(joint, &here, links.len())?;
                here = Pose { translation: -anchor, ..Pose::IDENTITY };
                links.push(Vec::new());
            }
            let Some(of) = links.last_mut() else { continue };
            // Open bodies, with their poses. Children of the tip's body are ignored.
            let mut open = vec![(body, here)];
            while let Some((node, pose)) = open.pop() {
                for geom in children(node, "geom") {
                    of.extend(self.visual(node, geom, &pose)?);
                }
                if k + 1 == chain.len() {
                    continue;
                }
                for child in children(node, "body").filter(|c| *c != chain[k + 1]) {
                    if children(child, "joint").next().is_none() && children(child, "freejoint").next().is_none() {
                        open.push((child, compose(&pose, &self.pose(child)?)));
                    }
                }
            }
        }
        Ok(links)
    }

    /// The shape of a geom of a body at `here`; `None` for an invisible one.
    fn visual(&self, body: Node<'a, 'i>, geom: Node<'a, 'i>, here: &Pose) -> Result<Option<Visual>> {
        if self.number(geom, "group")? > MAX_VISIBLE_GROUP {
            return Ok(None);
        }
        let mesh = self.attribute(geom, "mesh")?;
        let kind = self.attribute(geom, "type")?.unwrap_or(if mesh.is_some() { "mesh" } else { "sphere" });
        // Unused numbers may follow, as in MuJoCo.
        let size = |count: usize| -> Result<Vec<f64>> {
            let text = self.attribute(geom, "size")?.unwrap_or_default();
            let number = |word| self.source.parse_numbers::<1>(word, &place(geom), "size").map(|[v]| v);
            let all = text.split_whitespace().map(number).collect::<Result<Vec<_>>>()?;
            if !(count..=3).contains(&all.len()) || all[..count].iter().any(|v| *v <= 0.0) {
                return Err(self.at(geom, &format!("needs a size of {count} positive numbers; up to 3 are allowed")));
            }
            Ok(all)
        };
        let mut turns = Vec::new();
        for key in ["quat", "euler", "axisangle", "xyaxes", "zaxis"] {
            turns.extend(self.attribute(geom, key)?.map(|_| key));
        }
        if turns.len() > 1 {
            // Their precedence is unclear if one comes from a default class.
            let turns = turns.join(" and ");
            return Err(self.at(geom, &format!("has {turns}, of its own or of its default classes; it must have one")));
        }
        let mut pose = self.pose(geom)?;
        // Half the length of a shape that is given by its ends.
        let mut between = None;
        if let Some([a, b, c, d, e, f]) = self.numbers::<6>(geom, "fromto")? {
            let (from, to) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
            let rotation = DQuat::from_rotation_arc(DVec3::Z, (to - from).normalize_or(DVec3::Z));
            pose = Pose { rotation, translation: 0.5 * (from + to) };
            between = Some(0.5 * from.distance(to));
        }
        let long = |between: Option<f64>| -> Result<(f64, f64)> {
            let all = size(if between.is_some() { 1 } else { 2 })?;
            Ok((all[0], between.unwrap_or_else(|| all.get(1).copied().unwrap_or(all[0]))))
        };
        let shape = match kind {
            "mesh" => self.mesh(geom, mesh)?,
            "box" => {
                let all = size(3)?;
                VisualShape::Block(DVec3::new(all[0], all[1], all[2]))
            }
            "sphere" => VisualShape::Ball(size(1)?[0]),
            "cylinder" => {
                let (radius, half) = long(between)?;
                VisualShape::Cylinder { radius, half }
            }
            "capsule" => {
                let (radius, half) = long(between)?;
                VisualShape::Capsule { radius, half }
            }
            // Ellipsoids, planes and height fields are ignored: known arms have none.
            _ => return Ok(None),
        };
        let Some(color) = self.color(geom)? else { return Ok(None) };
        let link = body.attribute("name").map_or_else(|| place(body), shown);
        Ok(Some(Visual { link, shape, pose: compose(here, &pose), color }))
    }

    /// A geom's colour: its own, or its material's; `None` if it is fully transparent.
    fn color(&self, geom: Node<'a, 'i>) -> Result<Option<[f64; 3]>> {
        if let Some(own) = self.numbers::<4>(geom, "rgba")? {
            return Ok(opaque(own));
        }
        let Some(name) = self.attribute(geom, "material")? else { return Ok(Some(DEFAULT_COLOR)) };
        let material = self.asset("material", name);
        let rgba = material.map(|m| self.numbers::<4>(m, "rgba")).transpose()?.flatten();
        Ok(rgba.map_or(Some(DEFAULT_COLOR), opaque))
    }

    /// The asset of a kind by its name, by default the stem of its file.
    fn asset(&self, kind: &str, name: &str) -> Option<Node<'a, 'i>> {
        let stem = |n: Node<'a, 'i>| Path::new(n.attribute("file")?).file_stem()?.to_str().map(str::to_owned);
        let own = |n: Node<'a, 'i>| n.attribute("name").map(str::to_owned).or_else(|| stem(n));
        let mut all = children(self.root, "asset").flat_map(|a| a.children()).filter(|n| n.has_tag_name(kind));
        all.find(|n| own(*n).as_deref() == Some(name))
    }

    fn mesh(&self, geom: Node<'a, 'i>, name: Option<&str>) -> Result<VisualShape> {
        let name = name.ok_or_else(|| self.at(geom, "has the type mesh and names no mesh"))?;
        let unknown = || self.at(geom, &format!("has the mesh '{}', which is in no <asset>", shown(name)));
        let asset = self.asset("mesh", name).ok_or_else(unknown)?;
        let file = asset.attribute("file").ok_or_else(|| self.at(asset, "has no file, which is not supported"))?;
        for unknown in ["refpos", "refquat"] {
            if self.attribute(asset, unknown)?.is_some() {
                return Err(self.at(asset, &format!("has {unknown}, which is not supported")));
            }
        }
        let scale = self.numbers::<3>(asset, "scale")?.map_or(DVec3::ONE, DVec3::from_array);
        Ok(VisualShape::Mesh { file: self.folder().join(file), scale })
    }

    /// The folder of mesh files.
    fn folder(&self) -> PathBuf {
        let said = |key: &str| children(self.root, "compiler").filter_map(|c| c.attribute(key)).last();
        let folder = self.source.path.parent().unwrap_or(Path::new(""));
        folder.join(said("meshdir").or_else(|| said("assetdir")).unwrap_or_default())
    }
}
