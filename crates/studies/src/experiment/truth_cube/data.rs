//! The beads of the Truth Cube, read from its table.
//!
//! Kerdok and others, "Truth cube: establishing physical standards for soft tissue simulation",
//! Medical Image Analysis 7, 2003: 7 x 7 x 7 beads in a cube of silicone of 80 mm, seen by computed
//! tomography at rest and between two rough plates that compress it.

use crate::{Error, Result};
use glam::DVec3;
use std::path::Path;

/// Beads along each axis.
pub(super) const BEADS: usize = 7;

/// The largest file that is read (bytes).
const MAX_BYTES: u64 = 16 << 20;

/// All beads, by layer from one plate to the other, and in a layer by row and column.
pub(super) struct Beads {
    /// Places at rest (m).
    pub rest: Vec<DVec3>,
    /// The compressions, in the order of the table.
    pub strains: Vec<Strain>,
}

/// The beads under one compression.
pub(super) struct Strain {
    /// Nominal strain in percent, as the table writes it: `12.5`.
    pub percent: String,
    /// Places (m).
    pub at: Vec<DVec3>,
}

/// The number of a bead.
pub(super) fn bead(layer: usize, row: usize, column: usize) -> usize {
    (layer * BEADS + row) * BEADS + column
}

impl Beads {
    /// Reads the table: a line `i,j,k,x0,y0,z0,...` of columns whose strains the line above names,
    /// and a line for each bead (mm).
    ///
    /// # Errors
    /// A file that cannot be read, and the line that is wrong.
    pub fn read(path: &Path) -> Result<Self> {
        let io = |source| Error::Io { path: path.to_owned(), source };
        if std::fs::metadata(path).map_err(io)?.len() > MAX_BYTES {
            return Err(Error::Mismatch(format!("{}: it is longer than {MAX_BYTES} bytes", path.display())));
        }
        let text = String::from_utf8_lossy(&std::fs::read(path).map_err(io)?).into_owned();
        Self::parse(&text).map_err(|why| Error::Mismatch(format!("{}: {why}", path.display())))
    }

    pub(super) fn parse(text: &str) -> std::result::Result<Self, String> {
        let cells = |line: &str| line.split(',').map(|cell| cell.trim().to_owned()).collect::<Vec<String>>();
        let lines: Vec<Vec<String>> = text.lines().map(cells).collect();
        let is_head = |line: &Vec<String>| line.starts_with(&["i".to_owned(), "j".to_owned(), "k".to_owned()]);
        let head = lines.iter().position(is_head).filter(|at| *at > 0);
        let head = head.ok_or("it has no line 'i,j,k,x0,...' below a line with the strains")?;
        let named = |k: usize| lines[head - 1].get(k).map_or("", String::as_str);
        let width = lines[head].iter().filter(|cell| !cell.is_empty()).count();
        if width < 9 || width % 3 != 0 {
            return Err(format!("line {}: it has {width} columns; three for each place are needed", head + 1));
        }
        let percent = |k: usize| {
            let name = named(k).trim_end_matches("strain").trim().trim_end_matches('%').to_owned();
            let known = name.parse::<f64>().is_ok_and(|p| (0.0..100.0).contains(&p));
            let said = || format!("line {}, column {}: '{}' is no strain such as '5% strain'", head, k + 1, named(k));
            known.then_some(name).ok_or_else(said)
        };
        let names = (6..width).step_by(3).map(percent).collect::<std::result::Result<Vec<_>, String>>()?;
        let mut rest = vec![DVec3::NAN; BEADS.pow(3)];
        let mut strains: Vec<Strain> = names.into_iter().map(|percent| Strain { percent, at: rest.clone() }).collect();
        for (k, line) in lines.iter().enumerate().skip(head + 1) {
            if line.iter().all(String::is_empty) {
                continue;
            }
            let wrong = |what: &str| format!("line {}: {what}", k + 1);
            let numbers: Vec<f64> = line[..width.min(line.len())].iter().filter_map(|cell| cell.parse().ok()).collect();
            if numbers.len() < width || numbers.iter().any(|x| !x.is_finite() || x.abs() > 1e4) {
                return Err(wrong(&format!("{width} numbers of millimetres are needed")));
            }
            let index = |x: f64| (x.fract() == 0.0 && (1.0..=BEADS as f64).contains(&x)).then(|| x as usize - 1);
            let place = || Some(bead(index(numbers[2])?, index(numbers[1])?, index(numbers[0])?));
            let at = place().ok_or_else(|| wrong("i, j and k must be from 1 to 7"))?;
            if rest[at].is_finite() {
                return Err(wrong("this bead was there before"));
            }
            let mut places = numbers[3..].chunks_exact(3).map(|p| 1e-3 * DVec3::from_slice(p));
            rest[at] = places.next().unwrap_or(DVec3::NAN);
            strains.iter_mut().zip(places).for_each(|(strain, place)| strain.at[at] = place);
        }
        match rest.iter().filter(|p| !p.is_finite()).count() {
            0 => Ok(Self { rest, strains }),
            missing => Err(format!("{missing} of 343 beads are missing")),
        }
    }

