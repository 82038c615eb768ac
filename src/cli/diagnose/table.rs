//! Chains as text.

use crate::cli::output::table;
use crate::integrators::chains::ChainReport;
use crate::samplers::RungReport;

/// Titles of the columns.
const HEAD: [&str; 11] =
    ["rung", "share", "acceptance", "step size", "exchange rate", "tau", "autocorrelation", "ESS", "R-hat", "b", "s.e. of b"];

/// All there is to say: numbers, then warnings.
pub(super) fn text(chains: &ChainReport) -> String {
    let mut text = numbers(chains) + "\n";
    let warnings = chains.warnings();
    if warnings.is_empty() {
        text += "nothing to warn of\n";
    }
    for warning in &warnings {
        text += &format!("warning: {}\n", chains.words(warning));
    }
    text
}

/// One row a rung, and what is counted for all together.
pub(in crate::cli) fn numbers(chains: &ChainReport) -> String {
    let ladder = &chains.ladder;
    let mut rows = vec![HEAD.map(str::to_owned).to_vec()];
    rows.extend(ladder.rungs.iter().enumerate().map(|(rung, report)| row(&chains.name(rung), report)));
    let dead: u64 = ladder.rungs.iter().map(|rung| rung.dead_states).sum();
    let mut counts = vec![
        ("iterations".to_owned(), ladder.draws.to_string()),
        ("light paths".to_owned(), ladder.traced.to_string()),
        ("ensembles".to_owned(), ladder.ensembles.to_string()),
        ("round trips".to_owned(), ladder.round_trips.to_string()),
        ("dead states".to_owned(), dead.to_string()),
    ];
    if ladder.rested > 0 {
        counts.insert(1, ("left to uniform".to_owned(), ladder.rested.to_string()));
    }
    if let Some(regions) = chains.regions {
        counts.push(("regions in use".to_owned(), format!("{} of {}", regions.in_use, regions.leaves)));
    }
    let counts: Vec<String> = counts.iter().map(|(name, count)| format!("{name:<14}  {count}\n")).collect();
    format!("{}\n{}", table(&rows), counts.concat())
}

fn row(name: &str, rung: &RungReport) -> Vec<String> {
    let or_dash = |value: Option<f64>, show: fn(f64) -> String| value.map_or_else(|| "-".to_owned(), show);
    let percent = |v: f64| format!("{:.1} %", 100.0 * v);
    let relative = rung.normalisation_relative_error.map_or_else(String::new, |e| format!(" ({})", percent(e)));
    let error = match rung.normalisation_error {
        // That of rung 0 is 1 by definition.
        0.0 => "-".to_owned(),
        error if rung.normalisation > 0.0 => format!("{error:.1e}{relative}"),
        bound => format!("< {bound:.1e}"),
    };
    vec![
        name.to_owned(),
        percent(rung.share),
        or_dash(rung.acceptance, percent),
        or_dash(rung.step_size, |v| format!("{v:.4}")),
        or_dash(rung.exchange_rate, percent),
        format!("{:.2}", rung.dispersion),
        or_dash(rung.target_time, |v| format!("{v:.1}")),
        or_dash(rung.target_effective, |v| format!("{v:.0}")),
        or_dash(rung.r_hat, |v| format!("{v:.3}")),
        format!("{:.4e}", rung.normalisation),
        error,
    ]
}
