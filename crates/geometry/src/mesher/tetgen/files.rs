//! TetGen's file formats (TetGen manual, section 5): `.smesh` for a surface, `.node` and `.ele` for
//! the elements.

use crate::{Error, Result, TriMesh};
use glam::DVec3;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::Path;

/// Maximum number of items for which memory is reserved from a count in the file.
const MAX_RESERVED: usize = 1 << 20;
/// Maximum line length (bytes).
const MAX_LINE_BYTES: u64 = 4096;

/// Writes a closed surface as a piecewise linear complex: one facet per triangle, no holes, no
/// regions.
pub(super) fn write_smesh(path: &Path, surface: &TriMesh) -> Result<()> {
    let write = || -> std::io::Result<()> {
        let mut out = BufWriter::new(File::create(path)?);
        writeln!(out, "{} 3 0 0", surface.vertices.len())?;
        for (i, v) in surface.vertices.iter().enumerate() {
            // Enough digits to read back the same number.
            writeln!(out, "{i} {:e} {:e} {:e}", v.x, v.y, v.z)?;
        }
        writeln!(out, "{} 0", surface.triangles.len())?;
        for [a, b, c] in &surface.triangles {
            writeln!(out, "3 {a} {b} {c}")?;
        }
        writeln!(out, "0\n0")?;
        out.flush()
    };
    write().map_err(|source| Error::Io { path: path.to_owned(), source })
}

/// The index of the first node (0 or 1) and all positions of a `.node` file.
pub(super) fn read_nodes(path: &Path) -> Result<(u64, Vec<DVec3>)> {
    let mut table = Table::open(path)?;
    let [count, dimensions] = table.header("the number of nodes and 3")?;
    if dimensions != 3 {
        return Err(table.error(&format!("has {dimensions} coordinates per node; there must be 3")));
    }
    let mut first = 0;
    let mut nodes = Vec::with_capacity((count as usize).min(MAX_RESERVED));
    for i in 0..count {
        let row = table.row(&format!("node {i} of {count}"))?;
        let mut fields = row.split_ascii_whitespace();
        let index: Option<u64> = fields.next().and_then(|field| field.parse().ok());
        if i == 0 {
            first = index.unwrap_or(u64::MAX);
        }
        if first > 1 || index != Some(first + i) {
            return Err(table.error("has nodes that are not numbered consecutively from 0 or 1"));
        }
        let mut axis = || fields.next().and_then(|field| field.parse().ok()).unwrap_or(f64::NAN);
        let node = DVec3::new(axis(), axis(), axis());
        if !node.is_finite() {
            return Err(table.error("has a node without three finite coordinates"));
        }
        nodes.push(node);
    }
    Ok((first, nodes))
}

/// Corners of all elements of an `.ele` file. There are `nodes` nodes, and the first has index
/// `first` in the file. Nodes on element edges are ignored.
pub(super) fn read_elements(path: &Path, first: u64, nodes: usize) -> Result<Vec<[u32; 4]>> {
    let mut table = Table::open(path)?;
    let [count, corners] = table.header("the number of elements and 4")?;
    if corners != 4 && corners != 10 {
        return Err(table.error(&format!("has {corners} nodes per element; there must be 4 or 10")));
    }
    let mut tets = Vec::with_capacity((count as usize).min(MAX_RESERVED));
    for i in 0..count {
        let row = table.row(&format!("element {i} of {count}"))?;
        let mut fields = row.split_ascii_whitespace().skip(1);
        let mut tet = [0; 4];
        for corner in &mut tet {
            let node = fields.next().and_then(|field| field.parse::<u64>().ok()).and_then(|n| n.checked_sub(first));
            *corner = match node {
                Some(node) if node < nodes as u64 => node as u32,
                _ => return Err(table.error(&format!("has an element without four valid nodes; there are {nodes}"))),
            };
        }
        if (0..4).any(|a| tet[..a].contains(&tet[a])) {
            return Err(table.error("has an element with a repeated node"));
        }
        tets.push(tet);
    }
    Ok(tets)
}

/// A file with rows of numbers, empty lines and comments after `#`.
struct Table<'a> {
    path: &'a Path,
    reader: BufReader<File>,
    line: usize,
}

impl<'a> Table<'a> {
    fn open(path: &'a Path) -> Result<Self> {
        let file = File::open(path).map_err(|source| Error::Io { path: path.to_owned(), source })?;
        Ok(Self { path, reader: BufReader::new(file), line: 0 })
    }

    /// The first two integers of the first row.
    fn header(&mut self, what: &str) -> Result<[u64; 2]> {
        let row = self.row(what)?;
        let mut fields = row.split_ascii_whitespace().map(|field| field.parse::<u64>().ok());
        match (fields.next().flatten(), fields.next().flatten()) {
            // Node and element indices have 32 bits.
            (Some(count), Some(width)) if count < u64::from(u32::MAX) => Ok([count, width]),
            _ => Err(self.error(&format!("must begin with {what}"))),
        }
    }

