//! What never changes while stepping.

/// Everything that is constant over a simulation.
#[derive(Clone, Debug)]
pub struct Model {
    /// The bodies, in the order they were added.
    pub bodies: Vec<Body>,
}

/// One deformable body.
#[derive(Clone, Debug)]
pub struct Body {
    /// Name.
    pub name: String,
}
