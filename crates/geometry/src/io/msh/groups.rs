//! Physical groups of a Gmsh file: the names under which its parts were saved.

use super::super::Parsed;
use super::{Content, Source, assemble};
use crate::TetMesh;

/// Gmsh's number for volumes.
const VOLUME: i64 = 3;

/// `$PhysicalNames`, text in every kind of file: a count, then dimension, number and quoted name,
/// one a line.
pub(super) fn read_names(source: &mut Source<'_>, content: &mut Content) -> Parsed<()> {
    let count = source.text_count()?;
    source.expect(count, 4, "names")?;
    for _ in 0..count {
        let (dimension, number): (i64, i64) = (source.parsed()?, source.parsed()?);
        let name = String::from_utf8_lossy(source.line()).trim_matches('"').to_owned();
        if dimension == VOLUME && !name.is_empty() {
            content.groups.push((number, name));
        }
    }
    Ok(())
}

/// `$Entities` of version 4.1: of what groups the volumes are.
pub(super) fn read_volumes(source: &mut Source<'_>, content: &mut Content) -> Parsed<()> {
    let counts = [source.size()?, source.size()?, source.size()?, source.size()?];
    for (dimension, count) in (0..).zip(counts) {
        source.expect(count, if source.binary { 36 } else { 9 }, "entities")?;
        for _ in 0..count {
            let entity = source.int()?;
            for _ in 0..if dimension == 0 { 3 } else { 6 } {
                source.real()?;
            }
            let physical = numbers(source)?;
            if dimension == VOLUME
                && let Some(group) = physical.first()
            {
                // Negative for a volume turned inside out.
                content.volumes.push((entity, group.saturating_abs()));
            }
            if dimension > 0 {
                numbers(source)?;
            }
        }
    }
    Ok(())
}

fn numbers(source: &mut Source<'_>) -> Parsed<Vec<i64>> {
    let count = source.size()?;
    source.expect(count, if source.binary { 4 } else { 2 }, "numbers")?;
    (0..count).map(|_| source.int()).collect()
}

/// A mesh a named group, after what is in none.
pub(super) fn split(mut content: Content) -> Parsed<Vec<(Option<String>, TetMesh)>> {
    // The whole must be sound, whatever the groups.
    let whole = assemble(&content)?;
    if content.groups.is_empty() {
        return Ok(vec![(None, whole)]);
    }
    content.groups.sort();
    content.groups.dedup_by_key(|g| g.0);
    let groups = std::mem::take(&mut content.groups);
    let tets = std::mem::take(&mut content.tets);
    let place = |group: &i64| groups.iter().position(|g| g.0 == *group).map_or(0, |k| k + 1);
    let mut of_group = vec![Vec::new(); groups.len() + 1];
    for (tet, group) in tets.into_iter().zip(&content.group_of) {
        of_group[place(group)].push(tet);
    }
    let mut meshes = Vec::new();
    for (k, tets) in of_group.into_iter().enumerate().filter(|(_, tets)| !tets.is_empty()) {
        content.tets = tets;
        meshes.push((k.checked_sub(1).map(|k| groups[k].1.clone()), assemble(&content)?));
    }
    Ok(meshes)
}

#[cfg(test)]
mod tests {
    use super::super::contents;
    use super::*;

    const NODES: &str = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n";

    fn names() -> &'static str {
        "$PhysicalNames\n3\n2 7 \"skin\"\n3 8 \"cecum\"\n3 9 \"the appendix\"\n$EndPhysicalNames\n"
    }

    #[test]
    fn groups_come_with_their_names_in_both_versions() {
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
            let groups = split(contents(text.as_bytes()).unwrap()).unwrap();
            let seen: Vec<_> = groups.iter().map(|(n, m)| (n.as_deref(), m.vertices.len(), m.tets.len())).collect();
            assert_eq!(seen, [(Some("cecum"), 4, 1), (Some("the appendix"), 4, 1)]);
            let without = text.replace(names(), "");
            let groups = split(contents(without.as_bytes()).unwrap()).unwrap();
            assert_eq!((groups.len(), groups[0].0.as_deref(), groups[0].1.vertices.len()), (1, None, 5));
        }
    }
}
