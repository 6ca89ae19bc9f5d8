//! The compared integrators: each with the settings of the paper or of an engine, and with its best
//! settings; and findings from the comparison.

use super::row::IntegratorRow;
use trocar_tissue::{Descent, Model, SolverSettings, Start};
use trocar_tissue_reference::{Scheme, SemiImplicit, Xpbd, XpbdConstraints, XpbdSweep};

/// An integrator with its settings.
pub(super) struct Form {
    pub name: &'static str,
    pub settings: String,
    pub paper: &'static str,
    pub scheme: Scheme,
}

/// The paper's finding on explicit integration and XPBD (section VII-B).
const DIVERGES: &str = "20 m/s in the first frame";

/// A relaxation with which Newton's XPBD stays bounded.
const SMALL_RELAXATION: f64 = 0.1;

/// Maximum sag error of a correct result.
const MAX_SAG_ERROR: f64 = 0.1;

/// All integrators, for frames of `dt` (s).
pub(super) fn forms(model: &Model, dt: f64) -> Vec<Form> {
    let form = |name, settings: String, paper, scheme| Form { name, settings, paper, scheme };
    let stable = SemiImplicit::stable(model, dt);
    let small_steps = Xpbd::default();
    let strains = Xpbd { constraints: XpbdConstraints::Strains, ..small_steps };
    let relaxed = Xpbd { sweep: XpbdSweep::Jacobi { relaxation: SMALL_RELAXATION }, ..Xpbd::NEWTON };
    let large_steps = Xpbd { substeps: Xpbd::NEWTON.substeps, iterations: Xpbd::NEWTON.iterations, ..small_steps };
    let adaptive = Descent { substeps: 8, iterations: 10, start: Start::Adaptive };
    let cut = |x: &Xpbd| format!("{} substeps of {}", x.substeps, x.iterations);
    vec![
        form("Semi-implicit Euler", "8 substeps".into(), DIVERGES, Scheme::SemiImplicit(SemiImplicit::PAPER)),
        form(
            "Semi-implicit Euler, stable steps",
            format!("{} substeps", stable.substeps),
            "",
            Scheme::SemiImplicit(stable),
        ),
        form(
            "XPBD as in Newton 1.8",
            format!("{}, Jacobi, relaxation 0.9", cut(&Xpbd::NEWTON)),
            DIVERGES,
            Scheme::Xpbd(Xpbd::NEWTON),
        ),
        form(
            "XPBD as in Newton, relaxed",
            format!("{}, Jacobi, relaxation 0.1", cut(&relaxed)),
            "",
            Scheme::Xpbd(relaxed),
        ),
        form(
            "XPBD, neo-Hookean, large steps",
            format!("{}, Gauss-Seidel", cut(&large_steps)),
            "",
            Scheme::Xpbd(large_steps),
        ),
        form(
            "XPBD, neo-Hookean, small steps",
            format!("{}, Gauss-Seidel", cut(&small_steps)),
            "",
            Scheme::Xpbd(small_steps),
        ),
        form("XPBD, six strains, small steps", format!("{}, Gauss-Seidel", cut(&strains)), "", Scheme::Xpbd(strains)),
        form(
            "Vertex Block Descent as in the paper",
            "8 substeps of 10".into(),
            "stays at 0.16 m/s",
            SolverSettings::PAPER.into(),
        ),
        form(
            "Vertex Block Descent, adaptive start",
            "8 substeps of 10".into(),
            "",
            SolverSettings::Descent(adaptive).into(),
        ),
        form("Quasi-Newton", "fast schedule".into(), "", SolverSettings::FAST.into()),
    ]
}

/// Findings from the rows.
pub(super) fn findings(rows: &[IntegratorRow]) -> Vec<String> {
    let of = |start: &str| rows.iter().filter(|r| r.name.starts_with(start)).collect::<Vec<_>>();
    ["Semi-implicit Euler", "XPBD"].iter().map(|method| method_finding(method, &of(method))).chain(sags(rows)).collect()
}

/// Whether the finding of the paper holds for the method or only for its settings.
fn method_finding(method: &str, rows: &[&IntegratorRow]) -> String {
    let unbounded: Vec<String> =
        rows.iter().filter(|r| !r.bounded).map(|r| format!("{} ({})", r.name, r.settings)).collect();
    let bounded = |decimals: usize, chosen: &dyn Fn(f64) -> bool| -> Vec<String> {
        let errors = rows.iter().filter_map(|r| Some((r, r.sag_error.filter(|e| chosen(*e))?)));
        errors.map(|(r, e)| format!("{} ({}; sag error {:.decimals$}%)", r.name, r.settings, 100.0 * e)).collect()
    };
    let right = bounded(2, &|e| e <= MAX_SAG_ERROR);
    let wrong = bounded(0, &|e| e.is_nan() || e > MAX_SAG_ERROR);
    let verdict = match (unbounded.is_empty(), right.is_empty()) {
        (false, false) => format!("{method}: whether it stays bounded depends on its settings"),
        (true, _) => format!("{method}: bounded with all settings"),
        (false, true) => format!("{method}: no settings are bounded and correct"),
    };
    let part = |what: &str, names: &[String]| {
        if names.is_empty() { String::new() } else { format!("; {what}: {}", names.join(", ")) }
    };
    format!(
        "{verdict}{}{}{}.",
        part("diverges", &unbounded),
        part("bounded, but wrong", &wrong),
        part("bounded and correct", &right)
    )
}

/// The sag error of Vertex Block Descent as in the paper, which is bounded.
fn sags(rows: &[IntegratorRow]) -> Option<String> {
    let paper = rows.iter().find(|r| r.name.starts_with("Vertex Block Descent"))?;
    let (error, ratio) = (paper.sag_error?, paper.sag_ratio?);
    Some(if error > MAX_SAG_ERROR {
        format!(
            "Bounded is not correct: Vertex Block Descent as in the paper stays slow and sags {ratio:.1} times as \
             far as the equilibrium."
        )
    } else {
        format!("The sag of Vertex Block Descent as in the paper is within {:.1}% of the equilibrium.", 100.0 * error)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(name: &'static str, sag_error: Option<f64>) -> IntegratorRow {
        IntegratorRow {
            name,
            settings: "so".into(),
            paper: "",
            bounded: sag_error.is_some(),
            event: None,
            ended_at_s: None,
            peak_speed_m_s: 0.0,
            last_speed_m_s: 0.0,
            sag_error,
            sag_ratio: sag_error.map(|e| 1.0 + e),
            frame_ms: 1.0,
            speeds: Vec::new(),
        }
    }

    #[test]
    fn findings_follow_from_the_rows() {
        let found = findings(&[
            row("Semi-implicit Euler", None),
            row("XPBD a", None),
            row("XPBD b", Some(0.04)),
            row("XPBD c", Some(9.0)),
            row("Vertex Block Descent as in the paper", Some(9.5)),
        ]);
        assert!(found[0].starts_with("Semi-implicit Euler: no settings are bounded"), "{}", found[0]);
        assert!(
            found[1].contains("depends on its settings") && found[1].contains("XPBD b (so; sag error 4.00%)"),
            "{}",
            found[1]
        );
        assert!(found[1].contains("but wrong: XPBD c"), "{}", found[1]);
        assert!(found[2].contains("10.5 times"), "{}", found[2]);
    }
}
