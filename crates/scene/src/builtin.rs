//! The scenes that come with the program, as commented TOML.

/// A scene that comes with the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Builtin {
    /// Its name.
    pub name: &'static str,
    /// One line of what it shows.
    pub summary: &'static str,
    /// The file, with comments.
    pub text: &'static str,
}

/// The built-in scenes.
pub const BUILTINS: [Builtin; 1] = [Builtin {
    name: "cell-a",
    summary: "the paper's two-arm cell around phantom A: grasper left, cutter right, resection of the appendix",
    text: include_str!("../scenes/cell-a.toml"),
}];

impl Builtin {
    /// The built-in scene of that name.
    pub fn named(name: &str) -> Option<&'static Self> {
        BUILTINS.iter().find(|b| b.name == name)
    }
}
