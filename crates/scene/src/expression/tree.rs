//! Checked expressions, ready to be evaluated row by row.

/// What holds or does not.
#[derive(Clone, Debug, PartialEq)]
pub enum Condition {
    /// A flag is above 0.
    Flag(Number),
    /// Two numbers in the same unit.
    Compare(Number, Comparison, Number),
    /// A number lies in a range, its ends included.
    Within(Number, Number, Number),
    /// All hold.
    All(Vec<Condition>),
    /// One or more hold.
    Any(Vec<Condition>),
    /// It does not hold.
    Not(Box<Condition>),
    /// It has held without a break for a time.
    Lasts {
        /// What.
        what: Box<Condition>,
        /// For how long (s).
        seconds: Number,
        /// Which of the stage's timers counts it.
        timer: usize,
    },
    /// One thing comes after another.
    Sequence {
        /// What must hold first.
        first: Box<Condition>,
        /// What must then come to hold.
        last: Box<Condition>,
        /// What must hold in every row from the first to the one before the last.
        during: Option<Box<Condition>>,
        /// Which of the stage's marks says that the first has held.
        mark: usize,
    },
}

/// How two numbers compare.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comparison {
    /// Less.
    Less,
    /// Less or equal.
    AtMost,
    /// Greater.
    Greater,
    /// Greater or equal.
    AtLeast,
}

/// Arithmetic of two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// a + b.
    Add,
    /// a - b.
    Subtract,
    /// a b.
    Multiply,
    /// a / b.
    Divide,
    /// The smaller one.
    Least,
    /// The larger one.
    Most,
}

/// A number, in the unit that it was checked in.
#[derive(Clone, Debug, PartialEq)]
pub enum Number {
    /// Written in the text.
    Literal(f64),
    /// A channel by its place in [`channel_names`](crate::channel_names).
    Channel(usize),
    /// A measure by its place in the task's list.
    Measure(usize),
    /// A gate or constant by its place in the task's list.
    Constant(usize),
    /// Force of tissue on the instrument of an arm, contact and constraint together (N); the left
    /// arm is 0.
    Force(usize),
    /// -a.
    Negative(Box<Number>),
    /// |a|.
    Magnitude(Box<Number>),
    /// Two numbers.
    Arithmetic(Operation, Box<[Number; 2]>),
    /// A number kept between two others.
    Clamp(Box<[Number; 3]>),
    /// Nearness of a distance: 1 within the second number, falling to 0 over the third.
    Near(Box<[Number; 3]>),
    /// One of two numbers, the first where the condition holds.
    Choose(Box<Condition>, Box<[Number; 2]>),
    /// Share that has passed of the time (s) of the stage's first `for`.
    Lasted(Box<Number>),
    /// The first part of the stage's first `then` has held.
    Armed,
    /// The least value over all rows.
    LeastOf(Box<Number>),
    /// The greatest value over all rows.
    MostOf(Box<Number>),
}
