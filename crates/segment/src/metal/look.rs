//! The appearance of single pixels.

/// The class of a pixel by its colour alone.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Look {
    pub grey: bool,
    pub seed: bool,
    /// Largest channel.
    pub brightness: u8,
}

/// Pixels whose 3 x 3 neighbourhood is mostly grey; the image continues beyond its rim with the
/// rim's values.
pub(super) fn without_speckle(looks: &[Look], width: usize, height: usize) -> Vec<bool> {
    let mut rows = vec![0u8; width * height];
    for (row, out) in looks.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        for u in 0..width {
            let (left, right) = (u.saturating_sub(1), (u + 1).min(width - 1));
            out[u] = u8::from(row[left].grey) + u8::from(row[u].grey) + u8::from(row[right].grey);
        }
    }
    let mut set = vec![false; width * height];
    for v in 0..height {
        let (above, below) = (v.saturating_sub(1) * width, (v + 1).min(height - 1) * width);
        for u in 0..width {
            set[v * width + u] = rows[above + u] + rows[v * width + u] + rows[below + u] >= 5;
        }
    }
    set
}
