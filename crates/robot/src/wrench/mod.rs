//! Forces at the tool mount: what an instrument weighs is identified and taken off.
