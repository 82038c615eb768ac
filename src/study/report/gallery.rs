//! Pictures of a scene at equal time, crops, maps and the flip viewer.

use super::ReportError;
use super::claims::EqualTime;
use super::data::{Scene, Study, loss, loss_name};
use super::interim::{Layer, Rectangle, View, fragment};
use super::load::{ScenePictures, Shown};
use super::numbers::{count, duration, or_dash, plain};
use super::pictures::{crop, exact, false_colour, overview, scale_bar, worst_windows};
use crate::image::picture::Picture;
use crate::image::tonemap::Exposure;
use maud::{Markup, PreEscaped, html};
use serde_json::Value;

/// Ends of the scale of relative errors.
const ERRORS: (f64, f64) = (0.01, 10.0);

/// Further from equal time than this, as a factor, a picture says so.
const FAR: f64 = 1.1;

/// Windows of a scene, and what to tell about them.
pub(super) struct Insets {
    pub(super) windows: Vec<Rectangle>,
    pub(super) note: Option<String>,
}

/// The study's insets for a scene, or where the error is largest.
pub(super) fn insets(study: &Study, scene: &Scene, pictures: &ScenePictures) -> Insets {
    let shown = || pictures.methods.iter().filter_map(|m| m.shown.as_ref()).map(|s| &s.picture);
    let Some(size) = pictures.reference.as_ref().or(shown().next()).map(Picture::size) else {
        return Insets { windows: Vec::new(), note: None };
    };
    let asked = study.plan().get("report").and_then(|r| r.get("insets")).and_then(Value::as_array);
    let mine: Vec<&Value> =
        asked.into_iter().flatten().filter(|i| i.get("scene").is_none_or(|s| s.as_str() == Some(&scene.name))).collect();
    if !mine.is_empty() {
        let windows: Vec<Option<Rectangle>> = mine.iter().map(|i| window(i, size)).collect();
        let outside = windows.iter().filter(|w| w.is_none()).count();
        let note = (outside > 0)
            .then(|| format!("{outside} of the study's insets do not lie inside {}x{} pixels and are left out.", size.0, size.1));
        return Insets { windows: windows.into_iter().flatten().collect(), note };
    }
    let mut sum = vec![0.0_f32; size.0 * size.1];
    for map in pictures.methods.iter().filter_map(|m| m.error_map.as_ref()).filter(|m| m.len() == size.0 * size.1) {
        for (total, value) in sum.iter_mut().zip(map) {
            *total += value;
        }
    }
    if sum.iter().all(|v| *v == 0.0) {
        return Insets { windows: Vec::new(), note: None };
    }
    let note = "The study file asks for no insets: these are where the methods' relative errors are largest.".to_string();
    Insets { windows: worst_windows(&sum, size), note: Some(note) }
}

/// Pixels where the inset names a scene, else fractions of the picture.
fn window(inset: &Value, (width, height): (usize, usize)) -> Option<Rectangle> {
    let number = |key: &str| inset.get(key).and_then(Value::as_f64).filter(|v| *v >= 0.0);
    let (sx, sy) = if inset.get("scene").is_some() { (1.0, 1.0) } else { (width as f64, height as f64) };
    let pixels = |v: f64, scale: f64| (v * scale).round() as usize;
    let rectangle = Rectangle {
        x: pixels(number("x")?, sx),
        y: pixels(number("y")?, sy),
        width: pixels(number("width")?, sx),
        height: pixels(number("height")?, sy),
    };
    rectangle.fits((width, height)).then_some(rectangle)
}

/// Label and value under a picture.
fn caption(study: &Study, shown: &Shown, equal: Option<&EqualTime>) -> Vec<(String, String)> {
    let mut lines =
        vec![("iterations".to_string(), count(shown.snapshot.iteration)), ("render time".to_string(), duration(shown.snapshot.seconds))];
    for metric in study.metrics.iter().take(2) {
        if let Some(value) = shown.snapshot.values.get(metric).copied().flatten() {
            lines.push((loss_name(metric), plain(loss(metric, value))));
        }
    }
    lines.push(("seed".to_string(), shown.seed.to_string()));
    if shown.snapshot.masked > 0 {
        lines.push(("pixels masked".to_string(), count(shown.snapshot.masked)));
    }
    let factor = equal.map_or(1.0, |e| shown.snapshot.seconds / e.seconds);
    if !(1.0 / FAR..=FAR).contains(&factor) {
        lines.push(("not at equal time".to_string(), format!("{} times as long", plain(factor))));
    }
    lines
}

/// Full pictures with crops and numbers, the reference last.
pub(super) fn equal_time_row(
    study: &Study,
    scene: &Scene,
    pictures: &ScenePictures,
    equal: Option<&EqualTime>,
    insets: &Insets,
) -> Result<Markup, ReportError> {
    let mut cards = Vec::new();
    let first = pictures.reference.as_ref().or_else(|| pictures.methods.iter().find_map(|m| m.shown.as_ref()).map(|s| &s.picture));
    let scale = first.map_or(1.0, |p| Exposure::FromImage.scale(p));
    for (row, found) in scene.rows.iter().zip(&pictures.methods) {
        let lines = found.shown.as_ref().map(|s| caption(study, s, equal));
        let picture = found.shown.as_ref().map(|s| &s.picture);
        cards.push(card(&super::tables::name(&row.label, row.style), &row.label, picture, scale, insets, lines.unwrap_or_default())?);
    }
    if let Some(reference) = &pictures.reference {
        let made = scene.reference.as_ref().and_then(|r| r.made.as_ref());
        let lines = made.map_or_else(
            || vec![("origin".to_string(), "a file".to_string())],
            |m| {
                let iterations = m.iterations.iter().sum::<u64>();
                vec![
                    ("origin".to_string(), format!("{}, {} runs, {} iterations", m.method, m.seeds.len(), count(iterations))),
                    ("render time".to_string(), duration(m.seconds)),
                ]
            },
        );
        cards.push(card(&html! { "Reference" }, "the reference", Some(reference), scale, insets, lines)?);
    }
    Ok(html! { div.cards { @for card in cards { (card) } } })
}

