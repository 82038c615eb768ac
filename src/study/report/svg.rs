//! What plotters drew, with classes for colours, groups for series, titles for points.

use super::ReportError;
use super::charts::{Chart, SIZE, marker};
use maud::{Markup, PreEscaped, Render, html};
use roxmltree::{Document, Node};

/// What an element of a chart is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Part {
    Text = 1,
    Axis,
    Grid,
    Guide,
    Band,
    Front,
    Line,
    Whisker,
    Marker,
}

impl Part {
    const ALL: [Part; 9] =
        [Part::Text, Part::Axis, Part::Grid, Part::Guide, Part::Band, Part::Front, Part::Line, Part::Whisker, Part::Marker];

    fn class(self) -> &'static str {
        match self {
            Part::Text => "text",
            Part::Axis => "axis",
            Part::Grid => "grid",
            Part::Guide => "guide",
            Part::Band => "band",
            Part::Front => "front",
            Part::Line => "line",
            Part::Whisker => "whisker",
            Part::Marker => "marker",
        }
    }

    /// What a colour stands for, and the index of the series or guide.
    fn read(colour: &str) -> Option<(Part, usize)> {
        let number = u32::from_str_radix(colour.strip_prefix('#')?, 16).ok()?;
        let part = Part::ALL.into_iter().find(|p| *p as u32 == number >> 16)?;
        Some((part, usize::try_from(number & 0xffff).ok()?))
    }

    fn of_series(self) -> bool {
        matches!(self, Part::Line | Part::Whisker | Part::Marker)
    }
}

/// Attributes that are kept.
const KEPT: [&str; 17] =
    ["x", "y", "dy", "text-anchor", "font-size", "transform", "points", "cx", "cy", "r", "x1", "y1", "x2", "y2", "width", "height", "fill"];

/// One element, or a run of elements of one series.
enum Piece<'a, 'b> {
    Plain(Node<'a, 'b>, Part, usize),
    Series(usize, Vec<(Node<'a, 'b>, Part)>),
}

/// Classes of a style: colour and dash.
pub(super) fn classes(style: usize) -> String {
    format!("c{} d{}", style % 7, style % 5)
}

/// The chart as inline SVG.
pub(super) fn dress(text: &str, chart: &Chart) -> Result<String, ReportError> {
    let failed = |message: String| ReportError::Picture { message: format!("a chart cannot be read back: {message}") };
    let tree = Document::parse(text).map_err(|e| failed(e.to_string()))?;
    let mut pieces: Vec<Piece> = Vec::new();
    for node in tree.root_element().children().filter(Node::is_element) {
        let colour = [node.attribute("stroke"), node.attribute("fill")].into_iter().flatten().find(|c| *c != "none").unwrap_or("");
        let Some((part, index)) = Part::read(colour) else { return Err(failed(format!("nothing is known of the colour {colour:?}"))) };
        match pieces.last_mut() {
            Some(Piece::Series(last, nodes)) if part.of_series() && *last == index => nodes.push((node, part)),
            _ if part.of_series() => pieces.push(Piece::Series(index, vec![(node, part)])),
            _ => pieces.push(Piece::Plain(node, part, index)),
        }
    }
    let style = |index: usize| chart.series.get(index).map_or(0, |s| s.style);
    let label = |index: usize| chart.series.get(index).map_or("", |s| s.label.as_str());
    let (title, description) = (format!("{}-title", chart.id), format!("{}-desc", chart.id));
    let markup = html! {
        svg viewBox=(format!("0 0 {} {}", SIZE.0, SIZE.1)) role="img" aria-labelledby=(title) aria-describedby=(description)
            xmlns="http://www.w3.org/2000/svg" {
            title id=(title) { (chart.title) }
            desc id=(description) { (chart.description) }
            @for piece in &pieces {
                @match piece {
                    Piece::Plain(node, part, index) => {
                        @if *part == Part::Band {
                            g class=(classes(style(*index))) data-band=(label(*index)) { (element(*node, part.class(), None)) }
                        } @else {
                            (element(*node, part.class(), None))
                        }
                    }
                    Piece::Series(index, nodes) => (series(chart, *index, nodes)),
                }
            }
        }
    };
    Ok(markup.into_string())
}

fn series(chart: &Chart, index: usize, nodes: &[(Node, Part)]) -> Markup {
    let Some(series) = chart.series.get(index) else { return Markup::default() };
    let mut tips = series.points.iter().map(|p| p.tip.as_str());
    html! {
        g class=(format!("series {}", classes(series.style))) data-series=(series.label) {
            @for (node, part) in nodes {
                @let tip = if *part == Part::Marker { tips.next() } else { None };
                (element(*node, part.class(), tip))
            }
        }
    }
}

/// An element with a class for its colour.
fn element(node: Node, class: &str, tip: Option<&str>) -> Markup {
    let name = node.tag_name().name();
    let mut text = format!("<{name} class=\"{class}\"");
    for key in KEPT {
        let Some(value) = node.attribute(key) else { continue };
        // Only "none" is left of a fill; everything else is the class's.
        if key == "fill" && value != "none" {
            continue;
        }
        text.push_str(&format!(" {key}=\"{}\"", value.trim().render().into_string()));
    }
    text.push('>');
    if let Some(tip) = tip {
        text.push_str(&html! { title { (tip) } }.into_string());
    }
    if name == "text" {
        text.push_str(&node.text().unwrap_or("").trim().render().into_string());
    }
    text.push_str(&format!("</{name}>"));
    PreEscaped(text)
}

/// A piece of line with a marker, for legends and tables.
pub(super) fn swatch(style: usize) -> Markup {
    let outline = marker(style).map(|points| points.iter().map(|(x, y)| format!("{x},{y} ")).collect::<String>());
    html! {
        svg.swatch viewBox="-72 -24 144 48" aria-hidden="true" focusable="false" {
            g class=(format!("series {}", classes(style))) {
                path.line d="M-72 0H72" {}
                @match outline {
                    Some(points) => polygon.marker points=(points.trim()) {},
                    None => circle.marker r="17" {},
                }
            }
        }
    }
}
