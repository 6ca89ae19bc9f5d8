//! Applying what was drawn: the scene of one episode.

use super::{Drawn, Factor, Variation};
use crate::{CellCamera, Frame, InstrumentKind, Lens, PinRule, Scene, View};
use glam::{DQuat, DVec3};
use trocar_core::Pose;
use trocar_specimen::{Pins, Specimen};

impl Scene {
    /// The scene of the episode for which `drawn` was drawn, around its `specimen`: every value is
    /// fixed, and nothing varies any more.
    pub fn with_drawn(&self, drawn: &Drawn, specimen: &Specimen) -> Self {
        let mut scene = self.clone();
        scene.variation = Variation::default();
        scene.specimen = drawn.specimen.clone();
        scene.place_specimen(drawn, specimen);
        scene.vary_tissue(drawn, specimen);
        scene.vary_posterior(drawn, specimen);
        scene.vary_pictures(drawn);
        scene.vary_tools(drawn);
        scene.vary_starts(drawn);
        scene.vary_cameras(drawn);
        scene
    }

    fn place_specimen(&mut self, drawn: &Drawn, specimen: &Specimen) {
        let shift = drawn.axes(Factor::SpecimenShift, "").unwrap_or([0.0; 2]).map(|mm: f64| 1e-3 * mm);
        let turn = drawn.one(Factor::SpecimenTurn).unwrap_or(0.0).to_radians();
        if shift == [0.0; 2] && turn == 0.0 {
            return;
        }
        let placement = self.placement.pose();
        let points = || specimen.organs.iter().flat_map(|o| &o.body.vertices);
        let middle = placement.transform(points().sum::<DVec3>() / points().count().max(1) as f64);
        let rotation = DQuat::from_rotation_z(turn);
        let at = Pose {
            rotation: (rotation * placement.rotation).normalize(),
            translation: middle + rotation * (placement.translation - middle) + DVec3::new(shift[0], shift[1], 0.0),
        };
        self.placement = Frame::of(&at);
    }

    fn vary_tissue(&mut self, drawn: &Drawn, specimen: &Specimen) {
        let modulus = drawn.one(Factor::Modulus).map(|kpa| 1e3 * kpa);
        let (poisson, density) = (drawn.one(Factor::Poisson), drawn.one(Factor::Density));
        let pins = drawn.one(Factor::PinScale);
        if modulus.or(poisson).or(density).or(pins).is_some() {
            for organ in &specimen.organs {
                let own = self.organs.entry(organ.name.clone()).or_default();
                let material = &mut own.material;
                material.young_modulus_pa = modulus.or(material.young_modulus_pa);
                material.poisson_ratio = poisson.or(material.poisson_ratio);
                material.density_kg_m3 = density.or(material.density_kg_m3);
                if let Some(scale) = pins {
                    own.pins = Some(own.pins.unwrap_or_else(|| PinRule::of(organ.pins)).scaled(scale));
                }
            }
        }
        let tissue = &mut self.tissue;
        tissue.friction = drawn.one(Factor::Friction).unwrap_or(tissue.friction);
        tissue.tear_force_n = drawn.one(Factor::TearForce).unwrap_or(tissue.tear_force_n);
        let error = &mut self.gravity_error;
        error.joint_friction_nm = drawn.one(Factor::JointFriction).unwrap_or(error.joint_friction_nm);
    }

    fn vary_pictures(&mut self, drawn: &Drawn) {
        let imaging = &mut self.imaging;
        imaging.lamp *= drawn.one(Factor::LampScale).unwrap_or(1.0);
        imaging.exposure *= drawn.one(Factor::ExposureScale).unwrap_or(1.0);
        imaging.noise *= drawn.one(Factor::NoiseScale).unwrap_or(1.0);
        imaging.gloss *= drawn.one(Factor::GlossScale).unwrap_or(1.0);
        for (own, scale) in imaging.tint.iter_mut().zip(drawn.axes(Factor::Tint, "").unwrap_or([1.0; 3])) {
            *own *= scale;
        }
    }

