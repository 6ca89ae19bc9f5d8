//! Splits nodes into copies where the elements around them come apart.

use super::faces::Opened;
use trocar_geometry::TetMesh;

/// A mesh after a cut. Elements are those of before.
pub(super) struct Split {
    /// Elements by the new nodes.
    pub tets: Vec<[u32; 4]>,
    /// For each new node the old one. The first are the old nodes themselves; then copies,
    /// ascending.
    pub parent: Vec<u32>,
    /// Faces that opened.
    pub faces: usize,
    /// Number of nodes before.
    pub before: usize,
}

impl Split {
    /// Whether a node of before has fallen into several.
    pub fn fell_apart(&self, node: u32) -> bool {
        self.parent[self.before..].binary_search(&node).is_ok()
    }

    /// The new nodes of an old one, ascending.
    pub fn copies(&self, node: u32) -> impl Iterator<Item = u32> {
        let added = &self.parent[self.before..];
        let first = added.partition_point(|parent| *parent < node);
        let end = added.partition_point(|parent| *parent <= node);
        let at = |k: usize| (self.before + k) as u32;
        std::iter::once(node).chain((first..end).map(at))
    }
}

/// Splits the nodes of `mesh` along its open faces.
pub(super) fn split(mesh: &TetMesh, opened: &Opened) -> Split {
    let before = mesh.vertices.len();
    let mut tets = mesh.tets.clone();
    let mut parent: Vec<u32> = (0..before as u32).collect();
    let mut fan = Fan::default();
    for (node, elements) in around_open_faces(mesh, opened) {
        fan.find(node, &elements, mesh, opened);
        // The first group keeps the node, every other gets a copy, in the order of their first
        // elements.
        let mut copy_of = vec![(fan.group[0], node)];
        for (k, &t) in elements.iter().enumerate() {
            let group = fan.group[k];
            let copy = match copy_of.iter().find(|(known, _)| *known == group) {
                Some((_, copy)) => *copy,
                None => {
                    let copy = parent.len() as u32;
                    parent.push(node);
                    copy_of.push((group, copy));
                    copy
                }
            };
            for corner in tets[t as usize].iter_mut().filter(|corner| **corner == node) {
                *corner = copy;
            }
        }
    }
    let faces = count_faces(&mesh.tets, &tets, opened);
    Split { tets, parent, faces, before }
}

/// The nodes of open faces, ascending, and the elements around each, ascending.
fn around_open_faces(mesh: &TetMesh, opened: &Opened) -> Vec<(u32, Vec<u32>)> {
    let mut touched = vec![false; mesh.vertices.len()];
    for (tet, open) in mesh.tets.iter().zip(&opened.open) {
        for k in (0..4).filter(|k| open[*k]) {
            (1..4).for_each(|c| touched[tet[(k + c) % 4] as usize] = true);
        }
    }
    let mut at = vec![usize::MAX; touched.len()];
    let mut fans = Vec::new();
    for node in (0..touched.len()).filter(|node| touched[*node]) {
        at[node] = fans.len();
        fans.push((node as u32, Vec::new()));
    }
    for (t, tet) in mesh.tets.iter().enumerate() {
        for node in tet.iter().filter(|node| touched[**node as usize]) {
            fans[at[*node as usize]].1.push(t as u32);
        }
    }
    fans
}

/// The elements around a node in groups.
#[derive(Default)]
struct Fan {
    /// Group of each element: the index of its first.
    group: Vec<usize>,
    /// The same without the cut.
    whole: Vec<usize>,
}

impl Fan {
    /// Groups the `elements` around `node` by the faces that join them. Elements that shared no
    /// face around the node before the cut join those on their side: the cut separates only what it
    /// meets.
    fn find(&mut self, node: u32, elements: &[u32], mesh: &TetMesh, opened: &Opened) {
        for group in [&mut self.group, &mut self.whole] {
            group.clear();
            group.extend(0..elements.len());
        }
        for (i, &t) in elements.iter().enumerate() {
            let t = t as usize;
            for k in (0..4).filter(|k| mesh.tets[t][*k] != node) {
                let Some(other) = opened.neighbours[t][k] else { continue };
                let Ok(j) = elements.binary_search(&other) else { continue };
                join(&mut self.whole, i, j);
                if !opened.open[t][k] {
                    join(&mut self.group, i, j);
                }
            }
        }
        if self.whole.iter().any(|whole| *whole != 0) {
            for i in 0..elements.len() {
                for j in 0..i {
                    let beside = opened.above[elements[i] as usize] == opened.above[elements[j] as usize];
                    if beside && self.whole[i] != self.whole[j] {
                        join(&mut self.group, i, j);
                    }
                }
            }
        }
    }
}

/// Merges the groups of `i` and `j`. Fans have some twenty elements.
fn join(group: &mut [usize], i: usize, j: usize) {
    let (keep, drop) = (group[i].min(group[j]), group[i].max(group[j]));
    group.iter_mut().filter(|group| **group == drop).for_each(|group| *group = keep);
}

/// Faces whose two elements no longer share all three corners.
fn count_faces(before: &[[u32; 4]], after: &[[u32; 4]], opened: &Opened) -> usize {
    let mut count = 0;
    for (t, open) in opened.open.iter().enumerate() {
        for k in (0..4).filter(|k| open[*k]) {
            let Some(other) = opened.neighbours[t][k].map(|other| other as usize).filter(|other| *other > t) else {
                continue;
            };
            let apart = |c: usize| {
                let at = before[other].iter().position(|node| *node == before[t][c]);
                at.is_some_and(|at| after[other][at] != after[t][c])
            };
            count += usize::from((0..4).any(|c| c != k && apart(c)));
        }
    }
    count
}

/// Number of the connected part of each node; parts are connected by nodes and numbered by their
/// first.
pub(super) fn parts(tets: &[[u32; 4]], nodes: usize) -> (Vec<u32>, usize) {
    let mut root: Vec<u32> = (0..nodes as u32).collect();
    for tet in tets {
        for node in &tet[1..] {
            let (a, b) = (find(&mut root, tet[0]), find(&mut root, *node));
            root[a.max(b) as usize] = a.min(b);
        }
    }
    // A root is the first of its part and so is numbered before the others.
    let (mut part, mut count) = (vec![0; nodes], 0);
    for node in 0..nodes {
        let first = find(&mut root, node as u32) as usize;
        if first == node {
            part[node] = count as u32;
            count += 1;
        } else {
            part[node] = part[first];
        }
    }
    (part, count)
}

fn find(root: &mut [u32], mut node: u32) -> u32 {
    while root[node as usize] != node {
        root[node as usize] = root[root[node as usize] as usize];
        node = root[node as usize];
    }
    node
}
