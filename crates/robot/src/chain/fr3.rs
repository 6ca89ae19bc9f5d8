//! The built-in Franka Research 3.

use super::arm::{Joint, JointKind, JointLimits, Segment, SerialArm};
use super::mass::MassProperties;
use crate::Result;
use glam::{DMat3, DQuat, DVec3};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use trocar_core::Pose;

/// The parameters of a joint and its link.
struct Row {
    /// Position in the parent's axes (m), and rotation about x (quarter turns).
    position: [f64; 3],
    quarters: f64,
    /// Limits of position (rad), speed (rad/s) and torque (N m).
    range: [f64; 2],
    velocity: f64,
    effort: f64,
    /// Rotor inertia (kg m2) and Coulomb friction (N m).
    armature: f64,
    friction: f64,
    /// Mass (kg), centre of mass (m), inertia xx, xy, xz, yy, yz, zz about it (kg m2).
    mass: f64,
    center: [f64; 3],
    inertia: [f64; 6],
}

const ROWS: [Row; 7] = [
    Row {
        position: [0.0, 0.0, 0.333],
        quarters: 0.0,
        range: [-2.7437, 2.7437],
        velocity: 2.62,
        effort: 87.0,
        armature: 0.195,
        friction: 1.137,
        mass: 2.9274653454,
        center: [4.128e-7, -0.0181251324, -0.038603597],
        inertia: [
            0.023927316485107913,
            1.3317903455714081e-5,
            -0.00011404774918616684,
            0.0224821613275756,
            -0.0019950320628240115,
            0.006350098258530016,
        ],
    },
    Row {
        position: [0.0, 0.0, 0.0],
        quarters: -1.0,
        range: [-1.7837, 1.7837],
        velocity: 2.62,
        effort: 87.0,
        armature: 0.195,
        friction: 1.137,
        mass: 2.9355370338,
        center: [0.0031828864, -0.0743221644, 0.0088146084],
        inertia: [
            0.041938946257609425,
            0.00020257331521090626,
            0.004077784227179924,
            0.02514514885014724,
            -0.0042252158006570156,
            0.06170214472888839,
        ],
    },
    Row {
        position: [0.0, -0.316, 0.0],
        quarters: 1.0,
        range: [-2.9007, 2.9007],
        velocity: 2.62,
        effort: 87.0,
        armature: 0.195,
        friction: 1.137,
        mass: 2.2449013699,
        center: [0.0407015686, -0.0048200565, -0.0289730823],
        inertia: [
            0.02410142547240885,
            0.002404694559042109,
            -0.002856269270114313,
            0.01974053266708178,
            -0.002104212683891874,
            0.019044494482244823,
        ],
    },
    Row {
        position: [0.0825, 0.0, 0.0],
        quarters: 1.0,
        range: [-3.0421, -0.1518],
        velocity: 2.62,
        effort: 87.0,
        armature: 0.195,
        friction: 1.137,
        mass: 2.6155955791,
        center: [-0.0459100965, 0.063049296, -0.0085187868],
        inertia: [
            0.03452998321913202,
            0.01322552265982813,
            0.01015142998484113,
            0.028881621933049058,
            -0.0009762833870704552,
            0.04125471171146641,
        ],
    },
    Row {
        position: [-0.0825, 0.384, 0.0],
        quarters: -1.0,
        range: [-2.8065, 2.8065],
        velocity: 5.26,
        effort: 12.0,
        armature: 0.074,
        friction: 0.763,
        mass: 2.3271207594,
        center: [-0.0016039605, 0.0292536262, -0.097296599],
        inertia: [
            0.051610278463662895,
            -0.005715173387783472,
            -0.0035673167625872135,
            0.04787729713371481,
            0.010673985108535986,
            0.016423625579357254,
        ],
    },
    Row {
        position: [0.0, 0.0, 0.0],
        quarters: 1.0,
        range: [0.5445, 4.5169],
        velocity: 4.18,
        effort: 12.0,
        armature: 0.074,
        friction: 0.44,
        mass: 1.8170376524,
        center: [0.0597131221, -0.0410294666, -0.0101692726],
        inertia: [
            0.005412333594383447,
            0.006193456360285834,
            0.0014219289306117652,
            0.014058329545509979,
            -0.0013140753741120031,
            0.016080817924212554,
        ],
    },
    Row {
        position: [0.088, 0.0, 0.0],
        quarters: 1.0,
        range: [-3.0159, 3.0159],
        velocity: 5.26,
        effort: 12.0,
        armature: 0.074,
        friction: 0.248,
        mass: 0.6271432862,
        center: [0.0045225817, 0.0086261921, -0.0161633251],
        inertia: [
            0.00021092389150104718,
            -2.433299114461931e-5,
            4.564480393778983e-5,
            0.00017718568002411474,
            8.744070223226438e-5,
            5.993190599659971e-5,
        ],
    },
];

/// Viscous damping of every joint (N m s/rad).
const DAMPING: f64 = 0.21;
/// Maximum acceleration of every joint (rad/s2).
const ACCELERATION: f64 = 10.0;
/// Distance from the last joint to the flange, along its axis (m).
const FLANGE: f64 = 0.107;
/// The posture of delivery: elbow up, hand down.
const HOME: [f64; 7] = [0.0, 0.0, 0.0, -FRAC_PI_2, 0.0, FRAC_PI_2, -FRAC_PI_4];

impl SerialArm {
    /// A Franka Research 3 without hand, its base at the world's origin.
    ///
    /// Kinematics, masses, inertias and limits of position, speed and torque come from the
    /// manufacturer's `franka_description` (commit 566ba44, `robots/fr3`); the acceleration limit
    /// comes from the manufacturer's control interface. Rotor inertia, damping and Coulomb
    /// friction, for which the manufacturer publishes no identified values, and the home posture
    /// come from the MuJoCo Menagerie's `franka_fr3`. (`franka_description` has 0.2 N m and 0.003 N
    /// m s/rad for every joint: see [`SerialArm::with_friction`].)
    ///
    /// The limits are the manufacturer's, which the real arm's controller enforces; some versions
    /// of the Menagerie's file have wider ones. The speed limits are those of the description;
    /// those of the real arm also depend on position.
    ///
    /// # Errors
    /// None; the table passes the checks of [`SerialArm::new`].
    pub fn franka_fr3() -> Result<Self> {
        let segments = ROWS.iter().enumerate().map(|(i, row)| segment(i + 1, row)).collect();
        let flange = Pose { translation: DVec3::new(0.0, 0.0, FLANGE), ..Pose::IDENTITY };
        Self::new("fr3", segments, flange)?.with_home(&HOME)
    }
}

fn segment(number: usize, row: &Row) -> Segment {
    let [xx, xy, xz, yy, yz, zz] = row.inertia;
    let inertia = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
    let joint = Joint {
        name: format!("fr3_joint{number}"),
        kind: JointKind::Revolute,
        placement: Pose {
            rotation: DQuat::from_rotation_x(row.quarters * FRAC_PI_2),
            translation: DVec3::from_array(row.position),
        },
        axis: DVec3::Z,
        limits: JointLimits {
            position: row.range,
            velocity: row.velocity,
            effort: row.effort,
            acceleration: ACCELERATION,
        },
        armature: row.armature,
        damping: DAMPING,
        friction: row.friction,
    };
    let mass = MassProperties { mass: row.mass, center: DVec3::from_array(row.center), inertia };
    Segment { link: format!("fr3_link{number}"), joint, mass }
}
