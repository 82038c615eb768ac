//! Valid scenes with bytes changed, cut out, doubled or cut off: whatever they become, the loader neither panics nor hangs.

use isophote::scene::mitsuba::{LoadOptions, load};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

const SCENE: &str = r#"<?xml version="1.0"?>
<scene version="3.0.0">
  <default name="spp" value="16"/>
  <integrator type="path"><integer name="max_depth" value="6"/></integrator>
  <sensor type="thinlens">
    <float name="fov" value="40"/><string name="fov_axis" value="smaller"/>
    <float name="aperture_radius" value="0.1"/><float name="focus_distance" value="4"/>
    <transform name="to_world"><lookat origin="0, 1, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
    <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
    <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="24"/><rfilter type="tent"/></film>
  </sensor>
  <bsdf type="twosided" id="two"><bsdf type="roughconductor"><float name="alpha" value="0.2"/><rgb name="eta" value="1 2 3"/></bsdf></bsdf>
  <bsdf type="blendbsdf" id="blend"><float name="weight" value="0.5"/><ref id="two"/>
    <bsdf type="diffuse"><texture name="reflectance" type="checkerboard"><transform name="to_uv"><scale value="3"/></transform></texture></bsdf></bsdf>
  <include filename="part.xml"/>
  <shape type="obj"><string name="filename" value="mesh.obj"/><boolean name="face_normals" value="true"/><ref id="blend"/></shape>
  <shape type="sphere"><point name="center" x="1" y="2" z="3"/><float name="radius" value="0.5"/><emitter type="area"><rgb name="radiance" value="3"/></emitter></shape>
  <emitter type="spot"><transform name="to_world"><rotate x="1" angle="90"/><translate value="0 2 0"/></transform></emitter>
  <!-- remark --><emitter type="constant"><rgb name="radiance" value="0.1, 0.2, 0.3"/></emitter>
</scene>
"#;

const PART: &str = r#"<scene version="3.0.0">
  <shape type="cylinder"><point name="p0" value="0 0 0"/><point name="p1" value="0 1 0"/><transform name="to_world"><matrix value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/></transform></shape>
</scene>
"#;

const MESH: &str = "# a quad and a triangle\no thing\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 1\nvt 0 0\nvt 1 0\nvn 0 0 1\ng side\nf 1/1/1 2/2/1 3/1/1 4/2/1\nf -1//1 1//1 2//1\n";

/// One to four changes of a kind that finds other errors than noise does: bytes of the file itself, digits, and structure.
fn mutate(text: &[u8], random: &mut Pcg64) -> Vec<u8> {
    const TOKENS: &[&[u8]] = &[
        b"$",
        b"\"",
        b"<",
        b">",
        b"/>",
        b"-1",
        b"1e39",
        b"1e38",
        b"3e30",
        b"1e-38",
        b"1e-44",
        b"1e19",
        b"nan",
        b"0",
        b"99999999999999999999",
        b"&a;",
        b"\0",
        b"\xff",
        b"<!--",
        b"</scene>",
        b"<ref id=\"two\"/>",
        b"f -9 1 1\n",
        b"id=\"two\" ",
        b"<include filename=\"scene.xml\"/>",
        b"$spp",
    ];
    let mut out = text.to_vec();
    for _ in 0..random.random_range(1..=4) {
        if out.is_empty() {
            break;
        }
        let at = random.random_range(0..out.len());
        let length = random.random_range(1..=40usize).min(out.len() - at);
        match random.random_range(0..7) {
            0 => out[at] = random.random(),
            1 => out[at] ^= 1 << random.random_range(0..7),
            2 => out.truncate(at),
            3 => drop(out.drain(at..at + length)),
            4 => {
                let piece = out[at..at + length].to_vec();
                let to = random.random_range(0..=out.len());
                out.splice(to..to, piece);
            }
            5 => {
                let token = TOKENS[random.random_range(0..TOKENS.len())];
                out.splice(at..at, token.iter().copied());
            }
            _ => {
                let token = TOKENS[random.random_range(0..TOKENS.len())];
                out.splice(at..at + length, token.iter().copied());
            }
        }
    }
    out
}

/// Writes the three files, one of them mutated, and loads them; the outcome is whether they were still a scene.
fn attempt(folder: &Path, number: u64) -> bool {
    let mut random = Pcg64::seed_from_u64(number);
    let files = [("scene.xml", SCENE), ("part.xml", PART), ("mesh.obj", MESH)];
    let victim = random.next_u32() as usize % 3;
    for (i, (name, text)) in files.iter().enumerate() {
        let bytes = if i == victim { mutate(text.as_bytes(), &mut random) } else { text.as_bytes().to_vec() };
        std::fs::write(folder.join(name), bytes).unwrap();
    }
    let start = Instant::now();
    let outcome = catch_unwind(AssertUnwindSafe(|| load(&folder.join("scene.xml"), &LoadOptions::default())));
    let Ok(outcome) = outcome else { panic!("mutation {number} panicked; its files are in {}", folder.display()) };
    let taken = start.elapsed();
    assert!(taken < Duration::from_secs(1), "mutation {number} took {taken:?}");
    if let Err(error) = &outcome {
        assert!(error.to_string().contains(&*folder.to_string_lossy()), "mutation {number}: the error names no file: {error}");
    }
    outcome.is_ok()
}

#[test]
fn mutated_scenes_never_panic_or_hang() {
    let folder = tempfile::tempdir().unwrap();
    let untouched: [(&str, &str); 3] = [("scene.xml", SCENE), ("part.xml", PART), ("mesh.obj", MESH)];
    for (name, text) in untouched {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    load(&folder.path().join("scene.xml"), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));

    let (start, mut tried, mut loaded) = (Instant::now(), 0u64, 0u64);
    // A few thousand, fewer on a slow machine.
    while tried < 4000 && (tried < 500 || start.elapsed() < Duration::from_secs(4)) {
        loaded += u64::from(attempt(folder.path(), tried));
        tried += 1;
    }
    // Mutations that all fail, or all pass, would test one path only.
    assert!(loaded > tried / 100 && loaded < tried * 9 / 10, "{loaded} of {tried} mutations still loaded");
}
