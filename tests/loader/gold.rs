//! Scenes as Mitsuba reads them: the XML that its values were measured from, loaded here, gives the same values.

use super::{SENSOR, load_files};
use glam::{Affine2, Vec2, Vec3};
use isophote::math::Rgb;
use isophote::scene::Scene;
use isophote::scene::bsdf::diffuse::Diffuse;
use isophote::scene::bsdf::{Bsdf, Lobes};
use isophote::scene::emitter::EmitterKind;
use isophote::scene::mitsuba::{LoadOptions, LoadedParts};
use isophote::scene::ray::Ray;
use isophote::scene::texture::{Checkerboard, Texture};
use serde_json::Value;

fn entries(file: &str, list: &str) -> Vec<Value> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/oracle").join(file);
    // JSON has neither infinity nor NaN; the distance to the sky is not compared here.
    let content = std::fs::read_to_string(path).unwrap().replace("Infinity", "null").replace("NaN", "null");
    let document: Value = serde_json::from_str(&content).unwrap();
    document[list].as_array().unwrap().clone()
}

/// Loads a scene of these objects; the images they name lie beside the values.
fn load(body: &str) -> LoadedParts {
    let data = format!("{}/tests/oracle/data/", env!("CARGO_MANIFEST_DIR"));
    let sensor = if body.contains("<sensor") { "" } else { SENSOR };
    let text = format!("<scene version=\"3.0.0\">{sensor}{}</scene>", body.replace("\"data/", &format!("\"{data}")));
    load_files(&[("scene.xml", &text)], &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}\n{body}"))
}

fn build(body: &str) -> Scene {
    Scene::build(load(body).parts).unwrap_or_else(|e| panic!("{e}\n{body}"))
}

fn text<'a>(v: &'a Value, key: &str) -> &'a str {
    v[key].as_str().unwrap()
}

fn list<'a>(v: &'a Value, key: &str) -> &'a [Value] {
    v[key].as_array().map_or(&[], Vec::as_slice)
}

fn numbers(v: &Value) -> Vec<f32> {
    v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap() as f32).collect()
}

fn vec3(v: &Value) -> Vec3 {
    Vec3::from_slice(&numbers(v))
}

fn vec2(v: &Value) -> Vec2 {
    Vec2::from_slice(&numbers(v))
}

fn rgb(v: &Value) -> Rgb {
    let v = numbers(v);
    Rgb::new(v[0], v[1], v[2])
}

/// Largest difference, relative to the larger of the expected values and `scale`; infinite where a value is not finite.
fn error(found: &[f32], expected: &[f32], scale: f32) -> f32 {
    if found.len() != expected.len() || !found.iter().all(|v| v.is_finite()) {
        return f32::INFINITY;
    }
    let largest = expected.iter().fold(scale, |a, b| a.max(b.abs()));
    found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / largest
}

/// Collects what is off by more than `tolerance`.
struct Report {
    tolerance: f32,
    compared: usize,
    wrong: Vec<String>,
}

impl Report {
    fn new(tolerance: f32) -> Self {
        Self { tolerance, compared: 0, wrong: Vec::new() }
    }

    fn compare(&mut self, what: &str, found: &[f32], expected: &[f32], scale: f32) {
        self.compared += 1;
        let off = error(found, expected, scale);
        if off > self.tolerance {
            self.wrong.push(format!("{what}: {found:?} instead of {expected:?}"));
        }
    }

    fn end(self, least: usize) {
        assert!(self.compared >= least, "only {} comparisons", self.compared);
        assert!(
            self.wrong.is_empty(),
            "{} of {} are off:\n{}",
            self.wrong.len(),
            self.compared,
            self.wrong[..self.wrong.len().min(12)].join("\n")
        );
    }
}

#[test]
fn materials_scatter_as_in_mitsuba() {
    // Loose: the materials' own tests hold them to their formulas; a wrong parameter or default is off by far more.
    let mut report = Report::new(0.02);
    for entry in entries("bsdf_values.json", "bsdfs") {
        let name = text(&entry, "name");
        let loaded = load(&format!("<shape type=\"rectangle\">{}</shape>", text(&entry, "xml")));
        let bsdf: &Bsdf = &loaded.parts.bsdfs[loaded.parts.shapes[0].bsdf.0 as usize];
        for eval in list(&entry, "evals") {
            let (given, sampled) = (vec3(&eval["wi"]), vec3(&eval["wo"]));
            let (wi, wo) = if text(eval, "mode") == "radiance" { (sampled, given) } else { (given, sampled) };
            let value = bsdf.eval(vec2(&eval["uv"]), wi, wo, Lobes::All) * sampled.z.abs();
            report.compare(name, &value.to_array(), &numbers(&eval["value"]), 1e-2);
        }
    }
    report.end(300);
}

#[test]
fn textures_hold_what_mitsuba_sees() {
    let mut report = Report::new(1e-3);
    for entry in entries("texture_values.json", "textures") {
        let texture = text(&entry, "xml").replacen("<texture ", "<texture name=\"reflectance\" ", 1);
        let loaded = load(&format!("<shape type=\"rectangle\"><bsdf type=\"diffuse\">{texture}</bsdf></shape>"));
        let Bsdf::Diffuse(diffuse) = &loaded.parts.bsdfs[0] else { panic!() };
        for value in list(&entry, "values") {
            let found = diffuse.reflectance.eval(vec2(&value["uv"]));
            report.compare(&format!("{} at {}", text(&entry, "name"), value["uv"]), &found.to_array(), &numbers(&value["value"]), 0.1);
        }
    }
    report.end(150);
}

