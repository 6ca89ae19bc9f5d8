//! `trocar demo`.

use crate::cli;
use crate::commands::{reconstruct, simulate};
use crate::{open, output};
use std::path::Path;
use trocar_core::Progress;
use trocar_workflow::{Demo, DemoResult, Result};

pub fn run(arguments: &cli::Demo, json: bool, progress: &dyn Progress) -> Result<()> {
    let demo = Demo { frames: arguments.frames, seed: arguments.seed, threads: arguments.threads };
    let opens = !arguments.no_open && !json && std::env::var_os("CI").is_none();
    let show = |page: &Path| {
        if opens {
            let page = page.display().to_string();
            open::in_browser(&page, &page);
        }
    };
    let result = demo.run(&arguments.output, &show, progress)?;
    output::print(json, &result, |r: &DemoResult| {
        format!(
            "{}\n\n{}\n\n{:.0} s in total; report {}",
            reconstruct::text(&r.reconstructed),
            simulate::text(&r.lift),
            r.seconds,
            r.lift.report
        )
    });
    Ok(())
}
