//! Figures of the paper, for comparison.

/// An organ of Table I.
pub struct PaperOrgan {
    /// Its phantom.
    pub phantom: &'static str,
    /// Its name.
    pub organ: &'static str,
    /// Nodes.
    pub nodes: usize,
    /// Tetrahedra.
    pub tets: usize,
    /// Young's modulus (kPa).
    pub young_modulus_kpa: f64,
}

/// Table I.
#[rustfmt::skip]
pub const TABLE_I: [PaperOrgan; 13] = {
    const fn organ(phantom: &'static str, organ: &'static str, nodes: usize, tets: usize, kpa: f64) -> PaperOrgan {
        PaperOrgan { phantom, organ, nodes, tets, young_modulus_kpa: kpa }
    }
    [
        organ("phantom-a", "cecum", 3893, 14_914, 30.0),
        organ("phantom-a", "bowel-1", 2242, 8211, 30.0),
        organ("phantom-a", "bowel-2", 853, 3024, 15.0),
        organ("phantom-a", "bowel-3", 1744, 6328, 15.0),
        organ("phantom-a", "stomach", 967, 3407, 30.0),
        organ("phantom-a", "appendix", 2263, 8072, 12.0),
        organ("phantom-b", "cecum", 448, 1372, 20.0),
        organ("phantom-b", "small-bowel", 1339, 4878, 20.0),
        organ("phantom-b", "bowel-bloc", 4603, 17_780, 20.0),
        organ("phantom-b", "stomach", 292, 895, 20.0),
        organ("phantom-b", "appendix", 1211, 4299, 12.0),
        organ("phantom-c", "liver", 13_039, 50_834, 10.0),
        organ("phantom-c", "gallbladder", 5626, 22_047, 5.0),
    ]
};

/// The row of Table I for an organ of a phantom.
pub fn table_i(phantom: &str, organ: &str) -> Option<&'static PaperOrgan> {
    TABLE_I.iter().find(|p| p.phantom == phantom && p.organ == organ)
}
