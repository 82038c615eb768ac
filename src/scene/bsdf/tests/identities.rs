//! What must hold between value, density, samples, filters and directions.

use super::support::*;
use crate::math::{Rgb, warp};
use crate::samplers::Stream;
use crate::scene::bsdf::{Bsdf, Lobes, Mode, blend, twosided};
use crate::scene::texture::Texture;
use glam::{Vec2, Vec3};

const UV: Vec2 = Vec2::new(0.2, 0.3);

fn close(a: f32, b: f32, relative: f32) -> bool {
    (a - b).abs() <= relative * a.abs().max(b.abs()) + 1e-7
}

fn all_close(a: Rgb, b: Rgb, relative: f32) -> bool {
    (0..3).all(|c| close(a[c], b[c], relative))
}

/// Rounding of a half vector against the width of the narrowest lobe.
fn tolerance(name: &str) -> f32 {
    if name.contains("smooth") || name.contains("0.05") { 2e-2 } else { 3e-3 }
}

#[test]
fn samples_report_what_value_and_density_say() {
    for (name, b) in materials() {
        let mut s = stream(1);
        for round in 0..400 {
            let given = if round < 6 { given_directions()[round] } else { warp::sphere(pair(&mut s)) };
            for lobes in FILTERS {
                for mode in MODES {
                    let Some(x) = b.sample(UV, given, mode, lobes, s.next_1d(), pair(&mut s)) else { continue };
                    let tag = format!("{name}, given {given}, {mode:?}, {lobes:?}: {x:?}");
                    assert!(x.weight.is_finite() && x.weight.at_least(0.0) == x.weight && !x.weight.is_black(), "{tag}");
                    assert!((x.w.length() - 1.0).abs() < 1e-4, "{tag}");
                    assert!(x.pdf_fwd > 0.0 && x.pdf_fwd.is_finite() && x.pdf_rev >= 0.0 && x.pdf_rev.is_finite(), "{tag}");
                    assert!(lobes.admit(x.roughness), "{tag}");
                    assert_eq!(x.delta, x.roughness == 0.0, "{tag}");
                    assert!(x.eta == 1.0 || x.w.z * given.z < 0.0, "{tag}");
                    if x.delta {
                        assert!(x.pdf_fwd <= 1.0 + 1e-6, "{tag}");
                        continue;
                    }
                    // Grazing facets and directions lose digits in the half vector.
                    if x.w.z.abs() < 0.02 || given.z.abs() < 0.02 || (x.w + given).length() < 0.1 {
                        continue;
                    }
                    let (wi, wo) = mode.roles(given, x.w);
                    let (fwd, rev) = (b.pdf(UV, given, x.w, lobes), b.pdf(UV, x.w, given, lobes));
                    let f = b.eval(UV, wi, wo, lobes);
                    let t = tolerance(name);
                    assert!(close(x.pdf_fwd, fwd, t), "{tag} but density {fwd}");
                    assert!(close(x.pdf_rev, rev, t), "{tag} but reverse density {rev}");
                    assert!(all_close(x.weight, f * (x.w.z.abs() / fwd), t), "{tag} but f {f:?} density {fwd}");
                    let (f2, fwd2) = b.eval_pdf(UV, given, x.w, mode, lobes);
                    assert!(all_close(f, f2, 1e-3) && close(fwd, fwd2, 1e-3), "{tag} but {f:?} {f2:?} {fwd} {fwd2}");
                    let (f3, [fwd3, rev3]) = b.eval_pdfs(UV, given, x.w, mode, lobes);
                    assert_eq!((f3, fwd3), (f2, fwd2), "{tag}");
                    assert!(close(rev, rev3, 1e-3), "{tag} but {rev} {rev3}");
                }
            }
        }
    }
}

