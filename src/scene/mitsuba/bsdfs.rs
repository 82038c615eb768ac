//! Materials.

use super::build::{Builder, Table, constructor};
use super::error::{Result, SceneError, excerpt, suggest};
use super::plugin::{Given, Kind, Plugin, PluginId, Value};
use super::textures::Role;
use crate::math::Rgb;
use crate::scene::BsdfId;
use crate::scene::bsdf::microfacet::{MIN_ALPHA, Microfacet, MicrofacetKind, NormalSampling};
use crate::scene::bsdf::{
    Bsdf, blend, conductor, dielectric, diffuse, ior, mask, phong, plastic, roughconductor, roughdielectric, roughplastic,
};
use crate::scene::bsdf::{thindielectric, twosided};
use crate::scene::texture::Texture;

/// Every material. Adding one is its constructor and one line here.
pub(super) const TABLE: Table<Bsdf> = &[
    ("diffuse", diffuse),
    ("twosided", twosided),
    ("dielectric", dielectric),
    ("thindielectric", thindielectric),
    ("conductor", conductor),
    ("roughconductor", roughconductor),
    ("roughdielectric", roughdielectric),
    ("plastic", plastic),
    ("roughplastic", roughplastic),
    ("blendbsdf", blendbsdf),
    ("mask", mask),
    ("phong", phong),
];

/// Nested materials are evaluated one by one: more than this is a mistake, or an attack by references that double at every level.
const MOST_NESTED: usize = 1024;

impl Builder<'_> {
    /// The material that a plugin describes.
    pub(super) fn bsdf(&mut self, id: PluginId) -> Result<Bsdf> {
        if let Some(built) = self.built_bsdfs.get(&id) {
            return Ok(built.clone());
        }
        let plugin = self.plugin(id);
        let construct = constructor(TABLE, plugin)?;
        let bsdf = construct(self, plugin)?;
        self.finish(plugin, &[])?;
        if nested_count(&bsdf) > MOST_NESTED {
            return Err(SceneError::new(&plugin.position, format!("the {} nests more than {MOST_NESTED} materials", plugin.title())));
        }
        self.built_bsdfs.insert(id, bsdf.clone());
        Ok(bsdf)
    }

    /// The number of a material among those of the scene, which it joins when it is first used.
    pub(super) fn bsdf_number(&mut self, id: PluginId) -> Result<BsdfId> {
        if let Some(number) = self.bsdf_numbers.get(&id) {
            return Ok(*number);
        }
        let bsdf = self.bsdf(id)?;
        let number = self.push_bsdf(bsdf);
        self.bsdf_numbers.insert(id, number);
        Ok(number)
    }

    /// The material of a shape that names none: black if it shines, else a diffuse grey of .5.
    pub(super) fn unnamed_bsdf(&mut self, shines: bool) -> BsdfId {
        if let Some(number) = self.unnamed[usize::from(shines)] {
            return number;
        }
        let reflectance = Texture::grey(if shines { 0.0 } else { 0.5 });
        let number = self.push_bsdf(Bsdf::Diffuse(diffuse::Diffuse { reflectance }));
        self.unnamed[usize::from(shines)] = Some(number);
        number
    }

    fn push_bsdf(&mut self, bsdf: Bsdf) -> BsdfId {
        self.bsdfs.push(bsdf);
        BsdfId((self.bsdfs.len() - 1) as u32)
    }

    /// The materials nested in a plugin, in the order written.
    fn nested(&mut self, plugin: &Plugin, counts: std::ops::RangeInclusive<usize>) -> Result<Vec<Bsdf>> {
        let children = plugin.children_of(Kind::Bsdf, &self.tree.plugins);
        if !counts.contains(&children.len()) {
            let wanted =
                if counts.start() == counts.end() { counts.start().to_string() } else { format!("{} or {}", counts.start(), counts.end()) };
            let message = format!("a {} nests {wanted} bsdf, this one {}", plugin.title(), children.len());
            return Err(SceneError::new(children.get(*counts.end()).map_or(&plugin.position, |c| &c.position), message));
        }
        children.into_iter().map(|child| self.bsdf(child.target)).collect()
    }
}

