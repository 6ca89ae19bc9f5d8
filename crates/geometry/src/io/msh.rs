//! Gmsh tetrahedral meshes: versions 2.2 and 4.1, text and binary.
//!
//! Format: Gmsh reference manual, "Gmsh file formats". The two versions and the two encodings hold
//! the same numbers in almost the same order, so one parser reads them all from a source of numbers
//! that knows the encoding.

mod groups;

use super::{Parsed, bad, write};
use crate::{Error, Result, TetMesh};
use glam::DVec3;
use std::path::Path;

/// Gmsh's number for the four-node tetrahedron.
const TET: i64 = 4;
/// Gmsh's number for the ten-node tetrahedron.
const CURVED_TET: i64 = 11;
/// Nodes of Gmsh's element types, from type 1 on.
const NODES: [usize; 31] =
    [2, 3, 4, 4, 8, 6, 5, 3, 6, 9, 10, 27, 18, 14, 1, 8, 20, 15, 13, 9, 10, 12, 15, 15, 21, 4, 5, 6, 20, 35, 56];
/// An element thinner than this has no volume: volume by the cube of its longest edge.
const NO_VOLUME: f64 = 1e-12;

/// Reads the tetrahedra of a Gmsh `.msh` file (2.2 or 4.1, text or binary little-endian), in
/// metres. Turns negative elements; refuses an element without volume. Nodes that no tetrahedron
/// uses are left out, the others keep their order.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read; [`Error::Parse`] if it is not such a file, is damaged
/// or cut short, or has no tetrahedra, second-order ones, one without volume, or a coordinate that
/// is not finite.
pub fn read_msh(path: &Path) -> Result<TetMesh> {
    let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.into(), source })?;
    parse(&bytes).map_err(|reason| bad(path, reason))
}

/// Reads the tetrahedra of a Gmsh `.msh` file group by group: of each physical group with a name,
/// name and mesh, by the groups' numbers, and before them without a name what is in none. Nodes
/// that groups share are in each of them. Otherwise as [`read_msh`].
///
/// # Errors
/// As [`read_msh`].
pub fn read_msh_groups(path: &Path) -> Result<Vec<(Option<String>, TetMesh)>> {
    let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.into(), source })?;
    contents(&bytes).and_then(groups::split).map_err(|reason| bad(path, reason))
}

/// Writes a Gmsh 4.1 binary `.msh`, in metres.
///
/// # Errors
/// [`Error::Mesh`] if an element uses a node that is not there; [`Error::Io`] if the file cannot be
/// written.
pub fn write_msh(path: &Path, mesh: &TetMesh) -> Result<()> {
    let nodes = mesh.vertices.len() as u64;
    if let Some(t) = mesh.tets.iter().position(|tet| tet.iter().any(|&v| u64::from(v) >= nodes)) {
        return Err(Error::Mesh(format!("tetrahedron {t} uses nodes {:?}, but there are only {nodes}", mesh.tets[t])));
    }
    let mut bytes = b"$MeshFormat\n4.1 1 8\n".to_vec();
    let ints = |bytes: &mut Vec<u8>, values: &[i32]| bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    let sizes = |bytes: &mut Vec<u8>, values: &[u64]| bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    ints(&mut bytes, &[1]);
    bytes.extend(b"\n$EndMeshFormat\n$Nodes\n");
    sizes(&mut bytes, &[1, nodes, 1, nodes]);
    ints(&mut bytes, &[3, 1, 0]);
    sizes(&mut bytes, &[nodes]);
    (1..=nodes).for_each(|tag| sizes(&mut bytes, &[tag]));
    bytes.extend(mesh.vertices.iter().flat_map(|v| v.to_array()).flat_map(f64::to_le_bytes));
    bytes.extend(b"\n$EndNodes\n$Elements\n");
    let tets = mesh.tets.len() as u64;
    sizes(&mut bytes, &[1, tets, 1, tets]);
    ints(&mut bytes, &[3, 1, TET as i32]);
    sizes(&mut bytes, &[tets]);
    for (tag, tet) in (1..).zip(&mesh.tets) {
        sizes(&mut bytes, &[tag]);
        tet.iter().for_each(|&v| sizes(&mut bytes, &[u64::from(v) + 1]));
    }
    bytes.extend(b"\n$EndElements\n");
    write(path, &bytes)
}

