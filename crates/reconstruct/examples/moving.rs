//! Prints per organ the share of its pixels that move during the window.
#![allow(clippy::print_stdout, clippy::unwrap_used, missing_docs)]
fn main() {
    for path in std::env::args().skip(1) {
        let recording = trocar_recording::Recording::open(std::path::Path::new(&path)).unwrap();
        let made = trocar_reconstruct::reconstruct(&recording, &Default::default(), &trocar_core::Silent).unwrap();
        for o in &made.organs {
            println!("{path} {} {:.4}", o.name, o.moving_share);
        }
        println!("{:?}", made.warnings);
    }
}
