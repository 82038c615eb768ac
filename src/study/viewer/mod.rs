//! Pictures side by side in a page: flip between methods and reference, look into pixels, see where the error is.
//!
//! What comes out is HTML that needs nothing but itself: the pictures are inside, as half floats, and a script without dependencies
//! unpacks a section when it comes into view. `docs/viewer.md` tells keys, modes and numbers.

mod packing;

use crate::image::metrics::EPSILON;
use crate::image::picture::Picture;
use crate::image::tonemap::Exposure;
use packing::pack;
use serde_json::json;
use std::fmt::Write;

/// The script, once a page, after the last section or deferred.
pub const SCRIPT: &str = concat!(
    "(() => {\n\"use strict\";\n",
    include_str!("numbers.js"),
    include_str!("viewer.js"),
    include_str!("controls.js"),
    include_str!("input.js"),
    "})();\n"
);

/// The style, once a page. Every rule begins with `.viewer`.
pub const STYLE: &str = include_str!("viewer.css");

/// What [`page`] adds to [`STYLE`]: type, tables, colours of a page of its own.
const PAGE_STYLE: &str = include_str!("page.css");

/// Pixels, from the top left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rectangle {
    /// First column.
    pub x: usize,
    /// First row.
    pub y: usize,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
}

impl Rectangle {
    /// This part of a picture.
    ///
    /// # Panics
    /// If it reaches out of the picture.
    pub fn crop(&self, picture: &Picture) -> Picture {
        let rows = picture.pixels.chunks_exact(picture.width.max(1)).skip(self.y).take(self.height);
        let pixels = rows.flat_map(|row| &row[self.x..self.x + self.width]).copied().collect();
        Picture::new(self.width, self.height, pixels)
    }
}

impl std::fmt::Display for Rectangle {
    /// As `--inset` takes it.
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(formatter, "{},{},{},{}", self.x, self.y, self.width, self.height)
    }
}

/// A picture to flip to.
#[derive(Clone, Debug)]
pub struct Layer<'a> {
    /// What it is called; plain text.
    pub name: String,
    /// Linear colours. Against a reference of another size no error is shown.
    pub picture: &'a Picture,
    /// Numbers shown under it, label and value; plain text.
    pub caption: Vec<(String, String)>,
}

/// A section: one scene.
#[derive(Clone, Debug)]
pub struct View<'a> {
    /// The section's `id`, unique in the page: letters, digits, `-` and `_`.
    pub id: String,
    /// Heading; plain text.
    pub title: String,
    /// What the layers are compared with; the first to flip to.
    pub reference: Option<&'a Picture>,
    /// In the order of the number keys.
    pub layers: Vec<Layer<'a>>,
    /// Crops shown beside it from the start, cut to the picture.
    pub insets: Vec<Rectangle>,
}

/// A section of a page. The page has [`STYLE`] and [`SCRIPT`] once.
///
/// Relative errors have the epsilon [`EPSILON`]; see [`fragment_at`].
pub fn fragment(view: &View) -> String {
    fragment_at(view, EPSILON)
}

/// [`fragment`] with an epsilon for the relative errors.
pub fn fragment_at(view: &View, epsilon: f64) -> String {
    let reference = view.reference.map(|picture| Layer { name: "Reference".to_string(), picture, caption: Vec::new() });
    let layers: Vec<&Layer> = reference.iter().chain(&view.layers).collect();
    let (id, title) = (escape(&view.id), escape(&view.title));
    let Some(first) = layers.first() else {
        return format!("<section class=\"viewer\" id=\"{id}\"><h2>{title}</h2><p>No picture.</p></section>\n");
    };
    let stops = stops_into_half_range(first.picture);
    let packed: Vec<_> = layers.iter().map(|layer| pack(layer.picture, stops)).collect();
    let described = layers.iter().zip(&packed).enumerate().map(|(index, (layer, packed))| {
        json!({
            "name": layer.name, "width": layer.picture.width, "height": layer.picture.height, "caption": layer.caption,
            "reference": index == 0 && view.reference.is_some(),
            "nan": packed.nan, "infinite": packed.infinite, "beyond": packed.beyond,
        })
    });
    let header = json!({
        "layers": described.collect::<Vec<_>>(),
        "insets": view.insets.iter().map(|r| [r.x, r.y, r.width, r.height]).collect::<Vec<_>>(),
        "stops": stops, "epsilon": epsilon, "exposure": stops_to_grey(first.picture),
    });
    let (width, height) = first.picture.size();
    let mut html = format!(
        "<section class=\"viewer\" id=\"{id}\" aria-labelledby=\"{id}-title\" style=\"--viewer-across:{width};--viewer-down:{height}\">\n\
         <h2 id=\"{id}-title\">{title}</h2>\n<noscript><p>The pictures need JavaScript; they are in this file, nothing is fetched.</p></noscript>\n\
         <script type=\"application/json\" data-viewer=\"header\">{}</script>\n",
        header.to_string().replace('<', "\\u003c")
    );
    for packed in &packed {
        // Writing into a string does not fail.
        let _ = writeln!(html, "<script type=\"text/plain\" data-viewer=\"picture\">{}</script>", packed.text);
    }
    html + "</section>\n"
}

/// A whole page: heading, the views, and `foot`, which is HTML and stands below them.
pub fn page(title: &str, views: &[View], foot: &str) -> String {
    document(title, &(views.iter().map(fragment).collect::<String>() + foot))
}

