//! Tasks of one's own: what is right is read, what is wrong is named with its column and what would
//! be right, and no damaged expression does more than give an error.
#![allow(clippy::unwrap_used, reason = "tests")]

use trocar_core::Random;
use trocar_scene::{BUILTIN_TASKS, Builtin, Scene};

/// The paper's scene with a task of one stage.
fn scene(when: &str) -> String {
    with(&format!("[[task.stage]]\nname = \"it\"\nwhen = {when:?}\n"))
}

fn with(stages: &str) -> String {
    let text = Builtin::named("cell-a").unwrap().text;
    let text = text.replace("name = \"appendix-resection\"", "name = \"mine\"");
    let constants = "[task.constants]\naside_mm = 5.0\n";
    text.replace("[safety]\n", &format!("{constants}{stages}\n[safety]\n"))
}

fn read(text: &str) -> Result<Scene, String> {
    Scene::parse(text, "scene.toml", "".as_ref()).map_err(|e| e.to_string())
}

#[test]
fn conditions_are_read() {
    for when in [
        "lift_mm >= 8 for 0.5 s",
        "distance(right.tip, organ.stomach) < 10 mm",
        "distance(left.jaws, right.tip) < 0.01 m or in_mouth(right)",
        "in_mouth(right) in organ.bowel-1",
        "attached(left) in organ.appendix[0.3, 0.7] and not attached(right)",
        "attached(grasper) in organ[gates.grasp_from, gates.grasp_to]",
        "grasped and (cut_jaw > 0.5 then cut_jaw < 0.15 while cut_mouth)",
        "aside(organ.cecum[0.4, 0.6]) >= constants.aside_mm for 500 ms",
        "force(left) in [0.3 N, 1 N] for 2 s",
        "left_tilt_deg < 0.3 rad",
        "((((time_s > 2))))",
    ] {
        let scene = read(&scene(when)).unwrap_or_else(|e| panic!("{when}: {e}"));
        let again = read(&scene.to_toml().unwrap()).unwrap();
        assert_eq!(scene.task, again.task);
        assert_eq!(scene.program().unwrap(), again.program().unwrap());
    }
}

#[test]
fn mistakes_are_told_with_their_column() {
    for (when, said) in [
        ("lft_mm >= 8", "column 1: there is no channel 'lft_mm'; did you mean 'lift_mm'?"),
        ("grasped and lift_mn > 8 mm", "column 13: there is no channel 'lift_mn'; did you mean 'lift_mm'?"),
        ("lift_mm >= 8 N", "column 12: is a force (N), and what it goes with is a length (mm)"),
        ("lift_mm >= 8 cm", "column 14: 'cm' is no unit; the units are mm, m, s,"),
        ("force(left) > 2", "column 15: has no unit, and what it goes with is a force; write 2 N"),
        ("lift_mm", "column 1: is a number where a condition is needed; compare it, for example with `> 1 mm`"),
        ("lift_mm > 8 for 0.5", "column 17: has no unit; a time is needed, such as 0.5 s"),
        ("lift_mm > 8 for 3 mm", "column 17: is a length; a time is needed"),
        ("grasped and", "column 12: a value is missing at the end"),
        ("(grasped", "column 9: ')' is expected here, not the end"),
        ("lift_mm = 8", "column 9: numbers are compared by <, <=, > and >=, or by `in [low, high]`"),
        ("grasped grasped", "column 9: 'grasped' is not expected here"),
        (
            "lift_mm > 8 for 1 s and grasped",
            "column 21: 'and' is not expected here; put what comes before it in parentheses",
        ),
        ("attached(lefft)", "column 10: there is no arm 'lefft'; left, right, grasper or cutter; did you mean 'left'?"),
        ("attached()", "column 1: attached has 0 arguments; it needs an arm: left, right, grasper or cutter"),
        ("distnce(left.tip, organ) < 3 mm", "column 1: there is no function 'distnce'; did you mean 'distance'?"),
        ("distance(organ, organ.cecum) < 3 mm", "column 1: distance needs a point of an instrument"),
        (
            "distance(left.tip, organ.liver) < 3 mm",
            "column 20: there is no organ 'liver'; the specimen has cecum, bowel-1, bowel-2, bowel-3, stomach, appendix",
        ),
        ("attached(left) in organ.apendix", "did you mean 'appendix'?"),
        ("aside(organ[0.6, 0.4]) > 1 mm", "column 7: the range must rise"),
        ("gates.lift_mn > 3 mm", "column 1: there is no channel 'gates.lift_mn'; did you mean 'gates.lift_mm'?"),
        ("aside_mm > 3", "column 1: there is no channel 'aside_mm'; did you mean 'constants.aside_mm'?"),
        ("lasted > 0.5", "column 1: lasted is known in `progress` only"),
        ("lift_mm * lift_mm > 3", "column 11: length times length has no unit here"),
        ("grasped and 3", "column 13: is a number where a condition is needed; compare it, for example with `> 0.5`"),
        ("lift_mm + grasped > 3 mm", "column 11: is a plain number, and what it goes with is a length (mm)"),
        ("right.tip > 3", "column 1: right.tip is a place and no number"),
        (
            "visible(endoscop, organ) > 0.5",
            "column 9: there is no camera 'endoscop'; the scene has endoscope, d405, recording; did you mean 'endoscope'?",
        ),
        ("visible(d405) > 0.5", "column 1: visible has 1 arguments; it needs a camera and an organ"),
        ("visible(d405, left.tip) > 0.5", "column 15: an organ is needed"),
        ("visible(d405, organ) > 3 mm", "column 24: is a length (mm), and what it goes with is a plain number"),
        ("lift_mm > 1.2.3", "column 11: '1.2.3' is no number"),
        ("§ > 1", "column 1: '\\u{a7}' is not expected here; a name or a number is"),
        ("", "column 1: a value is missing at the end"),
    ] {
        let text = scene(when);
        let error = read(&text).unwrap_err();
        let line = 1 + text.lines().position(|l| l.starts_with("when")).unwrap();
        assert!(error.contains(said), "{when}:\n{error}\n{said}");
        assert!(error.starts_with(&format!("scene.toml: line {line}: task.stage[0].when, column ")), "{error}");
        assert!(!error.contains('\n') && error.len() < 500, "{error}");
    }
}