/// What the file holds, by the file's own tags.
#[derive(Default)]
struct Content {
    nodes: Vec<(u64, DVec3)>,
    tets: Vec<(u64, [u64; 4])>,
    /// For each of `tets`, its physical group; 0 for none.
    group_of: Vec<i64>,
    /// Physical groups of volumes: number and name.
    groups: Vec<(i64, String)>,
    /// Version 4.1: volumes and their first physical group.
    volumes: Vec<(i64, i64)>,
}

fn parse(bytes: &[u8]) -> Parsed<TetMesh> {
    assemble(&contents(bytes)?)
}

fn contents(bytes: &[u8]) -> Parsed<Content> {
    let mut source = Source { bytes, at: 0, binary: false };
    if source.line() != b"$MeshFormat" {
        return Err("a Gmsh file starts with $MeshFormat".into());
    }
    let version = source.word()?.to_string();
    let encoding = source.word()?.to_string();
    let old = version == "2.2" || version == "2";
    if !old && version != "4.1" {
        return Err(format!("Gmsh format {version} is not supported; save as 4.1 or 2.2"));
    }
    let word_size = source.word()?;
    if word_size != "8" || !matches!(encoding.as_str(), "0" | "1") {
        return Err(format!("encoding {encoding} with numbers of {word_size} bytes; supported are 0 and 1 with 8"));
    }
    source.line();
    source.binary = encoding == "1";
    if source.binary && source.int()? != 1 {
        return Err("the binary numbers are not little-endian".into());
    }
    source.skip_past("$EndMeshFormat")?;

    let mut content = Content::default();
    let (mut seen_nodes, mut seen_elements) = (false, false);
    while let Some(section) = source.section() {
        match section.as_str() {
            "$PhysicalNames" => groups::read_names(&mut source, &mut content)?,
            "$Entities" if !old => groups::read_volumes(&mut source, &mut content)?,
            "$Nodes" if old => read_nodes_2(&mut source, &mut content)?,
            "$Nodes" => read_nodes_4(&mut source, &mut content)?,
            "$Elements" if old => read_elements_2(&mut source, &mut content)?,
            "$Elements" => read_elements_4(&mut source, &mut content)?,
            _ => {}
        }
        seen_nodes |= section == "$Nodes";
        seen_elements |= section == "$Elements";
        source.skip_past(&section.replacen('$', "$End", 1))?;
    }
    match (seen_nodes, seen_elements) {
        (true, true) => Ok(content),
        (false, _) => Err("the file has no section $Nodes".into()),
        (_, false) => Err("the file has no section $Elements".into()),
    }
}

fn read_nodes_2(source: &mut Source<'_>, content: &mut Content) -> Parsed<()> {
    let count = source.text_count()?;
    source.expect(count, if source.binary { 28 } else { 8 }, "nodes")?;
    for _ in 0..count {
        let tag = source.tag_2()?;
        content.nodes.push((tag, source.point()?));
    }
    Ok(())
}

fn read_nodes_4(source: &mut Source<'_>, content: &mut Content) -> Parsed<()> {
    let (blocks, total) = (source.size()?, source.size()?);
    source.expect(total, if source.binary { 32 } else { 8 }, "nodes")?;
    let _tag_range = (source.size()?, source.size()?);
    for _ in 0..blocks {
        let (dimension, _entity, parametric, count) = (source.int()?, source.int()?, source.int()?, source.size()?);
        source.expect(count, if source.binary { 32 } else { 8 }, "nodes")?;
        let tags = (0..count).map(|_| source.size()).collect::<Parsed<Vec<u64>>>()?;
        for tag in tags {
            content.nodes.push((tag, source.point()?));
            let parameters = if parametric == 0 { 0 } else { dimension.clamp(0, 3) };
            for _ in 0..parameters {
                source.real()?;
            }
        }
    }
    if content.nodes.len() as u64 != total {
        return Err(format!("$Nodes promises {total} nodes and holds {}", content.nodes.len()));
    }
    Ok(())
}

