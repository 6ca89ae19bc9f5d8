#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]
use std::path::Path;
#[test]
fn base() {
    let folder = Path::new("/tmp/w/base-episode");
    let file = trocar_task::EpisodeFile::read(&folder.join("episode.trocar")).unwrap();
    let specimen = trocar_specimen::Specimen::read(Path::new(&std::env::var("SPEC").unwrap())).unwrap();
    let scene = file.scene(None).unwrap();
    let verdict = file.verify(&scene, &specimen, 1, &mut || true).unwrap();
    println!("{verdict:?}");
    let (_, rows) = trocar_task::read_channels(&folder.join("channels.parquet")).unwrap();
    let mut episode = trocar_task::Episode::new(&scene, &specimen, 1).unwrap();
    let mut policy = trocar_task::policy::named("scripted").unwrap();
    let made = trocar_task::run(&mut episode, policy.as_mut(), 0, &mut |_| true).unwrap();
    println!("{} rows, {}", made.channels.len(), rows.len());
    let names = trocar_task::Channels::names();
    for (k, (a, b)) in made.channels.iter().zip(&rows).enumerate() {
        for ((x, y), n) in a.to_row().iter().zip(b.to_row()).zip(&names) {
            if x.to_bits() != y.to_bits() && !(n.contains("guarded") || n.contains("activation")) {
                println!("row {k} {n}: {x} {y}");
            }
        }
    }
    println!("{}", serde_json::to_string_pretty(&made.result()).unwrap());
}