/// A delta's way back: the reverse probability is what the reverse sample reports.
#[test]
fn deltas_are_reversible() {
    for (name, b) in materials() {
        let mut s = stream(2);
        for _ in 0..100 {
            let given = warp::sphere(pair(&mut s));
            for lobes in [Lobes::All, Lobes::Smooth(0.35)] {
                let Some(x) = b.sample(UV, given, Mode::Radiance, lobes, s.next_1d(), pair(&mut s)).filter(|x| x.delta) else { continue };
                let back = (0..64)
                    .filter_map(|i| b.sample(UV, x.w, Mode::Importance, lobes, (i as f32 + 0.5) / 64.0, pair(&mut s)))
                    .find(|y| y.delta && y.w.distance(given) < 1e-3);
                let Some(back) = back else {
                    assert!(x.pdf_rev < 0.1, "{name}: {x:?} from {given} has no way back");
                    continue;
                };
                assert!(close(back.pdf_fwd, x.pdf_rev, 1e-3) && close(back.pdf_rev, x.pdf_fwd, 1e-3), "{name}: {x:?} and {back:?}");
                assert!(close(back.eta * x.eta, 1.0, 1e-5), "{name}: {x:?} and {back:?}");
                // Both carry the same f by roles: radiance one way is importance the other.
                assert!(all_close(x.weight * (x.eta * x.eta), back.weight, 2e-3), "{name}: {x:?} and {back:?}");
            }
        }
    }
}

/// What a delta sample reports, [`Bsdf::delta`] answers for the two directions, from both sides; and nothing for others.
#[test]
fn deltas_answer_for_directions() {
    let mut found = 0;
    for (name, b) in materials() {
        let mut s = stream(5);
        for _ in 0..100 {
            let given = warp::sphere(pair(&mut s));
            let elsewhere = warp::sphere(pair(&mut s));
            let Some(x) = b.sample(UV, given, Mode::Importance, Lobes::All, s.next_1d(), pair(&mut s)) else { continue };
            assert!(b.delta(UV, given, elsewhere).is_none(), "{name}: {given} to {elsewhere}");
            if !x.delta {
                continue;
            }
            // Of glass straight on, a hole in it and a second glass cannot be told.
            if name.starts_with("mask") && x.w.distance(-given) < 0.2 {
                continue;
            }
            let (fwd, rev) = (b.delta(UV, given, x.w).unwrap(), b.delta(UV, x.w, given).unwrap());
            assert!(close(fwd.probability, x.pdf_fwd, 1e-3) && close(rev.probability, x.pdf_rev, 1e-3), "{name}: {x:?}, {fwd:?}, {rev:?}");
            assert!(
                all_close(fwd.value, x.weight * x.pdf_fwd, 1e-3) && all_close(rev.value, fwd.value, 2e-3),
                "{name}: {x:?}, {fwd:?}, {rev:?}"
            );
            assert!(close(fwd.eta, x.eta, 1e-5) && close(fwd.eta * rev.eta, 1.0, 1e-5), "{name}: {x:?}, {fwd:?}, {rev:?}");
            found += 1;
        }
    }
    assert!(found > 300, "{found}");
}

/// The index by directions is that of samples.
#[test]
fn refraction_has_the_index_of_its_directions() {
    let mut found = 0;
    for (name, b) in materials() {
        let mut s = stream(6);
        for _ in 0..100 {
            let given = warp::sphere(pair(&mut s));
            let Some(x) = b.sample(UV, given, Mode::Radiance, Lobes::Rough(0.0), s.next_1d(), pair(&mut s)) else { continue };
            assert!(close(b.relative_index(given, x.w), x.eta, 1e-6), "{name}: {x:?}");
            found += usize::from(x.eta != 1.0);
        }
    }
    assert!(found > 100, "{found}");
}

/// A side without roughness has no value, no density and no rough sample; another may have all of them, and most have.
#[test]
fn what_scatters_on_a_side_is_known_ahead() {
    let one_side = |b: &Bsdf| Bsdf::TwoSided(twosided::TwoSided { front: Box::new(b.clone()), back: None });
    let rough = phong(0.3, 0.4, 10.0);
    let half_wrapped = blend::Blend { weight: Texture::grey(0.5), first: Box::new(rough.clone()), second: Box::new(one_side(&rough)) };
    let wrapped = [("rough on both sides".to_owned(), one_side(&rough)), ("blend of such".to_owned(), Bsdf::Blend(half_wrapped))];
    let (mut black, mut behind) = (0, 0);
    for (name, b) in materials().iter().chain(&wrapped) {
        let mut s = stream(8);
        for side in [1.0, -1.0] {
            let roughness = b.max_roughness_from(0.5 * side);
            assert!(roughness == 0.0 || roughness == b.max_roughness(), "{name}");
            let mut found = false;
            for _ in 0..300 {
                let given = warp::sphere(pair(&mut s));
                let given = given.with_z(given.z.abs() * side);
                let other = warp::sphere(pair(&mut s));
                let (f, pdf) = b.eval_pdf(UV, given, other, Mode::Importance, Lobes::All);
                let sample = b.sample(UV, given, Mode::Importance, Lobes::All, s.next_1d(), pair(&mut s));
                found |= !f.is_black() || pdf > 0.0 || sample.is_some_and(|s| !s.delta);
            }
            assert!(roughness > 0.0 || !found, "{name}: something on the side {side}");
            // Of those that may scatter all do, but where a hole is all there is.
            assert!(roughness == 0.0 || found || name == "all hole", "{name}: nothing on the side {side}");
            black += usize::from(roughness == 0.0 && b.max_roughness() > 0.0);
            behind += usize::from(roughness > 0.0 && side < 0.0);
        }
    }
    assert!(black > 10 && behind > 4, "{black} and {behind}");
}

