//! The sections `$Nodes` and `$Elements`, and the sequence of sections in a file.

use super::super::file::Parsed;
use super::content::Content;
use super::groups;
use super::source::Source;

/// Gmsh's number for the four-node tetrahedron.
pub(super) const TET: i64 = 4;
/// Gmsh's number for the ten-node tetrahedron.
const CURVED_TET: i64 = 11;
/// Nodes of Gmsh's element types, from type 1 on.
const NODES: [usize; 31] =
    [2, 3, 4, 4, 8, 6, 5, 3, 6, 9, 10, 27, 18, 14, 1, 8, 20, 15, 13, 9, 10, 12, 15, 15, 21, 4, 5, 6, 20, 35, 56];

pub(super) fn contents(bytes: &[u8]) -> Parsed<Content> {
    let mut source = Source::new(bytes);
    if source.line() != b"$MeshFormat" {
        return Err("a Gmsh file must start with $MeshFormat".into());
    }
    let version = source.word()?.to_string();
    let encoding = source.word()?.to_string();
    let old = version == "2.2" || version == "2";
    if !old && version != "4.1" {
        return Err(format!("Gmsh format {version} is not supported; save the file as 4.1 or 2.2"));
    }
    let word_size = source.word()?;
    if word_size != "8" || !matches!(encoding.as_str(), "0" | "1") {
        return Err(format!("encoding {encoding} with numbers of {word_size} bytes; supported are 0 and 1 with 8"));
    }
    source.line();
    source.binary = encoding == "1";
    if source.binary && source.int()? != 1 {
        return Err("the binary numbers must be little-endian".into());
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
        return Err(format!("$Nodes states {total} nodes and contains {}", content.nodes.len()));
    }
    Ok(())
}

fn read_elements_2(source: &mut Source<'_>, content: &mut Content) -> Parsed<()> {
    let count = source.text_count()?;
    source.expect(count, if source.binary { 8 } else { 6 }, "elements")?;
    let mut read = 0;
    while read < count {
        // Text has tag, type and number of tags for each element. Binary has type and number of
        // tags once for a run of elements.
        let (tag, kind, run, tags) = if source.binary {
            let (kind, run, tags) = (source.int()?, source.tag_2()?, source.tag_2()?);
            (None, kind, run, tags)
        } else {
            let tag = source.tag_2()?;
            let (kind, tags) = (source.int()?, source.tag_2()?);
            (Some(tag), kind, 1, tags)
        };
        if run == 0 || run > count - read {
            return Err(format!("$Elements states {count} elements, but a run of {run} follows the first {read}"));
        }
        let corners = node_count(kind)?;
        for _ in 0..run {
            let tag = tag.map_or_else(|| source.tag_2(), Ok)?;
            let mut group = 0;
            for k in 0..tags {
                let tag = source.int()?;
                // The first tag is the physical group.
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
        return Err(format!("$Elements states {total} elements and contains {read}"));
    }
    Ok(())
}

fn node_count(kind: i64) -> Parsed<usize> {
    if kind == CURVED_TET {
        return Err("the tetrahedra are of second order (10 nodes); save them with 4 nodes".into());
    }
    let known = usize::try_from(kind).ok().and_then(|k| NODES.get(k.wrapping_sub(1)));
    known.copied().ok_or_else(|| format!("element type {kind} is unknown"))
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
