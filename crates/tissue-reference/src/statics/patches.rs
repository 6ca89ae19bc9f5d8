//! Patches of neighbouring tetrahedra that share one deformation gradient.
//!
//! Linear tetrahedra are too stiff because each of them alone must keep its volume and its shape.
//! Here the resistance to a change of volume, and a share of that to a change of shape, act on the
//! mean gradient of a patch. Each element keeps the rest, which leaves no mode of a patch without
//! stiffness. The mean over patches is that of de Souza Neto and others ("F-bar-based linear
//! triangles and tetrahedra for finite strain analysis of nearly incompressible solids", 2005), as
//! an energy.

use super::elements::{Elements, Sample, linear_sample};
use glam::DVec3;
use std::collections::BTreeMap;
use trocar_geometry::TetMesh;
use trocar_tissue::Material;

impl Elements {
    /// Linear tetrahedra in patches of `size`, whose mean gradient has `share` of the shear modulus
    /// and all of Lame's lambda.
    pub fn patches(mesh: &TetMesh, material: Material, size: usize, share: f64) -> Self {
        let (mu, lambda) = material.lame();
        let own = with_lame(material, (1.0 - share) * mu, 0.0);
        let shared = with_lame(material, share * mu, lambda);
        let mut samples: Vec<Sample> = (0..mesh.tets.len()).map(|t| linear_sample(mesh, t, 0)).collect();
        let means: Vec<Sample> = grouped(mesh, size).iter().map(|group| mean(&samples, group)).collect();
        samples.extend(means);
        Self::of(mesh, BTreeMap::new(), samples, vec![own, shared])
    }
}

/// The material with these Lame's parameters (Pa).
fn with_lame(material: Material, mu: f64, lambda: f64) -> Material {
    let young_modulus = mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu);
    Material { young_modulus, poisson_ratio: 0.5 * lambda / (lambda + mu), ..material }
}

/// One sample of the second material with the mean gradient of a group.
fn mean(samples: &[Sample], group: &[usize]) -> Sample {
    let volume: f64 = group.iter().map(|t| samples[*t].volume).sum();
    let mut gradients: BTreeMap<u32, DVec3> = BTreeMap::new();
    for t in group {
        let sample = &samples[*t];
        for (i, m) in sample.nodes.iter().zip(&sample.gradients) {
            *gradients.entry(*i).or_default() += *m * (sample.volume / volume);
        }
    }
    let (nodes, gradients) = gradients.into_iter().unzip();
    Sample { nodes, gradients, volume, material: 1 }
}

/// Groups of up to `size` tetrahedra with as few nodes as possible: each grows from the first
/// element that is left, by the neighbour that adds the fewest nodes and is nearest.
fn grouped(mesh: &TetMesh, size: usize) -> Vec<Vec<usize>> {
    let mut around = vec![Vec::new(); mesh.vertices.len()];
    for (t, tet) in mesh.tets.iter().enumerate() {
        tet.iter().for_each(|i| around[*i as usize].push(t));
    }
    let centres: Vec<DVec3> = (0..mesh.tets.len()).map(|t| mesh.corners(t).iter().sum::<DVec3>() / 4.0).collect();
    let mut order: Vec<usize> = (0..mesh.tets.len()).collect();
    let key = |t: &usize| centres[*t].to_array();
    order.sort_by(|a, b| {
        let pairs = key(a).into_iter().zip(key(b));
        pairs.map(|(a, b)| a.total_cmp(&b)).find(|o| o.is_ne()).unwrap_or(a.cmp(b))
    });
    let mut taken = vec![false; mesh.tets.len()];
    let mut groups = Vec::new();
    for first in order {
        if std::mem::replace(&mut taken[first], true) {
            continue;
        }
        let mut group = vec![first];
        let mut nodes = mesh.tets[first].to_vec();
        while group.len() < size {
            let centre = group.iter().map(|t| centres[*t]).sum::<DVec3>() / group.len() as f64;
            let added = |t: usize| mesh.tets[t].iter().filter(|i| !nodes.contains(i)).count();
            let free = nodes.iter().flat_map(|i| &around[*i as usize]).filter(|t| !taken[**t]);
            let best = free.min_by(|a, b| {
                let distance = |t: usize| centres[t].distance_squared(centre);
                let far = distance(**a).total_cmp(&distance(**b));
                added(**a).cmp(&added(**b)).then(far).then(a.cmp(b))
            });
            let Some(best) = best.copied() else { break };
            taken[best] = true;
            group.push(best);
            let new: Vec<u32> = mesh.tets[best].iter().copied().filter(|i| !nodes.contains(i)).collect();
            nodes.extend(new);
        }
        groups.push(group);
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle::Precision;
    use crate::statics::Loading;
    use trocar_testing::blocks::{block, tissue};

    /// Where the whole body has one gradient, patches are the law itself: a block that is stretched
    /// evenly has the forces of linear elements.
    #[test]
    fn patches_keep_the_law_of_an_even_strain() {
        let mesh = block([3, 2, 2], 2e-3);
        let outer = |p: DVec3| p.min_element() < 1e-9 || (p - DVec3::new(6e-3, 4e-3, 4e-3)).max_element() > -1e-9;
        let strain = DVec3::new(0.2, -0.05, 0.1);
        let pulled = |elements: &Elements| {
            let held = elements.held_by(outer);
            let at = |i: usize| elements.rest()[i];
            let moved = (0..held.len()).filter(|i| held[*i]).map(|i| (i as u32, strain * at(i))).collect();
            let loading = Loading { moved, ..Loading::default() };
            elements.settle(&held, &loading, 2, Precision::default()).unwrap().reactions
        };
        let [linear, patched] = [Elements::linear(&mesh, tissue(12e3)), Elements::patches(&mesh, tissue(12e3), 8, 0.5)];
        let (linear, patched) = (pulled(&linear), pulled(&patched));
        let largest = linear.iter().map(|f| f.length()).fold(0.0, f64::max);
        for (a, b) in linear.iter().zip(&patched) {
            assert!(a.distance(*b) < 1e-6 * largest, "{a}, {b}");
        }
    }

    #[test]
    fn every_element_is_in_one_group() {
        let mesh = block([4, 3, 3], 2e-3);
        let mut all: Vec<usize> = grouped(&mesh, 8).concat();
        all.sort_unstable();
        assert!(all.iter().copied().eq(0..mesh.tets.len()));
        assert!(grouped(&mesh, 8).len() < mesh.tets.len() / 6);
    }
}
