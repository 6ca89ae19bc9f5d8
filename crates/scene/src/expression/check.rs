//! The meaning of an expression in a scene: names are resolved, units compared, types checked.

use super::measure::{Measure, Part, Place, Target};
use super::names::{Needs, channel, channel_names, unit_at_end};
use super::syntax::{Node, Tree};
use super::{Comparison, Condition, Mistake, Number, Operation, Unit};
use crate::{InstrumentKind, Side};
use trocar_specimen::nearest;

type Checked<T> = Result<T, Mistake>;

/// Most measures of a task: every row has room for as many.
pub const MAX_MEASURES: usize = 16;

const FUNCTIONS: [&str; 14] = [
    "attached", "in_mouth", "force", "jaw", "distance", "moved", "aside", "risen", "visible", "abs", "min", "max",
    "clamp", "near",
];

/// Whether an expression is a hint's, which looks back over all rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hints {
    No,
    Yes,
}

/// Resolves the names and units of expressions, and collects their needs and measures.
#[derive(Debug)]
pub(crate) struct Checker<'a> {
    /// The task's organ.
    pub organ: &'a str,
    /// The specimen's organs, where these are known.
    pub organs: Option<&'a [&'a str]>,
    /// The scene's arms, left first.
    pub arms: &'a [(Side, InstrumentKind)],
    /// Names of the scene's cameras.
    pub cameras: &'a [String],
    /// Names of gates and constants, as `gates.lift_mm`.
    pub constants: &'a [String],
    /// Measures so far.
    pub measures: Vec<Measure>,
    /// Of the expressions since it was last taken.
    pub needs: Needs,
    /// Timers and marks of the stage so far.
    pub timers: Vec<Number>,
    pub marks: usize,
    /// Looking back is allowed.
    pub hints: Hints,
    /// `lasted` and `armed` are allowed.
    pub in_progress: bool,
}

/// The kind of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Kind {
    unit: Unit,
    /// It is a number as it is written, without a unit.
    bare: bool,
    /// Its name ends in its unit, so that a bare number beside it is clear.
    told: bool,
    flag: bool,
}

const PLAIN: Kind = Kind { unit: Unit::None, bare: false, told: false, flag: false };

fn shown(text: &str) -> String {
    text.chars().take(60).flat_map(char::escape_default).collect()
}

/// What a name that is not known may mean, as the end of a message.
fn did_you_mean<'n>(given: &str, known: impl IntoIterator<Item = &'n str>) -> String {
    nearest(given, known).map_or_else(String::new, |n| format!("; did you mean '{n}'?"))
}

