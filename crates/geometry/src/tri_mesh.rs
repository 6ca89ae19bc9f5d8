//! Triangle surfaces.

use glam::DVec3;

/// A triangle surface, optionally coloured per vertex. Outward normals follow the right-hand rule.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions [m].
    pub vertices: Vec<DVec3>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// sRGB colour per vertex; empty, or as long as `vertices`.
    pub colors: Vec<[u8; 3]>,
}

impl TriMesh {
    /// Corner positions of triangle `t` [m].
    pub fn corners(&self, t: usize) -> [DVec3; 3] {
        self.triangles[t].map(|i| self.vertices[i as usize])
    }

    /// Number of undirected edges that are not shared by exactly two triangles running along them in opposite directions.
    pub fn open_edges(&self) -> usize {
        // (low, high, direction) sorted: a closed edge is a run of one of each direction.
        let mut edges: Vec<(u32, u32, bool)> = self
            .triangles
            .iter()
            .flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])])
            .map(|(a, b)| (a.min(b), a.max(b), a < b))
            .collect();
        edges.sort_unstable();
        edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).filter(|run| !(run.len() == 2 && run[0].2 != run[1].2)).count()
    }

    /// True when every edge is shared by exactly two triangles that run along it in opposite directions.
    pub fn is_watertight(&self) -> bool {
        !self.triangles.is_empty() && self.open_edges() == 0
    }

    /// Enclosed volume [m3]; negative when the triangles face inward.
    pub fn volume(&self) -> f64 {
        // Seen from a vertex of its own, so that a far origin costs no digits.
        let Some(origin) = self.vertices.first().copied() else { return 0.0 };
        let cone = |[a, b, c]: [DVec3; 3]| (a - origin).dot((b - origin).cross(c - origin));
        (0..self.triangles.len()).map(|t| cone(self.corners(t))).sum::<f64>() / 6.0
    }

    /// Smallest and largest coordinates [m]; `None` without vertices.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        bounds(&self.vertices)
    }

    /// Turns every triangle around.
    pub fn flip(&mut self) {
        for t in &mut self.triangles {
            t.swap(1, 2);
        }
    }

    /// Component number of each triangle (components share vertices), and the number of components. Numbered by first triangle.
    pub fn components(&self) -> (Vec<u32>, usize) {
        let mut parent: Vec<u32> = (0..self.vertices.len() as u32).collect();
        fn root(parent: &mut [u32], mut i: u32) -> u32 {
            while parent[i as usize] != i {
                parent[i as usize] = parent[parent[i as usize] as usize];
                i = parent[i as usize];
            }
            i
        }
        for t in &self.triangles {
            for k in 1..3 {
                let (a, b) = (root(&mut parent, t[0]), root(&mut parent, t[k]));
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        let mut number = vec![u32::MAX; self.vertices.len()];
        let mut count = 0;
        let mut of_triangle = Vec::with_capacity(self.triangles.len());
        for t in &self.triangles {
            let r = root(&mut parent, t[0]) as usize;
            if number[r] == u32::MAX {
                number[r] = count;
                count += 1;
            }
            of_triangle.push(number[r]);
        }
        (of_triangle, count as usize)
    }

    /// The connected component that encloses the largest volume (by magnitude), without unused vertices.
    pub fn largest_component(&self) -> Self {
        let (component, count) = self.components();
        let Some(origin) = self.vertices.first().copied() else { return Self::default() };
        let mut volume = vec![0.0; count];
        for (t, k) in component.iter().enumerate() {
            let [a, b, c] = self.corners(t);
            volume[*k as usize] += (a - origin).dot((b - origin).cross(c - origin));
        }
        let mut best = 0;
        for k in 1..count {
            if volume[k].abs() > volume[best].abs() {
                best = k;
            }
        }
        self.keep(|t| component[t] as usize == best)
    }

    /// The triangles chosen by index, without unused vertices.
    pub(crate) fn keep(&self, chosen: impl Fn(usize) -> bool) -> Self {
        let mut new_index = vec![u32::MAX; self.vertices.len()];
        let mut out = Self::default();
        for (_, triangle) in self.triangles.iter().enumerate().filter(|(t, _)| chosen(*t)) {
            out.triangles.push(triangle.map(|i| {
                let i = i as usize;
                if new_index[i] == u32::MAX {
                    new_index[i] = out.vertices.len() as u32;
                    out.vertices.push(self.vertices[i]);
                    if !self.colors.is_empty() {
                        out.colors.push(self.colors[i]);
                    }
                }
                new_index[i]
            }));
        }
        out
    }
}

/// Smallest and largest coordinates of some points; `None` without points.
pub(crate) fn bounds(points: &[DVec3]) -> Option<(DVec3, DVec3)> {
    let first = *points.first()?;
    Some(points.iter().fold((first, first), |(lo, hi), p| (lo.min(*p), hi.max(*p))))
}

impl TriMesh {
    /// Refuses vertices that are not finite and indices out of range, by number.
    pub(crate) fn check(&self) -> crate::Result<()> {
        let refuse = |reason: String| Err(crate::Error::Mesh(reason));
        if let Some(i) = self.vertices.iter().position(|v| !v.is_finite()) {
            return refuse(format!(
                "vertex {i} of {} is {}; coordinates are finite numbers",
                self.vertices.len(),
                self.vertices[i]
            ));
        }
        let n = self.vertices.len();
        if let Some(t) = self.triangles.iter().position(|t| t.iter().any(|i| *i as usize >= n)) {
            return refuse(format!("triangle {t} names vertices {:?}; there are {n}", self.triangles[t]));
        }
        Ok(())
    }
}
