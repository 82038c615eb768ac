//! What the study asks and answers, in sentences.

use super::claims::{EqualTime, Standing};
use super::data::{Scene, Study, loss_name};
use super::load::seeds_of;
use super::numbers::{count, duration, with_interval};
use super::tables::{level, ratio};
use crate::math::statistics::Verdict;
use maud::{Markup, html};

/// What is asked.
pub(super) fn question(study: &Study) -> Markup {
    let seeds: Vec<usize> = study.scenes.iter().map(|s| seeds_of(s).len()).collect();
    let (few, many) = (seeds.iter().min().copied().unwrap_or(0), seeds.iter().max().copied().unwrap_or(0));
    let seeds = if few == many { many.to_string() } else { format!("{few} to {many}") };
    let plural = |n: usize, one: &str, more: &str| format!("{n} {}", if n == 1 { one } else { more });
    html! {
        p.lede {
            "Which of " (plural(study.methods.len(), "method", "methods")) " is most accurate in the same render time, on "
            (plural(study.scenes.len(), "scene", "scenes")) ", over " (seeds) (if many == 1 { " seed" } else { " seeds" }) "?"
        }
        @if let Some(metric) = study.metric() {
            p.note {
                "Error is " (loss_name(metric)) "; lower is better. A seed is one independent run. Numbers in brackets are " (level())
                " intervals from resampling the seeds; each comparison is decided by its own interval, none is adjusted for their number."
            }
        }
    }
}

/// What a scene answers.
pub(super) fn answer(scene: &Scene, metric: Option<&str>, equal: Option<&EqualTime>) -> Markup {
    let Some((equal, metric)) = equal.zip(metric) else {
        return html! {
            @if scene.rows.is_empty() { "No cell is done yet." }
            @else if scene.reference.is_none() {
                "No reference, so no error: times, noise over runs and pictures are shown. Give the scene a reference in the study file, or a "
                code { "[reference]" } " section, to have it measured."
            }
            @else { "No error was measured that can be compared." }
        };
    };
    let Some(best) = equal.standings.first() else { return html! { "No error was measured that can be compared." } };
    let others = &equal.standings[1..];
    let is = |s: &&Standing, wanted: fn(&Verdict) -> bool| s.against_best.as_ref().and_then(|a| a.1.as_ref()).is_some_and(wanted);
    let beaten: Vec<&Standing> = others.iter().filter(|s| is(s, |v| *v == Verdict::Holds)).collect();
    let open: Vec<&Standing> = others.iter().filter(|s| !is(s, |v| *v == Verdict::Holds)).collect();
    html! {
        "After " (duration(equal.seconds)) ", " strong { (best.label) }
        @if others.is_empty() { " is alone" } @else if open.is_empty() { " wins" } @else { " has the lowest median" }
        ": " (loss_name(metric)) " " (with_interval(best.error.value, best.error.interval)) ". "
        @if !beaten.is_empty() {
            "The error is larger with "
            @for (i, s) in beaten.iter().enumerate() {
                (separator(i, beaten.len())) em { (s.label) } " (" (ratio(s.against_best.as_ref().map(|a| &a.0))) " times)"
            }
            ". "
        }
        @if !open.is_empty() {
            "Undecided against "
            @for (i, s) in open.iter().enumerate() {
                (separator(i, open.len())) em { (s.label) } " (" (ratio(s.against_best.as_ref().map(|a| &a.0))) " times; " (needed(s)) ")"
            }
            ". "
        }
        @for (label, first) in &equal.too_slow {
            em { (label) } " had measured nothing by then; its first measurement is after " (duration(*first)) ". "
        }
    }
}

/// How many more seeds would decide.
fn needed(standing: &Standing) -> String {
    match standing.against_best.as_ref().map(|(r, v)| (r.runs, *v)) {
        Some((_, Some(Verdict::Undecided { more_runs: Some(n) }))) => format!("about {} more seeds would decide", count(n as u64)),
        Some((_, Some(Verdict::Undecided { more_runs: None }))) => "no number of seeds in sight would decide".to_string(),
        Some((runs, None)) if runs < 2 => "one seed gives no interval; run at least five".to_string(),
        _ => "no seeds in common, or no interval".to_string(),
    }
}

fn separator(index: usize, count: usize) -> &'static str {
    match index {
        0 => "",
        i if i + 1 == count => " and ",
        _ => ", ",
    }
}

/// One line a scene, and a table of all: error over the scene's lowest.
pub(super) fn overview(study: &Study, equals: &[Option<EqualTime>]) -> Markup {
    let rows = study.scenes.iter().zip(equals).enumerate().map(|(i, (scene, equal))| {
        let mut row = vec![html! { a href=(format!("#scene-{i}")) { (scene.name) } }];
        row.push(html! { (equal.as_ref().map_or("–".to_string(), |e| duration(e.seconds))) });
        for label in &study.methods {
            let standing = equal.as_ref().and_then(|e| e.standings.iter().find(|s| s.label == *label));
            row.push(match standing {
                None => html! { "–" },
                Some(s) if s.against_best.is_none() => html! { strong { "lowest" } },
                Some(s) => html! { (ratio(s.against_best.as_ref().map(|a| &a.0))) },
            });
        }
        row
    });
    let mut head = vec!["scene", "equal time"];
    head.extend(study.methods.iter().map(String::as_str));
    html! {
        ul.answers {
            @for (i, (scene, equal)) in study.scenes.iter().zip(equals).enumerate() {
                li { a href=(format!("#scene-{i}")) { (scene.name) } ": " (answer(scene, study.metric(), equal.as_ref())) }
            }
        }
        @if study.metric().is_some() {
            (super::tables::framed("Error at equal time, times the scene's lowest", &head, rows.collect()))
        }
    }
}
