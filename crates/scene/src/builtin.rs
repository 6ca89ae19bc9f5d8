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
pub const BUILTINS: [Builtin; 9] = [
    Builtin {
        name: "cell-a",
        summary: "the paper's two-arm cell around phantom A: grasper left, cutter right, resection of the appendix",
        text: include_str!("../scenes/cell-a.toml"),
    },
    Builtin {
        name: "cell-a-retraction",
        summary: "the same cell: the grasper pulls the appendix aside and holds it, as a task of stages in the scene",
        text: include_str!("../scenes/cell-a-retraction.toml"),
    },
    Builtin {
        name: "cell-a-stretch",
        summary: "the same cell with two graspers, which stretch the appendix between them with 0.3 to 1 N",
        text: include_str!("../scenes/cell-a-stretch.toml"),
    },
    Builtin {
        name: "cell-a-bowel",
        summary: "the same cell with two graspers, which run a loop of bowel hand over hand",
        text: include_str!("../scenes/cell-a-bowel.toml"),
    },
    Builtin {
        name: "cell-b",
        summary: "the cell around phantom B, another rabbit: the grasper lifts a shorter appendix",
        text: include_str!("../scenes/cell-b.toml"),
    },
    Builtin {
        name: "cell-b-resection",
        summary: "the same cell: resection of that appendix",
        text: include_str!("../scenes/cell-b-resection.toml"),
    },
    Builtin {
        name: "cell-c",
        summary: "the cell around phantom C, a pig's liver: the grasper lifts the gallbladder by its fundus",
        text: include_str!("../scenes/cell-c.toml"),
    },
    Builtin {
        name: "cell-c-resection",
        summary: "the same cell: the gallbladder lifted and cut between grasp and neck",
        text: include_str!("../scenes/cell-c-resection.toml"),
    },
    Builtin {
        name: "cell-d-retraction",
        summary: "a cell around phantom D: the grasper lifts the folded gallbladder's fundus, so that the endoscope sees its neck",
        text: include_str!("../scenes/cell-d-retraction.toml"),
    },
];

impl Builtin {
    /// The built-in scene of that name.
    pub fn named(name: &str) -> Option<&'static Self> {
        BUILTINS.iter().find(|b| b.name == name)
    }
}
