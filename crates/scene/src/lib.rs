//! Scene files: the whole cell in one TOML file, checked before anything is built from it.
