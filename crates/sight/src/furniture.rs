//! The room: table, tray, what carries the ports, the endoscope and its stand.

use crate::field::Field;
use crate::solid::{Part, Solid, along, join, turned};
use glam::{DVec2, DVec3};
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::{Look, SurfaceKind};
use trocar_scene::Port;

/// A piece of furniture.
pub(crate) struct Piece {
    pub name: &'static str,
    pub mesh: TriMesh,
    pub look: Look,
}

/// Half the table's side [m].
const TABLE: f64 = 20.0;
/// Height of the tray's rim above the field, and its width [m].
const RIM: [f64; 2] = [0.008, 0.007];
/// Radius of an endoscope's shaft, its length, and the same of its camera head [m].
const SCOPE: [f64; 2] = [0.005, 0.30];
const HEAD: [f64; 2] = [0.021, 0.11];

/// Radius to which gas domes the abdominal wall, and rings of which a piece of it is made [m].
const DOME: f64 = 0.25;
const SHEET_RINGS: u32 = 12;

fn plastic(color: [u8; 3], roughness: f32) -> Look {
    Look { color, surface: SurfaceKind::Coated { roughness, ior: 1.46, wander: [0.0; 3] } }
}

/// Height of the table's top [m].
pub(crate) fn table(field: &Field) -> f64 {
    (field.height - 0.012).min(0.0)
}

/// Table, tray, ports with their holders.
pub(crate) fn room(field: &Field, ports: &[Port]) -> Vec<Piece> {
    let table = table(field);
    let mut all = vec![
        Piece { name: "table", mesh: square(table), look: plastic([92, 126, 138], 0.7) },
        Piece { name: "tray", mesh: tray(field, table), look: plastic([214, 216, 218], 0.45) },
    ];
    let mut rings = TriMesh::default();
    let mut holders = TriMesh::default();
    let mut sheets = TriMesh::default();
    let n = ports.len().max(1) as f64;
    let middle = ports.iter().map(|p| DVec3::from(p.centre_m)).sum::<DVec3>() / n;
    for port in ports {
        let frame = port.frame();
        let z = frame.rotation * DVec3::Z;
        let centre = frame.translation;
        let hole = 0.5e-3 * port.hole_diameter_mm;
        let half = 0.5 * (1e-3 * port.sheet_thickness_mm).max(0.002);
        let outer = hole + 0.009;
        // A lip that is round inside, as silicone is.
        let ring = turned(&[
            [-half, outer],
            [-half, hole + 0.0012],
            [-0.5 * half, hole + 0.0003],
            [0.0, hole],
            [0.5 * half, hole + 0.0003],
            [half, hole + 0.0012],
            [half + 0.0012, hole + 0.004],
            [half + 0.0012, outer - 0.001],
            [half, outer],
            [-half, outer],
        ]);
        // The profile goes round the other way than one from pole to pole.
        let mut ring = along(&ring, centre, centre + z);
        ring.flip();
        join(&mut rings, &ring);
        join(&mut sheets, &sheet(port, outer, half));
        let aside = centre - middle;
        let out = (aside - aside.dot(z) * z).try_normalize().unwrap_or(frame.rotation * DVec3::X);
        join(&mut holders, &holder(field, centre, out, z, outer, table));
    }
    all.push(Piece { name: "ports", mesh: rings, look: plastic([206, 112, 70], 0.5) });
    if !sheets.triangles.is_empty() {
        all.push(Piece { name: "wall", mesh: sheets, look: plastic([255; 3], 0.55) });
    }
    all.push(Piece { name: "holders", mesh: holders, look: Look { color: [150, 153, 158], ..Look::steel() } });
    all
}

/// A round piece of the abdominal wall from under the port's ring outwards, a little domed as gas does it: skin, fat at its edge, peritoneum inside. Nothing where the scene wants none.
fn sheet(port: &Port, ring: f64, half: f64) -> TriMesh {
    let rim = 0.5e-3 * port.sheet_diameter_mm;
    let near = ring - 0.004;
    let mut all = TriMesh::default();
    if rim <= ring {
        return all;
    }
    let sunk = |r: f64| (near * near - r * r) / (2.0 * DOME);
    let radii = || (0..=SHEET_RINGS).map(|k| near + (rim - near) * f64::from(k) / f64::from(SHEET_RINGS));
    let skin: Vec<[f64; 2]> = radii().map(|r| [half + sunk(r), r]).collect();
    let inside: Vec<[f64; 2]> = radii().map(|r| [sunk(r) - half, r]).collect();
    let edge = [[half + sunk(rim), rim], [half + sunk(rim) - 0.0008, rim + 0.0004], [sunk(rim) - half, rim]];
    let frame = port.frame();
    for (profile, color) in [(&skin[..], [222, 176, 148]), (&inside[..], [186, 92, 84]), (&edge[..], [232, 204, 128])] {
        let mut part = along(&turned(profile), frame.translation, frame.translation + frame.rotation * DVec3::Z);
        part.colors = vec![color; part.vertices.len()];
        join(&mut all, &part);
    }
    all
}