#[test]
fn values_are_reciprocal_and_filters_add_up() {
    for (name, b) in materials() {
        let mut s = stream(3);
        for _ in 0..400 {
            let (wi, wo) = (warp::sphere(pair(&mut s)), warp::sphere(pair(&mut s)));
            let f = b.eval(UV, wi, wo, Lobes::All);
            let tag = format!("{name}, {wi} -> {wo}");
            let back = b.eval(UV, wo, wi, Lobes::All);
            if wi.z * wo.z > 0.0 {
                assert!(all_close(f, back, 1e-3), "{tag}: {f:?} back {back:?}");
            } else if !f.is_black() && !back.is_black() && name.starts_with("roughdielectric") {
                let Bsdf::RoughDielectric(glass) = b else { panic!("{name}") };
                // f(wi -> wo)/eta_o^2 = f(wo -> wi)/eta_i^2 [VEACH 5.2]
                let ratio = if wo.z > 0.0 { glass.eta * glass.eta } else { 1.0 / (glass.eta * glass.eta) };
                assert!(all_close(f * ratio, back, 2e-3), "{tag}: {f:?} back {back:?} ratio {ratio}");
            }
            for threshold in [0.0, 0.05, 0.35, 1.0, 1.5] {
                let parts = b.eval(UV, wi, wo, Lobes::Rough(threshold)) + b.eval(UV, wi, wo, Lobes::Smooth(threshold));
                assert!(all_close(f, parts, 1e-5), "{tag} at {threshold}: {f:?} is not {parts:?}");
            }
            assert!(b.eval(UV, wi, wo, Lobes::Smooth(0.0)).is_black(), "{tag}");
        }
    }
}

/// Mean of the weights that a light walk gets: the share of light from `given` that goes on.
fn measured_albedo(b: &Bsdf, given: Vec3, lobes: Lobes, n: usize, index: u64) -> (Rgb, f32) {
    let mut s = stream(index);
    let (mut sum, mut squares) = (Rgb::BLACK, 0.0f32);
    for _ in 0..n {
        let x = b.sample(UV, given, Mode::Importance, lobes, s.next_1d(), pair(&mut s)).map_or(Rgb::BLACK, |x| x.weight);
        sum += x;
        squares += x.max_component() * x.max_component();
    }
    let mean = sum / n as f32;
    let variance = (squares / n as f32 - mean.max_component() * mean.max_component()).max(0.0);
    (mean, (variance / n as f32).sqrt())
}

#[test]
fn nothing_makes_light_and_the_albedo_is_about_right() {
    for (name, b) in materials() {
        for (i, given) in given_directions().into_iter().enumerate() {
            for lobes in [Lobes::All, Lobes::Rough(0.35), Lobes::Smooth(0.35)] {
                let (mean, error) = measured_albedo(b, given, lobes, 4000, i as u64);
                let tag = format!("{name}, given {given}, {lobes:?}: measured {mean:?} +- {error}");
                assert!(mean.max_component() <= 1.0 + 5.0 * error + 1e-4, "{tag}");
                let albedo = b.albedo(UV, given, lobes);
                assert!((0.0..=1.0 + 1e-5).contains(&albedo), "{tag}: albedo {albedo}");
                assert_eq!(albedo == 0.0, mean.is_black(), "{tag}: albedo {albedo}");
                if !mean.is_black() {
                    let ratio = albedo / mean.mean();
                    assert!((0.4..2.5).contains(&ratio), "{tag}: albedo {albedo}");
                }
            }
        }
    }
}