#[test]
fn what_stands_beside_a_condition_is_checked_too() {
    let stage = |more: &str| with(&format!("[[task.stage]]\nname = \"it\"\nwhen = \"grasped\"\n{more}"));
    for (more, said) in [
        ("progress = \"lift_mm\"", "task.stage[0].progress, column 1: is a length; a number without a unit is needed"),
        ("progress = \"lasted\"", "task.stage[0].progress, column 1: lasted needs a `for` in the stage's `when`"),
        ("progress = \"armed\"", "task.stage[0].progress, column 1: armed needs a `then` in the stage's `when`"),
        ("hint = \"so {most(lift_mn):.1} mm\"", "task.stage[0].hint, column 10: there is no channel 'lift_mn'"),
        ("hint = \"so {lift_mm\"", "task.stage[0].hint, column 4: the bracket is not closed"),
        ("share = -1.0", "task.stage[0].share is -1; it must be in [0, 1000]"),
        ("share = 0.0", "task.stage[0].share is 0, as all others"),
        ("wen = \"grasped\"", "unknown field `wen`, expected one of `name`, `when`,"),
        (
            "[[task.stage]]\nname = \"it\"\nwhen = \"grasped\"",
            "task.stage[1].name is 'it', which task.stage[0] already has",
        ),
        ("[[task.abort]]\nname = \"a\"\nwhen = \"force(left) > 2\"", "task.abort[0].when, column 15: has no unit"),
        (
            "[[task.script]]\narm = \"left\"\ngrasp = \"organ.liver\"",
            "task.script[0].grasp, column 1: there is no organ 'liver'",
        ),
        ("[[task.script]]\narm = \"left\"\nrelease = true\nmove_mm = [0, 0, 1]", "task.script[0] has more than one of"),
        (
            "[[task.script]]\narm = \"left\"\nmove_mm = [0, 0, 1000]",
            "task.script[0].move_mm[2] is 1000; it must be in [-200, 200] mm",
        ),
    ] {
        let error = read(&stage(more)).unwrap_err();
        assert!(error.contains(said), "{more}:\n{error}\n{said}");
    }
    let text = Builtin::named("cell-a").unwrap().text;
    let error = read(&text.replace("\"appendix-resection\"", "\"apendix-resection\"")).unwrap_err();
    let said = "task.name is 'apendix-resection', which has no stages; write [[task.stage]], or name a built-in task: \
                appendix-resection, grasp-lift, port-reach; did you mean 'appendix-resection'?";
    assert!(error.contains(said), "{error}");
    assert!(
        read(&text.replace("[safety]", "[task.constants]\nlift_mm = 3.0\n[safety]"))
            .unwrap_err()
            .contains("is also a gate")
    );
}

