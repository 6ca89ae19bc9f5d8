//! Quantiles of the standard normal distribution.

/// The score below which a share of the standard normal distribution lies (P. J. Acklam's rational
/// approximation, to a relative 1e-9; here for shares within (0, 1)).
pub(crate) fn normal_quantile(share: f64) -> f64 {
    const A: [f64; 6] = [
        -39.696_830_286_653_8,
        220.946_098_424_521,
        -275.928_510_446_969,
        138.357_751_867_269,
        -30.664_798_066_147_2,
        2.506_628_277_459_24,
    ];
    const B: [f64; 5] =
        [-54.476_098_798_224_1, 161.585_836_858_041, -155.698_979_859_887, 66.801_311_887_719_7, -13.280_681_552_885_7];
    const C: [f64; 6] = [
        -7.784_894_002_430_29e-3,
        -0.322_396_458_041_136,
        -2.400_758_277_161_84,
        -2.549_732_539_343_73,
        4.374_664_141_464_97,
        2.938_163_982_698_78,
    ];
    const D: [f64; 4] = [7.784_695_709_041_46e-3, 0.322_467_129_070_04, 2.445_134_137_143, 3.754_408_661_907_42];
    let polynomial = |c: &[f64], x: f64| c.iter().fold(0.0, |sum, c| sum * x + c);
    let tail = |p: f64| {
        let q = (-2.0 * p.ln()).sqrt();
        polynomial(&C, q) / (polynomial(&D, q) * q + 1.0)
    };
    let share = share.clamp(1e-9, 1.0 - 1e-9);
    if share < 0.02425 {
        tail(share)
    } else if share > 1.0 - 0.02425 {
        -tail(1.0 - share)
    } else {
        let (q, r) = (share - 0.5, (share - 0.5) * (share - 0.5));
        polynomial(&A, r) * q / (polynomial(&B, r) * r + 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::normal_quantile;

    #[test]
    fn quantiles_are_those_of_the_normal_distribution() {
        for (share, score) in [(0.5, 0.0), (0.95, 1.644_853_6), (0.01, -2.326_347_9), (0.25, -0.674_489_75)] {
            assert!((normal_quantile(share) - score).abs() < 1e-6, "{share}: {}", normal_quantile(share));
        }
    }
}
