//! OpenEXR files: any picture with R, G, B or Y comes in; 32-bit float R, G, B with further layers and metadata goes out.

use super::file::replace;
use super::picture::{ImageError, Picture};
use crate::math::Rgb;
use ::exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer, LayerAttributes,
    ReadChannels, ReadLayers, Text, Vec2, WritableImage, read,
};
use serde_json::Value;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Name of the header attribute that holds the metadata.
pub const ATTRIBUTE: &str = "isophote";

/// One channel of a file.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Full name: the part's name, the layer, the component, joined by dots.
    pub name: String,
    /// `half`, `float` or `uint`.
    pub kind: &'static str,
    /// Width of its part.
    pub width: usize,
    /// Height of its part.
    pub height: usize,
    /// Values, row-major from the top left; fewer than `width * height` if the channel is subsampled.
    pub samples: Vec<f32>,
}

/// What a file holds.
#[derive(Clone, Debug)]
pub struct ExrFile {
    /// Where it is.
    pub path: PathBuf,
    /// All channels of all parts.
    pub channels: Vec<Channel>,
    /// The header attribute `isophote`, if there is one.
    pub metadata: Option<String>,
}

/// A layer to be written beside the picture.
#[derive(Clone, Debug)]
pub enum Plane {
    /// `NAME.R`, `NAME.G`, `NAME.B`.
    Colour(Cow<'static, str>, Vec<Rgb>),
    /// `NAME.Y`.
    Scalar(Cow<'static, str>, Vec<f32>),
}

/// Reads a file.
pub fn read_file(path: &Path) -> Result<ExrFile, ImageError> {
    // Opened here so that a missing file gives the system's reason.
    let file = std::fs::File::open(path).map_err(|e| ImageError::io(path, e))?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(std::io::BufReader::new(file))
        .map_err(|e| ImageError::content(path, format!("not a readable EXR file ({e})")))?;
    let attribute = Text::new_or_none(ATTRIBUTE);
    let in_parts = image.layer_data.iter().map(|layer| &layer.attributes.other);
    let metadata = std::iter::once(&image.attributes.other)
        .chain(in_parts)
        .filter_map(|other| attribute.as_ref().and_then(|name| other.get(name)))
        .find_map(|value| if let AttributeValue::Text(text) = value { Some(text.to_string()) } else { None });
    let mut channels = Vec::new();
    for part in image.layer_data {
        let prefix = part.attributes.layer_name.as_ref().map(|n| n.to_string()).filter(|n| !n.is_empty());
        for channel in part.channel_data.list {
            let (kind, samples) = match channel.sample_data {
                FlatSamples::F16(values) => ("half", values.into_iter().map(f32::from).collect()),
                FlatSamples::F32(values) => ("float", values),
                FlatSamples::U32(values) => ("uint", values.into_iter().map(|v| v as f32).collect()),
            };
            let name = channel.name.to_string();
            // A part called like a layer of its own channels must not name it twice.
            let name = match &prefix {
                Some(prefix) if !name.starts_with(&format!("{prefix}.")) => format!("{prefix}.{name}"),
                _ => name,
            };
            channels.push(Channel { name, kind, width: part.size.width(), height: part.size.height(), samples });
        }
    }
    Ok(ExrFile { path: path.to_path_buf(), channels, metadata })
}

/// The picture in a file; see [`ExrFile::picture`].
pub fn read_picture(path: &Path) -> Result<Picture, ImageError> {
    read_file(path)?.picture()
}

impl ExrFile {
    /// The picture: R, G, B outside any layer; else Y there, as grey; else the one layer or part that has R, G, B or Y.
    pub fn picture(&self) -> Result<Picture, ImageError> {
        if self.has("", &["R", "G", "B"]) || self.has("", &["Y"]) {
            return self.layer("");
        }
        let mut layers: Vec<&str> = self.channels.iter().filter_map(|c| Some(c.name.rsplit_once('.')?.0)).collect();
        layers.sort_unstable();
        layers.dedup();
        layers.retain(|layer| self.has(layer, &["R", "G", "B"]) || self.has(layer, &["Y"]));
        match layers[..] {
            [one] => self.layer(one),
            [] => Err(self.unfit(format!("has no channels R, G, B and no Y; its channels: {}", self.names()))),
            _ => Err(self.unfit(format!("has several layers and none without a name, so which is meant is open: {}", layers.join(", ")))),
        }
    }

    /// The picture in a layer, the name of which is empty for the channels outside any layer.
    pub fn layer(&self, layer: &str) -> Result<Picture, ImageError> {
        let full = |name: &str| if layer.is_empty() { name.to_string() } else { format!("{layer}.{name}") };
        let find = |name: &str| self.channels.iter().find(|c| c.name == full(name));
        let planes = match (find("R"), find("G"), find("B"), find("Y")) {
            (Some(r), Some(g), Some(b), _) => [r, g, b],
            (.., Some(y)) if find("RY").is_some() || find("BY").is_some() => {
                return Err(self.unfit(format!("stores {} with colour differences; convert it to R, G, B", y.name)));
            }
            (.., Some(y)) => [y, y, y],
            _ => return Err(self.unfit(format!("has no layer {layer:?} with R, G, B or Y; its channels: {}", self.names()))),
        };
        let (width, height) = (planes[0].width, planes[0].height);
        if let Some(odd) = planes.iter().find(|p| p.samples.len() != width * height || (p.width, p.height) != (width, height)) {
            return Err(self.unfit(format!("channel {} does not have one value for each of {width}x{height} pixels", odd.name)));
        }
        let pixel = |i: usize| Rgb::new(planes[0].samples[i], planes[1].samples[i], planes[2].samples[i]);
        Ok(Picture::new(width, height, (0..width * height).map(pixel).collect()))
    }

    /// The metadata as JSON.
    pub fn metadata_json(&self) -> Result<Option<Value>, ImageError> {
        let parse =
            |text: &String| serde_json::from_str(text).map_err(|e| self.unfit(format!("its attribute {ATTRIBUTE} is not JSON ({e})")));
        self.metadata.as_ref().map(parse).transpose()
    }

    /// Whether a layer has all of these components.
    fn has(&self, layer: &str, components: &[&str]) -> bool {
        let full = |name: &str| if layer.is_empty() { name.to_string() } else { format!("{layer}.{name}") };
        components.iter().all(|component| self.channels.iter().any(|c| c.name == full(component)))
    }

    fn names(&self) -> String {
        self.channels.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ")
    }

    fn unfit(&self, message: String) -> ImageError {
        ImageError::content(&self.path, message)
    }
}

/// Writes a picture with further layers and metadata, replacing the file atomically.
///
/// # Panics
/// If a plane has another size than the picture.
pub fn write(path: &Path, picture: &Picture, planes: &[Plane], metadata: Option<&Value>) -> Result<(), ImageError> {
    let (width, height) = picture.size();
    let mut channels: Vec<AnyChannel<FlatSamples>> = Vec::new();
    let mut push = |name: String, samples: Vec<f32>| {
        assert_eq!(samples.len(), width * height, "{name} is of another size");
        channels.push(AnyChannel::new(name.as_str(), FlatSamples::F32(samples)));
    };
    let component = |pixels: &[Rgb], c: usize| -> Vec<f32> { pixels.iter().map(|p| p[c]).collect() };
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        push(name.to_string(), component(&picture.pixels, c));
        for plane in planes {
            match plane {
                Plane::Colour(layer, pixels) => push(format!("{layer}.{name}"), component(pixels, c)),
                Plane::Scalar(layer, samples) if c == 0 => push(format!("{layer}.Y"), samples.clone()),
                Plane::Scalar(..) => {}
            }
        }
    }
    let mut attributes = ImageAttributes::new(IntegerBounds::from_dimensions(Vec2(width, height)));
    if let Some(metadata) = metadata {
        let text = |s: &str| Text::new_or_none(s).ok_or_else(|| ImageError::content(path, "metadata is not ASCII"));
        attributes.other.insert(text(ATTRIBUTE)?, AttributeValue::Text(text(&ascii(&metadata.to_string()))?));
    }
    let channels = AnyChannels::sort(channels.into_iter().collect());
    let layer = Layer::new(Vec2(width, height), LayerAttributes::default(), Encoding::SMALL_LOSSLESS, channels);
    let image = Image::empty(attributes).with_layer(layer);
    // The format seeks while it writes, so it is laid out in memory first.
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write().non_parallel().to_buffered(&mut bytes).map_err(|e| ImageError::content(path, e.to_string()))?;
    replace(path, |w| std::io::Write::write_all(w, bytes.get_ref()).map_err(|e| ImageError::io(path, e)))
}

/// JSON with everything beyond ASCII escaped: the attribute's type knows no encoding.
fn ascii(json: &str) -> String {
    let mut out = String::with_capacity(json.len());
    for character in json.chars() {
        if character.is_ascii() {
            out.push(character);
        } else {
            let mut units = [0_u16; 2];
            for unit in character.encode_utf16(&mut units) {
                out.push_str(&format!("\\u{unit:04x}"));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::exr::prelude::{Layers, f16};
    use serde_json::json;

    fn small() -> Picture {
        let pixels = (0..6).map(|i| Rgb::new(i as f32, 1e-9 * i as f32, -0.1 * i as f32)).collect();
        Picture::new(3, 2, pixels)
    }

    /// Writes channels of one part as they are.
    fn raw(path: &Path, channels: Vec<(&str, FlatSamples)>) {
        let list = channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
        let layer = Layer::new(Vec2(2, 1), LayerAttributes::default(), Encoding::UNCOMPRESSED, AnyChannels::sort(list));
        Image::from_layer(layer).write().non_parallel().to_file(path).expect("written");
    }

    #[test]
    fn what_is_written_is_read_bit_by_bit() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr");
        let mut pixels = small().pixels.to_vec();
        pixels[1] = Rgb::new(f32::INFINITY, f32::NAN, f32::MIN_POSITIVE / 4.0);
        let picture = Picture::new(3, 2, pixels);
        let variance: Vec<Rgb> = (0..6).map(|i| Rgb::splat(i as f32 * 0.5)).collect();
        let metadata = json!({"scene": {"path": "Bücher/𝄞.xml"}, "schema": 1});
        let planes = [Plane::Colour("variance".into(), variance.clone()), Plane::Scalar("count".into(), vec![4.0; 6])];
        write(&path, &picture, &planes, Some(&metadata)).expect("written");
        let file = read_file(&path).expect("read");
        let names: Vec<&str> = file.channels.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["B", "G", "R", "count.Y", "variance.B", "variance.G", "variance.R"]);
        assert!(file.channels.iter().all(|c| c.kind == "float"));
        let bits = |p: &Picture| p.pixels.iter().map(|v| v.to_array().map(f32::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&file.picture().expect("a picture")), bits(&picture));
        assert_eq!(file.layer("variance").expect("a layer").pixels, variance);
        assert!(file.metadata.as_ref().expect("metadata").is_ascii());
        assert_eq!(file.metadata_json().expect("JSON"), Some(metadata));
        assert_eq!(picture.non_finite(), 1);
    }

    #[test]
    fn half_luminance_and_named_layers_are_pictures() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr");
        let half = |a: f32, b: f32| FlatSamples::F16(vec![f16::from_f32(a), f16::from_f32(b)]);
        raw(&path, vec![("R", half(1.0, 2.0)), ("G", half(3.0, 4.0)), ("B", half(5.0, 6.0)), ("A", half(1.0, 1.0))]);
        assert_eq!(read_picture(&path).expect("RGBA").pixels[1], Rgb::new(2.0, 4.0, 6.0));
        raw(&path, vec![("Y", half(0.5, 0.25))]);
        assert_eq!(read_picture(&path).expect("Y").pixels, [Rgb::splat(0.5), Rgb::splat(0.25)]);
        let float = |v: f32| FlatSamples::F32(vec![v, v]);
        raw(&path, vec![("main.R", float(1.0)), ("main.G", float(2.0)), ("main.B", float(3.0)), ("depth.Z", float(9.0))]);
        assert_eq!(read_picture(&path).expect("one layer").pixels[0], Rgb::new(1.0, 2.0, 3.0));
    }

    #[test]
    fn parts_are_layers() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr");
        let part = |name: &str, value: f32| {
            let list = ["R", "G", "B"].map(|c| AnyChannel::new(c, FlatSamples::F32(vec![value; 2])));
            Layer::new(Vec2(2, 1), LayerAttributes::named(name), Encoding::UNCOMPRESSED, AnyChannels::sort(list.into_iter().collect()))
        };
        let parts: Layers<AnyChannels<FlatSamples>> = [part("beauty", 1.0), part("normals", 2.0)].into_iter().collect();
        let attributes = ImageAttributes::new(IntegerBounds::from_dimensions(Vec2(2, 1)));
        Image::new(attributes, parts).write().non_parallel().to_file(&path).expect("written");
        let file = read_file(&path).expect("read");
        assert_eq!(file.layer("normals").expect("there").pixels[0], Rgb::splat(2.0));
        let message = file.picture().expect_err("two candidates").to_string();
        assert!(message.contains("beauty, normals"), "{message}");
    }

    #[test]
    fn errors_name_the_file_and_what_is_in_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("broken.exr");
        let of = |path: &Path| read_picture(path).expect_err("an error").to_string();
        assert!(of(&path).contains("broken.exr"));
        std::fs::write(&path, "no picture").expect("written");
        assert!(of(&path).contains("not a readable EXR"), "{}", of(&path));
        raw(&path, vec![("Z", FlatSamples::F32(vec![1.0, 2.0]))]);
        assert!(of(&path).contains("its channels: Z"), "{}", of(&path));
        // A file cut short anywhere is an error, never a panic.
        write(&path, &small(), &[], Some(&json!({"a": 1}))).expect("written");
        let whole = std::fs::read(&path).expect("read");
        for cut in 0..whole.len() {
            std::fs::write(&path, &whole[..cut]).expect("written");
            assert!(read_picture(&path).is_err(), "cut at {cut} of {}", whole.len());
        }
    }
}
