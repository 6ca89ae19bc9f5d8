//! Supports of a body: one-sided surfaces with a quadratic penalty and Coulomb friction, and
//! threads that hold it.

mod field;
mod tether;

pub use field::SupportField;
pub use tether::Tether;

use glam::{DMat3, DVec3};

/// A one-sided surface that supports a body.
#[derive(Clone, Debug, PartialEq)]
pub enum Support {
    /// A plane.
    Plane(SupportPlane),
    /// A height field over a plane.
    Field(SupportField),
}

/// A one-sided plane that a body rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupportPlane {
    /// A point of the plane (m).
    pub point: DVec3,
    /// Unit normal, into the free side.
    pub normal: DVec3,
    /// Coulomb friction coefficient.
    pub friction: f64,
}

/// A point at a support. The energy of a pressed node of stiffness k is k/2 height^2.
#[derive(Clone, Copy, Debug)]
pub struct SupportContact {
    /// Height above the support (m), along a field's `up`; negative below.
    pub height: f64,
    /// Its gradient; of unit length for planes, longer on a field's slopes.
    pub gradient: DVec3,
    /// Its second derivative (1/m).
    pub curvature: DMat3,
}

impl Support {
    /// Coulomb friction coefficient.
    pub fn friction(&self) -> f64 {
        match self {
            Self::Plane(plane) => plane.friction,
            Self::Field(field) => field.friction(),
        }
    }

    /// Height of `x` above the support (m): along a plane's normal, along a field's `up`; negative
    /// below.
    pub fn height(&self, x: DVec3) -> f64 {
        self.contact(x).height
    }

    /// The support at `x` (m): height, gradient and curvature.
    pub fn contact(&self, x: DVec3) -> SupportContact {
        match self {
            Self::Plane(plane) => SupportContact {
                height: (x - plane.point).dot(plane.normal),
                gradient: plane.normal,
                curvature: DMat3::ZERO,
            },
            Self::Field(field) => field.contact(x),
        }
    }

    /// Checks the support.
    pub(crate) fn check(&self) -> Result<(), String> {
        let Self::Plane(plane) = self else {
            return Ok(());
        };
        if plane.normal.is_normalized()
            && plane.point.is_finite()
            && plane.friction >= 0.0
            && plane.friction.is_finite()
        {
            Ok(())
        } else {
            Err(format!("{plane:?} is no plane: a point, a unit normal, friction of 0 or more"))
        }
    }
}

impl From<SupportPlane> for Support {
    fn from(plane: SupportPlane) -> Self {
        Self::Plane(plane)
    }
}

impl From<SupportField> for Support {
    fn from(field: SupportField) -> Self {
        Self::Field(field)
    }
}
