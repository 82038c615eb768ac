//! Log-log charts, laid out by `plotters` and dressed by [`super::svg`].
//!
//! Colours here are no colours: each says which part of the chart an element is, and becomes a class, so that the page's style decides.

use super::ReportError;
use super::numbers::tick;
use super::svg::{Part, dress};
use plotters::coord::Shift;
use plotters::coord::combinators::WithKeyPoints;
use plotters::element::{Circle, EmptyElement, PathElement, Polygon, Text};
use plotters::prelude::{
    BindKeyPoints, Cartesian2d, ChartBuilder, ChartContext, DrawingArea, IntoDrawingArea, IntoFont, IntoLogRange, LogCoord, SVGBackend,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};
use std::ops::Range;

/// Units across and down; four to a pixel of the chart's natural size, because plotters rounds to whole units.
pub(super) const SIZE: (u32, u32) = (1920, 1320);

/// Size of text, units. Plotters divides by 1.24.
const TEXT: i32 = 64;

/// Room for the labels of the axes, units.
const MARGIN: (u32, u32) = (270, 160);

/// Half the size of a marker, units.
const MARKER: i32 = 17;

/// Most points an axis is labelled at.
const LABELS: usize = 12;

/// One chart.
pub(super) struct Chart {
    /// Unique in the page.
    pub(super) id: String,
    pub(super) title: String,
    pub(super) description: String,
    pub(super) x_label: String,
    pub(super) y_label: String,
    pub(super) series: Vec<Series>,
    pub(super) guides: Vec<Guide>,
    /// Corners of the staircase behind the points that nothing beats; empty if there is none.
    pub(super) front: Vec<(f64, f64)>,
}

/// What one method contributes.
pub(super) struct Series {
    pub(super) label: String,
    /// Decides colour, dash and marker.
    pub(super) style: usize,
    pub(super) points: Vec<Point>,
    /// Whether the points are joined; the spread of a line is a band, that of a lone point a whisker.
    pub(super) line: bool,
}

/// A point and its spread; all positive.
pub(super) struct Point {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) low: f64,
    pub(super) high: f64,
    /// What a reader sees when pointing at it.
    pub(super) tip: String,
}

/// A straight line to compare with.
pub(super) struct Guide {
    pub(super) label: String,
    /// Exponent; 0 is a level.
    pub(super) slope: f64,
    /// A point on it.
    pub(super) through: (f64, f64),
}

type Plot<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<WithKeyPoints<LogCoord<f64>>, WithKeyPoints<LogCoord<f64>>>>;

/// Anything plotters refuses; memory is all it writes to.
fn failed(error: impl std::fmt::Display) -> ReportError {
    ReportError::Picture { message: format!("a chart cannot be drawn: {error}") }
}

impl Chart {
    /// Inline SVG; nothing if there is no point to show.
    pub(super) fn draw(&self) -> Result<Option<String>, ReportError> {
        let points = || self.series.iter().flat_map(|s| &s.points);
        let (Some(x), Some(y)) = (range(points().map(|p| p.x)), range(points().flat_map(|p| [p.y, p.low, p.high]))) else {
            return Ok(None);
        };
        let mut text = String::new();
        {
            let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
            self.plot(&area, x, y)?;
            area.present().map_err(failed)?;
        }
        dress(&text, self).map(Some)
    }

