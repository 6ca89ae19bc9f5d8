//! Trocar as a library: a facade over its crates.
//!
//! It is empty as yet. The program of the same name is the package `trocar-cli`.
