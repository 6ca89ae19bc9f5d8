//! The factors and groups by which success is shown: the names that `--by` takes, checked against
//! the variation.

use crate::store::EpisodeRecord;
use trocar_scene::{Distribution, DrawnValue, Factor, Scene, Split};
use trocar_specimen::nearest;
use trocar_workflow::{Error, Result};

/// The name of the split, and of the specimen, beside the factors.
const SPLIT: &str = "split";
const SPECIMEN: &str = "specimen";
/// The name of all that varies.
const ALL: &str = "all";
/// Prefix of the name of an organ's specimen.
const SWAPPED: &str = "swapped.";

/// Groups: a name for one or more of the others.
const GROUPS: [(&str, &[&str]); 10] = [
    ("organ", &[SPECIMEN]),
    ("anatomy", &[SPECIMEN]),
    ("modulus", &["modulus_kpa"]),
    ("tissue", &["modulus_kpa", "poisson_ratio", "density_kg_m3", "friction", "pin_scale", "tear_force_n"]),
    ("place", &["specimen_shift_mm", "specimen_turn_deg"]),
    ("start", &["tilt_deg", "azimuth_deg", "insertion_mm", "roll_deg"]),
    ("setup", &["base_shift_mm", "port_shift_mm", "port_tilt_deg"]),
    ("tool", &["jaw_force_n", "joint_friction_nm", "instrument_mass_scale", "control_delay_ms"]),
    ("camera", &["camera_shift_mm", "camera_turn_deg", "focal_scale"]),
    ("light", &["lamp_scale", "exposure_scale", "noise_scale", "gloss_scale", "tint_scale"]),
];

/// Where an episode's value comes from.
#[derive(Clone, Debug, PartialEq)]
enum Source {
    Split,
    Specimen,
    /// The specimen that this organ is of.
    Swapped(String),
    /// All numbers of a factor as one.
    Factor(Factor),
    /// A single number by its name in tables, such as `left.tilt_deg`.
    Number(Factor),
}

/// Something that varies and that success is shown by.
#[derive(Clone, Debug, PartialEq)]
pub struct By {
    /// Its name: `split`, `specimen`, a factor, or a drawn number such as `left.tilt_deg`.
    pub name: String,
    source: Source,
    /// Each value is a row of its own.
    pub choice: bool,
    /// Drawn evenly in the logarithm.
    pub log: bool,
}

/// The value of an episode.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A name.
    Label(String),
    /// A number in the unit of the factor.
    Number(f64),
}

impl By {
    fn of(name: &str, source: Source, distribution: Option<&Distribution>) -> Self {
        let choice = distribution.is_none_or(|d| matches!(d, Distribution::Choice(_)));
        let log = matches!(distribution, Some(Distribution::LogUniform(_)));
        Self { name: name.to_owned(), source, choice, log }
    }

    /// All that varies between the episodes of `scene` in `split`.
    pub fn all(scene: &Scene, split: Split) -> Vec<Self> {
        let mut all = Vec::new();
        if split == Split::Both {
            all.push(Self::of(SPLIT, Source::Split, None));
        }
        if split.of_specimens(&scene.specimens()).len() > 1 {
            all.push(Self::of(SPECIMEN, Source::Specimen, None));
            let organs = scene.variation.swapped.iter();
            all.extend(organs.map(|o| Self::of(&format!("{SWAPPED}{o}"), Source::Swapped(o.clone()), None)));
        }
        // A factor of ports varies nothing in a scene without ports.
        let values = scene.draw(0).values;
        let varied = scene.variation.all_factors();
        let varied = varied.iter().filter(|(f, d)| d.varies() && values.iter().any(|v| v.factor == **f));
        all.extend(varied.map(|(factor, d)| Self::of(factor.name(), Source::Factor(*factor), Some(d))));
        all
    }

    /// The rows that `names` select: each name is a factor, a group, a drawn number, `specimen`,
    /// `split` or `all`. No name selects everything that varies.
    ///
    /// # Errors
    /// A name that is unknown, or of something that does not vary.
    pub fn parse(names: &[String], scene: &Scene, split: Split) -> Result<Vec<Self>> {
        let all = Self::all(scene, split);
        if names.is_empty() {
            return Ok(all);
        }
        let mut chosen: Vec<Self> = Vec::new();
        for name in names {
            let mut found = Self::named(name, &all, scene)?;
            found.retain(|by| !chosen.contains(by));
            chosen.extend(found);
        }
        Ok(chosen)
    }

