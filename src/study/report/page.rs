//! The whole page.

use super::answers::{overview, question};
use super::claims::EqualTime;
use super::data::{Scene, Study};
use super::numbers::{count, duration};
use super::tables::framed;
use crate::image::metrics::{METRICS, Metric};
use crate::study::records::{CellRecord, StudyRecord};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::Value;

const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// The page around the scenes' sections.
pub(super) fn page(study: &Study, equals: &[Option<EqualTime>], sections: &[Markup]) -> String {
    let name = study.name();
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta name="generator" content=(concat!("isophote ", env!("CARGO_PKG_VERSION")));
                link rel="icon" href="data:,";
                title { (name) " – isophote" }
                style { (PreEscaped(crate::study::viewer::STYLE)) (PreEscaped(STYLE)) }
            }
            body {
                a.skip href="#main" { "Skip to the results" }
                header {
                    div.title {
                        p.kind { "Study" }
                        h1 { (name) }
                    }
                    button.theme type="button" id="theme" hidden { "Theme: " span { "system" } }
                    nav aria-label="Contents" {
                        ul {
                            @for (i, scene) in study.scenes.iter().enumerate() { li { a href=(format!("#scene-{i}")) { (scene.name) } } }
                            @if study.ended().1 > 0 { li { a href="#failed" { "Failed cells" } } }
                            li { a href="#again" { "Run it again" } }
                            li { a href="#reading" { "How to read this" } }
                        }
                    }
                }
                main id="main" tabindex="-1" {
                    noscript { p.note { "Without JavaScript this page shows the first metric over render time only." } }
                    section id="answers" aria-label="Answers" {
                        (question(study))
                        (progress(study))
                        (overview(study, equals))
                    }
                    @for section in sections { (section) }
                    (failures(study))
                    (again(study))
                    (reading(study))
                }
                script { (PreEscaped(crate::study::viewer::SCRIPT)) (PreEscaped(SCRIPT)) }
            }
        }
    }
    .into_string()
}

/// Whether cells are missing, and what to do.
fn progress(study: &Study) -> Markup {
    let (done, failed) = study.ended();
    let missing = study.planned.map_or(0, |planned| planned.saturating_sub(done + failed));
    let file = study.starts.last().map_or("STUDY.toml", |s| s.file.as_str());
    html! {
        @if missing > 0 {
            p.warning role="note" {
                strong { (done) " of " (done + failed + missing) " cells are done" } ", " (missing) " are not on record yet. If the study is still running, "
                "make the report again when it ends; if it was stopped, " code { "isophote study " (file) " -o " (study.folder.display()) } " goes on where it was."
            }
        }
        @if failed > 0 {
            p.warning role="note" { strong { (failed) @if failed == 1 { " cell" } @else { " cells" } " failed" } "; " a href="#failed" { "their messages" } " are below." }
        }
        @if done == 0 {
            p.warning role="note" { "No cell is done, so there is nothing to compare yet." }
        }
    }
}

fn failures(study: &Study) -> Markup {
    let failed: Vec<(&Scene, &CellRecord)> = study.scenes.iter().flat_map(|s| s.failed.iter().map(move |c| (s, c))).collect();
    if failed.is_empty() {
        return Markup::default();
    }
    let rows = failed.iter().map(|(scene, cell)| {
        let message = cell.error.as_deref().unwrap_or("no message on record");
        vec![html! { (scene.name) }, html! { (cell.method) }, html! { (cell.seed) }, html! { span.message { (message) } }]
    });
    html! {
        section id="failed" {
            h2 { "Failed cells" }
            (framed("Cells that ended with an error", &["scene", "method", "seed", "message"], rows.collect()))
            p.note { "Mend the cause and run the study again: cells that failed are tried again, the others are kept." }
        }
    }
}

/// A command as a shell takes it.
fn quoted(words: &[String]) -> String {
    let plain = |w: &str| !w.is_empty() && w.chars().all(|c| c.is_ascii_alphanumeric() || "-_./=:,@%+".contains(c));
    let quote = |w: &String| if plain(w) { w.clone() } else { format!("'{}'", w.replace('\'', r"'\''")) };
    words.iter().map(quote).collect::<Vec<_>>().join(" ")
}

