//! Serial arms: their description, kinematics and dynamics.