impl Checker<'_> {
    /// The condition of `tree`.
    pub fn condition(&mut self, tree: &Tree) -> Checked<Condition> {
        Ok(match &tree.node {
            Node::All(trees) => Condition::All(self.conditions(trees)?),
            Node::Any(trees) => Condition::Any(self.conditions(trees)?),
            Node::Not(tree) => Condition::Not(Box::new(self.condition(tree)?)),
            Node::Compare { sign, sides } => {
                let [left, right] = &**sides;
                let (left, right, _) = self.agreed(left, right)?;
                let comparison = match *sign {
                    "<" => Comparison::Less,
                    "<=" => Comparison::AtMost,
                    ">" => Comparison::Greater,
                    _ => Comparison::AtLeast,
                };
                Condition::Compare(left, comparison, right)
            }
            Node::Within { what, range } => {
                let (value, low, _) = self.agreed(what, &range[0])?;
                let (_, high, _) = self.agreed(what, &range[1])?;
                Condition::Within(value, low, high)
            }
            Node::In { what, organ } => self.held_in(what, organ)?,
            Node::Lasts { .. } | Node::Sequence { .. } if self.in_progress || self.hints == Hints::Yes => {
                return Err(Mistake::new(tree.at, "`for` and `then` belong in a stage's `when`"));
            }
            Node::Lasts { what, time } => {
                let what = Box::new(self.condition(what)?);
                let seconds = self.in_unit(time, Unit::Second)?;
                self.timers.push(seconds.clone());
                Condition::Lasts { what, seconds, timer: self.timers.len() - 1 }
            }
            Node::Sequence { first, last, during } => {
                let first = Box::new(self.condition(first)?);
                let last = Box::new(self.condition(last)?);
                let during = during.as_ref().map(|d| self.condition(d).map(Box::new)).transpose()?;
                self.marks += 1;
                Condition::Sequence { first, last, during, mark: self.marks - 1 }
            }
            _ => {
                let (number, kind) = self.number(tree)?;
                if !kind.flag {
                    let right =
                        if kind.unit == Unit::None { "> 0.5".to_owned() } else { format!("> 1 {}", kind.unit.name()) };
                    let reason =
                        format!("is a number where a condition is needed; compare it, for example with `{right}`");
                    return Err(Mistake::new(tree.at, reason));
                }
                Condition::Flag(number)
            }
        })
    }

    fn conditions(&mut self, trees: &[Tree]) -> Checked<Vec<Condition>> {
        trees.iter().map(|tree| self.condition(tree)).collect()
    }

    /// `attached(left) in organ.appendix[0.3, 0.7]`, `in_mouth(right) in organ.appendix`.
    fn held_in(&mut self, what: &Tree, organ: &Tree) -> Checked<Condition> {
        let usage =
            "`in organ` follows attached(ARM) or in_mouth(ARM), such as attached(left) in organ.appendix[0.3, 0.7]";
        let Node::Call { name, arguments } = &what.node else { return Err(Mistake::new(what.at, usage)) };
        let (organ_name, range) = match &organ.node {
            Node::Part { organ, range } => (organ, Some(range)),
            Node::Name(organ) => (organ, None),
            _ => return Err(Mistake::new(organ.at, usage)),
        };
        let organ_name = self.organ_named(organ.at, organ_name)?;
        let side = self.only_arm(what.at, name, arguments)?;
        match (name.as_str(), range) {
            ("attached", range) => {
                let held = self.measure(what.at, Measure::Held(side, organ_name))?;
                let (low, high) = match range {
                    Some(range) => (self.in_unit(&range[0], Unit::None)?, self.in_unit(&range[1], Unit::None)?),
                    None => (Number::Literal(0.0), Number::Literal(1.0)),
                };
                Ok(Condition::Within(held, low, high))
            }
            ("in_mouth", None) => Ok(Condition::Flag(self.measure(what.at, Measure::InMouth(side, organ_name))?)),
            ("in_mouth", Some(_)) => {
                Err(Mistake::new(organ.at, "in_mouth(ARM) needs a whole organ, such as in_mouth(right) in organ.cecum"))
            }
            _ => Err(Mistake::new(what.at, usage)),
        }
    }

    /// A number, which is no flag as a condition but may be one as 0 or 1.
    fn number(&mut self, tree: &Tree) -> Checked<(Number, Kind)> {
        match &tree.node {
            Node::Number { value, unit } => {
                let kind = Kind { unit: unit.unwrap_or(Unit::None), bare: unit.is_none(), ..PLAIN };
                Ok((Number::Literal(*value), kind))
            }
            Node::Name(name) => self.named(tree.at, name),
            Node::Call { name, arguments } => self.call(tree.at, name, arguments),
            Node::Negative(of) => {
                let (number, kind) = self.number(of)?;
                let number = match number {
                    Number::Literal(value) => Number::Literal(-value),
                    other => Number::Negative(Box::new(other)),
                };
                Ok((number, Kind { flag: false, ..kind }))
            }
            Node::Arithmetic { sign, sides } => self.arithmetic(*sign, sides),
            Node::Part { .. } => {
                Err(Mistake::new(tree.at, "an organ is no number; use distance, moved, aside or risen of it"))
            }
            _ => Err(Mistake::new(tree.at, "is a condition where a number is needed")),
        }
    }

    fn arithmetic(&mut self, sign: char, sides: &[Tree; 2]) -> Checked<(Number, Kind)> {
        let [left, right] = sides;
        if sign == '+' || sign == '-' {
            let (a, b, kind) = self.agreed(left, right)?;
            let operation = if sign == '+' { Operation::Add } else { Operation::Subtract };
            return Ok((Number::Arithmetic(operation, Box::new([a, b])), kind));
        }
        let ((a, a_kind), (b, b_kind)) = (self.number(left)?, self.number(right)?);
        let bare = a_kind.bare && b_kind.bare;
        if sign == '*' {
            let unit = match (a_kind.unit, b_kind.unit) {
                (unit, Unit::None) | (Unit::None, unit) => unit,
                (x, y) => {
                    let reason = format!(
                        "{} times {} has no unit here; one of the two must be a plain number",
                        x.what(),
                        y.what()
                    );
                    return Err(Mistake::new(right.at, reason));
                }
            };
            return Ok((Number::Arithmetic(Operation::Multiply, Box::new([a, b])), Kind { unit, bare, ..PLAIN }));
        }
        let (b, unit) = match (a_kind.unit, b_kind.unit) {
            (unit, Unit::None) => (b, unit),
            (x, y) => match y.factor_to(x) {
                Some(factor) => (scaled(b, factor), Unit::None),
                None => {
                    let reason = format!("{} over {} has no unit here", x.what(), y.what());
                    return Err(Mistake::new(right.at, reason));
                }
            },
        };
        Ok((Number::Arithmetic(Operation::Divide, Box::new([a, b])), Kind { unit, bare, ..PLAIN }))
    }

    /// Two numbers in the same unit, the left one's.
    fn agreed(&mut self, left: &Tree, right: &Tree) -> Checked<(Number, Number, Kind)> {
        let ((a, a_kind), (b, b_kind)) = (self.number(left)?, self.number(right)?);
        let kind = |of: Kind| Kind { flag: false, bare: a_kind.bare && b_kind.bare, ..of };
        if a_kind.unit == b_kind.unit {
            return Ok((a, b, kind(a_kind)));
        }
        let needs_unit = |bare: &Tree, unit: Unit| {
            let value =
                if let Node::Number { value, .. } = bare.node { value.to_string() } else { "the number".to_owned() };
            Mistake::new(
                bare.at,
                format!("has no unit, and what it goes with is a {}; write {value} {}", unit.what(), unit.name()),
            )
        };
        match (a_kind.bare, b_kind.bare) {
            (true, _) if b_kind.told => return Ok((a, b, kind(b_kind))),
            (_, true) if a_kind.told => return Ok((a, b, kind(a_kind))),
            (true, _) => return Err(needs_unit(left, b_kind.unit)),
            (_, true) => return Err(needs_unit(right, a_kind.unit)),
            _ => {}
        }
        match b_kind.unit.factor_to(a_kind.unit) {
            Some(factor) => Ok((a, scaled(b, factor), kind(a_kind))),
            None => {
                let said = |unit: Unit| {
                    if unit == Unit::None {
                        "a plain number".to_owned()
                    } else {
                        format!("a {} ({})", unit.what(), unit.name())
                    }
                };
                let reason = format!("is {}, and what it goes with is {}", said(b_kind.unit), said(a_kind.unit));
                Err(Mistake::new(right.at, reason))
            }
        }
    }

    /// A number in `unit`.
    fn in_unit(&mut self, tree: &Tree, unit: Unit) -> Checked<Number> {
        let (number, kind) = self.number(tree)?;
        if kind.unit == unit {
            return Ok(number);
        }
        if kind.bare {
            return Err(Mistake::new(
                tree.at,
                format!("has no unit; a {} is needed, such as 0.5 {}", unit.what(), unit.name()),
            ));
        }
        match kind.unit.factor_to(unit) {
            Some(factor) => Ok(scaled(number, factor)),
            None => Err(Mistake::new(tree.at, format!("is a {}; a {} is needed", kind.unit.what(), unit.what()))),
        }
    }

    fn named(&mut self, at: usize, name: &str) -> Checked<(Number, Kind)> {
        if let Some(found) = channel(name) {
            if let Some(side) = found.side {
                self.has_arm(at, side)?;
            }
            self.needs = self.needs.and(found.needs);
            let kind = Kind { unit: found.unit, told: true, flag: found.flag, bare: false };
            return Ok((Number::Channel(found.place), kind));
        }
        if let Some(place) = self.constants.iter().position(|c| c == name) {
            return Ok((Number::Constant(place), Kind { unit: unit_at_end(name), told: true, ..PLAIN }));
        }
        match name {
            "lasted" | "armed" if !self.in_progress => {
                return Err(Mistake::new(at, format!("{name} is known in `progress` only")));
            }
            "lasted" => {
                return match self.timers.first() {
                    Some(time) => Ok((Number::Lasted(Box::new(time.clone())), PLAIN)),
                    None => Err(Mistake::new(at, "lasted needs a `for` in the stage's `when`")),
                };
            }
            "armed" if self.marks == 0 => return Err(Mistake::new(at, "armed needs a `then` in the stage's `when`")),
            "armed" => return Ok((Number::Armed, Kind { flag: true, ..PLAIN })),
            _ => {}
        }
        let as_call = FUNCTIONS.contains(&name);
        if as_call {
            return Err(Mistake::new(at, format!("{name} is a function; write {name}(...)")));
        }
        if name.ends_with(".tip") || name.ends_with(".jaws") || name == "organ" || name.starts_with("organ.") {
            let reason = format!("{} is a place and no number; use distance, moved, aside or risen of it", shown(name));
            return Err(Mistake::new(at, reason));
        }
        let known = channel_names();
        let all = known.iter().chain(self.constants).map(String::as_str);
        let same = self.constants.iter().find(|c| c.split_once('.').is_some_and(|(_, own)| own == name));
        let hint = match same {
            Some(same) => format!("; did you mean '{same}'?"),
            None => did_you_mean(name, all.chain(FUNCTIONS)),
        };
        Err(Mistake::new(at, format!("there is no channel '{}'{hint}", shown(name))))
    }

    fn call(&mut self, at: usize, name: &str, arguments: &[Tree]) -> Checked<(Number, Kind)> {
        let millimetres = Kind { unit: Unit::Millimetre, ..PLAIN };
        match name {
            "attached" | "in_mouth" | "jaw" => {
                let side = self.only_arm(at, name, arguments)?;
                self.named(at, &format!("{}_{name}", side.name()))
            }
            "force" => {
                let side = self.only_arm(at, name, arguments)?;
                Ok((Number::Force(side as usize), Kind { unit: Unit::Newton, ..PLAIN }))
            }
            "distance" => {
                let [a, b] =
                    self.arguments(at, name, arguments, "two places, such as distance(right.tip, organ.appendix)")?;
                let (a, b) = match (self.target(a)?, self.target(b)?) {
                    (Target::Place(a), b) | (b, Target::Place(a)) => (a, b),
                    _ => {
                        return Err(Mistake::new(
                            at,
                            "distance needs a point of an instrument, such as right.tip or left.jaws",
                        ));
                    }
                };
                Ok((self.measure(at, Measure::Distance(a, b))?, millimetres))
            }
            "moved" | "aside" | "risen" => {
                let usage = "an organ or a point, such as organ.appendix[0.4, 0.6] or left.tip";
                let [what] = self.arguments(at, name, arguments, usage)?;
                let what = self.target(what)?;
                let measure = match name {
                    "moved" => Measure::Moved(what),
                    "aside" => Measure::Aside(what),
                    _ => Measure::Risen(what),
                };
                Ok((self.measure(at, measure)?, millimetres))
            }
            "visible" => {
                let usage = "a camera and an organ, such as visible(endoscope, organ.gallbladder[0, 0.3])";
                let [camera, what] = self.arguments(at, name, arguments, usage)?;
                let measure = Measure::Visible(self.camera(camera)?, self.part(what)?);
                Ok((self.measure(at, measure)?, PLAIN))
            }
            "abs" => {
                let [what] = self.arguments(at, name, arguments, "one number")?;
                let (number, kind) = self.number(what)?;
                Ok((Number::Magnitude(Box::new(number)), Kind { flag: false, ..kind }))
            }
            "min" | "max" => {
                let [a, b] = self.arguments(at, name, arguments, "two numbers")?;
                let (a, b, kind) = self.agreed(a, b)?;
                let operation = if name == "min" { Operation::Least } else { Operation::Most };
                Ok((Number::Arithmetic(operation, Box::new([a, b])), kind))
            }
            "clamp" | "near" => {
                let usage = if name == "clamp" {
                    "a number, the least and the most"
                } else {
                    "a distance, how near is near enough, and from how far on it counts"
                };
                let [what, low, high] = self.arguments(at, name, arguments, usage)?;
                let (value, low, kind) = self.agreed(what, low)?;
                let (_, high, _) = self.agreed(what, high)?;
                let all = Box::new([value, low, high]);
                Ok(if name == "clamp" { (Number::Clamp(all), kind) } else { (Number::Near(all), PLAIN) })
            }
            "choose" => {
                let [condition, a, b] = self.arguments(at, name, arguments, "a condition and two numbers")?;
                let condition = self.condition(condition)?;
                let (a, b, kind) = self.agreed(a, b)?;
                Ok((Number::Choose(Box::new(condition), Box::new([a, b])), kind))
            }
            "least" | "most" | "last" if self.hints == Hints::Yes => {
                let [what] = self.arguments(at, name, arguments, "one number")?;
                let (number, kind) = self.number(what)?;
                let number = match name {
                    "least" => Number::LeastOf(Box::new(number)),
                    "most" => Number::MostOf(Box::new(number)),
                    _ => number,
                };
                Ok((number, Kind { flag: false, ..kind }))
            }
            _ => {
                let hint = did_you_mean(name, FUNCTIONS);
                let hint = if hint.is_empty() { format!("; there are {}", FUNCTIONS.join(", ")) } else { hint };
                Err(Mistake::new(at, format!("there is no function '{}'{hint}", shown(name))))
            }
        }
    }

    fn arguments<'t, const N: usize>(
        &self,
        at: usize,
        name: &str,
        all: &'t [Tree],
        usage: &str,
    ) -> Checked<[&'t Tree; N]> {
        let given: Vec<&Tree> = all.iter().collect();
        <[&Tree; N]>::try_from(given)
            .map_err(|given| Mistake::new(at, format!("{name} has {} arguments; it needs {usage}", given.len())))
    }

    fn only_arm(&mut self, at: usize, name: &str, arguments: &[Tree]) -> Checked<Side> {
        let usage = "an arm: left, right, grasper or cutter";
        let [arm] = self.arguments(at, name, arguments, usage)?;
        match &arm.node {
            Node::Name(word) => self.side(arm.at, word),
            _ => Err(Mistake::new(arm.at, format!("{name} needs {usage}"))),
        }
    }

    /// The arm that `word` names.
    fn side(&mut self, at: usize, word: &str) -> Checked<Side> {
        let with = |kind: InstrumentKind| self.arms.iter().find(|(_, k)| *k == kind).map(|(side, _)| *side);
        let side = match word {
            "left" => Side::Left,
            "right" => Side::Right,
            "grasper" | "cutter" => {
                let kind = if word == "grasper" { InstrumentKind::Grasper } else { InstrumentKind::Cutter };
                return with(kind).ok_or_else(|| Mistake::new(at, format!("the scene has no arm with a {word}")));
            }
            _ => {
                let hint = did_you_mean(word, ["left", "right", "grasper", "cutter"]);
                let reason = format!("there is no arm '{}'; left, right, grasper or cutter{hint}", shown(word));
                return Err(Mistake::new(at, reason));
            }
        };
        self.has_arm(at, side)?;
        Ok(side)
    }

    /// The camera that `tree` names.
    fn camera(&self, tree: &Tree) -> Checked<String> {
        let known = || self.cameras.iter().map(String::as_str);
        match &tree.node {
            Node::Name(name) if self.cameras.contains(name) => Ok(name.clone()),
            Node::Name(name) => {
                let all: Vec<&str> = known().collect();
                let (hint, all) = (did_you_mean(name, known()), all.join(", "));
                Err(Mistake::new(tree.at, format!("there is no camera '{}'; the scene has {all}{hint}", shown(name))))
            }
            _ => Err(Mistake::new(tree.at, "a camera of the scene is needed, such as endoscope")),
        }
    }

    fn has_arm(&self, at: usize, side: Side) -> Checked<()> {
        if self.arms.iter().any(|(own, _)| *own == side) {
            return Ok(());
        }
        Err(Mistake::new(at, format!("the scene has no {} arm", side.name())))
    }

    /// The organ's own name; `organ` alone is the task's.
    fn organ_named(&mut self, at: usize, name: &str) -> Checked<String> {
        self.needs.organ |= name == "organ";
        let organ = name.strip_prefix("organ.").unwrap_or(self.organ);
        match self.organs {
            Some(known) if name != "organ" && !known.contains(&organ) => {
                let hint = did_you_mean(organ, known.iter().copied());
                let reason =
                    format!("there is no organ '{}'; the specimen has {}{hint}", shown(organ), known.join(", "));
                Err(Mistake::new(at, reason))
            }
            _ => Ok(organ.to_owned()),
        }
    }

    fn target(&mut self, tree: &Tree) -> Checked<Target> {
        let usage = "a point (left.tip, left.jaws) or an organ (organ.appendix, organ.appendix[0.3, 0.7]) is needed";
        match &tree.node {
            Node::Name(name) if name == "organ" || name.starts_with("organ.") => {
                Ok(Target::Part(Part { organ: self.organ_named(tree.at, name)?, range: [0.0, 1.0] }))
            }
            Node::Part { organ, range } => {
                let mut ends = [0.0; 2];
                for (end, tree) in ends.iter_mut().zip(&**range) {
                    match tree.node {
                        Node::Number { value, unit: None } if (0.0..=1.0).contains(&value) => *end = value,
                        _ => {
                            return Err(Mistake::new(
                                tree.at,
                                "an organ coordinate from 0 to 1 is needed, as a number",
                            ));
                        }
                    }
                }
                if ends[0] > ends[1] {
                    return Err(Mistake::new(tree.at, "the range must rise"));
                }
                Ok(Target::Part(Part { organ: self.organ_named(tree.at, organ)?, range: ends }))
            }
            Node::Name(name) => match name.split_once('.') {
                Some((arm, "tip")) => Ok(Target::Place(Place::Tip(self.side(tree.at, arm)?))),
                Some((arm, "jaws")) => Ok(Target::Place(Place::Jaws(self.side(tree.at, arm)?))),
                _ => Err(Mistake::new(tree.at, usage)),
            },
            _ => Err(Mistake::new(tree.at, usage)),
        }
    }

    fn measure(&mut self, at: usize, measure: Measure) -> Checked<Number> {
        let place = self.measures.iter().position(|m| *m == measure);
        let place = match place {
            Some(place) => place,
            None if self.measures.len() == MAX_MEASURES => {
                return Err(Mistake::new(
                    at,
                    format!("is one measure too many; a task has at most {MAX_MEASURES} different ones"),
                ));
            }
            None => {
                self.measures.push(measure);
                self.measures.len() - 1
            }
        };
        Ok(Number::Measure(place))
    }

    /// A number without a unit, for `progress`.
    pub fn plain(&mut self, tree: &Tree) -> Checked<Number> {
        let (number, kind) = self.number(tree)?;
        if kind.unit == Unit::None {
            return Ok(number);
        }
        let reason =
            format!("is a {}; a number without a unit is needed, such as near(x, 2 mm, 60 mm)", kind.unit.what());
        Err(Mistake::new(tree.at, reason))
    }

    /// A part of an organ, for scripts.
    pub fn part(&mut self, tree: &Tree) -> Checked<Part> {
        match self.target(tree)? {
            Target::Part(part) => Ok(part),
            Target::Place(_) => Err(Mistake::new(tree.at, "an organ is needed, such as organ.appendix[0.3, 0.7]")),
        }
    }

    /// A number in whatever unit, for hints.
    pub fn any(&mut self, tree: &Tree) -> Checked<Number> {
        Ok(self.number(tree)?.0)
    }
}

/// `number` times `factor`.
fn scaled(number: Number, factor: f64) -> Number {
    match number {
        Number::Literal(value) => Number::Literal(value * factor),
        other if factor == 1.0 => other,
        other => Number::Arithmetic(Operation::Multiply, Box::new([Number::Literal(factor), other])),
    }
}
