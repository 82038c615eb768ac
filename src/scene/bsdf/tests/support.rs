//! The materials under test, and the numbers to test them with.

use crate::math::Rgb;
use crate::samplers::{Key, Purpose, Stream, UniformStream};
use crate::scene::bsdf::*;
use crate::scene::texture::{Checkerboard, Texture};
use glam::{Affine2, Vec2, Vec3};
use microfacet::{Microfacet, MicrofacetKind, NormalSampling};
use std::sync::LazyLock;

pub(super) const MODES: [Mode; 2] = [Mode::Radiance, Mode::Importance];

pub(super) fn stream(index: u64) -> UniformStream {
    Key { seed: 7, iteration: 0, index, purpose: Purpose::Test }.stream()
}

pub(super) fn pair(s: &mut UniformStream) -> Vec2 {
    let [x, y] = s.next_2d();
    Vec2::new(x, y)
}

fn number(text: &str) -> f32 {
    text.trim().parse().unwrap()
}

type Node<'a, 'b> = roxmltree::Node<'a, 'b>;

fn child<'a, 'b>(node: Node<'a, 'b>, name: &str) -> Option<Node<'a, 'b>> {
    node.children().find(|n| n.attribute("name") == Some(name))
}

fn texture(node: Node, name: &str, default: f32) -> Texture {
    let Some(n) = child(node, name) else { return Texture::grey(default) };
    if n.tag_name().name() == "texture" {
        let checkerboard = Checkerboard { color0: Texture::grey(0.4), color1: Texture::grey(0.2), to_uv: Affine2::IDENTITY };
        return Texture::Checkerboard(Box::new(checkerboard));
    }
    Texture::Constant(rgb(n))
}

fn rgb(node: Node) -> Rgb {
    let v: Vec<f32> = node.attribute("value").unwrap().split(' ').map(number).collect();
    if let [r, g, b] = v[..] { Rgb::new(r, g, b) } else { Rgb::splat(v[0]) }
}

fn ior(node: Node, name: &str, default: &str) -> f32 {
    let text = child(node, name).map_or(default, |n| n.attribute("value").unwrap());
    super::super::ior::dielectric(text).unwrap_or_else(|| number(text))
}

fn distribution(node: Node) -> Microfacet {
    let text = |name: &str| child(node, name).and_then(|n| n.attribute("value"));
    let alpha = text("alpha").map_or(0.1, number);
    Microfacet {
        kind: if text("distribution") == Some("ggx") { MicrofacetKind::Ggx } else { MicrofacetKind::Beckmann },
        alpha_u: text("alpha_u").map_or(alpha, number),
        alpha_v: text("alpha_v").map_or(alpha, number),
        sampling: if text("sample_visible") == Some("false") { NormalSampling::All } else { NormalSampling::Visible },
    }
}

fn metal(node: Node) -> (Rgb, Rgb) {
    if let Some(name) = child(node, "material") {
        return super::super::ior::conductor(name.attribute("value").unwrap()).unwrap();
    }
    match (child(node, "eta"), child(node, "k")) {
        (Some(eta), Some(k)) => (rgb(eta), rgb(k)),
        _ => (Rgb::BLACK, Rgb::WHITE),
    }
}

/// The material of a Mitsuba `bsdf` element, as far as these tests need it: the loader proper lives elsewhere.
pub(super) fn parse(xml: &str) -> Bsdf {
    build(roxmltree::Document::parse(xml).unwrap().root_element())
}