fn again(study: &Study) -> Markup {
    html! {
        section id="again" {
            h2 { "Run it again" }
            @for start in &study.starts { (started(start)) }
            @if study.starts.is_empty() { p.note { "The records do not say how the study was started." } }
            (methods(study))
            (scenes(study))
            @if !study.plan().is_null() {
                details { summary { "The plan, with every default" } pre tabindex="0" { (pretty(study.plan())) } }
            }
        }
    }
}

fn started(start: &StudyRecord) -> Markup {
    let memory = start.machine.memory.map_or("unknown".to_string(), |m| format!("{:.1} GiB", m as f64 / f64::from(1 << 30)));
    html! {
        pre tabindex="0" { (quoted(&start.command)) }
        dl.facts {
            div { dt { "started" } dd { (start.started) } }
            div { dt { "isophote" } dd { (start.version) } }
            div { dt { "study file" } dd { (start.file) } }
            div { dt { "plan" } dd.hash { (start.plan_hash) } }
            div { dt { "processor" } dd { (start.machine.cpu) ", " (start.machine.processors) " logical; " (start.machine.threads) " threads a cell" } }
            div { dt { "system" } dd { (start.machine.os) ", memory " (memory) } }
        }
    }
}

fn methods(study: &Study) -> Markup {
    let mut rows = Vec::new();
    for label in &study.methods {
        let found = study.scenes.iter().flat_map(|s| &s.rows).find(|r| r.label == *label);
        if let Some(row) = found {
            let seeds = row.seeds().iter().map(u64::to_string).collect::<Vec<_>>().join(", ");
            rows.push(vec![html! { (label) }, html! { (row.name()) }, html! { (seeds) }, html! { code { (row.settings().to_string()) } }]);
        }
    }
    framed("Methods", &["label", "method", "seeds", "settings"], rows)
}

fn scenes(study: &Study) -> Markup {
    let rows = study.scenes.iter().map(|scene| {
        let hash = scene.rows.first().map_or("–", |r| r.runs[0].scene_hash.as_str());
        let reference = scene.reference.as_ref();
        let origin = match reference.map(|r| r.made.as_ref()) {
            None => "none".to_string(),
            Some(None) => "a file".to_string(),
            Some(Some(m)) => format!(
                "{}, seeds {}, {} iterations, {}",
                m.method,
                m.seeds.iter().map(u64::to_string).collect::<Vec<_>>().join(", "),
                count(m.iterations.iter().sum()),
                duration(m.seconds)
            ),
        };
        vec![
            html! { (scene.name) },
            html! { span.hash { (hash) } },
            html! { (origin) },
            html! { span.hash { (reference.map_or("–", |r| r.hash.as_str())) } },
            html! { (reference.map_or("–".to_string(), |r| r.mean.display().to_string())) },
        ]
    });
    framed("Scenes and references", &["scene", "content hash", "reference", "its hash", "its file"], rows.collect())
}

fn pretty(value: &Value) -> String {
    format!("{value:#}")
}

fn reading(study: &Study) -> Markup {
    let formula = |name: &str| METRICS.iter().find(|m: &&Metric| m.name == name).map_or("not known to this version", |m| m.formula);
    let rows = study.metrics.iter().map(|name| vec![html! { (name) }, html! { code { (formula(name)) } }]);
    html! {
        section id="reading" {
            h2 { "How to read this" }
            dl.reading {
                dt { "Equal time" } dd { "The longest render time that every run reached. Errors at that time are read off each run's snapshots, on straight lines between them in log-log; nothing is extrapolated." }
                dt { "Render time" } dd { "Wall time of preparing and iterating; loading, writing and measuring do not count." }
                dt { "Intervals" } dd { "Of medians and ratios of medians, by resampling seeds, both methods' runs of one seed together. With few seeds they are rough." }
                dt { "Undecided" } dd { "The interval of the ratio holds one. The number of seeds still needed takes the ratio as it is and the interval's width as falling with the root of their number." }
                dt { "Front" } dd { "The points that no other beats in both cost and error." }
                dt { "Variance and bias²" } dd { "With d the difference of a run to the reference, averaged over pixels and channels: bias² is the mean of d·d' over different runs less the reference's variance, variance the mean of d·d less that of d·d'." }
            }
            (framed(&format!("Metrics: x the picture, r the reference, linear values; e = {}", study.epsilon()), &["metric", "formula"], rows.collect()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_can_be_pasted() {
        let words = ["isophote", "study", "my study.toml", "it's"].map(str::to_owned);
        assert_eq!(quoted(&words), r"isophote study 'my study.toml' 'it'\''s'");
    }
}
