//! Gmsh `.msh` files, versions 2.2 and 4.1, text and binary little-endian. Only nodes and four-node tetrahedra are read.

use super::{read, write, wrong};
use crate::{Result, TetMesh};
use glam::DVec3;
use std::path::Path;

/// Gmsh's number of the four-node tetrahedron.
const TETRAHEDRON: i64 = 4;

/// Nodes of Gmsh's element types, by type number (first-order and second-order ones; 0: unknown).
const NODES_OF_TYPE: [usize; 20] = [0, 2, 3, 4, 4, 8, 6, 5, 3, 6, 9, 10, 27, 18, 14, 1, 8, 20, 15, 13];

/// Reads the tetrahedra of a Gmsh `.msh` file (2.2 or 4.1, text or binary little-endian), in metres. Nodes that belong to no
/// tetrahedron are left out; negative elements are turned.
///
/// # Errors
/// Names the file when it is missing, truncated, of another format or version, or has an element without volume.
pub fn read_msh(path: &Path) -> Result<TetMesh> {
    parse(&read(path)?).map_err(|reason| wrong(path, reason))
}

fn parse(bytes: &[u8]) -> std::result::Result<TetMesh, String> {
    let mut file = Tokens { rest: bytes, binary: false };
    file.expect("$MeshFormat")?;
    let version = file.word()?;
    file.binary = match file.word()? {
        "0" => false,
        "1" => true,
        other => return Err(format!("file type '{other}' in $MeshFormat; 0 (text) or 1 (binary)")),
    };
    let size = file.word()?;
    if file.binary {
        file.end_line()?;
        if file.take(4)? != 1i32.to_le_bytes() {
            return Err("binary data is big-endian; little-endian is read".to_owned());
        }
    }
    let (nodes, tets) = match version {
        "2.2" => v22(&mut file)?,
        "4.1" if size == "8" => v41(&mut file)?,
        _ => return Err(format!("version {version} with {size}-byte numbers; 2.2 and 4.1 (8 bytes) are read")),
    };
    assemble(nodes, &tets)
}

type Parts = (Vec<(i64, DVec3)>, Vec<[i64; 4]>);

fn v22(file: &mut Tokens<'_>) -> std::result::Result<Parts, String> {
    file.section("$Nodes")?;
    let count = file.count_word(if file.binary { 28 } else { 7 })?;
    if file.binary {
        file.end_line()?;
    }
    let mut nodes = Vec::with_capacity(count);
    for _ in 0..count {
        let tag = i64::from(file.int()?);
        nodes.push((tag, file.point()?));
    }
    file.section("$Elements")?;
    let count = file.count_word(if file.binary { 4 } else { 3 })?;
    if file.binary {
        file.end_line()?;
    }
    let mut tets = Vec::new();
    let mut done = 0;
    while done < count {
        // Binary elements come in blocks with a common header; text elements one a line.
        let (kind, block, tags) = if file.binary {
            let (kind, block, tags) = (file.int()?, file.int()?, file.int()?);
            (kind, usize::try_from(block).unwrap_or(0), tags)
        } else {
            file.int()?;
            let kind = file.int()?;
            (kind, 1, file.int()?)
        };
        if block == 0 {
            return Err("an element block of no elements".to_owned());
        }
        for _ in 0..block {
            if file.binary {
                file.int()?;
            }
            for _ in 0..tags {
                file.int()?;
            }
            let mut corners = [0; 4];
            for k in 0..nodes_of(i64::from(kind))? {
                let tag = i64::from(file.int()?);
                if k < 4 {
                    corners[k] = tag;
                }
            }
            if i64::from(kind) == TETRAHEDRON {
                tets.push(corners);
            }
        }
        done += block;
    }
    Ok((nodes, tets))
}

