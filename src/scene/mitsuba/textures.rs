//! Colours and textures.

use super::build::{Builder, Table, constructor, degenerate};
use super::error::{Position, Result, SceneError};
use super::files::resolve;
use super::plugin::{Given, Kind, Plugin, PluginId, Property, Value};
use crate::math::Rgb;
use crate::scene::texture::{Bitmap, Checkerboard, Decoding, Filter, Texels, Texture, Wrap};
use glam::{Affine2, DMat4, Mat2, Vec2};
use std::path::PathBuf;
use std::sync::Arc;

/// Every texture. Adding one is its constructor and one line here.
pub(super) const TABLE: Table<Texture> = &[("bitmap", bitmap), ("checkerboard", checkerboard)];

/// What a colour is for: which values make sense, and what a `spectrum` means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// A share of light: every component in [0, 1].
    Share,
    /// Radiance, intensity or irradiance: not negative.
    Emission,
    /// An index of refraction: not negative.
    Index,
}

/// Linear Rec. 709 components of Mitsuba's `<spectrum value="1"/>` on an emitter: the equal-energy spectrum, not white (measured with 3.9.1).
const EQUAL_ENERGY: [f64; 3] = [1.204_794, 0.948_291, 0.908_916];

impl Role {
    fn holds(self, v: f32) -> bool {
        match self {
            Role::Share => (0.0..=1.0).contains(&v),
            Role::Emission | Role::Index => v >= 0.0 && v.is_finite(),
        }
    }

    fn rule(self) -> &'static str {
        match self {
            Role::Share => "in [0, 1]",
            Role::Emission | Role::Index => "zero or positive",
        }
    }
}

impl Builder<'_> {
    /// A parameter that may be a number, a colour or a texture.
    pub(super) fn colour_or_texture(&mut self, plugin: &Plugin, name: &'static str, default: f32, role: Role) -> Result<Texture> {
        if let Some(child) = plugin.child(name) {
            let what = self.plugin(child.target);
            if what.kind != Kind::Texture {
                return Err(SceneError::new(
                    &child.position,
                    format!("\"{name}\" of a {} is a {}, a texture is expected", plugin.title(), what.title()),
                ));
            }
            let texture = self.texture(child.target)?;
            self.check_texture(&texture, name, &child.position, role)?;
            return Ok(texture);
        }
        Ok(Texture::Constant(self.colour(plugin, name, default, role)?))
    }

    /// A parameter that may be a number or a colour.
    pub(super) fn colour(&mut self, plugin: &Plugin, name: &'static str, default: f32, role: Role) -> Result<Rgb> {
        if let Some(child) = plugin.children.iter().find(|c| c.name == name) {
            let message = format!("\"{name}\" of a {} is a {}", plugin.title(), self.plugin(child.target).title());
            return Err(SceneError::new(&child.position, message).help("a constant is supported here: <float> or <rgb>"));
        }
        let Some(property) = plugin.property(name) else { return Ok(Rgb::splat(default)) };
        let rgb = components(property, role)?;
        if !rgb.to_array().into_iter().all(|v| role.holds(v)) {
            let shown = if rgb.r() == rgb.g() && rgb.g() == rgb.b() {
                rgb.r().to_string()
            } else {
                format!("({}, {}, {})", rgb.r(), rgb.g(), rgb.b())
            };
            return Err(SceneError::new(&property.value_position, format!("\"{name}\" is {shown}, it must be {}", role.rule())));
        }
        Ok(rgb)
    }

    fn check_texture(&mut self, texture: &Texture, name: &str, position: &Position, role: Role) -> Result<()> {
        let (low, high) = texture.range();
        if !(low >= 0.0 && high.is_finite()) {
            return Err(SceneError::new(
                position,
                format!("the texture of \"{name}\" holds values from {low} to {high}, they must be {}", role.rule()),
            ));
        }
        if role == Role::Share && high > 1.0 {
            self.note(position, format!("the texture of \"{name}\" reaches {high}: more light than came in, as Mitsuba allows"));
        }
        Ok(())
    }

    /// The texture that a plugin describes.
    pub(super) fn texture(&mut self, id: PluginId) -> Result<Texture> {
        let plugin = self.plugin(id);
        let construct = constructor(TABLE, plugin)?;
        let texture = construct(self, plugin)?;
        self.finish(
            plugin,
            &[("format", "it sets how texels are stored"), ("accel", "it sets how texels are looked up on a graphics card")],
        )?;
        Ok(texture)
    }

    /// An image, read once however often it is used.
    pub(super) fn texels(&mut self, plugin: &Plugin, filename: &Given<String>, decoding: Decoding) -> Result<Arc<Texels>> {
        let path = resolve(&filename.value, &plugin.folders, &filename.position)?;
        let key: (PathBuf, bool) = (path.clone(), decoding == Decoding::Raw);
        if let Some(texels) = self.texels.get(&key) {
            return Ok(texels.clone());
        }
        self.files.read(&path, &filename.position)?;
        let texels = Arc::new(Texels::load(&path, decoding).map_err(|e| SceneError::new(&filename.position, e.to_string()))?);
        self.texels.insert(key, texels.clone());
        Ok(texels)
    }
}

