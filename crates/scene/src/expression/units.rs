//! Units of expressions.

/// A unit: what it measures, and how large it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unit {
    None,
    Millimetre,
    Metre,
    Second,
    Millisecond,
    Newton,
    Degree,
    Radian,
    MetrePerSecond,
    MillimetrePerSecond,
    RadianPerSecond,
    DegreePerSecond,
    PerSecond,
}

const ALL: [(Unit, &str, &str, f64); 13] = [
    (Unit::None, "", "number", 1.0),
    (Unit::Millimetre, "mm", "length", 1e-3),
    (Unit::Metre, "m", "length", 1.0),
    (Unit::Second, "s", "time", 1.0),
    (Unit::Millisecond, "ms", "time", 1e-3),
    (Unit::Newton, "N", "force", 1.0),
    (Unit::Degree, "deg", "angle", std::f64::consts::PI / 180.0),
    (Unit::Radian, "rad", "angle", 1.0),
    (Unit::MetrePerSecond, "m/s", "speed", 1.0),
    (Unit::MillimetrePerSecond, "mm/s", "speed", 1e-3),
    (Unit::RadianPerSecond, "rad/s", "angular speed", 1.0),
    (Unit::DegreePerSecond, "deg/s", "angular speed", std::f64::consts::PI / 180.0),
    (Unit::PerSecond, "1/s", "rate", 1.0),
];

impl Unit {
    fn row(self) -> (&'static str, &'static str, f64) {
        let found = ALL.iter().find(|(unit, ..)| *unit == self);
        found.map_or(("", "number", 1.0), |(_, name, what, size)| (name, what, *size))
    }

    /// As it is written; empty for numbers without a unit.
    pub fn name(self) -> &'static str {
        self.row().0
    }

    /// The quantity that it measures, such as length.
    pub fn what(self) -> &'static str {
        self.row().1
    }

    /// The unit that is written so.
    pub fn named(name: &str) -> Option<Self> {
        ALL.iter().find(|(_, n, ..)| *n == name && !n.is_empty()).map(|(unit, ..)| *unit)
    }

    /// All of them, for messages.
    pub fn list() -> String {
        ALL[1..].iter().map(|(_, name, ..)| *name).filter(|n| *n != "1/s").collect::<Vec<_>>().join(", ")
    }

    /// The factor that takes numbers in `self` to numbers in `other`; `None` where they measure
    /// different things.
    pub fn factor_to(self, other: Self) -> Option<f64> {
        let ((_, what, size), (_, other_what, other_size)) = (self.row(), other.row());
        (what == other_what).then(|| size / other_size)
    }
}
