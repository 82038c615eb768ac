//! Textures: colour or weight as a function of surface coordinates.

use crate::math::Rgb;
use glam::{Affine2, Vec2};

pub mod bitmap;
mod tiles;

pub use bitmap::{Bitmap, Decoding, Filter, Texels, TextureError, Wrap};

/// A colour that may vary over the surface.
#[derive(Clone, Debug)]
pub enum Texture {
    /// The same everywhere.
    Constant(Rgb),
    /// An image.
    Bitmap(Box<Bitmap>),
    /// Two colours in squares.
    Checkerboard(Box<Checkerboard>),
}

/// Squares of side 1/2 in `to_uv uv`: `color0` in the one at the origin and along the diagonals, `color1` in between.
#[derive(Clone, Debug)]
pub struct Checkerboard {
    /// Colour of the square at the origin; a texture here sees the surface's own coordinates, not those of the board.
    pub color0: Texture,
    /// The other colour.
    pub color1: Texture,
    /// Applied to the surface's coordinates before the squares are counted.
    pub to_uv: Affine2,
}

impl Texture {
    /// The same grey everywhere.
    pub fn grey(value: f32) -> Self {
        Texture::Constant(Rgb::splat(value))
    }

    /// Does the value depend on the texture coordinates?
    pub fn varies(&self) -> bool {
        !matches!(self, Texture::Constant(_))
    }

    /// Value at texture coordinates `uv` (any real numbers).
    #[inline(always)]
    pub fn eval(&self, uv: Vec2) -> Rgb {
        match self {
            Texture::Constant(c) => *c,
            _ => {
                let c = self.varying(uv);
                Rgb::new(c.r(), c.g(), c.b())
            }
        }
    }

    /// [`Texture::eval`] out of line.
    #[inline(never)]
    fn varying(&self, uv: Vec2) -> Rgb {
        match self {
            Texture::Constant(c) => *c,
            Texture::Bitmap(b) => b.eval(uv),
            Texture::Checkerboard(c) => c.at(uv, [&c.color0, &c.color1]).eval(uv),
        }
    }

    /// Fetches what [`Texture::eval`] will soon ask of the memory here.
    #[inline(always)]
    pub fn prefetch(&self, uv: Vec2) {
        if let Texture::Bitmap(b) = self {
            b.prefetch(uv);
        }
    }

    /// Value as one number, for weights: the luminance, which for a grey is the grey.
    ///
    /// A checkerboard's two colours change places here: Mitsuba 3.9.1 has it so (measured), and scenes made for it rely on it.
    #[inline]
    pub fn eval_1(&self, uv: Vec2) -> f32 {
        match self {
            Texture::Checkerboard(c) => c.at(uv, [&c.color1, &c.color0]).eval_1(uv),
            _ => self.eval(uv).luminance(),
        }
    }

    /// Mean over the unit square of the texture's own coordinates (for a bitmap, over its texels).
    pub fn mean(&self) -> Rgb {
        match self {
            Texture::Constant(c) => *c,
            Texture::Bitmap(b) => b.texels.mean(),
            Texture::Checkerboard(c) => c.color0.mean().lerp(c.color1.mean(), 0.5),
        }
    }

    /// Smallest and largest component anywhere.
    pub fn range(&self) -> (f32, f32) {
        let of = |c: Rgb| (c.r().min(c.g()).min(c.b()), c.max_component());
        match self {
            Texture::Constant(c) => of(*c),
            Texture::Bitmap(b) => b.texels.range(),
            Texture::Checkerboard(c) => {
                let ((a, b), (c, d)) = (c.color0.range(), c.color1.range());
                (a.min(c), b.max(d))
            }
        }
    }
}

