//! A grasp's part of the state's hash.

use super::{Compliance, Grasp};
use xxhash_rust::xxh3::Xxh3;

impl Grasp {
    /// Hashes every number. Destructuring names every field: a new one that is not hashed does not
    /// compile.
    pub(crate) fn hash(&self, hash: &mut Xxh3) {
        let Self { tool, body, nodes, captured, captured_at, compliance, slid, slips, torn } = self;
        hash.update(&(*body as u64).to_le_bytes());
        hash.update(&(*tool as u64).to_le_bytes());
        for (node, x) in nodes.iter().zip(captured) {
            hash.update(&node.to_le_bytes());
            hash_numbers(hash, &x.to_array());
        }
        if let Some(compliance) = compliance {
            // `blades` names tools and is left out: hashes in episodes that were recorded before
            // stay valid.
            let Compliance { stiffness, closing, jaw_force, friction, tear_force, blades: _ } = compliance;
            hash_numbers(hash, &[*stiffness, *jaw_force, *friction, *tear_force]);
            hash_numbers(hash, &closing.to_array());
        }
        for c in slid.iter().flat_map(|slid| slid.to_array()) {
            hash.update(&c.to_bits().to_le_bytes());
        }
        hash.update(&[u8::from(*slips), u8::from(*torn)]);
        hash_numbers(hash, &captured_at.translation.to_array());
        hash_numbers(hash, &captured_at.rotation.to_array());
    }
}

fn hash_numbers(hash: &mut Xxh3, numbers: &[f64]) {
    for x in numbers {
        hash.update(&x.to_bits().to_le_bytes());
    }
}