    fn named(name: &str, all: &[Self], scene: &Scene) -> Result<Vec<Self>> {
        if name == ALL {
            return Ok(all.to_vec());
        }
        let members = GROUPS.iter().find(|(group, _)| *group == name).map(|(_, members)| *members);
        let is_number = || scene.draw(0).values.iter().any(|v| v.name() == name);
        let known = members.is_some()
            || all.iter().any(|by| by.name == name)
            || [SPLIT, SPECIMEN].contains(&name)
            || Factor::named(name).is_some();
        if !known && !is_number() {
            let groups = GROUPS.iter().map(|(group, _)| *group);
            let names =
                || [SPLIT, SPECIMEN, ALL].into_iter().chain(groups.clone()).chain(Factor::NAMES.iter().copied());
            let hint = nearest(name, names()).map_or_else(String::new, |n| format!("; did you mean '{n}'?"));
            let listed: Vec<&str> = names().collect();
            let listed = listed.join(", ");
            let why = format!("--by {name:.60}: it is unknown; it must be some of {listed}, or a drawn number{hint}");
            return Err(Error::Mismatch(why));
        }
        if let Some(number) = DrawnValue::named(name, 0.0)
            && Factor::named(name).is_none()
            && all.iter().any(|by| by.source == Source::Factor(number.factor))
        {
            let distributions = scene.variation.all_factors();
            return Ok(vec![Self::of(name, Source::Number(number.factor), distributions.get(&number.factor))]);
        }
        let wanted = members.unwrap_or_default();
        let found: Vec<Self> = all.iter().filter(|by| by.name == name || by.is_of(wanted)).cloned().collect();
        if found.is_empty() {
            let what = if wanted.len() > 1 { format!("{name} ({})", wanted.join(", ")) } else { name.to_owned() };
            let varied: Vec<&str> = all.iter().map(|by| by.name.as_str()).collect();
            let varied =
                if varied.is_empty() { "nothing varies".to_owned() } else { format!("{} vary", varied.join(", ")) };
            let why = format!("--by {what}: it does not vary here; {varied}; see --variation and --split");
            return Err(Error::Mismatch(why));
        }
        Ok(found)
    }

    /// Whether it is among the `members` of a group. The organs of others go with the specimen.
    fn is_of(&self, members: &[&str]) -> bool {
        let name = if matches!(self.source, Source::Swapped(_)) { SPECIMEN } else { self.name.as_str() };
        members.contains(&name)
    }

    /// The value of an episode; `None` where nothing was drawn for it.
    pub fn value(&self, record: &EpisodeRecord) -> Option<Value> {
        let drawn = record.summary.drawn.as_ref();
        match &self.source {
            Source::Split => Some(Value::Label(Split::of_seed(record.seed).name().to_owned())),
            Source::Specimen => Some(Value::Label(drawn?.specimen.own_label())),
            Source::Swapped(organ) => drawn?.specimen.swapped.get(organ).cloned().map(Value::Label),
            Source::Number(_) => drawn?.values.iter().find(|v| v.name() == self.name).map(|v| Value::Number(v.value)),
            Source::Factor(factor) => {
                let values = drawn?.values.iter().filter(|v| v.factor == *factor);
                size(*factor, &values.collect::<Vec<_>>()).map(Value::Number)
            }
        }
    }

    /// The axis label of a plot, with the unit.
    pub fn label(&self, single: bool) -> String {
        let (Source::Factor(factor) | Source::Number(factor)) = self.source else { return self.name.clone() };
        let (words, unit) = words(factor.name());
        let unit = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
        let part = match self.source {
            Source::Number(_) => self.name.replace(factor.name(), &words).replace('.', " "),
            _ if single => words,
            _ if is_scale(factor) => format!("{words}, mean"),
            _ => format!("{words}, largest size"),
        };
        part + &unit
    }
}

fn is_scale(factor: Factor) -> bool {
    factor.name().ends_with("_scale")
}

/// The numbers of a factor as one: the number itself if it is the only one, the mean of scales, and
/// otherwise the largest size (over the axes) of any part.
fn size(factor: Factor, values: &[&DrawnValue]) -> Option<f64> {
    match values {
        [] => None,
        [one] => Some(one.value),
        _ if is_scale(factor) => Some(values.iter().map(|v| v.value).sum::<f64>() / values.len() as f64),
        _ => {
            let squares = |part: &str| values.iter().filter(|v| v.part == part).map(|v| v.value * v.value).sum::<f64>();
            values.iter().map(|v| squares(&v.part).sqrt()).reduce(f64::max)
        }
    }
}