impl Checkerboard {
    #[inline]
    fn at<'a>(&self, uv: Vec2, colors: [&'a Texture; 2]) -> &'a Texture {
        let p = self.to_uv.transform_point2(uv);
        let far = (p - p.floor()).cmpgt(Vec2::splat(0.5));
        colors[usize::from(far.x != far.y)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use std::sync::Arc;

    fn folder() -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/oracle")
    }

    /// `to_uv` of the gold file: scale (2, 3), turn by 30 degrees, move by (0.3, 0.1).
    fn gold_to_uv() -> Affine2 {
        Affine2::from_translation(Vec2::new(0.3, 0.1)) * Affine2::from_angle(30f32.to_radians()) * Affine2::from_scale(Vec2::new(2.0, 3.0))
    }

    fn gold_texture(entry: &serde_json::Value) -> Texture {
        let xml = entry["xml"].as_str().unwrap();
        let document = roxmltree::Document::parse(xml).unwrap();
        let value = |name: &str| document.descendants().find(|n| n.attribute("name") == Some(name)).and_then(|n| n.attribute("value"));
        let rgb = |name: &str, default: f32| {
            value(name).map_or(Rgb::splat(default), |v| {
                let v: Vec<f32> = v.split(' ').map(|v| v.parse().unwrap()).collect();
                Rgb::new(v[0], v[1], v[2])
            })
        };
        let to_uv = if xml.contains("to_uv") { gold_to_uv() } else { Affine2::IDENTITY };
        if xml.contains("checkerboard") {
            return Texture::Checkerboard(Box::new(Checkerboard {
                color0: Texture::Constant(rgb("color0", 0.4)),
                color1: Texture::Constant(rgb("color1", 0.2)),
                to_uv,
            }));
        }
        let decoding = if value("raw") == Some("true") { Decoding::Raw } else { Decoding::Srgb };
        let texels = Arc::new(Texels::load(&folder().join(value("filename").unwrap()), decoding).unwrap());
        let filter = if value("filter_type") == Some("nearest") { Filter::Nearest } else { Filter::Bilinear };
        let wrap = match value("wrap_mode") {
            Some("mirror") => Wrap::Mirror,
            Some("clamp") => Wrap::Clamp,
            _ => Wrap::Repeat,
        };
        Texture::Bitmap(Box::new(Bitmap { texels, filter, wrap, to_uv }))
    }

    #[test]
    fn values_agree_with_mitsuba() {
        let gold: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(folder().join("texture_values.json")).unwrap()).unwrap();
        let mut compared = 0;
        for entry in gold["textures"].as_array().unwrap() {
            let texture = gold_texture(entry);
            for value in entry["values"].as_array().unwrap() {
                let number = |v: &serde_json::Value| v.as_f64().unwrap() as f32;
                let uv = Vec2::new(number(&value["uv"][0]), number(&value["uv"][1]));
                let ours = texture.eval(uv);
                for c in 0..3 {
                    let theirs = number(&value["value"][c]);
                    assert!((ours[c] - theirs).abs() < 1e-5, "{} at {uv}: {ours:?}, Mitsuba {}", entry["name"], value["value"]);
                }
                // Mitsuba has no scalar for a coloured checkerboard.
                if let Some(theirs) = value["scalar"].as_f64() {
                    let ours = texture.eval_1(uv);
                    assert!((ours - theirs as f32).abs() < 1e-5, "{} at {uv}: scalar {ours}, Mitsuba {theirs}", entry["name"]);
                }
                compared += 1;
            }
        }
        assert!(compared > 100);
    }

    #[test]
    fn a_missing_or_damaged_file_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let missing = Texels::load(&folder.path().join("missing.png"), Decoding::Srgb).unwrap_err();
        assert!(matches!(missing, TextureError::Read { .. }) && missing.to_string().contains("missing.png"), "{missing}");
        let missing = Texels::load(&folder.path().join("missing.exr"), Decoding::Srgb).unwrap_err();
        assert!(matches!(missing, TextureError::Read { .. }) && missing.to_string().contains("missing.exr"), "{missing}");
        for name in ["damaged.png", "damaged.jpg", "damaged.exr"] {
            let path = folder.path().join(name);
            std::fs::write(&path, b"not an image").unwrap();
            let error = Texels::load(&path, Decoding::Srgb).unwrap_err();
            assert!(!matches!(error, TextureError::Read { .. }) && error.to_string().contains(name), "{error}");
        }
    }

    #[test]
    fn sixteen_bits_are_read_and_ranges_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep.png");
        image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2, 1, vec![0u16, 32768]).unwrap().save(&path).unwrap();
        let texels = Texels::load(&path, Decoding::Raw).unwrap();
        assert_eq!(texels.size(), [2, 1]);
        let (low, high) = texels.range();
        assert_eq!(low, 0.0);
        assert!((high - 32768.0 / 65535.0).abs() < 1e-6);
        assert!((texels.mean().g() - 0.5 * high).abs() < 1e-6);
    }

    #[test]
    fn far_away_coordinates_are_harmless() {
        let texels = Arc::new(Texels::from_linear([2, 2], vec![Rgb::WHITE; 4]));
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for filter in [Filter::Bilinear, Filter::Nearest] {
                let b = Bitmap { texels: texels.clone(), filter, wrap, to_uv: Affine2::IDENTITY };
                for v in [1e30, -1e30, f32::MAX, f32::MIN, 1e-38] {
                    let value = b.eval(Vec2::splat(v));
                    assert!(value.r() == 1.0 || !value.is_finite(), "{value:?}");
                }
            }
        }
    }
}