    fn vary_tools(&mut self, drawn: &Drawn) {
        let delay = &mut self.rates.control_delay_ms;
        *delay = drawn.one(Factor::ControlDelay).unwrap_or(*delay);
        for instrument in &mut self.instruments {
            if instrument.kind == InstrumentKind::Grasper {
                instrument.jaw_force_n = drawn.one(Factor::JawForce).unwrap_or(instrument.jaw_force_n);
            }
            instrument.mass_kg *= drawn.one(Factor::InstrumentMass).unwrap_or(1.0);
        }
        for port in &mut self.ports {
            let [x, y] = drawn.axes(Factor::PortShift, &port.name).unwrap_or_default();
            port.centre_m[0] += 1e-3 * x;
            port.centre_m[1] += 1e-3 * y;
            if let Some(turns) = drawn.axes::<2>(Factor::PortTilt, &port.name) {
                let [x, y] = turns.map(f64::to_radians);
                let turned = DQuat::from_scaled_axis(DVec3::new(x, y, 0.0)) * DVec3::from(port.normal);
                port.normal = turned.normalize().to_array();
            }
        }
        for arm in &mut self.arms {
            let shift = drawn.axes::<2>(Factor::BaseShift, arm.name.name());
            if let (Some([x, y]), Some(base)) = (shift, &mut arm.base) {
                base.position_m[0] += 1e-3 * x;
                base.position_m[1] += 1e-3 * y;
            }
        }
    }

    fn vary_starts(&mut self, drawn: &Drawn) {
        for arm in &mut self.arms {
            let (name, start) = (arm.name.name(), &mut arm.start);
            let added = |factor| drawn.axes::<1>(factor, name).map_or(0.0, |[v]| v);
            start.tilt_deg = (start.tilt_deg + added(Factor::Tilt)).max(0.0);
            start.azimuth_deg += added(Factor::Azimuth);
            start.insertion_mm += added(Factor::Insertion);
            start.roll_deg += added(Factor::Roll);
            let aside =
                |axis| drawn.values.iter().find(|v| v.factor == Factor::Insertion && v.part == name && v.axis == axis);
            if let Some(position) = &mut start.position_m {
                for (k, coordinate) in position.iter_mut().enumerate() {
                    *coordinate += aside(1 + k).map_or(0.0, |v| 1e-3 * v.value);
                }
            }
        }
    }

    fn vary_cameras(&mut self, drawn: &Drawn) {
        let placement = self.placement;
        for camera in &mut self.cameras {
            let shift = drawn.axes::<3>(Factor::CameraShift, &camera.name);
            let turn = drawn.axes::<3>(Factor::CameraTurn, &camera.name);
            if shift.or(turn).is_some() {
                let pose = camera.view.pose(&placement);
                let turn = DVec3::from(turn.unwrap_or_default().map(f64::to_radians));
                let at = Pose {
                    rotation: (pose.rotation * DQuat::from_scaled_axis(turn)).normalize(),
                    translation: pose.translation + 1e-3 * DVec3::from(shift.unwrap_or_default()),
                };
                let Frame { position_m, rotation_wxyz } = Frame::of(&at);
                camera.view = View::Pose { position_m, rotation_wxyz };
            }
            if let Some([scale]) = drawn.axes::<1>(Factor::FocalScale, &camera.name) {
                camera.zoom(scale);
            }
        }
    }
}

impl CellCamera {
    /// Scales the focal lengths. The lens of a recording is that of its camera and stays.
    fn zoom(&mut self, scale: f64) {
        match &mut self.lens {
            Lens::FieldOfView { width_deg, height_deg } => {
                for angle in [width_deg, height_deg] {
                    *angle = 2.0 * libm::atan(libm::tan((0.5 * *angle).to_radians()) / scale).to_degrees();
                }
            }
            Lens::Opencv { fx_px, fy_px, .. } => {
                *fx_px *= scale;
                *fy_px *= scale;
            }
            Lens::Recording {} => {}
        }
    }
}

impl PinRule {
    /// The rule of a specimen.
    fn of(pins: Pins) -> Self {
        use crate::PinEnd;
        use trocar_specimen::End;
        match pins {
            Pins::None => Self::None {},
            Pins::Band { share } => Self::Band { share },
            Pins::End { end, length, band_length, band_share } => {
                let end = match end {
                    End::Base => PinEnd::Base,
                    End::Tip => PinEnd::Tip,
                };
                Self::End { end, length, band_length, band_share }
            }
        }
    }

    /// The rule with its shares and lengths scaled; none passes 1.
    fn scaled(self, scale: f64) -> Self {
        let scaled = |v: f64| (v * scale).min(1.0);
        match self {
            Self::None {} => Self::None {},
            Self::Band { share } => Self::Band { share: scaled(share) },
            Self::End { end, length, band_length, band_share } => {
                let length = scaled(length);
                // The band is next to the end, within the organ.
                let band_length = scaled(band_length).min(1.0 - length);
                Self::End { end, length, band_length, band_share: scaled(band_share) }
            }
        }
    }
}
