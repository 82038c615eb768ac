//! Against Mitsuba 3.9.1: `tests/oracle/bsdf_values.json`.

use super::support::*;
use crate::math::Rgb;
use crate::samplers::Stream;
use crate::scene::bsdf::{Bsdf, Lobes, Mode, fresnel};
use glam::{Vec2, Vec3};
use serde_json::Value;

fn number(v: &Value) -> f32 {
    v.as_f64().unwrap() as f32
}

fn vec3(v: &Value) -> Vec3 {
    Vec3::new(number(&v[0]), number(&v[1]), number(&v[2]))
}

fn vec2(v: &Value) -> Vec2 {
    Vec2::new(number(&v[0]), number(&v[1]))
}

fn mode(v: &Value) -> Mode {
    if v["mode"] == "importance" { Mode::Importance } else { Mode::Radiance }
}

/// Largest difference over a scale that does not vanish.
fn difference(a: Rgb, b: Rgb) -> f32 {
    (0..3).map(|c| (a[c] - b[c]).abs() / b[c].abs().max(1e-4)).fold(0.0, f32::max)
}

/// Where Mitsuba's density is not that of its samples, by how much: it uses the rational shadowing fit for Beckmann's visible normals.
fn pdf_tolerance(name: &str, xml: &str) -> f32 {
    let rough = name.contains("rough");
    if rough && !xml.contains("ggx") && !xml.contains(r#"sample_visible" value="false"#) { 4e-3 } else { 1e-4 }
}

/// Narrow lobes magnify the rounding of the half vector, here and there.
fn value_tolerance(name: &str) -> f32 {
    if name.contains("smooth") || name.contains("0.05") || name.contains("aniso") { 1e-3 } else { 1e-4 }
}

#[test]
fn values_and_densities_agree_with_mitsuba() {
    let mut failures = Vec::new();
    for entry in gold()["bsdfs"].as_array().unwrap() {
        let (name, xml) = (entry["name"].as_str().unwrap(), entry["xml"].as_str().unwrap());
        let b = parse(xml);
        let mut worst = [0.0f32; 2];
        for e in entry["evals"].as_array().unwrap() {
            let (given, sampled) = (vec3(&e["wi"]), vec3(&e["wo"]));
            let (f, pdf) = b.eval_pdf(vec2(&e["uv"]), given, sampled, mode(e), Lobes::All);
            let value = difference(f * sampled.z.abs(), Rgb::from(vec3(&e["value"]).to_array()));
            let theirs = number(&e["pdf"]);
            let density = (pdf - theirs).abs() / theirs.max(1e-4);
            worst = [worst[0].max(value), worst[1].max(density)];
        }
        if worst[0] > value_tolerance(name) || worst[1] > pdf_tolerance(name, xml).max(value_tolerance(name)) {
            failures.push(format!("{name}: value {:.1e}, density {:.1e}", worst[0], worst[1]));
        }
        println!("{name}: value {:.1e}, density {:.1e}", worst[0], worst[1]);
    }
    assert!(failures.is_empty(), "relative differences:\n{}", failures.join("\n"));
}

/// The delta sample in Mitsuba's direction, whichever number leads to it.
fn delta_sample(b: &Bsdf, e: &Value) -> Option<crate::scene::bsdf::BsdfSample> {
    let mut s = stream(0);
    (0..200)
        .filter_map(|i| b.sample(vec2(&e["uv"]), vec3(&e["wi"]), mode(e), Lobes::All, (i as f32 + 0.5) / 200.0, pair(&mut s)))
        .find(|x| x.delta && x.w.distance(vec3(&e["wo"])) < 1e-3)
}

#[test]
fn samples_agree_with_mitsuba() {
    let mut failures = Vec::new();
    let mut deltas = 0;
    for entry in gold()["bsdfs"].as_array().unwrap() {
        let (name, xml) = (entry["name"].as_str().unwrap(), entry["xml"].as_str().unwrap());
        // Mitsuba adds a delta's probability to the other material's density per steradian, which cannot be right.
        if name == "blendbsdf-delta" {
            continue;
        }
        let b = parse(xml);
        for e in entry["samples"].as_array().unwrap().iter().filter(|e| e["valid"] == true) {
            let weight = Rgb::from(vec3(&e["weight"]).to_array());
            let (given, wo, uv, pdf) = (vec3(&e["wi"]), vec3(&e["wo"]), vec2(&e["uv"]), number(&e["pdf"]));
            if e["discrete"] == true || e["null"] == true {
                deltas += 1;
                let Some(x) = delta_sample(&b, e) else {
                    // A lobe of less than one in two hundred may be missed.
                    if pdf > 0.01 {
                        failures.push(format!("{name}: no such delta: {e}"));
                    }
                    continue;
                };
                if difference(x.weight, weight) > 2e-4 || (x.pdf_fwd - pdf).abs() > 1e-4 || (x.eta - number(&e["eta"])).abs() > 1e-5 {
                    failures.push(format!("{name}: {x:?}, Mitsuba {e}"));
                }
            } else {
                let (f, density) = b.eval_pdf(uv, given, wo, mode(e), Lobes::All);
                let value = difference(f * wo.z.abs(), weight * pdf);
                let density = (density - pdf).abs() / pdf;
                // Sampled directions come rounded, which steep lobes magnify.
                // Mitsuba's weights for all normals of rough glass are not its value over its density: its estimator, not its material.
                let value = if name.starts_with("roughdielectric") && name.ends_with("-all") { 0.0 } else { value };
                if value > 2e-3 + 10.0 * value_tolerance(name) || density > pdf_tolerance(name, xml) + 10.0 * value_tolerance(name) {
                    failures.push(format!("{name}: f cos differs by {value:.1e}, density by {density:.1e}: {e}"));
                }
            }
        }
    }
    assert!(deltas > 100);
    let _ = stream(0).next_1d();
    assert!(failures.is_empty(), "{} differ:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn fresnel_agrees_with_mitsuba() {
    let gold = gold();
    for row in gold["fresnel"].as_array().unwrap() {
        for (cos, f) in row["cos"].as_array().unwrap().iter().zip(row["f"].as_array().unwrap()) {
            let ours = fresnel::dielectric(number(cos), number(&row["eta"])).reflectance;
            assert!((ours - number(f)).abs() < 1e-5, "eta {} cos {cos}: {ours}, Mitsuba {f}", row["eta"]);
        }
    }
    for row in gold["fresnel_diffuse_reflectance"].as_array().unwrap() {
        let ours = fresnel::diffuse_reflectance(number(&row["eta"]));
        assert!((ours - number(&row["value"])).abs() < 1e-5, "{row}: {ours}");
    }
}
