//! Factors that may differ between episodes, one row each.

use std::ops::RangeInclusive;

/// How often a factor is drawn: once an episode, or once for each part of that kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Per {
    /// The whole cell.
    Cell,
    /// Each arm.
    Arm,
    /// Each port.
    Port,
    /// Each camera.
    Camera,
}

macro_rules! factors {
    ($($variant:ident $name:literal $per:ident $axes:tt $range:expr, $about:literal;)*) => {
        /// Something that may differ between episodes.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Factor {
            $(#[doc = $about] $variant,)*
        }

        impl Factor {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$variant),*];
            /// Their names in scene files.
            pub const NAMES: &[&str] = &[$($name),*];

            /// Its name in scene files, which ends in its unit.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),* }
            }

            /// What it is drawn for.
            pub fn per(self) -> Per {
                match self { $(Self::$variant => Per::$per),* }
            }

            /// Its numbers: one without a name, or one an axis.
            pub fn axes(self) -> &'static [&'static str] {
                match self { $(Self::$variant => &$axes),* }
            }

            /// The range of its values.
            pub fn range(self) -> RangeInclusive<f64> {
                match self { $(Self::$variant => $range),* }
            }

            /// Its description, with how the number is applied.
            pub fn about(self) -> &'static str {
                match self { $(Self::$variant => $about),* }
            }
        }
    };
}

factors! {
    SpecimenShift "specimen_shift_mm" Cell ["x", "y"] -50.0..=50.0, "Shift of the specimen along the cell's x and y (mm).";
    SpecimenTurn "specimen_turn_deg" Cell [""] -180.0..=180.0, "Turn of the specimen about the vertical through its middle (degrees).";
    Modulus "modulus_kpa" Cell [""] 0.1..=10_000.0, "Young's modulus of all organs (kPa).";
    Poisson "poisson_ratio" Cell [""] 0.0..=0.49, "Poisson's ratio of all organs.";
    Density "density_kg_m3" Cell [""] 100.0..=5000.0, "Density of all organs (kg/m3).";
    Friction "friction" Cell [""] 0.0..=2.0, "Coulomb friction of tissue on tissue and of instruments on tissue.";
    PinScale "pin_scale" Cell [""] 0.1..=3.0, "Factor on the shares and lengths of all pin rules; a share stays at most 1.";
    TearForce "tear_force_n" Cell [""] 0.1..=100.0, "Pull at which tissue tears out of a compliant grasp (N).";
    JawForce "jaw_force_n" Cell [""] 0.01..=40.0, "Force with which graspers close (N).";
    JointFriction "joint_friction_nm" Cell [""] 0.0..=5.0, "Joint friction that the controllers know nothing of (N m).";
    InstrumentMass "instrument_mass_scale" Cell [""] 0.5..=2.0, "Factor on the mass of all instruments.";
    ControlDelay "control_delay_ms" Cell [""] 0.0..=2000.0, "Time from an action to the arms (ms).";
    Tilt "tilt_deg" Arm [""] -30.0..=30.0, "Added to the tilt of the instrument at the start (degrees).";
    Azimuth "azimuth_deg" Arm [""] -180.0..=180.0, "Added to the azimuth of the instrument at the start (degrees).";
    Insertion "insertion_mm" Arm [""] -100.0..=100.0, "Added to the insertion at the start (mm); of an arm without a port, to each coordinate of its position.";
    Roll "roll_deg" Arm [""] -180.0..=180.0, "Added to the roll of the instrument at the start (degrees).";
    BaseShift "base_shift_mm" Arm ["x", "y"] -200.0..=200.0, "Shift of the arm's base along the cell's x and y (mm).";
    PortShift "port_shift_mm" Port ["x", "y"] -50.0..=50.0, "Shift of the port along the cell's x and y (mm).";
    PortTilt "port_tilt_deg" Port ["x", "y"] -45.0..=45.0, "Turn of the port's normal about the cell's x and y (degrees).";
    CameraShift "camera_shift_mm" Camera ["x", "y", "z"] -200.0..=200.0, "Shift of the camera along the cell's axes (mm).";
    CameraTurn "camera_turn_deg" Camera ["x", "y", "z"] -90.0..=90.0, "Turn of the camera about its own axes, applied as one rotation vector (degrees).";
    FocalScale "focal_scale" Camera [""] 0.3..=3.0, "Factor on the focal lengths of the camera.";
    LampScale "lamp_scale" Cell [""] 0.0..=10.0, "Factor on the light of all lamps, the endoscope's too.";
    ExposureScale "exposure_scale" Cell [""] 0.05..=20.0, "Factor on the exposure of all cameras.";
    NoiseScale "noise_scale" Cell [""] 0.0..=10.0, "Factor on the noise of all sensors, where noise is switched on.";
    GlossScale "gloss_scale" Cell [""] 0.0..=5.0, "Factor on the strength of highlights on tissue.";
    Tint "tint_scale" Cell ["red", "green", "blue"] 0.2..=2.0, "Factor on each colour channel of the organs.";
}

impl Factor {
    /// The factor of that name in scene files.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|f| f.name() == name)
    }

    /// Whether it changes pictures and nothing else.
    pub fn is_of_pictures(self) -> bool {
        use Factor::{CameraShift, CameraTurn, ExposureScale, FocalScale, GlossScale, LampScale, NoiseScale, Tint};
        let of_cameras = matches!(self, CameraShift | CameraTurn | FocalScale);
        of_cameras || matches!(self, LampScale | ExposureScale | NoiseScale | GlossScale | Tint)
    }
}