#[test]
fn length_and_depth_are_bounded() {
    let deep = format!("{}grasped{}", "(".repeat(5000), ")".repeat(5000));
    let many = vec!["grasped"; 5000].join(" and ");
    let nots = format!("{}grasped", "not ".repeat(200));
    assert!(read(&scene(&nots)).is_ok());
    for (when, said) in [
        (deep, "at most 1000: use more stages"),
        (many, "at most 1000: use more stages"),
        (format!("{}grasped{}", "(".repeat(13), ")".repeat(13)), "nested deeper than 12"),
        (format!("{}1{}", "abs(".repeat(13), ")".repeat(13)), "nested deeper than 12"),
    ] {
        assert!(read(&scene(&when)).unwrap_err().contains(said), "{when:.40}");
    }
    let measures: Vec<String> = (0..17).map(|k| format!("moved(organ[0.{k:02}, 1]) > 1 mm")).collect();
    assert!(read(&scene(&measures.join(" or "))).unwrap_err().contains("at most 16 different ones"));
}

#[test]
fn damaged_expressions_give_errors() {
    let seeds = [
        "grasped and (cut_jaw > gates.cut_open then cut_jaw < 0.15 while grasped and cut_mouth)",
        "distance(right.tip, organ.bowel-1[0.2, 0.8]) < 10 mm or force(left) in [0.3 N, 1 N] for 2 s",
        "choose(attached(left), 2 * lift_mm / 3 mm, near(lift_mm, 1 mm, 60 mm)) > -0.5",
    ];
    let alphabet: Vec<char> = "()[]{},.<>=*/+-_ 0129eEnNm\u{e9}\u{0}\"\\s".chars().collect();
    let words =
        ["and", "or", "not", "then", "while", "for", "in", "organ", "left.tip", "1e9", "inf", "nan", "§", "s/s"];
    let mut random = Random::new(7).sequence();
    let mut below = |n: usize| (random.bits() % n as u64) as usize;
    let mut refused = 0;
    for round in 0..3000 {
        let mut text: Vec<char> = seeds[round % seeds.len()].chars().collect();
        for _ in 0..1 + below(4) {
            let at = below(text.len().max(1)).min(text.len());
            match below(4) {
                0 if !text.is_empty() => drop(text.drain(at..(at + 1 + below(6)).min(text.len()))),
                1 => text.insert(at, alphabet[below(alphabet.len())]),
                2 => {
                    let word: Vec<char> = format!(" {} ", words[below(words.len())]).chars().collect();
                    text.splice(at..at, word);
                }
                _ => {
                    let part: Vec<char> = text[at..(at + below(12)).min(text.len())].to_vec();
                    text.splice(at..at, part);
                }
            }
        }
        let text: String = text.into_iter().collect();
        let quoted = toml::Value::String(text.clone()).to_string();
        let all =
            with(&format!("[[task.stage]]\nname = \"it\"\nwhen = {quoted}\nprogress = {quoted}\nhint = {quoted}\n"));
        if let Err(error) = read(&all) {
            assert!(!error.contains('\n') && error.contains("scene.toml") && error.len() < 700, "{text}: {error}");
            refused += 1;
        }
    }
    assert!(refused > 1000, "{refused}");
}

#[test]
fn built_in_tasks_are_read() {
    for builtin in BUILTIN_TASKS {
        let definition = builtin.definition().unwrap();
        assert!(!definition.stages.is_empty() && !definition.summary.is_empty() && !definition.prompt.is_empty());
    }
    let mut scene = Scene::builtin("cell-a").unwrap();
    let short = scene.program().unwrap();
    scene.task = scene.task.written_out().unwrap();
    assert_eq!(scene.program().unwrap(), short);
    scene.validate().unwrap();
}