fn v41(file: &mut Tokens<'_>) -> std::result::Result<Parts, String> {
    file.section("$Nodes")?;
    if file.binary {
        file.end_line()?;
    }
    let blocks = file.count(1)?;
    let total = file.count(6)?;
    file.long()?;
    file.long()?;
    let mut nodes = Vec::with_capacity(total);
    for _ in 0..blocks {
        let (dimension, _, parametric) = (file.int()?, file.int()?, file.int()?);
        let count = file.count(6)?;
        let first = nodes.len();
        for _ in 0..count {
            nodes.push((file.long()?, DVec3::ZERO));
        }
        for node in &mut nodes[first..] {
            node.1 = file.point()?;
            for _ in 0..if parametric != 0 { dimension } else { 0 } {
                file.real()?;
            }
        }
    }
    file.section("$Elements")?;
    if file.binary {
        file.end_line()?;
    }
    let blocks = file.count(1)?;
    for _ in 0..3 {
        file.long()?;
    }
    let mut tets = Vec::new();
    for _ in 0..blocks {
        let (_, _, kind) = (file.int()?, file.int()?, file.int()?);
        let count = file.count(2)?;
        let corners = nodes_of(i64::from(kind))?;
        for _ in 0..count {
            file.long()?;
            let mut tet = [0; 4];
            for k in 0..corners {
                let tag = file.long()?;
                if k < 4 {
                    tet[k] = tag;
                }
            }
            if i64::from(kind) == TETRAHEDRON {
                tets.push(tet);
            }
        }
    }
    Ok((nodes, tets))
}

fn nodes_of(kind: i64) -> std::result::Result<usize, String> {
    let nodes = usize::try_from(kind).ok().and_then(|k| NODES_OF_TYPE.get(k).copied()).unwrap_or(0);
    if nodes == 0 { Err(format!("unknown element type {kind}")) } else { Ok(nodes) }
}

/// From tags to a checked mesh.
fn assemble(mut nodes: Vec<(i64, DVec3)>, tets: &[[i64; 4]]) -> std::result::Result<TetMesh, String> {
    if let Some((tag, p)) = nodes.iter().find(|n| !n.1.is_finite()) {
        return Err(format!("node {tag} is {p}; coordinates are finite numbers"));
    }
    // Stable, so that numbering follows the tags.
    nodes.sort_by_key(|n| n.0);
    let mut used = vec![false; nodes.len()];
    let mut of_tets = Vec::with_capacity(tets.len());
    for tet in tets {
        let mut corners = [0usize; 4];
        for (corner, tag) in corners.iter_mut().zip(tet) {
            *corner = nodes
                .binary_search_by_key(tag, |n| n.0)
                .map_err(|_| format!("an element names node {tag}, which is not there"))?;
            used[*corner] = true;
        }
        of_tets.push(corners);
    }
    if of_tets.is_empty() {
        return Err("there is no tetrahedron in it".to_owned());
    }
    let mut mesh = TetMesh::default();
    let mut index = vec![0u32; nodes.len()];
    for (i, node) in nodes.iter().enumerate().filter(|(i, _)| used[*i]) {
        index[i] = mesh.vertices.len() as u32;
        mesh.vertices.push(node.1);
    }
    for (t, corners) in of_tets.iter().enumerate() {
        mesh.tets.push(corners.map(|c| index[c]));
        let volume = mesh.tet_volume(t);
        if volume < 0.0 {
            mesh.tets[t].swap(1, 2);
        } else if volume == 0.0 {
            return Err(format!("tetrahedron {t} has no volume"));
        }
    }
    Ok(mesh)
}

/// Words of the text, or numbers of the binary form; whatever is asked for, never reads past the end.
struct Tokens<'a> {
    rest: &'a [u8],
    binary: bool,
}

