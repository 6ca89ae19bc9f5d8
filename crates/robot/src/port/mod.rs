//! The port: a hole in a sheet that an instrument's shaft leans on and pivots in.
