use super::*;
use isophote_samplers::{Key, Purpose, Stream};

fn line(count: usize) -> Vec<Vec3> {
    (0..count).map(|i| Vec3::new(i as f32 / count as f32, 0.0, 0.0)).collect()
}

/// An iteration in which every path lands with density `density` and leaves hold `sizes`.
fn exact(regions: &mut Regions, sizes: &[f64], density: impl Fn(usize) -> f64, paths: f64) {
    let psi: Vec<f64> = sizes.iter().enumerate().map(|(leaf, s)| density(leaf) * s).collect();
    let half = Half { psi, paths: vec![0.5 * paths; sizes.len()] };
    regions.add(sizes, [&half, &half]);
}

const CUT: Refinement = Refinement::Cut { paths: 100.0, error: 0.05 };
const BLEND: Refinement = Refinement::Blend { strength: 64.0 };

/// Kernel sizes that come and go leave a constant density constant.
#[test]
fn a_constant_density_stays_whatever_the_kernel_sizes() {
    for refinement in [CUT, BLEND] {
        let mut regions = Regions::spatial(line(1000));
        let leaves = regions.leaves();
        assert!(leaves >= 32);
        let mut stream = Key { seed: 1, iteration: 0, index: 0, purpose: Purpose::Test }.stream();
        assert!(regions.densities(refinement).0.is_empty());
        for iteration in 0..20 {
            // Two leaves in three hold points, other ones each time; some never.
            let sizes: Vec<f64> = (0..leaves)
                .map(|leaf| if (leaf + iteration) % 3 == 0 || leaf == 5 { 0.0 } else { f64::from(0.1 + stream.next_1d()) })
                .collect();
            exact(&mut regions, &sizes, |_| 7.0, 1000.0);
            let (densities, count) = regions.densities(refinement);
            assert!(count >= 1 && densities.len() == leaves);
            for d in densities {
                assert!((d - 7.0).abs() < 1e-9, "{refinement:?}: {d}");
            }
        }
    }
}

#[test]
fn both_rules_find_a_density_that_differs_from_leaf_to_leaf() {
    for refinement in [CUT, BLEND] {
        let mut regions = Regions::spatial(line(1000));
        let sizes = vec![0.5; regions.leaves()];
        let truth = |leaf: usize| 1.0 + leaf as f64;
        for _ in 0..10 {
            exact(&mut regions, &sizes, truth, 1e6);
        }
        let (densities, count) = regions.densities(refinement);
        assert_eq!(count, regions.leaves());
        for (leaf, d) in densities.into_iter().enumerate() {
            assert!((d / truth(leaf) - 1.0).abs() < 1e-3, "{refinement:?}, leaf {leaf}: {d}");
        }
    }
}

#[test]
fn the_cut_waits_for_paths_and_for_halves_that_agree() {
    let few = |paths: f64, odd: f64| {
        let mut regions = Regions::spatial(line(1000));
        let sizes = vec![1.0; regions.leaves()];
        let half = |factor: f64| Half { psi: vec![factor; sizes.len()], paths: vec![0.5 * paths; sizes.len()] };
        regions.add(&sizes, [&half(1.0), &half(odd)]);
        regions.densities(CUT).1
    };
    // A node of two leaves holds twice a leaf's paths: what stops is the last level, or the first.
    assert_eq!(few(1e6, 1.0), few(200.0, 1.0));
    assert!(few(99.0, 1.0) < few(101.0, 1.0));
    assert_eq!(few(1e6, 1.06), 1);
    assert_eq!(few(0.0, 1.0), 1);
}

/// A leaf that nothing reached leans on its parent, less so the longer nothing comes, and never falls to zero.
#[test]
fn blending_shrinks_towards_the_parent() {
    let mut regions = Regions::spatial(line(1000));
    let leaves = regions.leaves();
    let sizes = vec![1.0; leaves];
    let mut last = f64::INFINITY;
    for _ in 0..5 {
        exact(&mut regions, &sizes, |leaf| if leaf == 0 { 0.0 } else { 1.0 }, 100.0);
        let (densities, _) = regions.densities(BLEND);
        assert!(densities[0] > 0.0 && densities[0] < last, "{} after {last}", densities[0]);
        // Far away only what the root says of it is felt.
        assert!((densities[leaves - 1] - 1.0).abs() < 0.01);
        last = densities[0];
    }
    assert!(last < 0.3);
}

#[test]
fn halves_cover_an_image_and_every_place_has_a_leaf() {
    let regions = Regions::image(96, 72);
    let mut seen = vec![0; regions.leaves()];
    for y in 0..72 {
        for x in 0..96 {
            seen[regions.leaf(Vec3::new(x as f32 + 0.5, y as f32 + 0.5, 0.0)) as usize] += 1;
        }
    }
    assert!(seen.iter().all(|&count| (1..=4).contains(&count)), "{:?}", seen.iter().max());
    let mut stream = Key { seed: 2, iteration: 0, index: 0, purpose: Purpose::Test }.stream();
    let points: Vec<Vec3> = (0..5000).map(|_| Vec3::new(stream.next_1d(), 0.1 * stream.next_1d(), 3.0)).collect();
    let spatial = Regions::spatial(points.clone());
    let mut count = vec![0; spatial.leaves()];
    points.iter().for_each(|p| count[spatial.leaf(*p) as usize] += 1);
    assert!(count.iter().all(|c| (16..=40).contains(c)), "{:?} {:?}", count.iter().min(), count.iter().max());
    assert!((spatial.leaf(Vec3::splat(1e9)) as usize) < spatial.leaves());
    // Points all in one place, and none at all.
    assert_eq!(Regions::spatial(vec![Vec3::ONE; 100]).leaves(), 1);
    assert_eq!(Regions::spatial(Vec::new()).leaves(), 1);
}