#[test]
fn lossless_materials_lose_nothing() {
    let white = [
        r#"<bsdf type="dielectric"/>"#,
        r#"<bsdf type="thindielectric"/>"#,
        r#"<bsdf type="conductor"/>"#,
        r#"<bsdf type="mask"><float name="opacity" value="0.3"/><bsdf type="conductor"/></bsdf>"#,
        r#"<bsdf type="blendbsdf"><float name="weight" value="0.3"/><bsdf type="conductor"/><bsdf type="dielectric"/></bsdf>"#,
    ];
    for xml in white {
        let b = parse(xml);
        for given in given_directions().into_iter().filter(|w| w.z > 0.0) {
            let (mean, _) = measured_albedo(&b, given, Lobes::All, 500, 9);
            assert!(all_close(mean, Rgb::WHITE, 1e-4), "{xml} {given}: {mean:?}");
        }
    }
}

/// At normal incidence the cosine-weighted integral of `(n + 2)/(2 pi) cos^n` is one: nothing of the Phong lobe is lost.
#[test]
fn phong_reflects_its_coefficients_at_normal_incidence() {
    for (name, b) in materials().iter().filter(|m| m.0.starts_with("phong")) {
        let Bsdf::Phong(phong) = b else { panic!("{name}") };
        let (mean, error) = measured_albedo(b, Vec3::Z, Lobes::All, 20_000, 11);
        let expected = phong.diffuse_reflectance.eval(UV) + phong.specular_reflectance.eval(UV);
        let difference = (mean.r() - expected.r()).abs();
        assert!(difference <= 4.0 * error + 1e-4, "{name}: {mean:?} +- {error}, expected {expected:?}");
    }
}

/// Directions in the tangent plane, along the normal, and a rounding away from either; numbers at both ends of [0, 1).
#[test]
fn degenerate_input_gives_finite_numbers() {
    let tiny = [0.0, -0.0, 1e-40, 1e-20, 1e-10, 1e-7, 1e-4];
    let mut directions: Vec<Vec3> = vec![Vec3::Z, -Vec3::Z, Vec3::new(1e-7, -1e-8, 1.0), Vec3::new(1e-30, 0.0, -1.0)];
    for z in tiny {
        directions.extend([Vec3::new(1.0, 0.0, z), Vec3::new(-0.6, 0.8, -z), Vec3::new(0.0, -1.0, z), Vec3::new(-1.0, 0.0, z)]);
    }
    let ends = [0.0f32, 1e-30, 0.5, 1.0 - 1.0 / 16_777_216.0];
    for (name, b) in materials() {
        let mut s = stream(5);
        for &given in &directions {
            for lobes in [Lobes::All, Lobes::Rough(0.35), Lobes::Smooth(0.35)] {
                assert!(b.albedo(UV, given, lobes).is_finite(), "{name} {given}");
                for i in 0..ends.len().pow(3) {
                    let u = Vec2::new(ends[i % 4], ends[i / 4 % 4]);
                    if let Some(x) = b.sample(UV, given, MODES[i % 2], lobes, ends[i / 16], u) {
                        let finite = x.weight.is_finite() && x.pdf_fwd.is_finite() && x.pdf_rev.is_finite() && x.w.is_finite();
                        assert!(finite && x.pdf_fwd > 0.0 && x.weight.at_least(0.0) == x.weight, "{name} {given} {lobes:?}: {x:?}");
                    }
                }
                let others = directions.iter().copied().chain([warp::sphere(pair(&mut s)), -given]);
                for other in others {
                    let (f, pdf) = b.eval_pdf(UV, given, other, MODES[0], lobes);
                    assert!(f.is_finite() && f.at_least(0.0) == f, "{name} {given} {other}: {f:?}");
                    assert!(pdf.is_finite() && pdf >= 0.0, "{name} {given} {other}: {pdf}");
                    assert!(b.eval_pdfs(UV, given, other, MODES[0], lobes).1.iter().all(|pdf| pdf.is_finite() && *pdf >= 0.0));
                    assert!(b.eval(UV, given, other, lobes).is_finite() && b.pdf(UV, given, other, lobes).is_finite());
                }
            }
        }
    }
}