/// The words and the unit of a factor's name.
fn words(name: &str) -> (String, &'static str) {
    const UNITS: [(&str, &str); 7] = [
        ("_kg_m3", "kg/m3"),
        ("_mm", "mm"),
        ("_ms", "ms"),
        ("_deg", "degrees"),
        ("_kpa", "kPa"),
        ("_nm", "N m"),
        ("_n", "N"),
    ];
    let found = UNITS.iter().find_map(|(end, unit)| Some((name.strip_suffix(end)?, *unit)));
    let (rest, unit) = found.unwrap_or((name, ""));
    (rest.replace('_', " "), unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_scene::VariationSet;

    fn cell_a(set: VariationSet) -> Scene {
        let mut scene = Scene::builtin("cell-a").unwrap();
        scene.variation.set = set;
        scene
    }

    #[test]
    fn every_factor_is_in_one_group_and_groups_hold_known_names() {
        for factor in Factor::ALL {
            // `modulus` is a name for one factor of `tissue`.
            let count = GROUPS.iter().filter(|(group, m)| *group != "modulus" && m.contains(&factor.name())).count();
            assert_eq!(count, 1, "{}", factor.name());
        }
        let known = |name: &&str| *name == SPECIMEN || Factor::named(name).is_some();
        assert!(GROUPS.iter().flat_map(|(_, members)| *members).all(known));
        assert!(GROUPS.iter().all(|(group, _)| Factor::named(group).is_none()));
    }

    #[test]
    fn names_are_factors_groups_and_drawn_numbers() {
        let names = |by: &[&str], set, split| -> std::result::Result<String, String> {
            let by: Vec<String> = by.iter().map(|n| (*n).to_owned()).collect();
            let found = By::parse(&by, &cell_a(set), split).map_err(|e| e.to_string())?;
            Ok(found.iter().map(|by| by.name.as_str()).collect::<Vec<_>>().join(" "))
        };
        let standard = |by: &[&str]| names(by, VariationSet::Standard, Split::Seen);
        assert_eq!(
            standard(&["organ", "modulus", "camera"]).unwrap(),
            "specimen modulus_kpa camera_shift_mm camera_turn_deg"
        );
        assert_eq!(standard(&["tissue", "friction", "left.tilt_deg"]).unwrap(), "modulus_kpa friction left.tilt_deg");
        assert_eq!(standard(&["all"]).unwrap(), standard(&[]).unwrap());
        let mut swapped = cell_a(VariationSet::Standard);
        swapped.variation.swapped = vec!["appendix".to_owned()];
        for by in ["organ", "anatomy"] {
            let found = By::parse(&[by.to_owned()], &swapped, Split::Seen).unwrap();
            assert_eq!(found.iter().map(|by| by.name.as_str()).collect::<Vec<_>>(), ["specimen", "swapped.appendix"]);
        }
        assert_eq!(By::parse(&["swapped.appendix".to_owned()], &swapped, Split::Seen).unwrap().len(), 1);
        let none = names(&[], VariationSet::None, Split::Both).unwrap();
        assert_eq!(none, "split tilt_deg azimuth_deg insertion_mm roll_deg");
        let said = standard(&["modulous"]).unwrap_err();
        assert!(
            said.starts_with("--by modulous: it is unknown") && said.ends_with("did you mean 'modulus'?"),
            "{said}"
        );
        let said = standard(&["port_tilt_deg"]).unwrap_err();
        assert!(said.starts_with("--by port_tilt_deg: it does not vary here; specimen, "), "{said}");
        let said = standard(&["split"]).unwrap_err();
        assert!(said.contains("does not vary here") && said.contains("--split"), "{said}");
        assert!(standard(&["left.port_tilt_deg.x"]).is_err());
    }

    #[test]
    fn the_numbers_of_a_factor_are_one() {
        let value = |part: &str, factor, axis, value| DrawnValue { factor, part: part.to_owned(), axis, value };
        let of = |values: &[DrawnValue]| size(values[0].factor, &values.iter().collect::<Vec<_>>());
        assert_eq!(of(&[value("", Factor::SpecimenTurn, 0, -7.0)]), Some(-7.0));
        let both = [value("left", Factor::Tilt, 0, -0.5), value("right", Factor::Tilt, 0, 0.25)];
        assert_eq!(of(&both), Some(0.5));
        let shift = [value("", Factor::SpecimenShift, 0, 3.0), value("", Factor::SpecimenShift, 1, -4.0)];
        assert_eq!(of(&shift), Some(5.0));
        let tint = [value("", Factor::Tint, 0, 0.8), value("", Factor::Tint, 1, 1.0), value("", Factor::Tint, 2, 1.2)];
        assert!((of(&tint).unwrap() - 1.0).abs() < 1e-12);
        assert_eq!(words("specimen_shift_mm"), ("specimen shift".to_owned(), "mm"));
    }
}
