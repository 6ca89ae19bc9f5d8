//! Reads untrusted XML: size, entities and numbers are checked.

use crate::{Error, Result};
use glam::DVec3;
use roxmltree::{Document, Node, ParsingOptions};
use std::io::Read;
use std::path::Path;

/// Maximum size of a file (bytes). Descriptions of arms have some tens of kilobytes; meshes are
/// separate files.
const MAX_FILE_SIZE: u64 = 16 << 20;
/// Maximum number of nodes, which bounds memory.
const MAX_NODES: u32 = 300_000;
/// Maximum nesting, because readers may recurse.
const MAX_NESTING: usize = 256;

/// A file, and errors about it.
#[derive(Clone, Copy)]
pub(super) struct Source<'p> {
    pub path: &'p Path,
}

impl<'p> Source<'p> {
    /// An error about the file, in one line.
    pub fn fail(&self, reason: impl Into<String>) -> Error {
        let reason = reason.into().replace(char::is_control, " ");
        Error::Description { path: self.path.to_owned(), reason }
    }

    /// Reads the file's text.
    pub fn read(path: &'p Path) -> Result<(Self, String)> {
        let source = Self { path };
        let io = |e| Error::Io { path: path.to_owned(), source: e };
        let mut bytes = Vec::new();
        std::fs::File::open(path).map_err(io)?.take(MAX_FILE_SIZE + 1).read_to_end(&mut bytes).map_err(io)?;
        if bytes.len() as u64 > MAX_FILE_SIZE {
            return Err(source
                .fail(format!("is larger than {} MiB, the maximum for a description of an arm", MAX_FILE_SIZE >> 20)));
        }
        let text = String::from_utf8(bytes).map_err(|e| source.fail(format!("is not UTF-8 text: {e}")))?;
        // Checked before parsing, which may overflow the stack.
        if nesting(&text) > MAX_NESTING {
            return Err(source.fail(format!("elements are nested deeper than {MAX_NESTING}")));
        }
        Ok((source, text))
    }

    /// Parses the document, whose root element must be `root`.
    pub fn parse<'t>(&self, text: &'t str, root: &str) -> Result<Document<'t>> {
        let options = ParsingOptions { allow_dtd: false, nodes_limit: MAX_NODES, ..ParsingOptions::default() };
        let document = Document::parse_with_options(text, options).map_err(|e| self.fail(e.to_string()))?;
        let found = document.root_element().tag_name().name();
        if found != root {
            return Err(self.fail(format!("the root element is <{}>; it must be <{root}>", shown(found))));
        }
        Ok(document)
    }

    /// The numbers of an attribute; `None` if it is missing.
    pub fn numbers<const N: usize>(&self, node: Node<'_, '_>, name: &str) -> Result<Option<[f64; N]>> {
        node.attribute(name).map(|text| self.parse_numbers(text, &place(node), name)).transpose()
    }

    /// `N` finite numbers.
    pub fn parse_numbers<const N: usize>(&self, text: &str, place: &str, name: &str) -> Result<[f64; N]> {
        let mut values = [0.0; N];
        let mut count = 0;
        for word in text.split_whitespace() {
            let value = word.parse::<f64>().ok().filter(|v| v.is_finite());
            let value = value
                .ok_or_else(|| self.fail(format!("{place}: '{}' in {name} is not a finite number", shown(word))))?;
            if let Some(slot) = values.get_mut(count) {
                *slot = value;
            }
            count += 1;
        }
        if count != N {
            return Err(self.fail(format!("{place}: {name} has {count} numbers; it must have {N}")));
        }
        Ok(values)
    }

    pub fn number(&self, node: Node<'_, '_>, name: &str) -> Result<Option<f64>> {
        Ok(self.numbers::<1>(node, name)?.map(|[v]| v))
    }

    pub fn vector(&self, node: Node<'_, '_>, name: &str) -> Result<Option<DVec3>> {
        Ok(self.numbers::<3>(node, name)?.map(DVec3::from_array))
    }

    /// A required attribute.
    pub fn required<'a>(&self, node: Node<'a, '_>, name: &str) -> Result<&'a str> {
        node.attribute(name).ok_or_else(|| self.fail(format!("{}: the attribute '{name}' is missing", place(node))))
    }

    /// Adds the file to an error of the arm's own checks.
    pub fn explain(&self, error: Error) -> Error {
        match error {
            Error::Invalid { what, reason } => self.fail(format!("{what}: {reason}")),
            other => other,
        }
    }
}

/// An element in error messages: its line, kind and name.
pub(super) fn place(node: Node<'_, '_>) -> String {
    let line = node.document().text_pos_at(node.range().start).row;
    let kind = node.tag_name().name();
    match node.attribute("name") {
        Some(name) => format!("line {line}, <{kind}> '{}'", shown(name)),
        None => format!("line {line}, <{kind}>"),
    }
}

/// A word of the file, shortened for error messages.
pub(super) fn shown(word: &str) -> String {
    let mut short: String = word.chars().take(60).collect();
    if short.len() < word.len() {
        short.push('…');
    }
    short
}

/// The child elements of one kind.
pub(super) fn children<'a, 'i>(node: Node<'a, 'i>, kind: &str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |c| c.has_tag_name(kind))
}

/// An upper bound of the nesting: opening tags minus closing tags.
fn nesting(text: &str) -> usize {
    let bytes = text.as_bytes();
    let (mut depth, mut deepest) = (0usize, 0);
    let mut i = 0;
    while let Some(at) = bytes.get(i..).and_then(|rest| rest.iter().position(|&b| b == b'<')) {
        i += at + 1;
        if bytes.get(i..).is_some_and(|r| r.starts_with(b"!--")) {
            match text.get(i..).and_then(|r| r.find("-->")) {
                Some(end) => i += end,
                None => break,
            }
            continue;
        }
        match bytes.get(i) {
            Some(b'/') => depth = depth.saturating_sub(1),
            Some(b'!' | b'?') | None => {}
            Some(_) => {
                let end = bytes[i..].iter().position(|&b| b == b'>').map_or(bytes.len(), |e| i + e);
                if bytes[end - 1] != b'/' {
                    depth += 1;
                    deepest = deepest.max(depth);
                }
            }
        }
    }
    deepest
}
