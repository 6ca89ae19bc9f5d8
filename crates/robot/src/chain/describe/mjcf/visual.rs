//! What an MJCF file's bodies look like: the geoms of groups 0 to 2, which MuJoCo's viewer shows, of each body from the world to the tip and of what is welded to them.

use super::super::visual::{PLAIN, Visual, VisualShape, opaque};
use super::super::xml::{Source, children, place, shown};
use super::{Compiler, Reader};
use crate::Result;
use crate::chain::frames::compose;
use glam::{DQuat, DVec3};
use roxmltree::Node;
use std::path::{Path, PathBuf};
use trocar_core::Pose;

/// Groups of geoms up to this one are seen.
const SEEN: f64 = 2.0;

/// What the arm that ends in `tip` looks like, as [`SerialArm::from_mjcf`](crate::chain::SerialArm::from_mjcf) reads it: of the base first, then of each link that a joint moves. Without `tip` it ends at
/// the last body of the file that a joint moves.
///
/// # Errors
/// As [`SerialArm::from_mjcf`](crate::chain::SerialArm::from_mjcf); a mesh that no asset is, a geom whose size is missing.
pub fn mjcf_visuals(path: &Path, tip: Option<&str>) -> Result<Vec<Vec<Visual>>> {
    let (source, text) = Source::read(path)?;
    let document = source.parse(&text, "mujoco")?;
    let root = document.root_element();
    let compiler = Compiler::read(&source, root)?;
    let reader = Reader { source, root, compiler };
    let moved = |n: &Node<'_, '_>| n.has_tag_name("body") && children(*n, "joint").next().is_some();
    let last = || root.descendants().filter(moved).filter_map(|n| n.attribute("name")).next_back();
    let tip = tip.or_else(last).ok_or_else(|| source.fail("no joint moves a body that has a name"))?;
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
            // Bodies that are still to be looked at, with their poses. What hangs on the tip's body is left out.
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

    /// What a geom of a body at `here` shows; `None` for one that is not seen.
    fn visual(&self, body: Node<'a, 'i>, geom: Node<'a, 'i>, here: &Pose) -> Result<Option<Visual>> {
        if self.number(geom, "group")? > SEEN {
            return Ok(None);
        }
        let mesh = self.attribute(geom, "mesh")?;
        let kind = self.attribute(geom, "type")?.unwrap_or(if mesh.is_some() { "mesh" } else { "sphere" });
        // Numbers that a shape has no use for may follow, as MuJoCo lets them.
        let size = |count: usize| -> Result<Vec<f64>> {
            let text = self.attribute(geom, "size")?.unwrap_or_default();
            let number = |word| self.source.parse_numbers::<1>(word, &place(geom), "size").map(|[v]| v);
            let all = text.split_whitespace().map(number).collect::<Result<Vec<_>>>()?;
            if !(count..=3).contains(&all.len()) || all[..count].iter().any(|v| *v <= 0.0) {
                return Err(self.at(geom, &format!("needs a size of {count} positive numbers, 3 with unused ones")));
            }
            Ok(all)
        };
        let mut turns = Vec::new();
        for key in ["quat", "euler", "axisangle", "xyaxes", "zaxis"] {
            turns.extend(self.attribute(geom, key)?.map(|_| key));
        }
        if turns.len() > 1 {
            // Which of them counts is not plain where one is of a default class.
            let turns = turns.join(" and ");
            return Err(self.at(geom, &format!("has {turns}, of its own or of its default classes; must have one")));
        }
        let mut pose = self.pose(geom)?;
        // The length of what is told by its ends.
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
            // Ellipsoids, planes and fields of height are no part of any arm that is known.
            _ => return Ok(None),
        };
        let Some(color) = self.color(geom)? else { return Ok(None) };
        let link = body.attribute("name").map_or_else(|| place(body), shown);
        Ok(Some(Visual { link, shape, pose: compose(here, &pose), color }))
    }

    /// A geom's colour: its own, or its material's; `None` if it cannot be seen.
    fn color(&self, geom: Node<'a, 'i>) -> Result<Option<[f64; 3]>> {
        if let Some(own) = self.numbers::<4>(geom, "rgba")? {
            return Ok(opaque(own));
        }
        let Some(name) = self.attribute(geom, "material")? else { return Ok(Some(PLAIN)) };
        let material = self.asset("material", name);
        let rgba = material.map(|m| self.numbers::<4>(m, "rgba")).transpose()?.flatten();
        Ok(rgba.map_or(Some(PLAIN), opaque))
    }

    /// The asset of a kind by its name, which is its file's stem where it has none.
    fn asset(&self, kind: &str, name: &str) -> Option<Node<'a, 'i>> {
        let stem = |n: Node<'a, 'i>| Path::new(n.attribute("file")?).file_stem()?.to_str().map(str::to_owned);
        let own = |n: Node<'a, 'i>| n.attribute("name").map(str::to_owned).or_else(|| stem(n));
        let mut all = children(self.root, "asset").flat_map(|a| a.children()).filter(|n| n.has_tag_name(kind));
        all.find(|n| own(*n).as_deref() == Some(name))
    }

    fn mesh(&self, geom: Node<'a, 'i>, name: Option<&str>) -> Result<VisualShape> {
        let name = name.ok_or_else(|| self.at(geom, "is a mesh and does not say which"))?;
        let unknown = || self.at(geom, &format!("shows the mesh '{}', which no <asset> has", shown(name)));
        let asset = self.asset("mesh", name).ok_or_else(unknown)?;
        let file = asset.attribute("file").ok_or_else(|| self.at(asset, "has no file, which is not understood"))?;
        for unknown in ["refpos", "refquat"] {
            if self.attribute(asset, unknown)?.is_some() {
                return Err(self.at(asset, &format!("has {unknown}, which is not understood")));
            }
        }
        let scale = self.numbers::<3>(asset, "scale")?.map_or(DVec3::ONE, DVec3::from_array);
        Ok(VisualShape::Mesh { file: self.folder().join(file), scale })
    }

    /// Where mesh files are.
    fn folder(&self) -> PathBuf {
        let said = |key: &str| children(self.root, "compiler").filter_map(|c| c.attribute(key)).last();
        let folder = self.source.path.parent().unwrap_or(Path::new(""));
        folder.join(said("meshdir").or_else(|| said("assetdir")).unwrap_or_default())
    }
}
