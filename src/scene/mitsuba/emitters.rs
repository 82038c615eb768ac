//! Emitters that are no shapes, and the radiance of shapes that shine.

use super::build::{Builder, Table, to_world, unsupported};
use super::error::{Result, SceneError};
use super::plugin::{Plugin, PluginId};
use super::textures::Role;
use crate::math::Rgb;
use crate::scene::emitter::{Constant, Directional, Emitter, EmitterError, Envmap, Point, Spot};
use crate::scene::texture::{Bitmap, Decoding, Filter, Texture, Wrap};
use glam::{Affine2, DVec3, Vec2, Vec3};

/// Emitters that stand in the scene. Adding one is its constructor and one line here, and one in [`NAMES`].
const TABLE: Table<Emitter> = &[("point", point), ("spot", spot), ("directional", directional), ("constant", constant), ("envmap", envmap)];

/// Every emitter; `area` stands in a shape.
pub(super) const NAMES: &[&str] = &["area", "point", "spot", "directional", "constant", "envmap"];

/// What every emitter may say without effect on the image.
const NOTED: &[(&str, &str)] =
    &[("sampling_weight", "emitters are chosen by power, which changes noise only"), ("mis_compensation", "it changes noise only")];

impl Builder<'_> {
    /// An emitter of the scene.
    pub(super) fn emitter(&mut self, plugin: &Plugin) -> Result<()> {
        if plugin.type_name == "area" {
            return Err(SceneError::new(&plugin.position, "an area emitter outside a shape").help("nest it in the shape that shines"));
        }
        let Some((_, construct)) = TABLE.iter().find(|(name, _)| *name == plugin.type_name) else { return Err(unsupported(plugin, NAMES)) };
        let emitter = construct(self, plugin)?;
        self.finish(plugin, NOTED)?;
        if matches!(emitter, Emitter::Constant(_) | Emitter::Envmap(_))
            && let Some(first) = self.environment.replace(plugin.position.clone())
        {
            let error = SceneError::new(&plugin.position, "a second emitter around the scene");
            return Err(error.help(format!("keep one constant or envmap; the first is at {first}")));
        }
        self.emitters.push(emitter);
        Ok(())
    }

    /// Radiance of the emitter nested in a shape.
    pub(super) fn radiance(&mut self, id: PluginId) -> Result<Texture> {
        let plugin = self.plugin(id);
        if plugin.type_name != "area" {
            if NAMES.contains(&plugin.type_name.as_str()) {
                let message = format!("a {} inside a shape", plugin.title());
                return Err(
                    SceneError::new(&plugin.position, message).help("only an area emitter belongs there; put this one into the scene")
                );
            }
            return Err(unsupported(plugin, NAMES));
        }
        let radiance = self.colour_or_texture(plugin, "radiance", 1.0, Role::Emission)?;
        self.finish(plugin, NOTED)?;
        Ok(radiance)
    }
}

fn rejected(plugin: &Plugin, e: &EmitterError) -> SceneError {
    SceneError::new(&plugin.position, e.to_string())
}

fn either(plugin: &Plugin, name: &'static str) -> Result<()> {
    if plugin.has(name) && plugin.has("to_world") {
        return Err(
            SceneError::new(plugin.place("to_world"), format!("both \"{name}\" and \"to_world\" are given")).help("give one of the two")
        );
    }
    Ok(())
}

fn single(v: DVec3) -> Vec3 {
    v.as_vec3()
}

fn point(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Emitter> {
    either(plugin, "position")?;
    let moved = to_world(plugin)?;
    let position = plugin.vector_if_given("position")?.map_or_else(|| Vec3::from(moved.translation), |p| single(p.value));
    Ok(Emitter::Point(Point { position, intensity: builder.colour(plugin, "intensity", 1.0, Role::Emission)? }))
}

fn spot(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Emitter> {
    let intensity = builder.colour(plugin, "intensity", 1.0, Role::Emission)?;
    let cutoff = plugin.float("cutoff_angle", 20.0)?.check("cutoff_angle", |a| *a > 0.0 && *a <= 180.0, "in (0, 180] degrees")?.value;
    let beam = plugin.float("beam_width", cutoff * 0.75)?;
    let beam = beam.check("beam_width", |a| *a >= 0.0 && *a <= cutoff, &format!("between 0 and cutoff_angle, {cutoff} degrees"))?.value;
    Spot::new(to_world(plugin)?, intensity, cutoff as f32, beam as f32).map(Emitter::Spot).map_err(|e| rejected(plugin, &e))
}

fn directional(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Emitter> {
    either(plugin, "direction")?;
    let turned = to_world(plugin)?;
    let given = plugin.vector_if_given("direction")?;
    let direction = match given {
        Some(d) => single(d.check("direction", |d| *d != DVec3::ZERO, "other than zero")?.value.normalize_or_zero()),
        None => Vec3::from(turned.matrix3.z_axis),
    };
    let irradiance = builder.colour(plugin, "irradiance", 1.0, Role::Emission)?;
    Directional::new(direction, irradiance).map(Emitter::Directional).map_err(|e| rejected(plugin, &e))
}

fn constant(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Emitter> {
    Ok(Emitter::Constant(Constant { radiance: builder.colour(plugin, "radiance", 1.0, Role::Emission)? }))
}

fn envmap(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Emitter> {
    let filename = plugin.required_string("filename")?;
    let scale = plugin.float("scale", 1.0)?.check("scale", |s| *s >= 0.0, "zero or positive")?.value as f32;
    let to_world = to_world(plugin)?;
    let texels = builder.texels(plugin, &filename, Decoding::Srgb)?;
    let [width, height] = texels.size();
    // The texels as they are: the nearest one at each texel's centre.
    let image = Texture::Bitmap(Box::new(Bitmap { texels, filter: Filter::Nearest, wrap: Wrap::Clamp, to_uv: Affine2::IDENTITY }));
    let centre = |i: usize, size: usize| ((i as f64 + 0.5) / size as f64) as f32;
    let row = |y: usize| (0..width).map(move |x| Vec2::new(centre(x, width), centre(y, height)));
    let pixels: Vec<Rgb> = (0..height).flat_map(row).map(|uv| image.eval(uv)).collect();
    let envmap = Envmap::new(width, height, pixels, scale, to_world);
    envmap.map(Emitter::Envmap).map_err(|e| SceneError::new(&filename.position, format!("{}: {e}", filename.value)))
}