fn card(
    heading: &Markup,
    label: &str,
    picture: Option<&Picture>,
    scale: f32,
    insets: &Insets,
    lines: Vec<(String, String)>,
) -> Result<Markup, ReportError> {
    let full = picture.map(|p| Ok::<_, ReportError>((overview(p, scale)?, p.width, p.height))).transpose()?;
    let mut crops = Vec::new();
    for window in picture.map_or(&[][..], |_| &insets.windows) {
        if let Some(picture) = picture.filter(|p| window.fits(p.size())) {
            crops.push(exact(&crop(picture, window), scale)?);
        }
    }
    Ok(html! {
        figure.card {
            figcaption.head { (heading) }
            @if let Some((uri, width, height)) = full {
                img src=(uri) width=(width) height=(height) alt=(format!("{label}, whole picture"));
                @if !crops.is_empty() {
                    div.crops {
                        @for (i, uri) in crops.iter().enumerate() { img.pixelated src=(uri) alt=(format!("{label}, crop {}", i + 1)); }
                    }
                }
            } @else { p.missing { "No picture could be read." } }
            dl { @for (key, value) in &lines { div { dt { (key) } dd { (value) } } } }
        }
    })
}

/// Flip between methods and reference, smaller by a factor where a page of full pictures would be too large.
pub(super) fn viewer(
    study: &Study,
    scene: &Scene,
    index: usize,
    pictures: &ScenePictures,
    insets: &Insets,
    factor: usize,
) -> Option<Markup> {
    let reference = pictures.reference.as_ref().map(|p| ScenePictures::shrunk(p, factor));
    let shown: Vec<_> = scene.rows.iter().zip(&pictures.methods).filter_map(|(row, m)| Some((row, m.shown.as_ref()?))).collect();
    let small: Vec<Picture> = shown.iter().map(|(_, s)| ScenePictures::shrunk(&s.picture, factor)).collect();
    let layers =
        shown.iter().zip(&small).map(|((row, s), picture)| Layer { name: row.label.clone(), picture, caption: caption(study, s, None) });
    let cut = |w: &Rectangle| Rectangle {
        x: w.x / factor,
        y: w.y / factor,
        width: (w.width / factor).max(1),
        height: (w.height / factor).max(1),
    };
    let view = View {
        id: format!("viewer-{index}"),
        title: format!("{}: flip", scene.name),
        reference: reference.as_ref(),
        layers: layers.collect(),
        insets: insets.windows.iter().map(cut).collect(),
    };
    let any = view.reference.is_some() || !view.layers.is_empty();
    any.then(|| {
        html! {
            @if factor > 1 {
                p.note {
                    "Pictures here are means over " (factor) " × " (factor) " pixels, to keep the page small; the files in the study's folder are whole. "
                    "Errors seen here are smaller than those of the tables."
                }
            }
            (PreEscaped(fragment(&view)))
        }
    })
}

/// Relative error of every method in false colour, and photon densities where a picture has them.
pub(super) fn maps(scene: &Scene, pictures: &ScenePictures) -> Result<Option<Markup>, ReportError> {
    let size = |m: &super::load::MethodPictures| pictures.reference.as_ref().or(m.shown.as_ref().map(|s| &s.picture)).map(Picture::size);
    let (mut errors, mut densities) = (Vec::new(), Vec::new());
    for (row, found) in scene.rows.iter().zip(&pictures.methods) {
        let Some(size) = size(found) else { continue };
        if let Some(map) = &found.error_map {
            let finite = map.iter().copied().filter(|v| v.is_finite()).map(f64::from);
            let (sum, n) = finite.fold((0.0, 0_u64), |(s, n), v| (s + v, n + 1));
            let note = format!("mean {}, {} runs", or_dash((n > 0).then(|| sum / n as f64)), found.runs);
            errors.push((row, false_colour(map, size, ERRORS.0, ERRORS.1)?, note));
        }
        if let Some(map) = found.density.as_ref().filter(|m| m.len() == size.0 * size.1) {
            let high = f64::from(map.iter().copied().filter(|v| v.is_finite()).fold(0.0, f32::max)).max(f64::MIN_POSITIVE);
            densities.push((row, false_colour(map, size, high * 1e-3, high)?, format!("brightest: {}", plain(high))));
        }
    }
    let bar = scale_bar()?;
    let cards = |maps: &[(&super::data::MethodRuns, String, String)], what: &str| {
        html! {
            div.cards {
                @for (row, uri, note) in maps {
                    figure.card {
                        figcaption.head { (super::tables::name(&row.label, row.style)) }
                        img src=(uri) alt=(format!("{what} of {}", row.label));
                        p.under { (note) }
                    }
                }
            }
        }
    };
    if errors.is_empty() && densities.is_empty() {
        return Ok(None);
    }
    Ok(Some(html! {
        @if !errors.is_empty() {
            (cards(&errors, "relative error"))
            div.bar { span { (plain(ERRORS.0)) } img src=(bar) alt="dark to light, logarithmic"; span { (plain(ERRORS.1)) } }
        }
        @if !densities.is_empty() {
            h4 { "Photon density" }
            p.note { "Photons that reached each pixel's measurement point, three decades up to the brightest, each map by its own." }
            (cards(&densities, "photon density"))
        }
    }))
}
