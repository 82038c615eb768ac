//! The chains' traces as a picture: one panel a rung, one line an ensemble.

use crate::cli::failure::Failure;
use crate::integrators::chains::ChainReport;
use plotters::coord::Shift;
use plotters::prelude::{ChartBuilder, DrawingArea, IntoDrawingArea, IntoFont, PathElement, SVGBackend};
use plotters::style::{Color, RGBColor};
use std::ops::Range;

/// Pixels of a panel, across and down.
const PANEL: (u32, u32) = (1200, 260);
/// Room above the panels.
const TOP: u32 = 44;

/// The series' colours of a study's report on white: told apart without red and green, and dark enough to be seen.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0x00, 0x67, 0xa5),
    RGBColor(0xc4, 0x50, 0x0a),
    RGBColor(0x00, 0x7d, 0x5a),
    RGBColor(0xa8, 0x44, 0x7f),
    RGBColor(0x8f, 0x6a, 0x00),
    RGBColor(0x5b, 0x4b, 0xb0),
    RGBColor(0x3d, 0x3f, 0x45),
];
const WHITE: RGBColor = RGBColor(255, 255, 255);
const INK: RGBColor = RGBColor(0x22, 0x24, 0x28);
const GRID: RGBColor = RGBColor(0xdd, 0xde, 0xe2);

/// Anything plotters refuses; memory is all it writes to.
fn failed(error: impl std::fmt::Display) -> Failure {
    Failure::new(format!("the traces cannot be drawn: {error}"))
}

/// A whole SVG file.
pub(super) fn draw(chains: &ChainReport) -> Result<String, Failure> {
    let panels = chains.ladder.rungs.len().saturating_sub(1);
    let mut text = String::new();
    {
        let size = (PANEL.0, TOP + PANEL.1 * panels as u32);
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        area.fill(&WHITE).map_err(failed)?;
        let (top, below) = area.split_vertically(TOP);
        let title = format!("{}, last iteration: one line an ensemble of {}", y_label(chains), chains.ladder.ensembles);
        top.titled(&title, ("sans-serif", 20).into_font().color(&INK)).map_err(failed)?;
        // One scale for all: a higher rung has to be seen to dwell higher up.
        let height = height(chains);
        for (panel, area) in below.split_evenly((panels, 1)).iter().enumerate() {
            plot(area, chains, panel + 1, &height)?;
        }
        area.present().map_err(failed)?;
    }
    Ok(text)
}

fn y_label(chains: &ChainReport) -> String {
    format!("log T of {}", chains.name(chains.ladder.rungs.len().saturating_sub(1)))
}

/// All values of all traces and a little air.
fn height(chains: &ChainReport) -> Range<f64> {
    let values = chains.ladder.rungs.iter().flat_map(|rung| rung.traces.iter().flatten()).filter(|v| v.is_finite());
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(f64::from(*v)), high.max(f64::from(*v))));
    if low > high {
        return -1.0..1.0;
    }
    let air = (0.05 * (high - low)).max(0.1);
    low - air..high + air
}

fn plot(area: &DrawingArea<SVGBackend<'_>, Shift>, chains: &ChainReport, rung: usize, height: &Range<f64>) -> Result<(), Failure> {
    let report = &chains.ladder.rungs[rung];
    let stride = report.trace_stride.max(1) as f64;
    let longest = report.traces.iter().map(Vec::len).max().unwrap_or(0);
    let caption = match longest {
        0 => format!("{}: no step was counted", chains.name(rung)),
        _ => chains.name(rung),
    };
    let font = |size: i32| ("sans-serif", size).into_font().color(&INK);
    let mut chart = ChartBuilder::on(area)
        .caption(caption, font(18))
        .margin_right(24)
        .margin_left(8)
        .x_label_area_size(42)
        .y_label_area_size(70)
        .build_cartesian_2d(0.0..(stride * longest as f64).max(1.0), height.clone())
        .map_err(failed)?;
    chart
        .configure_mesh()
        .x_labels(10)
        .y_labels(6)
        .x_label_formatter(&|v| format!("{v:.0}"))
        .y_label_formatter(&|v| format!("{v:.1}"))
        .label_style(font(14))
        .axis_desc_style(font(15))
        .x_desc("step of the ensemble on this rung")
        .y_desc(y_label(chains))
        .axis_style(INK)
        .bold_line_style(GRID)
        .light_line_style(GRID.mix(0.0))
        .draw()
        .map_err(failed)?;
    for (ensemble, trace) in report.traces.iter().enumerate() {
        let points = trace.iter().enumerate().filter(|(_, v)| v.is_finite()).map(|(i, v)| (i as f64 * stride, f64::from(*v)));
        let line = PathElement::new(points.collect::<Vec<_>>(), COLOURS[ensemble % COLOURS.len()].mix(0.75));
        chart.draw_series([line]).map_err(failed)?;
    }
    Ok(())
}
