//! Each mistake in a scene gives exactly its one-line message.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::path::Path;
use trocar_scene::{Builtin, Scene};

/// Marks, in the changed text, the line that the message names.
const HERE: char = '§';

/// A text of cell-a, its replacement, and the message after file and line. A message for another
/// line begins with that line's text between two `@`.
struct Case(&'static str, &'static str, &'static str);

fn said(text: &str, folder: &Path) -> String {
    Scene::parse(text, "scene.toml", folder).unwrap_err().to_string()
}

fn check(cases: &[Case]) {
    let cell = Builtin::named("cell-a").unwrap().text;
    let mut wrong = Vec::new();
    for Case(from, to, expected) in cases {
        assert!(cell.contains(from), "cell-a has no '{from}'");
        let text = cell.replacen(from, to, 1);
        let (at, expected) = match expected.strip_prefix('@').and_then(|rest| rest.split_once('@')) {
            Some((elsewhere, expected)) => (text.find(elsewhere).unwrap(), expected),
            None => (text.find(HERE).unwrap(), *expected),
        };
        let line = 1 + text[..at].matches('\n').count();
        let expected = format!("scene.toml: line {line}: {expected}");
        let said = said(&text.replace(HERE, ""), "".as_ref());
        if said != expected {
            wrong.push(format!("expected {expected}\n     got {said}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn form() {
    check(&[
        Case("[rates]", "[rate§s", "unclosed table, expected `]`"),
        Case(
            "[safety]",
            "[safty§]",
            "safty: unknown field `safty`, expected one of `name`, `description`, `specimen`, `placement`, `organ`, `tissue`, `rates`, `arm`, `port`, `instrument`, `gravity_error`, `camera`, `imaging`, `task`, `safety`, `variation`; did you mean `safety`?",
        ),
        Case(
            "hole_diameter_mm = 6.0",
            "hole_diamter_mm = 6.0§",
            "port[0].hole_diamter_mm: unknown field `hole_diamter_mm`, expected one of `name`, `centre_m`, `normal`, `hole_diameter_mm`, `sheet_thickness_mm`, `sheet_diameter_mm`; did you mean `hole_diameter_mm`?",
        ),
        Case(
            "control_hz = 30 ",
            "control_hz = 30.5§ ",
            "rates.control_hz: invalid type: floating point `30.5`, expected u32",
        ),
        Case("control_hz = 30 ", "control_hz = -30§ ", "rates.control_hz: invalid value: integer `-30`, expected u32"),
        Case("seed = 1", "seed = 1\nseed = 2§", "duplicate key"),
        Case(
            "name = \"cutter\"\nkind = \"cutter\"",
            "name = \"cutter\"\nkind = \"scissors\"§",
            "instrument[1].kind: unknown variant `scissors`, expected `grasper` or `cutter`",
        ),
        Case(
            "normal = [0.0, 0.0, 1.0]        #",
            "normal = [0.0, 1.0]§ #",
            "port[0].normal: invalid length 2, expected an array of length 3",
        ),
        Case(
            "name = \"left\"\n# A model",
            "name = \"middle\"§\n# A model",
            "arm[0].name: unknown variant `middle`, expected `left` or `right`",
        ),
    ]);
}

#[test]
fn variation() {
    check(&[
        Case(
            "set = \"none\"",
            "set = \"heavy\"§",
            "variation.set: unknown variant `heavy`, expected one of `none`, `easy`, `standard`, `hard`",
        ),
        Case(
            "tilt_deg = { within = 1.0 }",
            "tilt_deg = { about = 1.0 }§",
            "variation.tilt_deg: unknown variant `about`, expected one of `within`, `uniform`, `log_uniform`, `normal`, `choice`",
        ),
        Case(
            "tilt_deg = { within = 1.0 }",
            "tilt_deg = { within = -1.0 }§",
            "variation.tilt_deg has a negative `within`; it goes to either side",
        ),
        Case(
            "tilt_deg = { within = 1.0 }",
            "friction = { uniform = [0.2, 2.5] }§",
            "variation.friction gives 0.2 to 2.5; it must stay in [0, 2]",
        ),
        Case(
            "tilt_deg = { within = 1.0 }",
            "specimens = { phantoms = [\"phantom-e\"] }§",
            "variation.specimens.phantoms[0] is 'phantom-e'; the phantoms are: phantom-a, phantom-b, phantom-c, phantom-d; did you mean 'phantom-a'?",
        ),
        Case(
            "tilt_deg = { within = 1.0 }",
            "specimens = { phantoms = [\"phantom-a\"], seeds = [3, 2] }§",
            "variation.specimens.seeds is [3, 2]; the first seed must not be greater than the last",
        ),
        Case(
            "tilt_deg = { within = 1.0 }",
            "specimens = { phantoms = [\"phantom-a\"], seeds = [1, 2000] }§",
            "variation.specimens.seeds is [1, 2000]; there must be at most 1000 seeds",
        ),
        Case(
            "tilt_deg = { within = 1.0 }",
            "specimens = { phantoms = [\"phantom-c\"] }§",
            "variation.specimens has phantom-c:1, with which organ.appendix names 'appendix'; the specimen's organs are: liver, gallbladder",
        ),
        Case(
            "tilt_deg = { within = 1.0 }",
            "specimens = { seeds = [1, 2] }§",
            "variation.specimens has neither paths nor phantoms; it must have one or more",
        ),
        Case("lamp = 1.0 ", "lamp = 11.0§ ", "imaging.lamp is 11; it must be in [0, 10]"),
        Case(
            "[safety]",
            "[task.variation]§\ntilt_deg = 1.0\n[safety]",
            "task.variation is no longer a key; write [variation] with a distribution for each factor, such as tilt_deg = { within = 1.0 }",
        ),
    ]);
}

#[test]
fn units() {
    check(&[
        Case(
            "hole_diameter_mm = 6.0",
            "hole_diameter_mm = 0.006§",
            "port[0].hole_diameter_mm is 0.006; it must be in [1, 50] mm; 0.006 m is 6 mm",
        ),
        Case(
            "centre_m = [-0.045, 0.46, 0.16]",
            "centre_m = [-50, 460, 130]§",
            "port[0].centre_m[0] is -50; it must be in [-5, 5] m; -50 mm is -0.05 m",
        ),
        Case(
            "tilt_deg = 13.3",
            "tilt_deg = 0.2321§",
            "arm[0].start.tilt_deg is 0.2321; it must be 0 or in [1, 32.5] degrees: the shaft touches the hole at 33.5, and the variation is 1; 0.2321 rad is 13.2984 degrees",
        ),
        Case(
            "jaw_max_angle_deg = 60.0",
            "jaw_max_angle_deg = 1.0472§",
            "instrument[0].jaw_max_angle_deg is 1.0472; it must be in [5, 120] degrees; 1.0472 rad is 60.0001 degrees",
        ),
        Case(
            "width_deg = 86.2",
            "width_deg = 1.5045§",
            "camera[0].lens.width_deg is 1.5045; it must be in [5, 170] degrees; 1.5045 rad is 86.2015 degrees",
        ),
        Case(
            "mass_kg = 0.4793",
            "mass_kg = 479.3§",
            "instrument[0].mass_kg is 479.3; it must be in [0.005, 10] kg; 479.3 g is 0.4793 kg",
        ),
        Case(
            "joint_friction_nm = 0.2",
            "joint_friction_nm = 200§",
            "gravity_error.joint_friction_nm is 200; it must be in [0, 20] N m; 200 N mm is 0.2 N m",
        ),
        Case(
            "[organ.cecum.pins]",
            "[organ.cecum.material]\nyoung_modulus_pa = 30§\n[organ.cecum.pins]",
            "organ.cecum.material.young_modulus_pa is 30; it must be in [100, 1e9] Pa; 30 kPa is 30000 Pa",
        ),
        Case(
            "[organ.cecum.pins]",
            "[organ.cecum.material]\ndensity_kg_m3 = 1.2§\n[organ.cecum.pins]",
            "organ.cecum.material.density_kg_m3 is 1.2; it must be in [100, 30000] kg/m3; 1.2 g/cm3 is 1200 kg/m3",
        ),
        Case(
            "[organ.cecum.pins]",
            "[organ.cecum.material]\npreset = \"livr§\"\n[organ.cecum.pins]",
            "organ.cecum.material.preset: unknown variant `livr`, expected one of `appendix`, `liver`, `gallbladder`, `bile-duct`, `small-bowel`; did you mean `liver`?",
        ),
        Case(
            "[organ.cecum.pins]",
            "[organ.cecum.material]\ntoughness_j_m2 = 0.3§\n[organ.cecum.pins]",
            "organ.cecum.material.toughness_j_m2 is 0.3; it must be in [1, 20000] J/m2; 0.3 kJ/m2 is 300 J/m2",
        ),
        Case(
            "insertion_mm = 100.0",
            "insertion_mm = 0.07§ ",
            "arm[0].start.insertion_mm is 0.07; it must be in [21, 321] mm; 0.07 m is 70 mm",
        ),
        Case(
            "episode_s = 40.0",
            "episode_s = 40000§",
            "task.episode_s is 40000; it must be in [0.1, 3600] s; 40000 ms is 40 s",
        ),
        Case(
            "model = \"franka_fr3\"\nport = \"left\"",
            "model = \"franka_fr3\"\nposture_deg = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]§\nport = \"left\"",
            "arm[0].posture_deg[3] is -2.356; it must be in [-174.299, -8.6975] degrees; -2.356 rad is -134.989 degrees",
        ),
    ]);
}

#[test]
fn numbers() {
    check(&[
        Case("episode_s = 40.0", "episode_s = nan§", "task.episode_s is NaN; it must be in [0.1, 3600] s"),
        Case(
            "centre_m = [0.045, 0.46, 0.16]",
            "centre_m = [0.045, inf, 0.16]§",
            "port[1].centre_m[1] is inf; it must be in [-5, 5] m",
        ),
        Case(
            "position_m = [-0.012, 0.48, 0.17]",
            "position_m = [-0.012, 0.48, nan]§",
            "placement.position_m[2] is NaN; it must be in [-5, 5] m",
        ),
        Case("lift_mm = 8.0", "lift_mm = -8.0§", "task.gates.lift_mm is -8; it must be in [0.1, 100] mm"),
        Case(
            "sheet_thickness_mm = 0.0",
            "sheet_thickness_mm = 1e300§",
            "port[0].sheet_thickness_mm is 1e300; it must be in [0, 50] mm",
        ),
        Case("jaw_force_n = 0.5", "jaw_force_n = 0§", "instrument[0].jaw_force_n is 0; it must be in [0.01, 40] N"),
        Case(
            "schedule = \"fast\" ",
            "backend = \"latice§\" ",
            "tissue.backend: unknown variant `latice`, expected `tetrahedra` or `lattice`; did you mean `lattice`?",
        ),
        Case(
            "schedule = \"fast\" ",
            "cell_mm = 4.0§ ",
            "tissue.cell_mm is for tissue.backend = 'lattice'; remove it, or set the backend",
        ),
        Case(
            "schedule = \"fast\" ",
            "backend = \"lattice\"\ncell_mm = 0.2§ ",
            "tissue.cell_mm is 0.2; it must be in [1, 20] mm",
        ),
        Case(
            "schedule = \"fast\" ",
            "backend = \"lattice\"\nschedule = \"paper\"§ ",
            "tissue.schedule is for tetrahedra; a lattice has one schedule: remove it",
        ),
        Case("friction = 0.6\n# Organs", "friction = -0.6§\n# Organs", "tissue.friction is -0.6; it must be in [0, 5]"),
        Case("jaw = 0.5", "jaw = 30§", "arm[0].start.jaw is 30; it must be in [0, 1]"),
        Case("control_hz = 30 ", "control_hz = 0§ ", "rates.control_hz is 0; it must be in [1, 1000] Hz"),
        Case("size_px = [848, 480]", "size_px = [0, 480]§", "camera[1].size_px[0] is 0; it must be in [1, 8192] px"),
        Case(
            "link_mass_share = 0.02",
            "link_mass_share = 2§",
            "gravity_error.link_mass_share is 2; it must be in [-0.5, 0.5]",
        ),
        Case(
            "rotation_wxyz = [0.0, 1.0, 0.0, 0.0]",
            "rotation_wxyz = [0.0, 2.0, 0.0, 0.0]§",
            "placement.rotation_wxyz has length 2; it must be a unit quaternion, scalar first: [0, 1, 0, 0]",
        ),
        Case(
            "rotation_wxyz = [0.0, 1.0, 0.0, 0.0]",
            "rotation_wxyz = [0.0, 0.0, 0.0, 0.0]§",
            "placement.rotation_wxyz has length 0; it must be a unit quaternion, scalar first",
        ),
        Case(
            "rotation_wxyz = [0.7071067811865476, 0.0, 0.0, 0.7071067811865476]   #",
            "rotation_wxyz = [nan, 0.0, 0.0, 1.0]§ #",
            "arm[0].base.rotation_wxyz has length NaN; it must be a unit quaternion, scalar first",
        ),
        Case(
            "normal = [0.0, 0.0, 1.0]        #",
            "normal = [0.0, 1.0, 1.0]§ #",
            "port[0].normal has length 1.41421; it must be a unit vector: [0, 0.707107, 0.707107]",
        ),
        Case(
            "lens = { kind = \"field-of-view\", width_deg = 86.2, height_deg = 54.6 }",
            "lens = { kind = \"opencv\", fx_px = -700, fy_px = 700, cx_px = 640, cy_px = 360 }§",
            "camera[0].lens.fx_px is -700; it must be in [1, 1000000] px",
        ),
        Case(
            "lens = { kind = \"field-of-view\", width_deg = 86.2, height_deg = 54.6 }",
            "lens = { kind = \"opencv\", fx_px = 700, fy_px = 700, cx_px = 640, cy_px = 360, distortion = [0.1, 0.2] }§",
            "camera[0].lens.distortion has 2 coefficients; it must have 4, 5 or 8: k1 k2 p1 p2 [k3 [k4 k5 k6]]",
        ),
        Case(
            "target_m = [0.0, 0.456, 0.035]",
            "target_m = [0.0, 0.42, 0.115]§",
            "camera[0].view.target_m is equal to eye_m; it must be another point",
        ),
        Case(
            "up = [0.0, 1.0, 0.0]",
            "up = [0.0, 0.0, 1.0]§",
            "camera[1].view.up is zero or parallel to the view; it must be the direction of the image's top",
        ),
        Case(
            "[organ.cecum.pins]",
            "[organ.cecum.surfaces]\ncollision = { edge_mm = 0.003§ }\n[organ.cecum.pins]",
            "organ.cecum.surfaces.collision.edge_mm is 0.003; it must be in [0.2, 50] mm; 0.003 m is 3 mm",
        ),
        Case("share = 0.42", "share = 42§", "organ.cecum.pins.share is 42; it must be in [0, 1]"),
        Case(
            "length = 0.14",
            "length = 0.84",
            "@[organ.appendix.pins]@organ.appendix.pins has a length and a band_length of 1.14 together; it must be at most 1",
        ),
        Case(
            "name = \"default\"",
            "name = \"default\"\ngains = { stiffness = -1.0 }§",
            "arm[0].controller.gains.stiffness is -1; it must be at least 0 and finite",
        ),
    ]);
}

#[test]
fn names() {
    check(&[
        Case(
            "name = \"cell-a\"",
            "name = \"Cell A\"§",
            "name is 'Cell A'; it must be 1 to 64 lower-case letters, digits, '-' and '_'",
        ),
        Case(
            "phantom = \"phantom-a\"",
            "phantom = \"phantom-q\"§",
            "specimen.phantom is 'phantom-q'; the phantoms are: phantom-a, phantom-b, phantom-c, phantom-d; did you mean 'phantom-a'?",
        ),
        Case(
            "phantom = \"phantom-a\" ",
            "path = \"here\"\nphantom = \"phantom-a\" ",
            "@[specimen]@specimen has a path and a phantom; it must have one of them",
        ),
        Case(
            "phantom = \"phantom-a\" ",
            "max_elements = 999§\nphantom = \"phantom-a\" ",
            "specimen.max_elements is 999; it must be in [1000, 1000000]",
        ),
        Case(
            "phantom = \"phantom-a\" ",
            "",
            "@[specimen]@specimen has neither a path nor a phantom; it must have one of them",
        ),
        Case(
            "phantom = \"phantom-a\" ",
            "path = \"nowhere\"§ ",
            "specimen.path is nowhere, which is no specimen; it must be a folder with a specimen.toml",
        ),
        Case(
            "[organ.cecum.pins]",
            "[organ.cecum.surfaces]\ncollision = \"element§\"\n[organ.cecum.pins]",
            "organ.cecum.surfaces.collision: unknown variant `element`, expected one of `elements`, `edge_mm`, `file`; did you mean `elements`?",
        ),
        Case(
            "[organ.cecum.pins]",
            "[organ.cecum.surfaces]\nrender = { edge_mm = 3.0§ }\n[organ.cecum.pins]",
            "organ.cecum.surfaces.render: unknown variant `edge_mm`, expected one of `skin`, `elements`, `collision`, `file`",
        ),
        Case(
            "[organ.cecum.pins]",
            "[organ.cecum.surfaces]\ncollision = { file = \"cecum.step§\" }\n[organ.cecum.pins]",
            "organ.cecum.surfaces.collision.file is 'cecum.step'; it must be a file that ends in .ply, .stl or .obj",
        ),
        Case(
            "[organ.cecum.pins]",
            "[organ.cecum.surfaces]\nrender = { file = \"none.ply§\" }\n[organ.cecum.pins]",
            "organ.cecum.surfaces.render.file is none.ply, which is no file; it must be a path from the scene file's folder",
        ),
        Case(
            "[organ.cecum.pins]",
            "[organ.caecum.pins]§",
            "organ.caecum names 'caecum'; the specimen's organs are: cecum, bowel-1, bowel-2, bowel-3, stomach, appendix; did you mean 'cecum'?",
        ),
        Case(
            "filtered_pairs = []",
            "filtered_pairs = [[\"stomach\", \"fild\"]]§",
            "tissue.filtered_pairs[0][1] is 'fild'; it must be one of the specimen's organs or the field: cecum, bowel-1, bowel-2, bowel-3, stomach, appendix, field; did you mean 'field'?",
        ),
        Case(
            "filtered_pairs = []",
            "filtered_pairs = [[\"stomach\", \"field\"], [\"field\", \"stomach\"]]§",
            "tissue.filtered_pairs[1] is the pair of tissue.filtered_pairs[0] again; remove one of them",
        ),
        Case(
            "filtered_pairs = []",
            "filtered_pairs = [[\"field\", \"field\"]]§",
            "tissue.filtered_pairs[0] is 'field' twice; it must be two organs, or an organ and the field",
        ),
        Case(
            "organ = \"appendix\"",
            "organ = \"apendix\"§",
            "task.organ is 'apendix'; the specimen's organs are: cecum, bowel-1, bowel-2, bowel-3, stomach, appendix; did you mean 'appendix'?",
        ),
        Case(
            "port = \"left\"",
            "port = \"lft\"§",
            "arm[0].port is 'lft'; the ports are: left, right; did you mean 'left'?",
        ),
        Case(
            "instrument = \"cutter\"",
            "instrument = \"cuter\"§",
            "arm[1].instrument is 'cuter'; the instruments are: grasper, cutter; did you mean 'cutter'?",
        ),
        Case(
            "name = \"right\"\ncentre",
            "name = \"left\"§\ncentre",
            "port[1].name is 'left', which port[0] already has; names must be unique",
        ),
        Case(
            "name = \"cutter\"\nkind",
            "name = \"grasper\"§\nkind",
            "instrument[1].name is 'grasper', which instrument[0] already has; names must be unique",
        ),
        Case(
            "name = \"right\"\nmodel",
            "name = \"left\"§\nmodel",
            "arm[1].name is 'left', which arm[0] already has; names must be unique",
        ),
        Case(
            "name = \"d405\"",
            "name = \"endoscope\"§",
            "camera[1].name is 'endoscope', which camera[0] already has; names must be unique",
        ),
        Case(
            "model = \"franka_fr3\"\nport = \"left\"",
            "model = \"franka_fr4\"§\nport = \"left\"",
            "arm[0].model is 'franka_fr4'; it must be franka_fr3 or a file that ends in .urdf, .xml or .mjcf",
        ),
        Case(
            "model = \"franka_fr3\"\nport = \"left\"",
            "model = \"../arms/absent.urdf\"§\nport = \"left\"",
            "arm[0].model is ../arms/absent.urdf, which is no file; it must be a path from the scene file's folder",
        ),
        Case(
            "model = \"franka_fr3\"\nport = \"left\"",
            "model = \"franka_fr3\"\nposture_deg = [0.0]§\nport = \"left\"",
            "arm[0].posture_deg has 1 angles; it must have 7 for an FR3",
        ),
    ]);
}

#[test]
fn parts_fit() {
    check(&[
        Case(
            "physics_hz = 480",
            "physics_hz = 500§",
            "rates.physics_hz is 500, which is no multiple of control_hz (30); it must be a multiple, such as 480",
        ),
        Case(
            "shaft_diameter_mm = 5.0",
            "shaft_diameter_mm = 8.0",
            "@instrument = \"grasper\"@arm[0].instrument is 'grasper', whose shaft of 8 mm does not go through the hole of 6 mm of port 'left'; choose a thinner shaft or a larger hole",
        ),
        Case(
            "tilt_deg = 18.3",
            "tilt_deg = 34§",
            "arm[1].start.tilt_deg is 34; it must be 0 or in [1, 32.5] degrees: the shaft touches the hole at 33.5, and the variation is 1",
        ),
        Case(
            "tilt_deg = 18.3",
            "tilt_deg = 33§",
            "arm[1].start.tilt_deg is 33; it must be 0 or in [1, 32.5] degrees: the shaft touches the hole at 33.5, and the variation is 1",
        ),
        Case(
            "centre_m = [-0.045, 0.46, 0.16]",
            "centre_m = [-0.045, 0.96, 0.16]",
            "@port = \"left\"@arm[0].port is 'left', which is out of reach: the flange would start 1.024 m from the shoulder; it must be at most 0.855 m",
        ),
        Case(
            "position_m = [0.45, 0.0, 0.0]",
            "position_m = [-0.3, 0.0, 0.0]§",
            "arm[1].base.position_m is 0.15 m from that of arm[0]; it must be at least 0.2 m",
        ),
        Case(
            "centre_m = [0.045, 0.46, 0.16]",
            "centre_m = [-0.043, 0.46, 0.16]§",
            "port[1].centre_m is 2 mm from that of port[0]; holes must not overlap",
        ),
        Case(
            "port = \"right\"",
            "port = \"left\"§",
            "arm[1].port is 'left', which arm[0] already has; each arm needs its own",
        ),
        Case(
            "instrument = \"cutter\"",
            "instrument = \"grasper\"§",
            "arm[1].instrument is 'grasper', which arm[0] already has; each arm needs its own",
        ),
        Case(
            "kind = \"cutter\"",
            "kind = \"grasper\"",
            "@name = \"appendix-resection\"@task.name is 'appendix-resection', but no arm has a cutter; it needs an arm with a cutter",
        ),
        Case(
            "grasp_to = 0.70",
            "grasp_to = 0.20§",
            "task.gates.grasp_to is 0.2; it must be greater than grasp_from (0.3)",
        ),
        Case(
            "cut_open = 0.50",
            "cut_open = 0.10§",
            "task.gates.cut_open is 0.1; it must be greater than cut_closed (0.15)",
        ),
        Case(
            "puncture_force_n = 10.0",
            "puncture_force_n = 0.0§",
            "safety.puncture_force_n is 0; it must be in [0.1, 1000] N",
        ),
        Case(
            "rcm_abort_mm = 5.0",
            "rcm_abort_mm = 2.0§",
            "safety.rcm_abort_mm is 2; it must be greater than rcm_threshold_mm (3)",
        ),
    ]);
}

#[test]
fn long_lists() {
    let camera =
        |i| format!("[[camera]]\nname = 'c{i}'\nview = {{ kind = 'recording' }}\nlens = {{ kind = 'recording' }}\n");
    let scene = |n: usize| {
        let cameras: String = (0..n).map(camera).collect();
        format!("name = 'many'\n[specimen]\nphantom = 'phantom-a'\n{cameras}")
    };
    Scene::parse(&scene(16), "scene.toml", "".as_ref()).unwrap();
    assert_eq!(
        said(&scene(17), "".as_ref()),
        "scene.toml: line 4: camera has more than 16 entries; it must have at most 16"
    );
}

#[test]
fn files() {
    let root = tempfile::tempdir().unwrap();
    let path = root.path().join("scene.toml");
    let read = |content: &[u8]| {
        std::fs::write(&path, content).unwrap();
        Scene::read_file(&path).unwrap_err().to_string().replace(&root.path().display().to_string(), "")
    };
    assert_eq!(
        read(&[b' '; (1 << 20) + 1]),
        "/scene.toml: the file has more than 1048576 bytes; a scene file has a few thousand"
    );
    assert_eq!(read(&[0xff, 0xfe]), "/scene.toml: stream did not contain valid UTF-8");
    assert_eq!(read(b""), "/scene.toml: line 1: missing field `name`");
    let unknown = "no scene 'cell-d'; it must be a TOML file or one of the built-in scenes cell-a, cell-a-retraction, cell-a-stretch, cell-a-bowel, cell-b, cell-b-resection, cell-c, cell-c-resection, cell-d-retraction; \
                   did you mean 'cell-a'?";
    assert_eq!(Scene::read("cell-d").unwrap_err().to_string(), unknown);
    let absent = Scene::read("absent/scene.toml").unwrap_err().to_string();
    assert!(absent.starts_with("absent/scene.toml: no such file; a scene is a TOML file"), "{absent}");
    // What a scene names starts from its own folder, and its organs are known.
    let specimen = root.path().join("specimens/rabbit");
    std::fs::create_dir_all(&specimen).unwrap();
    std::fs::create_dir_all(root.path().join("scenes")).unwrap();
    let facts = "{ nodes = 4, tets = 1, watertight = true, inverted = 0, min_dihedral_deg = 60.0, median_dihedral_deg = 60.0, median_edge_mm = 2.0, volume_cm3 = 1.0 }";
    let text = format!(
        "name = 'rabbit'\nup = [0, 0, -1]\nplacement = {{ rotation_wxyz = [1, 0, 0, 0], translation_m = [0, 0, 0] }}\nprovenance = {{ source = 's', input_hash = '0', program = 'p' }}\n[[organ]]\nname = 'appendix'\nbase_m = [0, 0, 0]\nmaterial = {{ young_modulus_pa = 12e3, poisson_ratio = 0.45, density_kg_m3 = 1200 }}\npins = {{ rule = 'none' }}\nfacts = {facts}\n"
    );
    std::fs::write(specimen.join("specimen.toml"), text).unwrap();
    let scene = |rest: &str| format!("name = 'mine'\n[specimen]\npath = '../specimens/rabbit'\n{rest}");
    let folder = root.path().join("scenes");
    let good = Scene::parse(&scene(""), "scene.toml", &folder).unwrap();
    assert_eq!(good.organ_names().unwrap(), ["appendix"]);
    assert_eq!(
        said(&scene("[organ.apendix.pins]\nrule = 'none'\n"), &folder),
        "scene.toml: line 4: organ.apendix names 'apendix'; the specimen's organs are: appendix; did you mean 'appendix'?"
    );
    std::fs::write(specimen.join("specimen.toml"), "name = 3").unwrap();
    let spoiled = Scene::parse(&scene(""), "scene.toml", &folder).unwrap_err().to_string();
    assert!(spoiled.contains("specimen.toml: line 1: name: invalid type"), "{spoiled}");
}