impl<'a> Tokens<'a> {
    fn take(&mut self, n: usize) -> std::result::Result<&'a [u8], String> {
        let (head, tail) = self.rest.split_at_checked(n).ok_or("the file ends too early")?;
        self.rest = tail;
        Ok(head)
    }

    fn word(&mut self) -> std::result::Result<&'a str, String> {
        self.rest = self.rest.trim_ascii_start();
        let end = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
        let word = self.take(end)?;
        if word.is_empty() {
            return Err("the file ends too early".to_owned());
        }
        std::str::from_utf8(word).map_err(|_| "text expected, bytes found".to_owned())
    }

    fn expect(&mut self, word: &str) -> std::result::Result<(), String> {
        let found = self.word()?;
        if found == word {
            Ok(())
        } else {
            Err(format!("'{word}' expected, '{}' found", found.chars().take(20).collect::<String>()))
        }
    }

    fn end_line(&mut self) -> std::result::Result<(), String> {
        while self.take(1)? != b"\n" {}
        Ok(())
    }

    /// Skips to the line `$Name` of a section.
    fn section(&mut self, name: &str) -> std::result::Result<(), String> {
        let at = self.rest.windows(name.len() + 1).position(|w| w[0] == b'\n' && &w[1..] == name.as_bytes());
        let at = at.ok_or_else(|| format!("section {name} is missing"))?;
        self.rest = &self.rest[at + 1 + name.len()..];
        Ok(())
    }

    fn parse<T: std::str::FromStr>(&mut self) -> std::result::Result<T, String> {
        let word = self.word()?;
        word.parse().map_err(|_| format!("a number expected, '{}' found", word.chars().take(20).collect::<String>()))
    }

    fn int(&mut self) -> std::result::Result<i32, String> {
        if !self.binary {
            return self.parse();
        }
        self.take(4).map(|b| i32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    }

    fn long(&mut self) -> std::result::Result<i64, String> {
        if !self.binary {
            return self.parse();
        }
        self.take(8).map(|b| i64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]))
    }

    fn real(&mut self) -> std::result::Result<f64, String> {
        if !self.binary {
            return self.parse();
        }
        self.take(8).map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]))
    }

    fn point(&mut self) -> std::result::Result<DVec3, String> {
        Ok(DVec3::new(self.real()?, self.real()?, self.real()?))
    }

    /// A count of things that take at least `least` bytes each: refused when the rest of the file cannot hold them.
    fn count(&mut self, least: usize) -> std::result::Result<usize, String> {
        let count = self.long()?;
        self.plausible(count, least)
    }

    /// The same where the count is text even in a binary file.
    fn count_word(&mut self, least: usize) -> std::result::Result<usize, String> {
        let count = self.parse()?;
        self.plausible(count, least)
    }

    fn plausible(&self, count: i64, least: usize) -> std::result::Result<usize, String> {
        let most = self.rest.len() / least;
        usize::try_from(count)
            .ok()
            .filter(|n| *n <= most)
            .ok_or_else(|| format!("a count of {count}, but the rest of the file holds at most {most}"))
    }
}

/// Writes a Gmsh 4.1 binary `.msh`, in metres.
///
/// # Errors
/// Names the file when it cannot be written.
pub fn write_msh(path: &Path, mesh: &TetMesh) -> Result<()> {
    let (nodes, tets) = (mesh.vertices.len() as u64, mesh.tets.len() as u64);
    let mut out = b"$MeshFormat\n4.1 1 8\n".to_vec();
    out.extend(1i32.to_le_bytes());
    out.extend(b"\n$EndMeshFormat\n$Nodes\n");
    let ints = |out: &mut Vec<u8>, values: &[i32]| out.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    let longs = |out: &mut Vec<u8>, values: &[u64]| out.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    longs(&mut out, &[1, nodes, 1, nodes]);
    ints(&mut out, &[3, 1, 0]);
    longs(&mut out, &[nodes]);
    for i in 1..=nodes {
        longs(&mut out, &[i]);
    }
    for v in &mesh.vertices {
        out.extend(v.to_array().iter().flat_map(|x| x.to_le_bytes()));
    }
    out.extend(b"\n$EndNodes\n$Elements\n");
    longs(&mut out, &[1, tets, 1, tets]);
    ints(&mut out, &[3, 1, TETRAHEDRON as i32]);
    longs(&mut out, &[tets]);
    for (t, tet) in (1u64..).zip(&mesh.tets) {
        longs(&mut out, &[t]);
        longs(&mut out, &tet.map(|i| u64::from(i) + 1));
    }
    out.extend(b"\n$EndElements\n");
    write(path, &out)
}