fn read_elements_2(source: &mut Source<'_>, content: &mut Content) -> Parsed<()> {
    let count = source.text_count()?;
    source.expect(count, if source.binary { 8 } else { 6 }, "elements")?;
    let mut read = 0;
    while read < count {
        // Text has tag, type and number of tags for each element; binary has them once for a run of
        // elements.
        let (tag, kind, run, tags) = if source.binary {
            let (kind, run, tags) = (source.int()?, source.tag_2()?, source.tag_2()?);
            (None, kind, run, tags)
        } else {
            let tag = source.tag_2()?;
            let (kind, tags) = (source.int()?, source.tag_2()?);
            (Some(tag), kind, 1, tags)
        };
        if run == 0 || run > count - read {
            return Err(format!("$Elements promises {count} elements, but a run of {run} follows the first {read}"));
        }
        let corners = node_count(kind)?;
        for _ in 0..run {
            let tag = tag.map_or_else(|| source.tag_2(), Ok)?;
            let mut group = 0;
            for k in 0..tags {
                let tag = source.int()?;
                // The first is the physical group.
                group = if k == 0 { tag } else { group };
            }
            read_element(content, kind, corners, (tag, group), || source.tag_2())?;
        }
        read += run;
    }
    Ok(())
}

fn read_elements_4(source: &mut Source<'_>, content: &mut Content) -> Parsed<()> {
    let (blocks, total) = (source.size()?, source.size()?);
    source.expect(total, if source.binary { 16 } else { 4 }, "elements")?;
    let _tag_range = (source.size()?, source.size()?);
    let mut read = 0;
    for _ in 0..blocks {
        let (_dimension, entity, kind, count) = (source.int()?, source.int()?, source.int()?, source.size()?);
        source.expect(count, if source.binary { 16 } else { 4 }, "elements")?;
        let corners = node_count(kind)?;
        let group = content.volumes.iter().find(|v| v.0 == entity).map_or(0, |v| v.1);
        for _ in 0..count {
            let tag = source.size()?;
            read_element(content, kind, corners, (tag, group), || source.size())?;
        }
        read += count;
    }
    if read != total {
        return Err(format!("$Elements promises {total} elements and holds {read}"));
    }
    Ok(())
}

fn node_count(kind: i64) -> Parsed<usize> {
    if kind == CURVED_TET {
        return Err("the tetrahedra are of second order (10 nodes); save them with 4 nodes".into());
    }
    let known = usize::try_from(kind).ok().and_then(|k| NODES.get(k.wrapping_sub(1)));
    known.copied().ok_or_else(|| format!("element type {kind} is not known"))
}

fn read_element(
    content: &mut Content,
    kind: i64,
    corners: usize,
    (tag, group): (u64, i64),
    mut node: impl FnMut() -> Parsed<u64>,
) -> Parsed<()> {
    if kind == TET {
        content.tets.push((tag, [node()?, node()?, node()?, node()?]));
        content.group_of.push(group);
    } else {
        for _ in 0..corners {
            node()?;
        }
    }
    Ok(())
}

/// From tags to indices, and the checks that a body must pass.
fn assemble(content: &Content) -> Parsed<TetMesh> {
    if content.tets.is_empty() {
        return Err("the file has no tetrahedra".into());
    }
    if let Some((tag, p)) = content.nodes.iter().find(|(_, p)| !p.is_finite()) {
        return Err(format!("node {tag} is {p}; coordinates must be finite"));
    }
    let mut by_tag: Vec<(u64, usize)> = content.nodes.iter().enumerate().map(|(i, n)| (n.0, i)).collect();
    by_tag.sort_unstable();
    if let Some(pair) = by_tag.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(format!("node {} appears twice", pair[0].0));
    }
    let mut tets = Vec::with_capacity(content.tets.len());
    let mut used = vec![false; content.nodes.len()];
    for &(tag, nodes) in &content.tets {
        let mut tet = [0; 4];
        for (slot, node) in tet.iter_mut().zip(nodes) {
            let found = by_tag.binary_search_by_key(&node, |entry| entry.0);
            *slot = by_tag[found.map_err(|_| format!("element {tag} uses node {node}, which is not in the file"))?].1;
            used[*slot] = true;
        }
        let [a, b, c, d] = tet.map(|i| content.nodes[i].1);
        let volume = (b - a).cross(c - a).dot(d - a) / 6.0;
        let edges = [b - a, c - a, d - a, c - b, d - b, d - c];
        let longest = edges.iter().map(|e| e.length_squared()).fold(0.0, f64::max).sqrt();
        if volume.abs() <= NO_VOLUME * longest.powi(3) {
            return Err(format!("element {tag} (nodes {nodes:?}) has no volume"));
        }
        if volume < 0.0 {
            tet.swap(2, 3);
        }
        tets.push(tet);
    }
    let mut mesh = TetMesh::default();
    let mut renumbered = vec![0; used.len()];
    for i in 0..used.len() {
        if used[i] {
            renumbered[i] = u32::try_from(mesh.vertices.len()).map_err(|_| "too many nodes".to_string())?;
            mesh.vertices.push(content.nodes[i].1);
        }
    }
    mesh.tets = tets.into_iter().map(|tet| tet.map(|i| renumbered[i])).collect();
    Ok(mesh)
}