fn build(node: Node) -> Bsdf {
    let nested: Vec<Box<Bsdf>> = node.children().filter(|n| n.tag_name().name() == "bsdf").map(|n| Box::new(build(n))).collect();
    let mut nested = nested.into_iter();
    let specular_reflectance = texture(node, "specular_reflectance", 1.0);
    let specular_transmittance = texture(node, "specular_transmittance", 1.0);
    let eta = |int: &str| ior(node, "int_ior", int) / ior(node, "ext_ior", "air");
    let nonlinear = child(node, "nonlinear").is_some_and(|n| n.attribute("value") == Some("true"));
    let (metal_eta, k) = metal(node);
    match node.attribute("type").unwrap() {
        "diffuse" => Bsdf::Diffuse(diffuse::Diffuse { reflectance: texture(node, "reflectance", 0.5) }),
        "twosided" => Bsdf::TwoSided(twosided::TwoSided { front: nested.next().unwrap(), back: nested.next() }),
        "dielectric" => Bsdf::Dielectric(dielectric::Dielectric { eta: eta("bk7"), specular_reflectance, specular_transmittance }),
        "thindielectric" => {
            Bsdf::ThinDielectric(thindielectric::ThinDielectric { eta: eta("bk7"), specular_reflectance, specular_transmittance })
        }
        "conductor" => Bsdf::Conductor(conductor::Conductor { eta: metal_eta, k, specular_reflectance }),
        "roughconductor" => Bsdf::RoughConductor(roughconductor::RoughConductor {
            distribution: distribution(node),
            eta: metal_eta,
            k,
            specular_reflectance,
        }),
        "roughdielectric" => Bsdf::RoughDielectric(roughdielectric::RoughDielectric {
            distribution: distribution(node),
            eta: eta("bk7"),
            specular_reflectance,
            specular_transmittance,
        }),
        "plastic" => {
            let base = texture(node, "diffuse_reflectance", 0.5);
            Bsdf::Plastic(plastic::Plastic::new(eta("polypropylene"), base, specular_reflectance, nonlinear))
        }
        "roughplastic" => {
            let base = texture(node, "diffuse_reflectance", 0.5);
            let coat = roughplastic::RoughPlastic::new(distribution(node), eta("polypropylene"), base, specular_reflectance, nonlinear);
            Bsdf::RoughPlastic(Box::new(coat))
        }
        "blendbsdf" => Bsdf::Blend(blend::Blend {
            weight: texture(node, "weight", 0.5),
            first: nested.next().unwrap(),
            second: nested.next().unwrap(),
        }),
        "mask" => Bsdf::Mask(mask::Mask { opacity: texture(node, "opacity", 0.5), nested: nested.next().unwrap() }),
        other => panic!("{other}"),
    }
}

pub(super) fn phong(diffuse: f32, specular: f32, exponent: f32) -> Bsdf {
    let (diffuse_reflectance, specular_reflectance) = (Texture::grey(diffuse), Texture::Constant(Rgb::new(specular, 0.8 * specular, 0.1)));
    Bsdf::Phong(phong::Phong { diffuse_reflectance, specular_reflectance, exponent })
}

/// Every material, several sets of parameters each, lobes wide enough for a histogram.
pub(super) fn materials() -> &'static [(String, Bsdf)] {
    static LIST: LazyLock<Vec<(String, Bsdf)>> = LazyLock::new(list);
    &LIST
}

fn list() -> Vec<(String, Bsdf)> {
    let mut list: Vec<(String, Bsdf)> = gold()["bsdfs"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|e| !e["name"].as_str().unwrap().contains("-0.1-") || e["name"].as_str().unwrap().contains("nonlinear"))
        .map(|e| (e["name"].as_str().unwrap().to_owned(), parse(e["xml"].as_str().unwrap())))
        .collect();
    for (diffuse, specular, exponent) in [(0.4, 0.6, 20.0), (0.0, 1.0, 0.0), (0.2, 0.5, 150.0), (0.7, 0.0, 5.0)] {
        list.push((format!("phong {diffuse} {specular} {exponent}"), phong(diffuse, specular, exponent)));
    }
    let nested = |weight, first: Bsdf, second: Bsdf| {
        Bsdf::Blend(blend::Blend { weight: Texture::grey(weight), first: Box::new(first), second: Box::new(second) })
    };
    let glass = r#"<bsdf type="roughdielectric"><float name="alpha" value="0.4"/></bsdf>"#;
    let plastic = r#"<bsdf type="plastic"><float name="int_ior" value="1.8"/></bsdf>"#;
    list.push(("blend plastic and phong".into(), nested(0.4, parse(plastic), phong(0.2, 0.5, 30.0))));
    list.push(("blend glasses".into(), nested(0.6, parse(glass), parse(r#"<bsdf type="dielectric"/>"#))));
    let mask = |opacity, b| Bsdf::Mask(mask::Mask { opacity: Texture::grey(opacity), nested: Box::new(b) });
    list.push(("mask over blend".into(), mask(0.7, nested(0.5, parse(glass), parse(plastic)))));
    list.push(("opaque mask".into(), mask(1.0, parse(plastic))));
    list.push(("all hole".into(), mask(0.0, parse(plastic))));
    list
}

pub(super) fn gold() -> serde_json::Value {
    serde_json::from_str(include_str!("../../../../tests/oracle/bsdf_values.json")).unwrap()
}

/// Directions from normal to grazing incidence, on both sides.
pub(super) fn given_directions() -> Vec<Vec3> {
    [(8.0f32, 0.4f32), (40.0, 1.9), (70.0, 4.0), (86.0, 0.2), (130.0, 2.5), (165.0, 5.0)]
        .map(|(theta, phi)| {
            let (sin, cos) = theta.to_radians().sin_cos();
            Vec3::new(sin * phi.cos(), sin * phi.sin(), cos)
        })
        .to_vec()
}

pub(super) const FILTERS: [Lobes; 6] =
    [Lobes::All, Lobes::Rough(0.0), Lobes::Rough(0.35), Lobes::Smooth(0.0), Lobes::Smooth(0.35), Lobes::Smooth(2.0)];
