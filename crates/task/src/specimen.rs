//! The hash by which a replay identifies a specimen.

use trocar_specimen::{End, MaterialModel, Pins, Specimen, Threads};
use xxhash_rust::xxh3::Xxh3;

/// xxh3 of the simulated parts of a specimen: names, meshes, bases, materials, pins,
/// threads and the upward direction. Colours, facts and origin do not count.
pub fn specimen_hash(specimen: &Specimen) -> u64 {
    let mut hash = Xxh3::new();
    let numbers = |hash: &mut Xxh3, all: &[f64]| all.iter().for_each(|x| hash.update(&x.to_bits().to_le_bytes()));
    numbers(&mut hash, &specimen.up.to_array());
    for organ in &specimen.organs {
        hash.update(&(organ.name.len() as u64).to_le_bytes());
        hash.update(organ.name.as_bytes());
        hash.update(&(organ.body.vertices.len() as u64).to_le_bytes());
        for p in organ.body.vertices.iter().chain([&organ.base]) {
            numbers(&mut hash, &p.to_array());
        }
        hash.update(&(organ.body.tets.len() as u64).to_le_bytes());
        organ.body.tets.iter().flatten().for_each(|i| hash.update(&i.to_le_bytes()));
        let m = organ.material;
        let model = match m.model {
            MaterialModel::StableNeoHookean => 0.0,
            MaterialModel::StVenantKirchhoff => 1.0,
            MaterialModel::Corotated => 2.0,
        };
        numbers(&mut hash, &[model, m.young_modulus_pa, m.poisson_ratio, m.density_kg_m3]);
        let pins = match organ.pins {
            Pins::None => [0.0; 5],
            Pins::Band { share } => [1.0, share, 0.0, 0.0, 0.0],
            Pins::End { end, length, band_length, band_share } => {
                [2.0, if end == End::Base { 0.0 } else { 1.0 }, length, band_length, band_share]
            }
        };
        numbers(&mut hash, &pins);
        // Nothing without threads: hashes in episodes that were recorded before stay valid.
        if let Some(Threads { from, to, slack_m, stiffness_n_m2 }) = organ.threads {
            numbers(&mut hash, &[from, to, slack_m, stiffness_n_m2]);
        }
    }
    hash.digest()
}
