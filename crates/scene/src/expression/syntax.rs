//! From text to a tree of words, numbers and operators, with the place of each.

use super::{Mistake, Unit};
use winnow::error::{ErrMode, ParserError};
use winnow::stream::{LocatingSlice, Location, Stream};
use winnow::token::{literal, take_while};
use winnow::{ModalResult, Parser};

/// Longest expression (bytes) and deepest nesting of brackets.
const MAX_BYTES: usize = 1000;
const MAX_DEPTH: usize = 12;

/// Words that are no names.
const KEYWORDS: [&str; 7] = ["and", "or", "not", "then", "while", "for", "in"];

/// A part of an expression and the byte where it begins.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tree {
    pub at: usize,
    pub node: Node,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Node {
    Number {
        value: f64,
        unit: Option<Unit>,
    },
    /// `lift_mm`, `gates.lift_mm`, `right.tip` or `organ.appendix`.
    Name(String),
    Call {
        name: String,
        arguments: Vec<Tree>,
    },
    /// `organ.appendix[0.3, 0.7]`.
    Part {
        organ: String,
        range: Box<[Tree; 2]>,
    },
    Negative(Box<Tree>),
    Arithmetic {
        sign: char,
        sides: Box<[Tree; 2]>,
    },
    Compare {
        sign: &'static str,
        sides: Box<[Tree; 2]>,
    },
    /// `x in [low, high]`.
    Within {
        what: Box<Tree>,
        range: Box<[Tree; 2]>,
    },
    /// `attached(left) in organ.appendix[0.3, 0.7]`.
    In {
        what: Box<Tree>,
        organ: Box<Tree>,
    },
    Not(Box<Tree>),
    All(Vec<Tree>),
    Any(Vec<Tree>),
    Lasts {
        what: Box<Tree>,
        time: Box<Tree>,
    },
    Sequence {
        first: Box<Tree>,
        last: Box<Tree>,
        during: Option<Box<Tree>>,
    },
}

type Input<'a> = LocatingSlice<&'a str>;
type Parsed<T> = ModalResult<T, Mistake>;

impl<'a> ParserError<Input<'a>> for Mistake {
    type Inner = Self;

    fn from_input(input: &Input<'a>) -> Self {
        Self::new(input.current_token_start(), "cannot be read")
    }

    fn into_inner(self) -> Result<Self::Inner, Self> {
        Ok(self)
    }
}

/// The tree of `text`.
pub(crate) fn parse(text: &str) -> Result<Tree, Mistake> {
    if text.len() > MAX_BYTES {
        return Err(Mistake::new(0, format!("has {} bytes; at most {MAX_BYTES}: use more stages", text.len())));
    }
    let mut depth = 0_usize;
    for (at, c) in text.char_indices() {
        match c {
            '(' | '[' => depth += 1,
            ')' | ']' => depth = depth.saturating_sub(1),
            _ => {}
        }
        if depth > MAX_DEPTH {
            return Err(Mistake::new(at, format!("brackets are nested deeper than {MAX_DEPTH}; use more stages")));
        }
    }
    let mut input = LocatingSlice::new(text);
    let made = whole(&mut input);
    made.map_err(|e| match e {
        ErrMode::Backtrack(mistake) | ErrMode::Cut(mistake) => mistake,
        ErrMode::Incomplete(_) => Mistake::new(text.len(), "ends too early"),
    })
}

fn whole(input: &mut Input<'_>) -> Parsed<Tree> {
    let tree = condition(input)?;
    let at = here(input);
    if input.is_empty() {
        return Ok(tree);
    }
    let found = shown(input);
    let more = if matches!(tree.node, Node::Lasts { .. } | Node::Sequence { .. }) {
        "; put what comes before it in parentheses"
    } else {
        ""
    };
    Err(wrong(at, format!("'{found}' is not expected here{more}")))
}

fn wrong(at: usize, reason: impl Into<String>) -> ErrMode<Mistake> {
    ErrMode::Cut(Mistake::new(at, reason))
}

/// The place of the next word, after spaces.
fn here(input: &mut Input<'_>) -> usize {
    // Spaces may be none, so this cannot fail.
    let _ = take_while::<_, _, ErrMode<Mistake>>(0.., char::is_whitespace).parse_next(input);
    input.current_token_start()
}

/// The next word, for messages.
fn shown(input: &Input<'_>) -> String {
    let rest: &str = input.as_ref();
    let word: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').take(40).collect();
    if word.is_empty() { rest.chars().take(1).flat_map(char::escape_default).collect() } else { word }
}