/// The file's bytes as numbers.
struct Source<'a> {
    bytes: &'a [u8],
    at: usize,
    binary: bool,
}

impl<'a> Source<'a> {
    /// The rest of the current line, without white space around it.
    fn line(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|&b| b == b'\n');
        self.at += end.map_or(rest.len(), |e| e + 1);
        rest[..end.unwrap_or(rest.len())].trim_ascii()
    }

    /// The name of the next section, `$Name`; `None` at the end of the file.
    fn section(&mut self) -> Option<String> {
        while self.at < self.bytes.len() {
            let line = self.line();
            if line.first() == Some(&b'$') {
                return Some(String::from_utf8_lossy(line).into_owned());
            }
        }
        None
    }

    /// Goes on after the next `mark`.
    fn skip_past(&mut self, mark: &str) -> Parsed<()> {
        let found = self.bytes[self.at..].windows(mark.len()).position(|w| w == mark.as_bytes());
        self.at += found.ok_or_else(|| format!("the file is cut short: {mark} is missing"))? + mark.len();
        Ok(())
    }

    /// The next word of text.
    fn word(&mut self) -> Parsed<&'a str> {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace()).ok_or("the file is cut short")?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - start);
        self.at += start + length;
        std::str::from_utf8(&rest[start..start + length]).map_err(|_| format!("no text at byte {}", self.at - length))
    }

    fn parsed<T: std::str::FromStr>(&mut self) -> Parsed<T> {
        let word = self.word()?;
        let shown: String = word.chars().take(20).collect();
        word.parse().map_err(|_| format!("{shown:?} before byte {} should be a number", self.at))
    }

    fn raw<const N: usize>(&mut self) -> Parsed<[u8; N]> {
        let chunk = self.bytes[self.at..].first_chunk::<N>().ok_or("the file is cut short")?;
        self.at += N;
        Ok(*chunk)
    }

    /// A count in text, alone on its line, as version 2.2 has it even in binary files.
    fn text_count(&mut self) -> Parsed<u64> {
        let count = self.parsed()?;
        self.line();
        Ok(count)
    }

    fn int(&mut self) -> Parsed<i64> {
        if self.binary { Ok(i64::from(i32::from_le_bytes(self.raw()?))) } else { self.parsed() }
    }

    /// A number from 0 on that version 2.2 stores as an `int`.
    fn tag_2(&mut self) -> Parsed<u64> {
        let tag = self.int()?;
        u64::try_from(tag).map_err(|_| format!("{tag} before byte {} should not be negative", self.at))
    }

    fn size(&mut self) -> Parsed<u64> {
        if self.binary { Ok(u64::from_le_bytes(self.raw()?)) } else { self.parsed() }
    }

    fn real(&mut self) -> Parsed<f64> {
        if self.binary { Ok(f64::from_le_bytes(self.raw()?)) } else { self.parsed() }
    }

    fn point(&mut self) -> Parsed<DVec3> {
        Ok(DVec3::new(self.real()?, self.real()?, self.real()?))
    }

    /// Refuses a count of things of at least `bytes_each` that cannot be in what is left of the
    /// file.
    fn expect(&self, count: u64, bytes_each: u64, what: &str) -> Parsed<()> {
        let left = (self.bytes.len() - self.at) as u64;
        if count.saturating_mul(bytes_each) > left {
            return Err(format!("the file is cut short: {count} {what} cannot be in the {left} bytes that are left"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT_2: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 1 \"organ\"\n$EndPhysicalNames\n\
        $Nodes\n5\n7 0 0 0\n1 9 9 9\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n\
        $Elements\n2\n1 2 2 0 1 7 2 3\n2 4 2 0 1 7 3 2 4\n$EndElements\n";
    const TEXT_4: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n\
        $Nodes\n2 4 1 9\n2 1 1 1\n9\n0 0 0 0.5 0.5\n3 1 0 3\n2\n3\n4\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n\
        $Elements\n2 2 1 2\n2 1 2 1\n1 9 2 3\n3 1 4 1\n2 9 2 3 4\n$EndElements\n";

    fn corner() -> TetMesh {
        TetMesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], tets: vec![[0, 1, 2, 3]] }
    }

    /// The mesh of `TEXT_2` in binary.
    fn binary_2() -> Vec<u8> {
        let mut bytes = b"$MeshFormat\n2.2 1 8\n\x01\0\0\0\n$EndMeshFormat\n$Nodes\n4\n".to_vec();
        for (tag, v) in (1i32..).zip(corner().vertices) {
            bytes.extend(tag.to_le_bytes());
            bytes.extend(v.to_array().iter().flat_map(|x| x.to_le_bytes()));
        }
        bytes.extend(b"\n$EndNodes\n$Elements\n2\n");
        for value in [2i32, 1, 2, 1, 0, 1, 1, 2, 3, 4, 1, 2, 2, 0, 1, 1, 2, 3, 4] {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend(b"\n$EndElements\n");
        bytes
    }

    fn binary_4() -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("body.msh");
        write_msh(&path, &corner()).unwrap();
        assert_eq!(read_msh(&path).unwrap(), corner());
        std::fs::read(path).unwrap()
    }

    #[test]
    fn all_four_kinds_are_read() {
        // Its only tetrahedron is negative and gets turned; its first triangle and a node of no
        // tetrahedron are left out.
        let turned = TetMesh { tets: vec![[0, 2, 3, 1]], ..corner() };
        assert_eq!(parse(TEXT_2.as_bytes()).unwrap(), turned);
        assert_eq!(parse(TEXT_4.as_bytes()).unwrap(), corner());
        assert_eq!(parse(TEXT_4.replace('\n', "\r\n").as_bytes()).unwrap(), corner());
        assert_eq!(parse(&binary_2()).unwrap(), corner());
        assert_eq!(parse(&binary_4()).unwrap(), corner());
    }

    #[test]
    fn damage_is_named() {
        let refused = |from: &str, to: &str, why: &str| {
            assert!(TEXT_2.contains(from));
            let message = parse(TEXT_2.replace(from, to).as_bytes()).unwrap_err();
            assert!(message.contains(why), "{message}");
        };
        refused("4 0 0 1\n", "4 0 0 0\n", "element 2");
        refused("4 0 0 1\n", "4 0 0 nan\n", "node 4");
        refused("4 0 0 1\n", "4 0 0 one\n", "\"one\"");
        refused("4 0 0 1\n", "3 0 0 1\n", "node 3 appears twice");
        refused("7 3 2 4", "7 3 2 5", "node 5");
        refused("2 4 2 0 1 7 3 2 4", "2 2 2 0 1 7 3 2", "no tetrahedra");
        refused("2 4 2 0", "2 11 2 0", "second order");
        refused("2 4 2 0", "2 77 2 0", "77");
        refused("$Nodes\n5", "$Nodes\n5000000000", "5000000000 nodes");
        refused("2.2 0 8", "3.0 0 8", "3.0");
        refused("$EndElements", "", "$EndElements");
        refused("$MeshFormat", "$Nonsense", "$MeshFormat");
        assert!(parse(b"").is_err());
    }

    #[test]
    fn every_truncation_is_an_error() {
        for bytes in [TEXT_2.as_bytes().to_vec(), TEXT_4.as_bytes().to_vec(), binary_2(), binary_4()] {
            let needed = bytes.trim_ascii_end().len();
            for length in 0..needed {
                assert!(parse(&bytes[..length]).is_err(), "{length} of {needed}");
            }
        }
    }

    #[test]
    fn an_index_out_of_range_is_not_written() {
        let mut mesh = corner();
        mesh.tets[0][3] = 4;
        assert!(write_msh(Path::new("/nowhere/x.msh"), &mesh).unwrap_err().to_string().contains("tetrahedron 0"));
        assert!(matches!(write_msh(Path::new("/nowhere/x.msh"), &corner()), Err(Error::Io { .. })));
    }
}