/// A flat bar from a port's ring outwards and a post down to the table.
fn holder(field: &Field, centre: DVec3, out: DVec3, z: DVec3, ring: f64, table: f64) -> TriMesh {
    // As far as the tray's side and a hand's breadth beyond.
    let inside = |p: DVec2| p.cmpge(field.low - 0.03).all() && p.cmple(field.high + 0.03).all();
    let mut reach = ring + 0.05;
    while reach < 0.6 && inside((centre + reach * out).truncate()) {
        reach += 0.01;
    }
    let across = z.cross(out);
    let side = |s: f64, t: f64, u: f64| centre + u * out + s * across + t * z;
    let mut bar = TriMesh::default();
    let (w, h) = (0.006, 0.0015);
    let section = |u: f64| [side(-w, -h, u), side(w, -h, u), side(w, h, u), side(-w, h, u)];
    let (near, far) = (section(ring - 0.002), section(reach + 0.006));
    for k in 0..4 {
        let n = (k + 1) % 4;
        quad(&mut bar, [near[k], near[n], far[n], far[k]]);
    }
    quad(&mut bar, [near[3], near[2], near[1], near[0]]);
    quad(&mut bar, [far[0], far[1], far[2], far[3]]);
    let top = centre + reach * out + 0.004 * z;
    let foot = DVec3::new(top.x, top.y, table);
    if top.z > table + 0.01 {
        let length = top.z - table;
        let post = turned(&[
            [0.0, 0.0],
            [0.0, 0.022],
            [0.006, 0.022],
            [0.007, 0.021],
            [0.007, 0.006],
            [length - 0.001, 0.006],
            [length, 0.005],
            [length, 0.0],
        ]);
        join(&mut bar, &along(&post, foot, foot + DVec3::Z));
    }
    bar
}

fn quad(mesh: &mut TriMesh, corners: [DVec3; 4]) {
    let a = mesh.vertices.len() as u32;
    mesh.vertices.extend(corners);
    mesh.triangles.extend([[a, a + 1, a + 2], [a, a + 2, a + 3]]);
}

fn square(height: f64) -> TriMesh {
    let mut mesh = TriMesh::default();
    let corner = |x: f64, y: f64| DVec3::new(x * TABLE, y * TABLE, height);
    quad(&mut mesh, [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
    mesh
}

/// A frame with round corners about the field.
fn tray(field: &Field, table: f64) -> TriMesh {
    let [rise, wide] = RIM;
    let top = field.height + rise;
    let profile = [
        [wide, table],
        [wide, top - 0.002],
        [wide - 0.0006, top - 0.0006],
        [wide - 0.002, top],
        [0.002, top],
        [0.0006, top - 0.0006],
        [0.0, top - 0.002],
        [0.0, field.height - 0.006],
    ];
    // Corners as quarter circles of eight steps about points inside the rectangle.
    let inner = 0.006;
    let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
    let round: Vec<(DVec2, DVec2)> = corners
        .iter()
        .enumerate()
        .flat_map(|(q, (sx, sy))| {
            let (middle, half) = (0.5 * (field.low + field.high), 0.5 * (field.high - field.low));
            let centre = middle + DVec2::new(sx * (half.x - inner - 0.001), sy * (half.y - inner - 0.001));
            (0..=8).map(move |k| {
                let angle = std::f64::consts::FRAC_PI_2 * (q as f64 + f64::from(k) / 8.0);
                (centre, DVec2::from_angle(angle))
            })
        })
        .collect();
    let mut mesh = TriMesh::default();
    let n = round.len();
    for pair in profile.windows(2) {
        let first = mesh.vertices.len() as u32;
        for [out, z] in pair {
            mesh.vertices.extend(round.iter().map(|(c, d)| (*c + (inner + out) * *d).extend(*z)));
        }
        for k in 0..n as u32 {
            let next = (k + 1) % n as u32;
            let (a, b) = (first + k, first + next);
            let (c, d) = (a + n as u32, b + n as u32);
            mesh.triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    mesh
}

/// An endoscope whose shaft's frame (z towards the tip, origin at the lens) is `shaft`, and its stand on the table.
pub(crate) fn scope(shaft: &Pose, table: f64) -> Vec<Piece> {
    let z = shaft.rotation * DVec3::Z;
    let back = |d: f64| shaft.translation - d * z;
    let [radius, length] = SCOPE;
    let [wide, long] = HEAD;
    // The lens looks out of the end: nothing of the shaft lies before it.
    let end = 0.0015;
    let tube = turned(&[
        [end, 0.0],
        [end, radius - 0.0004],
        [end + 0.0004, radius],
        [length, radius],
        [length, 0.012],
        [length + 0.02, 0.013],
        [length + 0.02, 0.0],
    ]);
    let head = turned(&[
        [length + 0.018, 0.0],
        [length + 0.018, wide - 0.004],
        [length + 0.023, wide],
        [length + long - 0.006, wide],
        [length + long, wide - 0.005],
        [length + long, 0.0],
    ]);
    let axis = |mesh: &TriMesh| along(mesh, shaft.translation, back(1.0));
    let mut all = vec![
        Piece { name: "endoscope", mesh: axis(&tube), look: Look::steel() },
        Piece { name: "endoscope", mesh: axis(&head), look: plastic([40, 42, 46], 0.4) },
    ];
    let held = back(length + 0.5 * long);
    if held.z > table + 0.08 {
        let foot = DVec3::new(held.x, held.y, table);
        let rod =
            |radius: f64| Part::Cylinder { from: foot, to: held - DVec3::Z * (wide - 0.004), radius, edge: 0.001 };
        let base = Part::Cylinder { from: foot, to: foot + 0.014 * DVec3::Z, radius: 0.05, edge: 0.004 };
        let color = [120, 124, 130];
        let mesh = Solid::new(0.004).with(color, rod(0.009)).with(color, base).surface(0.004);
        all.push(Piece { name: "stand", mesh, look: Look { color, ..Look::steel() } });
    }
    all
}
