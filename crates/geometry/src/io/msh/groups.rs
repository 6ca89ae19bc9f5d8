//! Physical groups of a Gmsh file: the names of its parts.

use super::super::file::Parsed;
use super::content::{Content, assemble};
use super::source::Source;
use crate::TetMesh;

/// Gmsh's number for volumes.
const VOLUME: i64 = 3;

/// `$PhysicalNames`, which is text in every file: a count, then one line per group with dimension,
/// number and quoted name.
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

/// `$Entities` of version 4.1: the physical group of each volume.
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
                // Negative for a volume with reversed orientation.
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

/// One mesh per named group, after the elements without one.
pub(super) fn split(mut content: Content) -> Parsed<Vec<(Option<String>, TetMesh)>> {
    // The whole file must be valid, whatever the groups.
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