fn nested_count(bsdf: &Bsdf) -> usize {
    1 + match bsdf {
        Bsdf::TwoSided(b) => nested_count(&b.front) + b.back.as_ref().map_or(0, |back| nested_count(back)),
        Bsdf::Blend(b) => nested_count(&b.first) + nested_count(&b.second),
        Bsdf::Mask(b) => nested_count(&b.nested),
        _ => 0,
    }
}

// ---- constructors ----------------------------------------------------------------------------------------------------------------

fn diffuse(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Bsdf> {
    Ok(Bsdf::Diffuse(diffuse::Diffuse { reflectance: builder.colour_or_texture(plugin, "reflectance", 0.5, Role::Share)? }))
}

fn twosided(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Bsdf> {
    let mut nested = builder.nested(plugin, 1..=2)?;
    if let Some(number) = nested.iter().position(Bsdf::transmissive) {
        let child = plugin.children_of(Kind::Bsdf, &builder.tree.plugins)[number];
        let message = format!("a {} lets light through and cannot be twosided", builder.plugin(child.target).title());
        return Err(SceneError::new(&child.position, message).help("it has two sides already: use it without twosided"));
    }
    let back = (nested.len() == 2).then(|| nested.pop()).flatten().map(Box::new);
    match nested.pop() {
        Some(front) => Ok(Bsdf::TwoSided(twosided::TwoSided { front: Box::new(front), back })),
        None => Err(plugin.missing("front", "bsdf")),
    }
}

fn dielectric(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Bsdf> {
    let eta = relative_ior(plugin, "bk7")?.value;
    let (specular_reflectance, specular_transmittance) = factors(builder, plugin)?;
    Ok(Bsdf::Dielectric(dielectric::Dielectric { eta, specular_reflectance, specular_transmittance }))
}

fn thindielectric(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Bsdf> {
    let eta = relative_ior(plugin, "bk7")?.value;
    let (specular_reflectance, specular_transmittance) = factors(builder, plugin)?;
    Ok(Bsdf::ThinDielectric(thindielectric::ThinDielectric { eta, specular_reflectance, specular_transmittance }))
}

fn roughdielectric(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Bsdf> {
    let distribution = microfacet(builder, plugin, Anisotropy::Allowed)?;
    let eta = relative_ior(plugin, "bk7")?
        .check("int_ior / ext_ior", |eta| *eta != 1.0, "other than 1: such a surface would not be there")?
        .value;
    let (specular_reflectance, specular_transmittance) = factors(builder, plugin)?;
    Ok(Bsdf::RoughDielectric(roughdielectric::RoughDielectric { distribution, eta, specular_reflectance, specular_transmittance }))
}

fn conductor(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Bsdf> {
    let (eta, k) = complex_ior(builder, plugin)?;
    let specular_reflectance = builder.colour_or_texture(plugin, "specular_reflectance", 1.0, Role::Share)?;
    Ok(Bsdf::Conductor(conductor::Conductor { eta, k, specular_reflectance }))
}

fn roughconductor(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Bsdf> {
    let distribution = microfacet(builder, plugin, Anisotropy::Allowed)?;
    let (eta, k) = complex_ior(builder, plugin)?;
    let specular_reflectance = builder.colour_or_texture(plugin, "specular_reflectance", 1.0, Role::Share)?;
    Ok(Bsdf::RoughConductor(roughconductor::RoughConductor { distribution, eta, k, specular_reflectance }))
}

fn plastic(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Bsdf> {
    let eta = relative_ior(plugin, "polypropylene")?.value;
    let (diffuse, specular) = base_and_coat(builder, plugin, 0.5, 1.0)?;
    Ok(Bsdf::Plastic(plastic::Plastic::new(eta, diffuse, specular, plugin.boolean("nonlinear", false)?)))
}

fn roughplastic(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Bsdf> {
    let distribution = microfacet(builder, plugin, Anisotropy::None)?;
    let eta = relative_ior(plugin, "polypropylene")?
        .check("int_ior / ext_ior", |eta| *eta != 1.0, "other than 1: such a coat would not be there")?
        .value;
    let (diffuse, specular) = base_and_coat(builder, plugin, 0.5, 1.0)?;
    let nonlinear = plugin.boolean("nonlinear", false)?;
    Ok(Bsdf::RoughPlastic(Box::new(roughplastic::RoughPlastic::new(distribution, eta, diffuse, specular, nonlinear))))
}

fn blendbsdf(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Bsdf> {
    if !plugin.has("weight") {
        return Err(plugin.missing("weight", "float> or <texture"));
    }
    let weight = builder.colour_or_texture(plugin, "weight", 0.5, Role::Share)?;
    let mut nested = builder.nested(plugin, 2..=2)?.into_iter();
    match (nested.next(), nested.next()) {
        (Some(first), Some(second)) => Ok(Bsdf::Blend(blend::Blend { weight, first: Box::new(first), second: Box::new(second) })),
        _ => Err(plugin.missing("second", "bsdf")),
    }
}

fn mask(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Bsdf> {
    let opacity = builder.colour_or_texture(plugin, "opacity", 0.5, Role::Share)?;
    match builder.nested(plugin, 1..=1)?.pop() {
        Some(nested) => Ok(Bsdf::Mask(mask::Mask { opacity, nested: Box::new(nested) })),
        None => Err(plugin.missing("nested", "bsdf")),
    }
}

/// The thesis's energy-conserving model with the defaults of Mitsuba 0.6's plugin of this name; Mitsuba 3 has none.
fn phong(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Bsdf> {
    let (diffuse_reflectance, specular_reflectance) = base_and_coat(builder, plugin, 0.5, 0.2)?;
    let exponent = plugin.float("exponent", 30.0)?.check("exponent", |n| *n >= 0.0, "zero or positive")?.value as f32;
    let total = match (&diffuse_reflectance, &specular_reflectance) {
        (Texture::Constant(d), Texture::Constant(s)) => (*d + *s).max_component(),
        (d, s) => d.range().1 + s.range().1,
    };
    // A hair above one is rounding of decimal fractions, not a gain.
    if total > 1.0 + 1e-6 {
        let message = format!("diffuse_reflectance + specular_reflectance reaches {total}");
        return Err(SceneError::new(&plugin.position, message).help("their sum must be at most 1, or the surface would create light"));
    }
    builder.note(&plugin.position, "phong is not a plugin of Mitsuba 3, which will refuse this scene");
    Ok(Bsdf::Phong(phong::Phong { diffuse_reflectance, specular_reflectance, exponent }))
}

// ---- parameters that several share -----------------------------------------------------------------------------------------------

fn factors(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<(Texture, Texture)> {
    let reflectance = builder.colour_or_texture(plugin, "specular_reflectance", 1.0, Role::Share)?;
    Ok((reflectance, builder.colour_or_texture(plugin, "specular_transmittance", 1.0, Role::Share)?))
}

fn base_and_coat(builder: &mut Builder<'_>, plugin: &Plugin, diffuse: f32, specular: f32) -> Result<(Texture, Texture)> {
    let base = builder.colour_or_texture(plugin, "diffuse_reflectance", diffuse, Role::Share)?;
    Ok((base, builder.colour_or_texture(plugin, "specular_reflectance", specular, Role::Share)?))
}

/// `int_ior / ext_ior`, each a number or the name of a medium; outside is air unless given.
fn relative_ior(plugin: &Plugin, inside: &str) -> Result<Given<f32>> {
    let inside = index(plugin, "int_ior", inside)?;
    let outside = index(plugin, "ext_ior", "air")?;
    let eta = inside.value / outside.value;
    Given { value: eta as f32, position: inside.position }.check(
        "int_ior / ext_ior",
        |eta| eta.is_normal(),
        "a number that single precision can hold",
    )
}

fn index(plugin: &Plugin, name: &'static str, default: &str) -> Result<Given<f64>> {
    let named = |word: &str| ior::dielectric(&word.to_lowercase()).map(f64::from);
    let Some(property) = plugin.property(name) else {
        // The table holds every default; a missing one would show as an index that no medium has.
        return Ok(Given { value: named(default).unwrap_or(f64::NAN), position: plugin.position.clone() });
    };
    let position = property.value_position.clone();
    let value = match &property.value {
        Value::Float(v) => *v,
        Value::Integer(v) => *v as f64,
        Value::String(word) => named(word).ok_or_else(|| {
            let names: Vec<&str> = ior::DIELECTRICS.iter().map(|(name, _)| *name).collect();
            SceneError::new(&position, format!("no medium is called \"{}\"", excerpt(word))).help(suggest(&word.to_lowercase(), &names))
        })?,
        _ => return Err(property.mismatch("float or string")),
    };
    Given { value, position }.check(name, |v| *v > 0.0, "positive")
}

/// `eta` and `k` of a metal: by `material`, or each as a colour; without any, a perfect mirror.
fn complex_ior(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<(Rgb, Rgb)> {
    let material = plugin.string_if_given("material")?;
    let numbers = plugin.has("eta") || plugin.has("k");
    let eta = builder.colour(plugin, "eta", 0.0, Role::Index)?;
    let k = builder.colour(plugin, "k", 1.0, Role::Index)?;
    match material {
        None => Ok((eta, k)),
        Some(material) if numbers => {
            Err(SceneError::new(&material.position, "both \"material\" and \"eta\" or \"k\" are given").help("give one of the two"))
        }
        Some(material) => ior::conductor(&material.value).ok_or_else(|| {
            let names: Vec<&str> = ior::CONDUCTORS.iter().map(|(name, _, _)| *name).collect();
            SceneError::new(&material.position, format!("no metal is called \"{}\"", excerpt(&material.value)))
                .help(suggest(&material.value, &names))
        }),
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Anisotropy {
    Allowed,
    None,
}

fn microfacet(builder: &mut Builder<'_>, plugin: &Plugin, anisotropy: Anisotropy) -> Result<Microfacet> {
    let kinds = [("beckmann", MicrofacetKind::Beckmann), ("ggx", MicrofacetKind::Ggx)];
    let kind = plugin.choice("distribution", &kinds, MicrofacetKind::Beckmann)?;
    let sampling = if plugin.boolean("sample_visible", true)? { NormalSampling::Visible } else { NormalSampling::All };
    let alpha = plugin.float_if_given("alpha")?;
    let both = match anisotropy {
        Anisotropy::Allowed => [plugin.float_if_given("alpha_u")?, plugin.float_if_given("alpha_v")?],
        Anisotropy::None => [None, None],
    };
    let (u, v) = match (alpha, both) {
        (Some(alpha), [None, None]) => (alpha.clone(), alpha),
        (None, [Some(u), Some(v)]) => (u, v),
        (None, [None, None]) => return Ok(Microfacet { kind, alpha_u: 0.1, alpha_v: 0.1, sampling }),
        (Some(alpha), _) => {
            return Err(
                SceneError::new(&alpha.position, "both \"alpha\" and \"alpha_u\", \"alpha_v\" are given").help("give one of the two")
            );
        }
        (None, [Some(only), None] | [None, Some(only)]) => {
            return Err(
                SceneError::new(&only.position, "\"alpha_u\" and \"alpha_v\" must both be given").help("or give \"alpha\" for both")
            );
        }
    };
    let mut raise = |alpha: Given<f64>, name: &str| -> Result<f32> {
        let alpha = alpha.check(name, |a| *a > 0.0, "positive; for a smooth surface use the smooth material")?;
        let single = alpha.value as f32;
        if single < MIN_ALPHA {
            builder.note(&alpha.position, format!("\"{name}\" {} is raised to {MIN_ALPHA}, as in Mitsuba", alpha.value));
        }
        Ok(single.max(MIN_ALPHA))
    };
    Ok(Microfacet { kind, alpha_u: raise(u, "alpha")?, alpha_v: raise(v, "alpha")?, sampling })
}
