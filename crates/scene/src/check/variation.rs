//! Checks of what varies between episodes, and of the factors on pictures.

use super::unit::show;
use super::{Checked, numbers, one_of, problem};
use crate::{Factor, PHANTOMS, Scene, Specimens};

/// Most seeds of each phantom.
const MAX_SEEDS: u32 = 1000;

pub(super) fn check(scene: &Scene) -> Checked {
    imaging(scene)?;
    if let Some(specimens) = &scene.variation.specimens {
        self::specimens(scene, specimens)?;
    }
    let mut seen: Vec<&str> = Vec::new();
    for (k, organ) in scene.variation.swapped.iter().enumerate() {
        if seen.contains(&organ.as_str()) {
            return Err(problem(format!("variation.swapped[{k}]"), format!(" is '{organ}' again; name it once")));
        }
        seen.push(organ);
    }
    for (factor, distribution) in &scene.variation.factors {
        let field = format!("variation.{}", factor.name());
        if let Some(mistake) = distribution.mistake() {
            return Err(problem(field, mistake));
        }
        let ([low, high], range) = (distribution.range(), factor.range());
        if !range.contains(&low) || !range.contains(&high) {
            let (from, to) = (show(*range.start()), show(*range.end()));
            let given = if low < high { format!("{} to {}", show(low), show(high)) } else { show(low) };
            return Err(problem(field, format!(" gives {given}; it must stay in [{from}, {to}]")));
        }
    }
    Ok(())
}

fn imaging(scene: &Scene) -> Checked {
    let i = &scene.imaging;
    let factors = [
        ("lamp", i.lamp, Factor::LampScale),
        ("exposure", i.exposure, Factor::ExposureScale),
        ("noise", i.noise, Factor::NoiseScale),
        ("gloss", i.gloss, Factor::GlossScale),
        ("tint[0]", i.tint[0], Factor::Tint),
        ("tint[1]", i.tint[1], Factor::Tint),
        ("tint[2]", i.tint[2], Factor::Tint),
    ];
    numbers("imaging", &factors.map(|(key, value, factor)| (key, value, factor.range())))
}

fn specimens(scene: &Scene, specimens: &Specimens) -> Checked {
    const AT: &str = "variation.specimens";
    let Specimens { paths, phantoms, seeds: [first, last] } = specimens;
    if paths.is_empty() && phantoms.is_empty() {
        return Err(problem(AT, " has neither paths nor phantoms; it must have one or more".to_owned()));
    }
    for (k, name) in phantoms.iter().enumerate() {
        let known = PHANTOMS.map(|p| p.name);
        one_of(&format!("{AT}.phantoms[{k}]"), name, "the phantoms are", &known)?;
    }
    if first > last {
        let reason = format!(" is [{first}, {last}]; the first seed must not be greater than the last");
        return Err(problem(format!("{AT}.seeds"), reason));
    }
    if last - first >= MAX_SEEDS {
        let reason = format!(" is [{first}, {last}]; there must be at most {MAX_SEEDS} seeds");
        return Err(problem(format!("{AT}.seeds"), reason));
    }
    for (k, path) in paths.iter().enumerate() {
        let folder = scene.resolve(path);
        if !folder.join("specimen.toml").is_file() {
            let shown = folder.display().to_string().replace(['\n', '\r'], " ");
            let reason = format!(" is {shown}, which is no specimen; it must be a folder with a specimen.toml");
            return Err(problem(format!("{AT}.paths[{k}]"), reason));
        }
    }
    Ok(())
}
