//! Values that can be shown on organs: stretch and strain energy at the nodes.

use crate::shapes::Topology;
use glam::{DMat3, DVec3};

/// Visits the elements of an organ: the first node of the piece among all nodes, the piece's body,
/// and the element's number.
fn each_element(topology: &Topology, organ: usize, visit: &mut dyn FnMut(usize, &trocar_tissue::Body, usize)) {
    let mut first = 0;
    for b in &topology.bodies[organ] {
        let body = &topology.model.bodies()[*b];
        (0..body.tets().len()).for_each(|t| visit(first, body, t));
        first += body.len();
    }
}

/// At each node the length of its most stretched edge over that at rest; 1 without any.
pub(crate) fn stretches(topology: &Topology, organ: usize, nodes: &[DVec3]) -> Vec<f32> {
    let mut squares = vec![1.0_f32; nodes.len()];
    each_element(topology, organ, &mut |first, body, t| {
        let (tet, rest) = (body.tets()[t].map(|i| i as usize), body.rest_positions());
        for (i, k) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            let (a, b) = (tet[i], tet[k]);
            let length = nodes[first + a].distance_squared(nodes[first + b]);
            let square = (length / rest[a].distance_squared(rest[b])) as f32;
            for node in [first + a, first + b] {
                squares[node] = squares[node].max(square);
            }
        }
    });
    squares.into_iter().map(f32::sqrt).collect()
}

/// At each node the strain energy (J/m3) of its elements, weighted by their volumes.
pub(crate) fn energies(topology: &Topology, organ: usize, nodes: &[DVec3]) -> Vec<f32> {
    let mut sums = vec![(0.0_f64, 0.0_f64); nodes.len()];
    let first_body = topology.bodies[organ].first().map(|b| &topology.model.bodies()[*b]);
    let Some(material) = first_body.map(|body| body.material().hyperelastic()) else { return Vec::new() };
    each_element(topology, organ, &mut |first, body, t| {
        let (tet, rest) = (body.tets()[t].map(|i| i as usize), body.rest_positions());
        let edges = |x: &dyn Fn(usize) -> DVec3| {
            let origin = x(tet[0]);
            DMat3::from_cols(x(tet[1]) - origin, x(tet[2]) - origin, x(tet[3]) - origin)
        };
        let gradient = edges(&|i| nodes[first + i]) * edges(&|i| rest[i]).inverse();
        let (energy, volume) = (material.energy(gradient), body.volumes()[t]);
        if energy.is_finite() {
            for i in tet {
                sums[first + i].0 += volume * energy;
                sums[first + i].1 += volume;
            }
        }
    });
    sums.into_iter().map(|(energy, volume)| (energy / volume.max(f64::MIN_POSITIVE)) as f32).collect()
}
