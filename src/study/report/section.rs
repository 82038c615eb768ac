//! A scene's part of the page.

use super::ReportError;
use super::answers::answer;
use super::claims::{EqualTime, efficiency};
use super::data::{Axis, Scene, Study, loss_name};
use super::gallery::{equal_time_row, insets, maps, viewer};
use super::load::ScenePictures;
use super::numbers::duration;
use super::plots::{Cost, convergence, speed_accuracy};
use super::svg::swatch;
use super::tables;
use maud::{Markup, PreEscaped, html};

/// A scene and its number in the page.
pub(super) struct Section<'a> {
    pub(super) study: &'a Study,
    pub(super) scene: &'a Scene,
    pub(super) index: usize,
    pub(super) equal: Option<&'a EqualTime>,
    pub(super) pictures: ScenePictures,
    /// By how much the viewer's pictures are made smaller.
    pub(super) factor: usize,
}

impl Section<'_> {
    /// All of it.
    pub(super) fn render(&self) -> Result<Markup, ReportError> {
        let Section { study, scene, index, equal, pictures, factor } = self;
        let metric = study.metric();
        let insets = insets(study, scene, pictures);
        let maps = maps(scene, pictures)?;
        let viewer = viewer(study, scene, *index, pictures, &insets, *factor);
        let errors = if equal.is_some() { Some(self.errors()?) } else { None };
        Ok(html! {
            section.scene id=(format!("scene-{index}")) aria-labelledby=(format!("scene-{index}-name")) {
                h2 id=(format!("scene-{index}-name")) { (scene.name) }
                p.answer { (answer(scene, metric, *equal)) }
                @if let Some(errors) = errors { (errors) }
                @if scene.rows.iter().any(|r| r.runs.iter().any(|run| run.image.is_some())) {
                    h3 { (equal.map_or("Pictures".to_string(), |e| format!("Pictures after {}", duration(e.seconds)))) }
                    p.note {
                        "One seed each, the same for all where they share one; one exposure for all. Whole pictures are compressed for the page, crops are exact. "
                        (insets.note.as_deref().unwrap_or(""))
                    }
                    (equal_time_row(study, scene, pictures, *equal, &insets)?)
                    @if let Some(viewer) = viewer { (viewer) }
                }
                @if let Some(maps) = maps {
                    h3 { "Where the error is" }
                    p.note { "Relative error of a pixel: root of the mean over runs and channels of (x − r)²/(r² + " (study.epsilon()) "). Magenta is not finite." }
                    (maps)
                }
                h3 { "Noise and bias" }
                p.note { (self.about_splits()) }
                (tables::splits(scene, pictures))
                h3 { "Work" }
                (tables::work(scene))
                @if let Some(diagnostics) = tables::diagnostics(scene) { h3 { "Diagnostics" } (diagnostics) }
                @if !pictures.problems.is_empty() {
                    h3 { "Files that could not be used" }
                    ul.problems { @for problem in &pictures.problems { li { (problem) } } }
                }
            }
        })
    }

    /// Everything that needs an error.
    fn errors(&self) -> Result<Markup, ReportError> {
        let Section { study, scene, index, .. } = self;
        let default = study.metric().unwrap_or_default();
        let (rows, target) = efficiency(scene, default);
        Ok(html! {
            @if let Some(equal) = self.equal { (tables::standings(equal, default)) }
            h3 { "Convergence" }
            (self.controls())
            (legend(scene))
            div.charts { (self.convergence()?) }
            p.note {
                "Lines are medians over seeds, bands reach from the smallest to the largest seed; points stand at the iterations that all seeds measured. "
                "Thin straight lines show the slope of independent samples and, where theory knows it, of the method's own noise and bias. Point at a marker for its numbers."
            }
            @for metric in &study.metrics {
                div data-metric=(metric) hidden[metric != default] {
                    (tables::slopes(study, scene, metric))
                    details { summary { "Numbers of " (loss_name(metric)) } (tables::curves(scene, metric)) }
                }
            }
            h3 { "Speed against accuracy" }
            div.charts.pair { (self.pareto()?) }
            h3 { "Efficiency and speed-up" }
            p.note {
                "Speed-ups are ratios of medians, paired by seed, with " (tables::level()) " intervals. The first takes error × time as constant, which holds for unbiased methods; "
                "the second compares the times to the error that every run reached (" (super::numbers::or_dash(target)) ")."
            }
            (tables::efficiencies(&rows, target, default))
            span id=(format!("scene-{index}-end")) {}
        })
    }

    /// Metric and axis, native controls: arrow keys work.
    fn controls(&self) -> Markup {
        let Section { study, index, .. } = self;
        html! {
            form.controls {
                label { "Metric " select data-choose="metric" { @for metric in &study.metrics { option value=(metric) { (loss_name(metric)) } } } }
                fieldset {
                    legend.quiet { "against" }
                    @for axis in Axis::ALL {
                        label { input type="radio" name=(format!("axis-{index}")) value=(axis.key()) data-choose="axis" checked[axis == Axis::Time]; (axis.key()) }
                    }
                }
            }
        }
    }

    fn convergence(&self) -> Result<Markup, ReportError> {
        let Section { study, scene, index, pictures, .. } = self;
        let default = study.metric().unwrap_or_default();
        let mut charts = Vec::new();
        for metric in &study.metrics {
            for axis in Axis::ALL {
                charts.push((metric, axis, convergence(study, scene, *index, metric, axis, pictures)?));
            }
        }
        Ok(html! {
            @for (metric, axis, chart) in charts {
                figure.chart data-metric=(metric) data-axis=(axis.key()) hidden[metric != default || axis != Axis::Time] {
                    @match chart {
                        Some(text) => (PreEscaped(text)),
                        None => p.missing { "Nothing to show: no method has " (loss_name(metric)) " over " (axis.label()) " here." },
                    }
                }
            }
        })
    }

    fn pareto(&self) -> Result<Markup, ReportError> {
        let Section { study, scene, index, .. } = self;
        let default = study.metric().unwrap_or_default();
        let mut charts = Vec::new();
        for metric in &study.metrics {
            for cost in Cost::ALL {
                charts.push((metric, cost, speed_accuracy(study, scene, *index, metric, cost)?));
            }
        }
        Ok(html! {
            @for (metric, cost, chart) in charts {
                figure.chart data-metric=(metric) hidden[metric != default] {
                    @match chart {
                        Some((text, names)) => {
                            (PreEscaped(text))
                            figcaption {
                                @match cost {
                                    Cost::Iteration => "At the end of each run. ",
                                    Cost::Total => "On the way. ",
                                }
                                "On the front: " (names.join(", ")) "."
                            }
                        },
                        None => p.missing { "Nothing to show for " (loss_name(metric)) "." },
                    }
                }
            }
        })
    }

    fn about_splits(&self) -> Markup {
        let Section { study, scene, pictures, .. } = self;
        let corrected = pictures.methods.iter().filter_map(|m| m.relative).all(|s| s.corrected);
        html! {
            "From the final images of all seeds: variance is one run's; its sum with bias² is the expected error. relmse has epsilon " (study.epsilon())
            ". Intervals (" (tables::level()) ") are the jackknife's over seeds; a bias² whose interval holds zero is not seen. nsd is standard deviation over mean. "
            @if scene.reference.is_none() { "There is no reference, so only nsd is known." }
            @else if corrected { "The reference's own variance is taken out of bias²." }
            @else { strong { "The reference's own variance is not known: its noise is part of bias²." } }
        }
    }
}

/// What line is whose; pressing a name hides it.
fn legend(scene: &Scene) -> Markup {
    html! {
        ul.legend aria-label="methods; press to hide or show" {
            @for row in &scene.rows {
                li { button type="button" aria-pressed="true" data-series-of=(row.label) { (swatch(row.style)) (row.label) } }
            }
        }
    }
}
