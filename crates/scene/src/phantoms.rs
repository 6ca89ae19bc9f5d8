//! The phantoms that a scene may name, with their organs.
//!
//! They are listed here, not in the crate that films them, because a cell must not depend on
//! recordings. A test compares both lists.

/// A phantom as scenes know it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Phantom {
    /// Its name.
    pub name: &'static str,
    /// Its organs, in the specimen's order.
    pub organs: &'static [&'static str],
}

/// The phantoms there are.
pub const PHANTOMS: [Phantom; 4] = [
    Phantom { name: "phantom-a", organs: &["cecum", "bowel-1", "bowel-2", "bowel-3", "stomach", "appendix"] },
    Phantom { name: "phantom-b", organs: &["cecum", "small-bowel", "bowel-bloc", "stomach", "appendix"] },
    Phantom { name: "phantom-c", organs: &["liver", "gallbladder"] },
    Phantom { name: "phantom-d", organs: &["liver", "gallbladder"] },
];

impl Phantom {
    /// The phantom of that name.
    pub fn named(name: &str) -> Option<&'static Self> {
        PHANTOMS.iter().find(|p| p.name == name)
    }
}
