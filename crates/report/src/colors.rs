//! Colours of organs, depths and signed errors.

/// Background of rendered views; readable on a light and on a dark page.
pub const VIEW_GROUND: [u8; 3] = [33, 39, 45];

/// Outline of instruments.
pub const INSTRUMENT: [u8; 3] = [0, 229, 255];

/// Colour of organ `index`, distinguishable with most kinds of colour vision (after M. Okabe and K.
/// Ito).
pub const fn organ(index: usize) -> [u8; 3] {
    const HUES: [[u8; 3]; 8] = [
        [230, 150, 20],
        [70, 165, 225],
        [0, 158, 115],
        [204, 110, 165],
        [213, 84, 0],
        [120, 120, 220],
        [200, 190, 60],
        [140, 140, 140],
    ];
    HUES[index % HUES.len()]
}

/// Stops of the sequential map: dark violet to yellow, with linearly increasing lightness.
pub const SEQUENTIAL: [[u8; 3]; 7] =
    [[66, 10, 90], [66, 62, 133], [46, 104, 142], [32, 144, 140], [57, 182, 118], [145, 213, 66], [250, 230, 40]];

/// Stops of the diverging map: blue, white at zero, red.
pub const DIVERGING: [[u8; 3]; 7] =
    [[24, 68, 150], [70, 132, 196], [160, 198, 226], [247, 247, 245], [246, 178, 142], [214, 92, 72], [150, 14, 38]];

/// Colour at `t` in [0, 1] along `stops`; clamped outside; NaN is the first stop.
pub fn map(stops: &[[u8; 3]], t: f64) -> [u8; 3] {
    let last = stops.len() - 1;
    let t = if t.is_nan() { 0.0 } else { t };
    let x = t.clamp(0.0, 1.0) * last as f64;
    let i = (x as usize).min(last.saturating_sub(1));
    mix(stops[i], stops[(i + 1).min(last)], x - i as f64)
}

/// Linear interpolation from `a` (`t` = 0) to `b` (`t` = 1).
pub fn mix(a: [u8; 3], b: [u8; 3], t: f64) -> [u8; 3] {
    std::array::from_fn(|c| (f64::from(a[c]) * (1.0 - t) + f64::from(b[c]) * t).round() as u8)
}

/// Luma of an sRGB colour (Rec. 601 weights), 0 to 255.
pub fn luma([r, g, b]: [u8; 3]) -> u8 {
    ((299 * u32::from(r) + 587 * u32::from(g) + 114 * u32::from(b)) / 1000) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_hit_their_stops_and_clamp() {
        for (i, stop) in SEQUENTIAL.iter().enumerate() {
            assert_eq!(map(&SEQUENTIAL, i as f64 / 6.0), *stop);
        }
        assert_eq!(map(&DIVERGING, 0.5), DIVERGING[3]);
        assert_eq!(map(&DIVERGING, -3.0), DIVERGING[0]);
        assert_eq!(map(&DIVERGING, 3.0), DIVERGING[6]);
        assert_eq!(map(&SEQUENTIAL, f64::NAN), SEQUENTIAL[0]);
    }

    #[test]
    fn the_sequential_map_gets_lighter() {
        let lumas: Vec<u8> = SEQUENTIAL.iter().map(|c| luma(*c)).collect();
        assert!(lumas.windows(2).all(|w| w[1] > w[0] + 10), "{lumas:?}");
    }
}
