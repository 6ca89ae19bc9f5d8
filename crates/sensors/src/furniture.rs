//! The surroundings: table, tray, ports with their holders, endoscope and its stand.

use crate::field::Field;
use crate::solid::{Part, Solid, align_x, append, revolve};
use glam::{DVec2, DVec3};
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::{Appearance, SurfaceKind};
use trocar_scene::Port;

/// A static object of the surroundings.
pub(crate) struct Prop {
    pub name: &'static str,
    pub mesh: TriMesh,
    pub appearance: Appearance,
}

/// Half the side of the table (m).
const TABLE_HALF_SIDE: f64 = 20.0;
/// Height of the tray's rim above the field, and its width (m).
const TRAY_RIM: [f64; 2] = [0.008, 0.007];
/// Radius and length of an endoscope's shaft, and of its camera head (m).
const SCOPE_SHAFT: [f64; 2] = [0.005, 0.30];
const CAMERA_HEAD: [f64; 2] = [0.021, 0.11];

/// Radius of curvature of the abdominal wall under gas pressure (m), and the number of rings of its
/// mesh.
const DOME_RADIUS: f64 = 0.25;
const SHEET_RINGS: u32 = 12;

fn plastic(color: [u8; 3], roughness: f32) -> Appearance {
    Appearance { color, surface: SurfaceKind::Coated { roughness, ior: 1.46, scattering_length: [0.0; 3] } }
}

/// Height of the table top (m).
pub(crate) fn table(field: &Field) -> f64 {
    (field.height - 0.012).min(0.0)
}

/// Table, tray, and ports with their holders.
pub(crate) fn room(field: &Field, ports: &[Port]) -> Vec<Prop> {
    let table = table(field);
    let mut all = vec![
        Prop { name: "table", mesh: square(table), appearance: plastic([92, 126, 138], 0.7) },
        Prop { name: "tray", mesh: tray(field, table), appearance: plastic([214, 216, 218], 0.45) },
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
        // A lip with a rounded inside, as of silicone.
        let ring = revolve(&[
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
        // This closed profile runs in the opposite direction of a profile from pole to pole.
        let mut ring = align_x(&ring, centre, centre + z);
        ring.flip();
        append(&mut rings, &ring);
        append(&mut sheets, &sheet(port, outer, half));
        let aside = centre - middle;
        let out = (aside - aside.dot(z) * z).try_normalize().unwrap_or(frame.rotation * DVec3::X);
        append(&mut holders, &holder(field, centre, out, z, outer, table));
    }
    all.push(Prop { name: "ports", mesh: rings, appearance: plastic([206, 112, 70], 0.5) });
    if !sheets.triangles.is_empty() {
        all.push(Prop { name: "wall", mesh: sheets, appearance: plastic([255; 3], 0.55) });
    }
    all.push(Prop {
        name: "holders",
        mesh: holders,
        appearance: Appearance { color: [150, 153, 158], ..Appearance::steel() },
    });
    all
}

/// A disc of the abdominal wall around the port, slightly domed by gas pressure: skin, fat at the
/// rim, peritoneum inside. Empty if the scene has no wall.
fn sheet(port: &Port, ring: f64, half: f64) -> TriMesh {
    let rim = 0.5e-3 * port.sheet_diameter_mm;
    let near = ring - 0.004;
    let mut all = TriMesh::default();
    if rim <= ring {
        return all;
    }
    let sunk = |r: f64| (near * near - r * r) / (2.0 * DOME_RADIUS);
    let radii = || (0..=SHEET_RINGS).map(|k| near + (rim - near) * f64::from(k) / f64::from(SHEET_RINGS));
    let skin: Vec<[f64; 2]> = radii().map(|r| [half + sunk(r), r]).collect();
    let inside: Vec<[f64; 2]> = radii().map(|r| [sunk(r) - half, r]).collect();
    let edge = [[half + sunk(rim), rim], [half + sunk(rim) - 0.0008, rim + 0.0004], [sunk(rim) - half, rim]];
    let frame = port.frame();
    for (profile, color) in [(&skin[..], [222, 176, 148]), (&inside[..], [186, 92, 84]), (&edge[..], [232, 204, 128])] {
        let mut part = align_x(&revolve(profile), frame.translation, frame.translation + frame.rotation * DVec3::Z);
        part.colors = vec![color; part.vertices.len()];
        append(&mut all, &part);
    }
    all
}

/// A flat bar from the port's ring outwards, and a post from its end down to the table.
fn holder(field: &Field, centre: DVec3, out: DVec3, z: DVec3, ring: f64, table: f64) -> TriMesh {
    // The bar ends a hand's breadth beyond the tray.
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
        let post = revolve(&[
            [0.0, 0.0],
            [0.0, 0.022],
            [0.006, 0.022],
            [0.007, 0.021],
            [0.007, 0.006],
            [length - 0.001, 0.006],
            [length, 0.005],
            [length, 0.0],
        ]);
        append(&mut bar, &align_x(&post, foot, foot + DVec3::Z));
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
    let corner = |x: f64, y: f64| DVec3::new(x * TABLE_HALF_SIDE, y * TABLE_HALF_SIDE, height);
    quad(&mut mesh, [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
    mesh
}

/// A frame with rounded corners around the field.
fn tray(field: &Field, table: f64) -> TriMesh {
    let [rise, wide] = TRAY_RIM;
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
    // Corners are quarter circles of eight steps around points inside the rectangle.
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

/// An endoscope with its stand on the table. `shaft` is the frame of its shaft: z towards the tip,
/// origin at the lens.
pub(crate) fn scope(shaft: &Pose, table: f64) -> Vec<Prop> {
    let z = shaft.rotation * DVec3::Z;
    let back = |d: f64| shaft.translation - d * z;
    let [radius, length] = SCOPE_SHAFT;
    let [wide, long] = CAMERA_HEAD;
    // The tube ends behind the lens, so that it does not block the view.
    let end = 0.0015;
    let tube = revolve(&[
        [end, 0.0],
        [end, radius - 0.0004],
        [end + 0.0004, radius],
        [length, radius],
        [length, 0.012],
        [length + 0.02, 0.013],
        [length + 0.02, 0.0],
    ]);
    let head = revolve(&[
        [length + 0.018, 0.0],
        [length + 0.018, wide - 0.004],
        [length + 0.023, wide],
        [length + long - 0.006, wide],
        [length + long, wide - 0.005],
        [length + long, 0.0],
    ]);
    let axis = |mesh: &TriMesh| align_x(mesh, shaft.translation, back(1.0));
    let mut all = vec![
        Prop { name: "endoscope", mesh: axis(&tube), appearance: Appearance::steel() },
        Prop { name: "endoscope", mesh: axis(&head), appearance: plastic([40, 42, 46], 0.4) },
    ];
    let held = back(length + 0.5 * long);
    if held.z > table + 0.08 {
        let foot = DVec3::new(held.x, held.y, table);
        let rod =
            |radius: f64| Part::Cylinder { from: foot, to: held - DVec3::Z * (wide - 0.004), radius, edge: 0.001 };
        let base = Part::Cylinder { from: foot, to: foot + 0.014 * DVec3::Z, radius: 0.05, edge: 0.004 };
        let color = [120, 124, 130];
        let mesh = Solid::new(0.004).with(color, rod(0.009)).with(color, base).surface(0.004);
        all.push(Prop { name: "stand", mesh, appearance: Appearance { color, ..Appearance::steel() } });
    }
    all
}
