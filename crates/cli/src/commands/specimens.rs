//! `trocar specimens`.

use crate::cli::Specimens;
use crate::output;
use serde::Serialize;
use std::time::Instant;
use trocar_core::Progress;
use trocar_scene::{Scene, SpecimenSource};
use trocar_workflow::{Error, Result, SpecimenCache, counted};

/// Most anatomies of one command.
const MAX_COUNT: u32 = 1000;

#[derive(Serialize)]
struct Made {
    folder: String,
    specimens: Vec<String>,
    seconds: f64,
}

pub fn run(arguments: &Specimens, json: bool, progress: &dyn Progress) -> Result<()> {
    let (count, first) = (arguments.count, arguments.first_seed);
    if !(1..=MAX_COUNT).contains(&count) {
        return Err(Error::Mismatch(format!("--count {count}: it must be in [1, {MAX_COUNT}]")));
    }
    let Some(last) = first.checked_add(count - 1) else {
        return Err(Error::Mismatch(format!("--first-seed {first}: the last seed would be greater than {}", u32::MAX)));
    };
    let known = trocar_phantom::NAMES;
    if !known.contains(&arguments.phantom.as_str()) {
        let known = known.join(", ");
        return Err(Error::Mismatch(format!("no phantom '{:.60}'; the phantoms are {known}", arguments.phantom)));
    }
    let clock = Instant::now();
    let source = |seed| SpecimenSource::phantom(&arguments.phantom, seed).with_max_elements(arguments.max_elements);
    let all: Vec<SpecimenSource> = (first..=last).map(source).collect();
    let scene = Scene::new("specimens", all[0].clone());
    if let Some(most) = arguments.max_elements.filter(|most| !SpecimenSource::MAX_ELEMENTS.contains(most)) {
        let (low, high) = (SpecimenSource::MAX_ELEMENTS.start(), SpecimenSource::MAX_ELEMENTS.end());
        return Err(Error::Mismatch(format!("--max-elements {most}: it must be in [{low}, {high}]")));
    }
    SpecimenCache::new(&scene, &arguments.phantoms).make_all(&all, progress)?;
    let made = Made {
        folder: arguments.phantoms.display().to_string(),
        specimens: all.iter().map(SpecimenSource::label).collect(),
        seconds: clock.elapsed().as_secs_f64(),
    };
    output::print(json, &made, |m| {
        let specimens = counted(m.specimens.len(), "specimen");
        format!("{specimens} of {} in {} ({:.1} s)", arguments.phantom, m.folder, m.seconds)
    });
    Ok(())
}
