//! Damaged recordings give frames or one-line errors: no panic, no hang, no memory beyond what
//! their size needs.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::fs;
use trocar_recording::Recording;
use trocar_testing::sphere::{info, write};
use trocar_testing::{Allowance, PEAK, Peak, fuzz_reader};

#[global_allocator]
static ALLOCATOR: &Peak = &PEAK;

/// Images decode to at most about a thousand times their size (the most that deflate can pack),
/// twice for the conversion.
const ALLOWANCE: Allowance = Allowance { fixed: 16 << 20, per_byte: 3000 };

#[test]
fn damage_never_panics() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("recording");
    let mut info = info();
    info.organs[0].polygon = vec![[60.0, 40.0], [100.0, 40.0], [80.0, 80.0]];
    write(&dir, &info, 2);
    // One image as a JPEG too.
    let jpeg = dir.join("color/000001.jpg");
    let picture = image::open(dir.join("color/000001.png")).unwrap();
    picture.save(&jpeg).unwrap();
    let index = dir.join("frames.csv");
    fs::write(&index, fs::read_to_string(&index).unwrap().replace("color/000001.png", "color/000001.jpg")).unwrap();

    let names = [
        "recording.toml",
        "frames.csv",
        "depth/000001.png",
        "color/000000.png",
        "color/000001.jpg",
        "masks/instruments/000000.png",
    ];
    let seeds: Vec<(String, Vec<u8>)> = names.map(|n| (n.to_owned(), fs::read(dir.join(n)).unwrap())).into();
    fuzz_reader(&seeds, ALLOWANCE, |name, bytes| {
        let path = dir.join(name);
        fs::write(&path, bytes).unwrap();
        let tell = |e: trocar_recording::Error| {
            let text = e.to_string();
            assert!(!text.contains('\n') && !text.is_empty(), "{text}");
        };
        match Recording::open(&dir) {
            Ok(recording) => {
                for packet in recording.packets(&[0, 1]) {
                    let index = packet.frame;
                    if let Err(e) = packet.parts.and_then(|parts| recording.decode(index, &parts)) {
                        tell(e);
                    }
                }
            }
            Err(e) => tell(e),
        }
        let good = seeds.iter().find(|s| s.0 == name).unwrap();
        fs::write(&path, &good.1).unwrap();
    });
}