    fn plot<'a>(&self, area: &DrawingArea<SVGBackend<'a>, Shift>, x: Range<f64>, y: Range<f64>) -> Result<(), ReportError> {
        let scale = |range: &Range<f64>| range.clone().log_scale().with_key_points(ticks(range));
        let mut chart = ChartBuilder::on(area)
            .margin_top(30)
            .margin_right(60)
            .x_label_area_size(MARGIN.1)
            .y_label_area_size(MARGIN.0)
            .build_cartesian_2d(scale(&x), scale(&y))
            .map_err(failed)?;
        let font = |size: i32| ("sans-serif", size).into_font().color(&Part::Text.colour(0));
        chart
            .configure_mesh()
            .x_labels(LABELS)
            .y_labels(LABELS)
            .x_label_formatter(&|v| tick(*v))
            .y_label_formatter(&|v| tick(*v))
            .label_style(font(TEXT))
            .axis_desc_style(font(TEXT))
            .x_desc(self.x_label.as_str())
            .y_desc(self.y_label.as_str())
            .axis_style(Part::Axis.colour(0))
            .bold_line_style(Part::Grid.colour(0))
            .light_line_style(Part::Grid.colour(0).mix(0.0))
            .draw()
            .map_err(failed)?;
        self.plot_guides(&mut chart, &x, &y)?;
        for (index, series) in self.series.iter().enumerate().filter(|(_, s)| s.line && s.points.len() > 1) {
            let upper = series.points.iter().map(|p| (p.x, p.high));
            let lower = series.points.iter().rev().map(|p| (p.x, p.low));
            let band: Vec<(f64, f64)> = upper.chain(lower).collect();
            chart.draw_series([Polygon::new(band, Part::Band.colour(index).filled())]).map_err(failed)?;
        }
        if !self.front.is_empty() {
            chart.draw_series([PathElement::new(self.staircase(&x, &y), Part::Front.colour(0))]).map_err(failed)?;
        }
        for (index, series) in self.series.iter().enumerate() {
            plot_series(&mut chart, index, series)?;
        }
        Ok(())
    }

    /// The front as a line of steps, from edge to edge.
    fn staircase(&self, x: &Range<f64>, y: &Range<f64>) -> Vec<(f64, f64)> {
        let mut line = Vec::new();
        let mut height = y.end;
        for corner in &self.front {
            line.extend([(corner.0, height), *corner]);
            height = corner.1;
        }
        line.push((x.end, height));
        line
    }

    fn plot_guides(&self, chart: &mut Plot<'_>, x: &Range<f64>, y: &Range<f64>) -> Result<(), ReportError> {
        for (index, guide) in self.guides.iter().enumerate() {
            let Some(ends) = guide.inside(x, y) else { continue };
            chart.draw_series([PathElement::new(ends.to_vec(), Part::Guide.colour(index))]).map_err(failed)?;
            // To the left of its place, so that the edge does not cut it; a level's stands at the left edge.
            let side = if guide.slope == 0.0 { HPos::Left } else { HPos::Right };
            let font = ("sans-serif", TEXT * 4 / 5).into_font().color(&Part::Guide.colour(index)).pos(Pos::new(side, VPos::Bottom));
            // Labels of neighbouring guides stand at different places of their lines.
            let t = if guide.slope == 0.0 { 0.02 } else { 1.0 - 0.11 * (index % 5) as f64 };
            let at = |a: f64, b: f64| (a.ln() * (1.0 - t) + b.ln() * t).exp();
            let place = (at(ends[0].0, ends[1].0), at(ends[0].1, ends[1].1));
            chart
                .draw_series(
                    [EmptyElement::at(place) + Text::new(guide.label.clone(), (if guide.slope == 0.0 { 8 } else { -8 }, -6), font)],
                )
                .map_err(failed)?;
        }
        Ok(())
    }
}

impl Guide {
    /// Its ends inside a box; from its point to the right, or from edge to edge for a level.
    fn inside(&self, x: &Range<f64>, y: &Range<f64>) -> Option<[(f64, f64); 2]> {
        let (x0, y0) = self.through;
        if !(y0 >= y.start && y0 <= y.end && x0 >= x.start && x0 < x.end) {
            return None;
        }
        if self.slope == 0.0 {
            return Some([(x.start, y0), (x.end, y0)]);
        }
        let floor = x0 * (y.start / y0).powf(1.0 / self.slope);
        let end = if self.slope < 0.0 { x.end.min(floor) } else { x.end };
        Some([(x0, y0), (end, y0 * (end / x0).powf(self.slope))])
    }
}

fn plot_series(chart: &mut Plot<'_>, index: usize, series: &Series) -> Result<(), ReportError> {
    if series.line {
        let line = series.points.iter().map(|p| (p.x, p.y)).collect::<Vec<_>>();
        chart.draw_series([PathElement::new(line, Part::Line.colour(index))]).map_err(failed)?;
    } else {
        let whiskers = series.points.iter().map(|p| PathElement::new(vec![(p.x, p.low), (p.x, p.high)], Part::Whisker.colour(index)));
        chart.draw_series(whiskers).map_err(failed)?;
    }
    let filled = Part::Marker.colour(index).filled();
    for point in &series.points {
        let place = EmptyElement::at((point.x, point.y));
        let drawn = match marker(series.style) {
            None => chart.draw_series([place + Circle::new((0, 0), MARKER, filled)]),
            Some(outline) => chart.draw_series([place + Polygon::new(outline, filled)]),
        };
        drawn.map_err(failed)?;
    }
    Ok(())
}

