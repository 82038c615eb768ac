use super::*;
use crate::math::Rgb;

fn row(values: &[[f32; 3]]) -> Picture {
    Picture::new(values.len(), 1, values.iter().map(|v| Rgb::from(*v)).collect())
}

fn value(name: &str, reference: &Picture, image: &Picture, epsilon: f64) -> Measured {
    metric(name).expect("a metric").measure(&Pairs::new(reference, image).expect("one size"), epsilon)
}

/// Integers 0..65535, as in `tests/oracle/metrics.py`.
fn number(i: usize, salt: u64) -> f32 {
    let h = (i as u64 * 2_654_435_761 + salt * 40_503) % (1 << 32);
    let h = (h ^ (h >> 15)) * 2_246_822_519 % (1 << 32);
    ((h ^ (h >> 13)) >> 16) as f32
}

/// A value of the reference and of the image of `tests/oracle/metrics.py`, by the same operations.
fn oracle_value(kind: &str, (width, height): (usize, usize), i: usize) -> (f32, f32) {
    let (x, y, c) = (i / 3 % width, i / 3 / width, i % 3);
    let ramp = (x + 2 * y + 5 * c + 1) as f32 / 64.0;
    let noisy = ramp * (number(i, 2) / 32768.0);
    let board = |x: usize| if (x / 8 + y / 8).is_multiple_of(2) { 1.0 } else { 0.0625 };
    match kind {
        "random" => (number(i, 1) / 16384.0, number(i, 2) / 16384.0),
        "noisy" => (ramp, noisy),
        "dark" => (ramp / 1024.0, noisy / 1024.0),
        "lamp" => {
            let inside = 4 * x >= width && 2 * x < width && 4 * y >= height && 2 * y < height;
            let lamp = if inside { 512.0 } else { 1.0 };
            (ramp * lamp, noisy * lamp)
        }
        "equal" => (ramp, ramp),
        "edges" => (board(x), board(x + 1)),
        "fireflies" => (ramp, if i % 97 == 5 { noisy * 1000.0 } else { noisy }),
        "mostly_black" => {
            let lit = 3 * x >= 2 * width;
            (if lit { ramp } else { 0.0 }, if lit || i.is_multiple_of(11) { noisy } else { 0.0 })
        }
        "black_reference" => (0.0, if y.is_multiple_of(3) { noisy } else { 0.0 }),
        "black" => (0.0, 0.0),
        "negative" => (if i.is_multiple_of(13) { -ramp } else { ramp }, if i.is_multiple_of(7) { -noisy } else { noisy }),
        "masked" => {
            let p = i / 3;
            (if p % 41 == 7 && c == 1 { f32::INFINITY } else { ramp }, if p % 29 == 3 && c == 2 { f32::NAN } else { noisy })
        }
        _ => panic!("the script has a kind {kind} that this test does not know"),
    }
}

/// Reference and image.
fn oracle_pictures(kind: &str, (width, height): (usize, usize)) -> (Picture, Picture) {
    let values: Vec<(f32, f32)> = (0..3 * width * height).map(|i| oracle_value(kind, (width, height), i)).collect();
    let picture = |pick: &dyn Fn(&(f32, f32)) -> f32| {
        Picture::new(width, height, values.chunks(3).map(|v| Rgb::new(pick(&v[0]), pick(&v[1]), pick(&v[2]))).collect())
    };
    (picture(&|v| v.0), picture(&|v| v.1))
}