    /// The mean place of a layer at rest (m).
    pub fn middle(&self, layer: usize) -> DVec3 {
        let beads = (0..BEADS * BEADS).map(|k| self.rest[layer * BEADS * BEADS + k]);
        beads.sum::<DVec3>() / (BEADS * BEADS) as f64
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A table of an evenly compressed cube, whose volume stays the same.
    pub fn table() -> String {
        let mut text = "Truth Cube\nnominal,,,no strain,,,5% strain,,\ni,j,k,x0,y0,z0,x1,y1,z1\n".to_owned();
        for k in 0..BEADS.pow(3) {
            let (i, j, layer) = (k % 7, k / 7 % 7, k / 49);
            let at = [10.0 * i as f64 - 30.0, 10.0 * j as f64 - 30.0, -10.0 * layer as f64];
            text += &format!("{},{},{},{},{},{}", i + 1, j + 1, layer + 1, at[0], at[1], at[2]);
            text += &format!(",{},{},{}\n", 1.025_978_35 * at[0], 1.025_978_35 * at[1], 0.95 * at[2]);
        }
        text
    }

    /// A cube between plates to which it sticks, 10% nearer to each other. Where the beads between
    /// go is not known.
    pub fn rough_plates() -> Beads {
        let mut beads = Beads::parse(&table()).unwrap();
        let at = beads.rest.iter().map(|p| *p * DVec3::new(1.0, 1.0, 0.9)).collect();
        beads.strains = vec![Strain { percent: "10".to_owned(), at }];
        beads
    }

    #[test]
    fn beads_are_read_by_layer() {
        let beads = Beads::parse(&table()).unwrap();
        assert_eq!(beads.strains[0].percent, "5");
        assert!(beads.rest[bead(2, 0, 6)].distance(1e-3 * DVec3::new(30.0, -30.0, -20.0)) < 1e-12);
        assert!(beads.middle(6).distance(DVec3::Z * -0.06) < 1e-12);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let table = table();
        let line = |k: usize| table.lines().nth(k).unwrap().to_owned();
        for (from, to, words) in [
            ("i,j,k,x0", "a,b,c,x0", "no line"),
            ("5% strain", "some strain", "line 2, column 7"),
            (&line(3), "1,1,1,0,0,0,0,0,nan", "line 4"),
            (&line(3), "1,1,9,0,0,0,0,0,0", "from 1 to 7"),
            (&line(3), &line(4), "there before"),
            (&line(3), "", "1 of 343"),
        ] {
            let said = Beads::parse(&table.replacen(from, to, 1)).err().unwrap();
            assert!(said.contains(words), "{said}");
        }
    }
}