    /// The next row that is not empty.
    fn row(&mut self, what: &str) -> Result<String> {
        loop {
            let mut bytes = Vec::new();
            let mut limited = std::io::Read::take(&mut self.reader, MAX_LINE_BYTES);
            let read = limited.read_until(b'\n', &mut bytes);
            let length = read.map_err(|source| Error::Io { path: self.path.to_owned(), source })?;
            if length == 0 {
                return Err(self.error(&format!("ends before {what}")));
            }
            self.line += 1;
            let text = String::from_utf8_lossy(&bytes);
            let row = text.split('#').next().unwrap_or_default().trim();
            if !row.is_empty() {
                return Ok(row.to_owned());
            }
        }
    }

    fn error(&self, what: &str) -> Error {
        Error::Parse { path: self.path.to_owned(), reason: format!("line {}: TetGen's file {what}", self.line) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const NODES: &str = "5  3  0  0\n   1    0  0  0\n   2    1  0  0\n   3    0  1  0\n\n   4    0  0  1 # top\n   5 0 0.5 5e-1\n# end\n";
    const ELEMENTS: &str = "2  4  0\n    1       3     1     4     5\n    2       2     1     4     5\n# end\n";

    fn read(nodes: &[u8], elements: &[u8]) -> Result<(Vec<DVec3>, Vec<[u32; 4]>)> {
        let folder = tempfile::tempdir().unwrap();
        let [n, e] = ["a.node", "a.ele"].map(|name| folder.path().join(name));
        std::fs::write(&n, nodes).unwrap();
        std::fs::write(&e, elements).unwrap();
        let (first, vertices) = read_nodes(&n)?;
        let tets = read_elements(&e, first, vertices.len())?;
        Ok((vertices, tets))
    }

    #[test]
    fn indices_may_start_at_0_or_1() {
        let (nodes, tets) = read(NODES.as_bytes(), ELEMENTS.as_bytes()).unwrap();
        assert_eq!(nodes[4], DVec3::new(0.0, 0.5, 0.5));
        assert_eq!(tets, [[2, 0, 3, 4], [1, 0, 3, 4]]);
        let from_0 = read(b"4 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1\n", b"1 4 1\n0 0 1 2 3 7\n").unwrap();
        assert_eq!(from_0.1, [[0, 1, 2, 3]]);
        let quadratic =
            read(b"4 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1\n", b"1 10 0\n0 3 1 2 0 9 9 9 9 9 9\n").unwrap();
        assert_eq!(quadratic.1, [[3, 1, 2, 0]]);
    }

    #[test]
    fn invalid_files_are_rejected_with_a_reason() {
        let rejection =
            |nodes: &str, elements: &str| read(nodes.as_bytes(), elements.as_bytes()).unwrap_err().to_string();
        assert!(rejection("", ELEMENTS).contains("ends before"));
        assert!(rejection("5 2 0 0\n", ELEMENTS).contains("there must be 3"));
        assert!(rejection("4000000000 3 0 0\n", ELEMENTS).contains("ends before node 0"));
        assert!(rejection("99999999999999999999 3\n", ELEMENTS).contains("must begin"));
        assert!(rejection("2 3 0 0\n2 0 0 0\n3 0 0 0\n", ELEMENTS).contains("from 0 or 1"));
        assert!(rejection("2 3 0 0\n0 0 0 0\n2 0 0 0\n", ELEMENTS).contains("from 0 or 1"));
        assert!(rejection("1 3 0 0\n0 0 nan 0\n", ELEMENTS).contains("finite"));
        assert!(rejection(NODES, "2 4 0\n1 3 1 4 5\n").contains("ends before element 1"));
        assert!(rejection(NODES, "1 3 0\n").contains("4 or 10"));
        assert!(rejection(NODES, "1 4 0\n1 0 1 2 3\n").contains("four valid nodes"));
        assert!(rejection(NODES, "1 4 0\n1 1 2 3 6\n").contains("four valid nodes"));
        assert!(rejection(NODES, "1 4 0\n1 1 2 3 3\n").contains("repeated node"));
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

        /// Truncated and damaged files give valid tets or an error.
        #[test]
        fn damaged_files_give_valid_tets_or_an_error(
            cut in any::<(u8, u8)>(),
            hits in proptest::collection::vec((any::<bool>(), any::<u8>(), any::<u8>()), 0..6),
        ) {
            let mut files = [NODES.as_bytes().to_vec(), ELEMENTS.as_bytes().to_vec()];
            for (which, at, byte) in hits {
                let file = &mut files[usize::from(which)];
                let at = usize::from(at) % file.len();
                file[at] = byte;
            }
            files[0].truncate(100 + usize::from(cut.0));
            files[1].truncate(40 + usize::from(cut.1));
            if let Ok((nodes, tets)) = read(&files[0], &files[1]) {
                prop_assert!(nodes.iter().all(|node| node.is_finite()));
                prop_assert!(tets.iter().flatten().all(|&node| (node as usize) < nodes.len()));
            }
        }
    }
}