fn mean_unmasked(pairs: &Pairs, map: &[f32]) -> f64 {
    let values: Vec<f64> = (0..map.len()).filter(|i| !pairs.masked_at(*i)).map(|i| f64::from(map[i])).collect();
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn values_are_those_of_independent_implementations() {
    const PLAIN: f64 = 1e-9;
    let stored: serde_json::Value = serde_json::from_str(include_str!("../../../tests/oracle/metrics.json")).expect("JSON");
    let cases = stored["cases"].as_array().expect("cases");
    assert!(cases.len() >= 84, "{} cases", cases.len());
    let mut worst = std::collections::BTreeMap::<&str, (f64, String)>::new();
    let mut wrong = Vec::new();
    for case in cases {
        let size = |key: &str| case[key].as_u64().expect("a number") as usize;
        let kind = case["kind"].as_str().expect("a kind");
        let (reference, image) = oracle_pictures(kind, (size("width"), size("height")));
        let pairs = Pairs::new(&reference, &image).expect("one size");
        let name = format!("{kind} {}x{}", reference.width, reference.height);
        assert_eq!(pairs.masked(), case["masked"].as_u64().expect("a number"), "{name}");
        let mut compare = |metric: &'static str, found: Option<f64>, expected: Option<f64>, tolerance: f64| {
            assert_eq!(found.is_some(), expected.is_some(), "{name}: {metric} is {found:?}, the script's {expected:?}");
            let (Some(found), Some(expected)) = (found, expected) else { return };
            // Plain metrics have no scale of their own; SSIM, FLIP and exposures do.
            let scale = if tolerance == PLAIN && expected != 0.0 { expected.abs() } else { 1.0 };
            let difference = (found - expected).abs() / scale;
            if difference > tolerance || difference.is_nan() {
                wrong.push(format!("{name}: {metric} is {found}, the script's {expected}"));
            }
            let worst = worst.entry(metric).or_insert_with(|| (0.0, name.clone()));
            if difference > worst.0 {
                *worst = (difference, name.clone());
            }
        };
        for (epsilon, key) in [(0.01, "0.01"), (0.5, "0.5")] {
            for metric in METRICS {
                let found = metric.measure(&pairs, epsilon).value;
                match metric.name {
                    "flip" => compare("flip", found, case["flip"].as_f64(), 1e-4),
                    "ssim" => compare("ssim", found, case["ssim"].as_f64(), 1e-6),
                    plain => compare(plain, found, case[key][plain].as_f64(), PLAIN),
                }
            }
        }
        compare("flip, LDR", Some(mean_unmasked(&pairs, &ldr_flip_map(&pairs))), case["flip_ldr"].as_f64(), 1e-4);
        let exposures = flip_exposures(&pairs);
        compare("start", exposures.map(|e| e.start), case["exposures"][0].as_f64(), 1e-6);
        compare("stop", exposures.map(|e| e.stop), case["exposures"][1].as_f64(), 1e-6);
        assert_eq!(exposures.map(|e| e.count as u64), case["exposures"][2].as_u64(), "{name}");
        assert_eq!(
            metric("srrmse").expect("known").measure(&pairs, 0.01).left_out,
            case["srrmse_left_out"].as_u64().expect("stored"),
            "{name}"
        );
    }
    for (metric, (difference, name)) in worst {
        eprintln!("{metric}: largest difference {difference:.1e} ({name})");
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn two_values_by_hand() {
    // One pixel: r = (0, 1, 2), x = (1, 1, 0).
    let (reference, image) = (row(&[[0.0, 1.0, 2.0]]), row(&[[1.0, 1.0, 0.0]]));
    let check = |name: &str, expected: f64| {
        let found = value(name, &reference, &image, 0.01).value.expect("a value");
        assert!((found - expected).abs() < 1e-12 * expected, "{name}: {found}, by hand {expected}");
    };
    check("mse", 5.0 / 3.0);
    check("rmse", (5.0_f64 / 3.0).sqrt());
    check("relmse", (100.0 + 4.0 / 4.01) / 3.0);
    check("relmse_trimmed", (100.0 + 4.0 / 4.01) / 3.0);
    check("mape", (100.0 + 2.0 / 2.01) / 3.0);
    check("smape", (2.0 / 1.02 + 4.0 / 2.02) / 3.0);
    check("srrmse", (8.0_f64 / 3.0).sqrt());
}

#[test]
fn equal_pictures_differ_by_nothing() {
    let (reference, _) = oracle_pictures("random", (31, 22));
    for metric in METRICS {
        let perfect = if metric.better == Better::Lower { 0.0 } else { 1.0 };
        assert_eq!(value(metric.name, &reference, &reference, EPSILON), Measured { value: Some(perfect), left_out: 0 }, "{}", metric.name);
    }
}

#[test]
fn pixels_that_are_not_finite_are_masked_whole_and_counted() {
    let reference = row(&[[1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [f32::INFINITY, 0.0, 0.0], [5.0, 5.0, 5.0]]);
    let image = row(&[[2.0, 2.0, 2.0], [f32::NAN, 9.0, 9.0], [0.0, 0.0, 0.0], [5.0, 5.0, 5.0]]);
    let pairs = Pairs::new(&reference, &image).expect("one size");
    assert_eq!((pairs.masked(), pairs.pixels()), (2, 2));
    assert_eq!(value("mse", &reference, &image, EPSILON).value, Some(0.5));
    let nothing = row(&[[f32::NAN; 3]]);
    assert_eq!(value("mse", &nothing, &nothing, EPSILON).value, None);
}

#[test]
fn trimming_takes_the_floor() {
    // 333 pixels: floor(0.999) = 0 values go; 334 pixels: floor(1.002) = 1 goes.
    for (pixels, expected) in [(333, 1.0 / 999.0), (334, 0.0)] {
        let reference = row(&vec![[0.0; 3]; pixels]);
        let mut values = vec![[0.0; 3]; pixels];
        values[7][1] = 1.0;
        let found = value("relmse_trimmed", &reference, &row(&values), 1.0).value.expect("a value");
        assert!((found - expected).abs() < 1e-15, "{pixels} pixels: {found}");
    }
}

#[test]
fn sizes_must_agree() {
    let mismatch = Pairs::new(&row(&[[0.0; 3]]), &row(&[[0.0; 3], [0.0; 3]])).err().expect("refused");
    assert_eq!(mismatch.to_string(), "is 2x1 pixels, the reference 1x1");
}

#[test]
fn windows_need_room() {
    let small = Picture::new(40, 10, vec![Rgb::WHITE; 400]);
    assert_eq!(value("ssim", &small, &small, EPSILON), Measured { value: None, left_out: 400 });
    let enough = Picture::new(11, 11, vec![Rgb::WHITE; 121]);
    assert_eq!(value("ssim", &enough, &enough, EPSILON), Measured { value: Some(1.0), left_out: 0 });
}

/// What a masked pixel holds is seen by no window: neither what the image shows there, nor which number that is not finite.
#[test]
fn windows_do_not_see_masked_pixels() {
    let (reference, image) = oracle_pictures("noisy", (24, 24));
    let spoil = |picture: &Picture, bad: [f32; 3]| {
        let mut picture = picture.clone();
        picture.pixels[24 * 12 + 12] = Rgb::from(bad);
        picture
    };
    let measure = |r: &Picture, x: &Picture| ["ssim", "flip"].map(|name| value(name, r, x, EPSILON).value.expect("a value"));
    let one = measure(&reference, &spoil(&image, [f32::NAN, 0.0, 0.0]));
    assert_eq!(one, measure(&reference, &spoil(&image, [f32::INFINITY, 1e30, -5.0])));
    assert_ne!(one, measure(&reference, &image));
    let nothing = Picture::new(12, 12, vec![Rgb::splat(f32::NAN); 144]);
    for name in ["ssim", "flip"] {
        assert_eq!(value(name, &nothing, &nothing, EPSILON).value, None, "{name}");
    }
}

#[test]
fn any_thread_count_gives_the_same_bits() {
    let (reference, image) = oracle_pictures("lamp", (61, 47));
    let measure = || ["ssim", "flip"].map(|name| value(name, &reference, &image, EPSILON).value.map(f64::to_bits));
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    assert_eq!(pool(1).install(measure), pool(3).install(measure));
}

#[test]
fn definitions_are_the_documented_keys_in_order() {
    let keys: Vec<&str> = definitions().map(|(name, _, _)| name).collect();
    assert_eq!(keys.join(" "), "mse rmse relmse relmse_trimmed mape smape srrmse ssim flip nsd");
}

/// Milliseconds of both metrics, printed: `cargo test --release --lib time_of_window -- --ignored --nocapture`.
#[test]
#[ignore = "measures time"]
fn time_of_window_metrics() {
    for side in [256, 1024] {
        let (reference, image) = oracle_pictures("lamp", (side, side));
        let pairs = Pairs::new(&reference, &image).expect("one size");
        let exposures = flip_exposures(&pairs).expect("lit").count;
        for name in ["ssim", "flip"] {
            let mut times: Vec<f64> = (0..5)
                .map(|_| {
                    let start = std::time::Instant::now();
                    std::hint::black_box(metric(name).expect("known").measure(&pairs, EPSILON));
                    start.elapsed().as_secs_f64() * 1e3
                })
                .collect();
            times.sort_unstable_by(f64::total_cmp);
            eprintln!(
                "{name} at {side}x{side} ({exposures} exposures), {} threads: median {:.1} ms",
                rayon::current_num_threads(),
                times[2]
            );
        }
    }
}
