//! Gmsh tetrahedral meshes: versions 2.2 and 4.1, text and binary.
//!
//! Format: Gmsh reference manual, chapter "Gmsh file formats". The versions and encodings contain
//! the same numbers in almost the same order. So one parser reads all of them from a source of
//! numbers that knows the encoding.

mod content;
mod groups;
mod sections;
mod source;

use super::file::{Parsed, bad, read, write};
use crate::{Error, Result, TetMesh};
use content::assemble;
use sections::{TET, contents};
use std::path::Path;

/// Reads the tetrahedra of a Gmsh `.msh` file (2.2 or 4.1, text or binary little-endian) in metres.
/// Negative elements are flipped. Nodes without a tetrahedron are omitted; the others keep their
/// order.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read. [`Error::Parse`] if it is not such a file, is damaged
/// or truncated, has no tetrahedra, second-order tetrahedra or one without volume, or a coordinate
/// that is not finite.
pub fn read_msh(path: &Path) -> Result<TetMesh> {
    let bytes = read(path)?;
    parse(&bytes).map_err(|reason| bad(path, reason))
}

/// Reads the tetrahedra of a Gmsh `.msh` file as one mesh per named physical group, ordered by
/// group number. Tetrahedra without such a group come first, without a name. Nodes shared by groups
/// are in each of them. Otherwise as [`read_msh`].
///
/// # Errors
/// As [`read_msh`].
pub fn read_msh_groups(path: &Path) -> Result<Vec<(Option<String>, TetMesh)>> {
    let bytes = read(path)?;
    contents(&bytes).and_then(groups::split).map_err(|reason| bad(path, reason))
}

/// Writes a Gmsh 4.1 binary `.msh`, in metres.
///
/// # Errors
/// [`Error::Mesh`] if an element uses a node that does not exist; [`Error::Io`] if the file cannot
/// be written.
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

fn parse(bytes: &[u8]) -> Parsed<TetMesh> {
    assemble(&contents(bytes)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

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
    fn both_versions_and_encodings_are_read() {
        // Its only tetrahedron is negative and is flipped. Its first triangle and a node without a
        // tetrahedron are omitted.
        let flipped = TetMesh { tets: vec![[0, 2, 3, 1]], ..corner() };
        assert_eq!(parse(TEXT_2.as_bytes()).unwrap(), flipped);
        assert_eq!(parse(TEXT_4.as_bytes()).unwrap(), corner());
        assert_eq!(parse(TEXT_4.replace('\n', "\r\n").as_bytes()).unwrap(), corner());
        assert_eq!(parse(&binary_2()).unwrap(), corner());
        assert_eq!(parse(&binary_4()).unwrap(), corner());
    }

    #[test]
    fn damage_is_reported() {
        let rejected = |from: &str, to: &str, why: &str| {
            assert!(TEXT_2.contains(from));
            let message = parse(TEXT_2.replace(from, to).as_bytes()).unwrap_err();
            assert!(message.contains(why), "{message}");
        };
        rejected("4 0 0 1\n", "4 0 0 0\n", "element 2");
        rejected("4 0 0 1\n", "4 0 0 nan\n", "node 4");
        rejected("4 0 0 1\n", "4 0 0 one\n", "\"one\"");
        rejected("4 0 0 1\n", "3 0 0 1\n", "node 3 appears twice");
        rejected("7 3 2 4", "7 3 2 5", "node 5");
        rejected("2 4 2 0 1 7 3 2 4", "2 2 2 0 1 7 3 2", "no tetrahedra");
        rejected("2 4 2 0", "2 11 2 0", "second order");
        rejected("2 4 2 0", "2 77 2 0", "77");
        rejected("$Nodes\n5", "$Nodes\n5000000000", "5000000000 nodes");
        rejected("2.2 0 8", "3.0 0 8", "3.0");
        rejected("$EndElements", "", "$EndElements");
        rejected("$MeshFormat", "$Nonsense", "$MeshFormat");
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
    fn an_index_out_of_range_is_rejected() {
        let mut mesh = corner();
        mesh.tets[0][3] = 4;
        assert!(write_msh(Path::new("/nowhere/x.msh"), &mesh).unwrap_err().to_string().contains("tetrahedron 0"));
        assert!(matches!(write_msh(Path::new("/nowhere/x.msh"), &corner()), Err(Error::Io { .. })));
    }

    const NODES: &str = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n";

    fn names() -> &'static str {
        "$PhysicalNames\n3\n2 7 \"skin\"\n3 8 \"cecum\"\n3 9 \"the appendix\"\n$EndPhysicalNames\n"
    }

    #[test]
    fn groups_have_their_names_in_both_versions() {
        let numbered: String = NODES.lines().enumerate().map(|(i, l)| format!("{} {l}\n", i + 1)).collect();
        let old = format!(
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{}$Nodes\n5\n{numbered}$EndNodes\n\
             $Elements\n2\n1 4 2 9 1 1 2 3 4\n2 4 2 8 2 2 3 4 5\n$EndElements\n",
            names()
        );
        let new = format!(
            "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n{}$Entities\n1 0 1 2\n1 0 0 0 0\n5 0 0 0 1 1 1 1 7 0\n\
             1 0 0 0 1 1 1 1 9 1 5\n2 0 0 0 1 1 1 1 8 1 -5\n$EndEntities\n$Nodes\n1 5 1 5\n3 1 0 5\n1\n2\n3\n4\n5\n{NODES}$EndNodes\n\
             $Elements\n2 2 1 2\n3 1 4 1\n1 1 2 3 4\n3 2 4 1\n2 2 3 4 5\n$EndElements\n",
            names()
        );
        for text in [old, new] {
            let groups = groups::split(contents(text.as_bytes()).unwrap()).unwrap();
            let seen: Vec<_> = groups.iter().map(|(n, m)| (n.as_deref(), m.vertices.len(), m.tets.len())).collect();
            assert_eq!(seen, [(Some("cecum"), 4, 1), (Some("the appendix"), 4, 1)]);
            let without = text.replace(names(), "");
            let groups = groups::split(contents(without.as_bytes()).unwrap()).unwrap();
            assert_eq!((groups.len(), groups[0].0.as_deref(), groups[0].1.vertices.len()), (1, None, 5));
        }
    }
}