fn is_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// Takes `sign` if it comes next.
fn sign(input: &mut Input<'_>, sign: &'static str) -> bool {
    here(input);
    literal::<_, _, ErrMode<Mistake>>(sign).parse_next(input).is_ok()
}

/// Takes the word `word` if it comes next, whole.
fn word(input: &mut Input<'_>, word: &'static str) -> bool {
    here(input);
    let start = input.checkpoint();
    match take_while::<_, _, ErrMode<Mistake>>(1.., is_name).parse_next(input) {
        Ok(found) if found == word => true,
        _ => {
            input.reset(&start);
            false
        }
    }
}

fn expect(input: &mut Input<'_>, what: &'static str) -> Parsed<()> {
    if sign(input, what) {
        return Ok(());
    }
    let at = here(input);
    let found = if input.is_empty() { "the end".to_owned() } else { format!("'{}'", shown(input)) };
    Err(wrong(at, format!("'{what}' is expected here, not {found}")))
}

fn boxed(tree: Tree) -> Box<Tree> {
    Box::new(tree)
}

fn condition(input: &mut Input<'_>) -> Parsed<Tree> {
    let at = here(input);
    let first = any(input)?;
    if word(input, "then") {
        let last = any(input)?;
        let during = if word(input, "while") { Some(boxed(any(input)?)) } else { None };
        return Ok(Tree { at, node: Node::Sequence { first: boxed(first), last: boxed(last), during } });
    }
    if word(input, "for") {
        let time = sum(input)?;
        return Ok(Tree { at, node: Node::Lasts { what: boxed(first), time: boxed(time) } });
    }
    Ok(first)
}

fn any(input: &mut Input<'_>) -> Parsed<Tree> {
    list(input, "or", all, Node::Any)
}

fn all(input: &mut Input<'_>) -> Parsed<Tree> {
    list(input, "and", not, Node::All)
}