fn components(property: &Property, role: Role) -> Result<Rgb> {
    let values = match property.value {
        Value::Rgb(rgb) => rgb,
        Value::Float(v) => [v; 3],
        Value::Integer(v) => [v as f64; 3],
        Value::Spectrum(v) if role == Role::Emission => EQUAL_ENERGY.map(|e| e * v),
        Value::Spectrum(v) => [v; 3],
        _ => return Err(property.mismatch("float, rgb or texture")),
    };
    Ok(Rgb::from(values.map(|v| v as f32)))
}

fn bitmap(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Texture> {
    let filename = plugin.required_string("filename")?;
    let filter = plugin.choice("filter_type", &[("bilinear", Filter::Bilinear), ("nearest", Filter::Nearest)], Filter::Bilinear)?;
    let wrap = plugin.choice("wrap_mode", &[("repeat", Wrap::Repeat), ("mirror", Wrap::Mirror), ("clamp", Wrap::Clamp)], Wrap::Repeat)?;
    let decoding = if plugin.boolean("raw", false)? { Decoding::Raw } else { Decoding::Srgb };
    let to_uv = to_uv(plugin)?;
    let texels = builder.texels(plugin, &filename, decoding)?;
    Ok(Texture::Bitmap(Box::new(Bitmap { texels, filter, wrap, to_uv })))
}

fn checkerboard(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Texture> {
    // Mitsuba gives the colours no range of their own; whoever uses the texture checks it.
    let color0 = builder.colour_or_texture(plugin, "color0", 0.4, Role::Index)?;
    let color1 = builder.colour_or_texture(plugin, "color1", 0.2, Role::Index)?;
    Ok(Texture::Checkerboard(Box::new(Checkerboard { color0, color1, to_uv: to_uv(plugin)? })))
}

/// The part of `to_uv` that acts on two coordinates: upper left 2 x 2, and the translation in x and y.
fn to_uv(plugin: &Plugin) -> Result<Affine2> {
    let given = plugin.transform("to_uv")?;
    let m: &DMat4 = &given.value;
    let linear = Mat2::from_cols_array(&[m.x_axis.x as f32, m.x_axis.y as f32, m.y_axis.x as f32, m.y_axis.y as f32]);
    let translation = Vec2::new(m.w_axis.x as f32, m.w_axis.y as f32);
    if !(linear.is_finite() && translation.is_finite() && linear.determinant().is_normal()) {
        return Err(degenerate(&given.position, "to_uv"));
    }
    Ok(Affine2::from_mat2_translation(linear, translation))
}