/// A whole page around sections that are there.
pub fn document(title: &str, body: &str) -> String {
    let title = escape(title);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<meta name=\"color-scheme\" content=\"light dark\">\n\
         <link rel=\"icon\" href=\"data:,\">\n<title>{title}</title>\n<style>\n{PAGE_STYLE}{STYLE}</style>\n</head>\n\
         <body>\n<main>\n<h1>{title}</h1>\n{body}</main>\n<script>\n{SCRIPT}</script>\n</body>\n</html>\n"
    )
}

/// Text as HTML, also inside a quoted attribute.
pub fn escape(text: &str) -> String {
    let mut html = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => html.push_str("&amp;"),
            '<' => html.push_str("&lt;"),
            '>' => html.push_str("&gt;"),
            '"' => html.push_str("&quot;"),
            '\'' => html.push_str("&#39;"),
            other => html.push(other),
        }
    }
    html
}

/// The exposure that `--preview` takes from a picture, in stops.
fn stops_to_grey(picture: &Picture) -> f32 {
    // Beyond f32's range the factor is infinite.
    Exposure::FromImage.scale(picture).log2().clamp(-140.0, 140.0)
}

/// Half floats span 2^-24 to 2^16: pictures whose typical luminance is far from 1 are moved there by a power of two, which costs no digit.
fn stops_into_half_range(picture: &Picture) -> i32 {
    const NEAR: f32 = 8.0;
    let to_grey = stops_to_grey(picture);
    if to_grey.abs() <= NEAR { 0 } else { to_grey.round() as i32 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rgb;

    fn picture(value: f32) -> Picture {
        Picture::new(4, 2, vec![Rgb::splat(value); 8])
    }

    fn header(html: &str) -> serde_json::Value {
        let start = html.split_once("data-viewer=\"header\">").expect("a header").1;
        serde_json::from_str(start.split_once("</script>").expect("its end").0).expect("JSON")
    }

    #[test]
    fn names_do_not_become_elements() {
        let nasty = "</script><b>&'\"";
        let pixels = picture(0.18);
        let layer = Layer { name: nasty.to_string(), picture: &pixels, caption: vec![(nasty.to_string(), nasty.to_string())] };
        let view = View { id: "a".to_string(), title: nasty.to_string(), reference: None, layers: vec![layer], insets: Vec::new() };
        let html = page(nasty, &[view], "<p>below</p>");
        assert!(!html.contains(nasty) && !html.contains("<b>"), "{html}");
        assert_eq!(header(&html)["layers"][0]["name"], nasty);
        assert_eq!(header(&html)["layers"][0]["caption"][0][1], nasty);
        assert!(html.contains("<p>below</p>"));
        // The script and the style must not end their own elements.
        assert!(!SCRIPT.contains("</script") && !STYLE.contains("</style") && !PAGE_STYLE.contains("</style"));
    }

    #[test]
    fn a_section_holds_reference_layers_and_insets() {
        let (reference, image) = (picture(0.18), picture(0.36));
        let layer = Layer { name: "a".to_string(), picture: &image, caption: vec![("relmse".to_string(), "0.5".to_string())] };
        let insets = vec![Rectangle { x: 1, y: 0, width: 2, height: 1 }];
        let view = View { id: "s".to_string(), title: "t".to_string(), reference: Some(&reference), layers: vec![layer], insets };
        let html = fragment_at(&view, 0.5);
        let header = header(&html);
        assert_eq!(html.matches("data-viewer=\"picture\"").count(), 2);
        let marks: Vec<_> = header["layers"].as_array().expect("layers").iter().map(|l| l["reference"].as_bool()).collect();
        assert_eq!(marks, [Some(true), Some(false)]);
        assert_eq!(header["insets"], json!([[1, 0, 2, 1]]));
        assert_eq!((header["stops"].as_i64(), header["epsilon"].as_f64()), (Some(0), Some(0.5)));
        assert!(header["exposure"].as_f64().expect("a number").abs() < 1e-5, "{header}");
    }

    #[test]
    fn a_crop_is_the_part_it_names() {
        let numbered = Picture::new(4, 3, (0..12).map(|i| Rgb::splat(i as f32)).collect());
        let crop = Rectangle { x: 1, y: 1, width: 2, height: 2 }.crop(&numbered);
        assert_eq!(crop, Picture::new(2, 2, [5.0, 6.0, 9.0, 10.0].map(Rgb::splat).to_vec()));
        assert_eq!(Rectangle { x: 1, y: 2, width: 3, height: 4 }.to_string(), "1,2,3,4");
    }

    #[test]
    fn pictures_far_from_one_are_moved_into_range() {
        for (value, stops) in
            [(0.18, 0), (20.0, 0), (1e-3, 0), (0.18 * 2.0_f32.powi(20), -20), (0.18 * 2.0_f32.powi(-20), 20), (1e-36, 117), (1e-40, 140)]
        {
            assert_eq!(stops_into_half_range(&picture(value)), stops, "{value}");
        }
        assert_eq!(stops_into_half_range(&picture(0.0)), 0);
        assert!((-140..=140).contains(&stops_into_half_range(&picture(f32::MAX))));
        assert!((-140..=140).contains(&stops_into_half_range(&picture(f32::from_bits(1)))));
    }
}