/// A marker's outline around the point; none is a circle.
pub(super) fn marker(style: usize) -> Option<Vec<(i32, i32)>> {
    let m = MARKER;
    let (long, thin) = (m * 5 / 4, m / 3);
    match style % 6 {
        0 => None,
        1 => Some(vec![(-m, -m), (m, -m), (m, m), (-m, m)]),
        2 => Some(vec![(0, -long), (long, m), (-long, m)]),
        3 => Some(vec![(0, -long - 4), (long + 4, 0), (0, long + 4), (-long - 4, 0)]),
        4 => Some(vec![(0, long), (long, -m), (-long, -m)]),
        _ => Some(vec![
            (-thin, -long),
            (thin, -long),
            (thin, -thin),
            (long, -thin),
            (long, thin),
            (thin, thin),
            (thin, long),
            (-thin, long),
            (-thin, thin),
            (-long, thin),
            (-long, -thin),
            (-thin, -thin),
        ]),
    }
}

/// All of the values and a little air; none without values.
fn range(values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
    if !(low > 0.0 && low <= high && high.is_finite()) {
        return None;
    }
    let air = ((high / low).ln() * 0.06).max(0.15).exp();
    Some(low / air..high * air)
}

/// Where an axis is labelled: powers of ten, or finer where few of them are inside.
fn ticks(range: &Range<f64>) -> Vec<f64> {
    let decades = (range.end / range.start).log10();
    let factors: &[f64] = match decades {
        d if d > 2.5 => &[1.0],
        d if d > 1.2 => &[1.0, 3.0],
        d if d > 0.5 => &[1.0, 2.0, 5.0],
        _ => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0],
    };
    let (first, last) = (range.start.log10().floor() as i32, range.end.log10().ceil() as i32);
    let stride = ((decades / 8.0).ceil() as usize).max(1);
    let powers = (first..=last).step_by(stride);
    let all = powers.flat_map(|e| factors.iter().map(move |f| f * 10_f64.powi(e)));
    all.filter(|v| *v >= range.start && *v <= range.end).collect()
}

impl Part {
    /// What plotters is told instead of a colour.
    fn colour(self, index: usize) -> RGBColor {
        RGBColor(self as u8, (index / 256) as u8, (index % 256) as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> Chart {
        let point = |x: f64, y: f64| Point { x, y, low: 0.9 * y, high: 1.1 * y, tip: format!("<{x}>") };
        Chart {
            id: "c".into(),
            title: "a <script>alert(1)</script>".into(),
            description: "d".into(),
            x_label: "x & y".into(),
            y_label: "e".into(),
            series: vec![
                Series { label: "\"<a>".into(), style: 0, points: vec![point(1.0, 1.0), point(100.0, 0.1)], line: true },
                Series { label: "b".into(), style: 2, points: vec![point(10.0, 0.5)], line: false },
            ],
            guides: vec![Guide { label: "−1/2".into(), slope: -0.5, through: (1.0, 1.0) }],
            front: vec![(1.0, 1.0), (100.0, 0.1)],
        }
    }

    #[test]
    fn a_chart_has_its_series_and_no_name_breaks_out() {
        let text = chart().draw().expect("drawn").expect("points");
        let tree = roxmltree::Document::parse(&text).expect("well-formed");
        let series: Vec<&str> = tree.descendants().filter_map(|n| n.attribute("data-series")).collect();
        assert_eq!(series, ["\"<a>", "b"]);
        assert_eq!(tree.root_element().attribute("role"), Some("img"));
        let titles = |n: &roxmltree::Node| n.tag_name().name() == "title";
        // One for the chart, one for each point.
        assert_eq!(tree.descendants().filter(titles).count(), 4);
        assert!(!text.contains("<script") && !text.contains("#0"), "{text}");
        assert!(tree.descendants().any(|n| n.text() == Some("x & y")));
    }

    #[test]
    fn nothing_to_show_is_no_chart() {
        let empty = Chart { series: Vec::new(), ..chart() };
        assert!(empty.draw().expect("no error").is_none());
    }

    #[test]
    fn axes_are_labelled_at_round_numbers() {
        assert_eq!(ticks(&(0.5..2000.0)), [1.0, 10.0, 100.0, 1000.0]);
        assert_eq!(ticks(&(0.9..6.0)), [1.0, 2.0, 5.0]);
        assert!(ticks(&(1e-9..1e9)).len() <= 8);
    }

    #[test]
    fn guides_stay_inside() {
        let guide = Guide { label: String::new(), slope: -1.0, through: (1.0, 1.0) };
        assert_eq!(guide.inside(&(0.5..1000.0), &(0.01..2.0)), Some([(1.0, 1.0), (100.0, 0.01)]));
        assert_eq!(guide.inside(&(2.0..1000.0), &(0.01..2.0)), None);
    }
}