fn list(
    input: &mut Input<'_>,
    between: &'static str,
    one: fn(&mut Input<'_>) -> Parsed<Tree>,
    node: fn(Vec<Tree>) -> Node,
) -> Parsed<Tree> {
    let at = here(input);
    let first = one(input)?;
    let mut trees = vec![first];
    while word(input, between) {
        trees.push(one(input)?);
    }
    Ok(match <[Tree; 1]>::try_from(trees) {
        Ok([only]) => only,
        Err(trees) => Tree { at, node: node(trees) },
    })
}

fn not(input: &mut Input<'_>) -> Parsed<Tree> {
    let at = here(input);
    let mut times = 0;
    while word(input, "not") {
        times += 1;
    }
    let tree = compare(input)?;
    Ok((0..times).fold(tree, |tree, _| Tree { at, node: Node::Not(boxed(tree)) }))
}

fn compare(input: &mut Input<'_>) -> Parsed<Tree> {
    let at = here(input);
    let left = sum(input)?;
    if word(input, "in") {
        let place = here(input);
        if sign(input, "[") {
            let range = range(input)?;
            return Ok(Tree { at, node: Node::Within { what: boxed(left), range } });
        }
        let organ = atom(input)?;
        let is_organ = match &organ.node {
            Node::Part { .. } => true,
            Node::Name(name) => name == "organ" || name.starts_with("organ."),
            _ => false,
        };
        if !is_organ {
            return Err(wrong(place, "a range as [0.3, 0.7] or an organ as organ.appendix[0.3, 0.7] is expected here"));
        }
        return Ok(Tree { at, node: Node::In { what: boxed(left), organ: boxed(organ) } });
    }
    for operator in ["<=", ">=", "<", ">"] {
        if sign(input, operator) {
            let right = sum(input)?;
            return Ok(Tree { at, node: Node::Compare { sign: operator, sides: Box::new([left, right]) } });
        }
    }
    let place = here(input);
    if sign(input, "=") || sign(input, "!") {
        return Err(wrong(place, "numbers are compared by <, <=, > and >=, or by `in [low, high]`"));
    }
    Ok(left)
}

/// What follows the bracket of a range.
fn range(input: &mut Input<'_>) -> Parsed<Box<[Tree; 2]>> {
    let low = sum(input)?;
    expect(input, ",")?;
    let high = sum(input)?;
    expect(input, "]")?;
    Ok(Box::new([low, high]))
}

fn sum(input: &mut Input<'_>) -> Parsed<Tree> {
    arithmetic(input, ["+", "-"], product)
}

fn product(input: &mut Input<'_>) -> Parsed<Tree> {
    arithmetic(input, ["*", "/"], signed)
}

fn arithmetic(
    input: &mut Input<'_>,
    signs: [&'static str; 2],
    one: fn(&mut Input<'_>) -> Parsed<Tree>,
) -> Parsed<Tree> {
    let at = here(input);
    let mut tree = one(input)?;
    while let Some(operator) = signs.into_iter().find(|s| sign(input, s)) {
        let right = one(input)?;
        let operator = operator.chars().next().unwrap_or('+');
        tree = Tree { at, node: Node::Arithmetic { sign: operator, sides: Box::new([tree, right]) } };
    }
    Ok(tree)
}

fn signed(input: &mut Input<'_>) -> Parsed<Tree> {
    let at = here(input);
    if sign(input, "-") {
        return Ok(Tree { at, node: Node::Negative(boxed(atom(input)?)) });
    }
    atom(input)
}

fn atom(input: &mut Input<'_>) -> Parsed<Tree> {
    let at = here(input);
    if sign(input, "(") {
        let tree = condition(input)?;
        expect(input, ")")?;
        return Ok(tree);
    }
    let rest: &str = input.as_ref();
    match rest.chars().next() {
        Some(c) if c.is_ascii_digit() => number(input, at),
        Some(c) if c.is_ascii_alphabetic() => named(input, at),
        None => Err(wrong(at, "a value is missing at the end")),
        Some(_) => Err(wrong(at, format!("'{}' is not expected here; a name or a number is", shown(input)))),
    }
}

fn number(input: &mut Input<'_>, at: usize) -> Parsed<Tree> {
    let text = take_while::<_, _, ErrMode<Mistake>>(1.., |c: char| c.is_ascii_digit() || c == '.').parse_next(input)?;
    let value: f64 = text.parse().map_err(|_| wrong(at, format!("'{text:.40}' is no number")))?;
    if !value.is_finite() || value > 1e9 {
        return Err(wrong(at, "a number must be at most 1e9"));
    }
    let place = here(input);
    let start = input.checkpoint();
    let unit = take_while::<_, _, ErrMode<Mistake>>(0.., is_name).parse_next(input)?;
    if unit.is_empty() || KEYWORDS.contains(&unit) {
        input.reset(&start);
        return Ok(Tree { at, node: Node::Number { value, unit: None } });
    }
    let after = input.checkpoint();
    let rate = literal::<_, _, ErrMode<Mistake>>("/s").parse_next(input).is_ok();
    let name = if rate { format!("{unit}/s") } else { unit.to_owned() };
    if let Some(unit) = Unit::named(&name) {
        return Ok(Tree { at, node: Node::Number { value, unit: Some(unit) } });
    }
    input.reset(&after);
    Err(wrong(place, format!("'{name:.40}' is no unit; the units are {}", Unit::list())))
}

/// The letters, digits and underscores that come next, and hyphens where they may.
fn taken<'a>(input: &mut Input<'a>, hyphen: bool) -> Parsed<&'a str> {
    take_while(0.., move |c: char| is_name(c) || hyphen && c == '-').parse_next(input)
}

fn named(input: &mut Input<'_>, at: usize) -> Parsed<Tree> {
    let mut name = taken(input, false)?.to_owned();
    if KEYWORDS.contains(&name.as_str()) {
        return Err(wrong(at, format!("a value is expected here, not '{name}'")));
    }
    if literal::<_, _, ErrMode<Mistake>>(".").parse_next(input).is_ok() {
        let is_organ = name == "organ";
        name.push('.');
        // Names of organs have hyphens; `a.b-c` of all others is a difference.
        name += taken(input, is_organ)?;
    }
    if sign(input, "(") {
        let mut arguments = Vec::new();
        if !sign(input, ")") {
            arguments.push(condition(input)?);
            while sign(input, ",") {
                arguments.push(condition(input)?);
            }
            expect(input, ")")?;
        }
        return Ok(Tree { at, node: Node::Call { name, arguments } });
    }
    if (name == "organ" || name.starts_with("organ.")) && sign(input, "[") {
        let range = range(input)?;
        return Ok(Tree { at, node: Node::Part { organ: name, range } });
    }
    Ok(Tree { at, node: Node::Name(name) })
}