#[test]
fn cameras_send_mitsubas_rays() {
    let mut report = Report::new(2e-5);
    for entry in entries("camera_values.json", "cameras") {
        let loaded = load(text(&entry, "xml"));
        let camera = &loaded.parts.camera;
        let [x, y, ..] = loaded.film.crop.unwrap_or_default();
        for ray in list(&entry, "rays") {
            let lens = if ray["aperture"].is_null() { Vec2::splat(0.5) } else { vec2(&ray["aperture"]) };
            let found = camera.ray(vec2(&ray["film"]) - Vec2::new(x as f32, y as f32), lens).ray;
            let what = format!("{} at {}", text(&entry, "name"), ray["film"]);
            report.compare(&what, &found.d.to_array(), &numbers(&ray["d"]), 1.0);
            report.compare(&what, &found.o.to_array(), &numbers(&ray["o"]), 1.0);
        }
    }
    report.end(100);
}

#[test]
fn shapes_are_hit_where_mitsuba_hits_them() {
    let mut report = Report::new(2e-4);
    for entry in entries("shape_values.json", "shapes") {
        // A material that varies, so that texture coordinates are found.
        let mut parts = load(text(&entry, "xml")).parts;
        let board = Checkerboard { color0: Texture::grey(0.2), color1: Texture::grey(0.4), to_uv: Affine2::IDENTITY };
        parts.bsdfs.fill(Bsdf::Diffuse(Diffuse { reflectance: Texture::Checkerboard(Box::new(board)) }));
        let scene = Scene::build(parts).unwrap();
        for ray in list(&entry, "rays") {
            let what = format!("{} from {}", text(&entry, "name"), ray["o"]);
            let hit = scene.intersect(&Ray::new(vec3(&ray["o"]), vec3(&ray["d"])));
            let Some(hit) = hit else {
                report.compare(&what, &[0.0], &[ray["hit"].as_bool().map_or(1.0, f32::from)], 1.0);
                continue;
            };
            if ray["hit"] != true {
                report.wrong.push(format!("{what}: hit, where Mitsuba misses"));
                continue;
            }
            report.compare(&format!("t of {what}"), &[hit.t], &[ray["t"].as_f64().unwrap() as f32], 1.0);
            // Under a mirroring transform Mitsuba's geometric normal follows the winding; ours takes the shading normal's side.
            let n: Vec<f32> = numbers(&ray["n"]);
            let side: f32 = n.iter().zip(numbers(&ray["sh_n"])).map(|(a, b)| a * b).sum();
            let turned: Vec<f32> = n.iter().map(|v| v * 1f32.copysign(side)).collect();
            report.compare(&format!("n of {what}"), &hit.end.n_g.to_array(), &turned, 1.0);
            report.compare(&format!("shading n of {what}"), &hit.frame.n.to_array(), &numbers(&ray["sh_n"]), 1.0);
            report.compare(&format!("uv of {what}"), &hit.uv.to_array(), &numbers(&ray["uv"]), 1.0);
        }
    }
    report.end(500);
}

#[test]
fn emitters_shine_as_in_mitsuba() {
    let mut report = Report::new(2e-3);
    for entry in entries("emitter_values.json", "emitters") {
        let name = text(&entry, "name");
        let scene = build(&format!("{}{}", text(&entry, "floor"), text(&entry, "xml")));
        for seen in list(&entry, "toward") {
            let (p, d) = (vec3(&seen["p"]), vec3(&seen["d"]));
            // A point on the light itself, and the pole, where every column of an environment meets.
            let on_the_light = seen["dist"].as_f64().is_some_and(|dist| dist < 1e-3);
            if on_the_light || (d.x == 0.0 && d.z == 0.0) {
                continue;
            }
            let found = match scene.intersect(&Ray::new(p, d)) {
                Some(hit) => scene.emitted(&hit, -d, p),
                None => scene.escaped(d),
            };
            report.compare(&format!("{name} seen along {d}"), &found.radiance.to_array(), &numbers(&seen["value"]), 1e-2);
        }
        for shade in list(&entry, "shade").iter().filter(|s| s["delta"] == true) {
            let sample = scene.sample_direct(vec3(&shade["p"]), 0.5, Vec2::splat(0.5));
            let found = sample.map_or(Rgb::BLACK, |s| {
                assert!(matches!(s.kind, EmitterKind::DeltaPosition | EmitterKind::DeltaDirection));
                s.radiance * (1.0 / s.pdf.0)
            });
            report.compare(&format!("{name} from {}", shade["p"]), &found.to_array(), &rgb(&shade["weight"]).to_array(), 1e-3);
        }
    }
    report.end(50);
}

#[test]
fn what_mitsuba_warns_about_is_refused() {
    for entry in entries("shape_values.json", "refused") {
        let xml = entry.as_str().map_or_else(|| text(&entry, "xml").to_owned(), str::to_owned);
        let text = format!("<scene version=\"3.0.0\">{SENSOR}{xml}</scene>");
        assert!(load_files(&[("scene.xml", &text)], &LoadOptions::default()).is_err(), "{xml}");
    }
}
