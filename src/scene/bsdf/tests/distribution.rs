//! Samples follow the density they report: chi-squared tests over the sphere, deltas and failures counted.

use super::support::*;
use crate::samplers::Stream;
use crate::scene::bsdf::{Bsdf, Lobes};
use glam::{Vec2, Vec3};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::f64::consts::TAU;

const Z_BINS: usize = 32;
const PHI_BINS: usize = 32;
const SAMPLES: usize = 60_000;
const UV: Vec2 = Vec2::new(0.2, 0.3);

/// Gauss and Legendre's nodes and weights on [0, 1], eight of them.
const NODES: [(f64, f64); 8] = [
    (0.019855071751231856, 0.05061426814518813),
    (0.10166676129318664, 0.1111905172266872),
    (0.2372337950418355, 0.15685332293894363),
    (0.4082826787521751, 0.18134189168918097),
    (0.591717321247825, 0.18134189168918097),
    (0.7627662049581645, 0.15685332293894363),
    (0.8983332387068134, 0.1111905172266872),
    (0.9801449282487681, 0.05061426814518813),
];

/// Probability of each bin by integrating the density, each bin in `cells_z * cells_phi` parts.
fn expected(b: &Bsdf, given: Vec3, lobes: Lobes, [cells_z, cells_phi]: [usize; 2]) -> Vec<f64> {
    let mut bins = vec![0.0; Z_BINS * PHI_BINS];
    let (n_z, n_phi) = (cells_z as f64, cells_phi as f64);
    for (i, bin) in bins.iter_mut().enumerate() {
        let (row, column) = ((i / PHI_BINS) as f64, (i % PHI_BINS) as f64);
        for cell in 0..cells_z * cells_phi {
            let (cell_z, cell_phi) = ((cell / cells_phi) as f64, (cell % cells_phi) as f64);
            for (x, wx) in NODES {
                let z = 2.0 * (row + (cell_z + x) / n_z) / Z_BINS as f64 - 1.0;
                let r = (1.0 - z * z).sqrt();
                for (y, wy) in NODES {
                    let phi = TAU * (column + (cell_phi + y) / n_phi) / PHI_BINS as f64;
                    let w = Vec3::new((r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32);
                    *bin += wx * wy * f64::from(b.pdf(UV, given, w, lobes)) / (n_z * n_phi);
                }
            }
        }
        *bin *= 2.0 * TAU / (Z_BINS * PHI_BINS) as f64;
    }
    bins
}

fn bin_of(w: Vec3) -> usize {
    let row = ((f64::from(w.z) + 1.0) * 0.5 * Z_BINS as f64) as usize;
    let phi = f64::from(w.y).atan2(f64::from(w.x)).rem_euclid(TAU);
    row.min(Z_BINS - 1) * PHI_BINS + ((phi / TAU * PHI_BINS as f64) as usize).min(PHI_BINS - 1)
}

/// The p-value of one material's samples, with what it rests on.
fn p_value(b: &Bsdf, given: Vec3, lobes: Lobes, index: u64, cells: [usize; 2]) -> (f64, String) {
    let mut expected = expected(b, given, lobes, cells);
    let mut observed = vec![0.0f64; expected.len()];
    // ## Deltas to either side, by the probability they report, and failures: what is left
    let (mut delta, mut delta_probability, mut failed) = ([0.0f64; 2], [0.0f64; 2], 0.0);
    let mut s = stream(index);
    for i in 0..SAMPLES {
        let mode = MODES[i % 2];
        match b.sample(UV, given, mode, lobes, s.next_1d(), pair(&mut s)) {
            None => failed += 1.0,
            Some(x) if x.delta => {
                let side = usize::from(x.w.z * given.z > 0.0);
                delta[side] += 1.0;
                delta_probability[side] = f64::from(x.pdf_fwd);
            }
            Some(x) => observed[bin_of(x.w)] += 1.0,
        }
    }
    let mass: f64 = expected.iter().sum();
    expected.extend(delta_probability);
    observed.extend(delta);
    let lost = 1.0 - mass - delta_probability[0] - delta_probability[1];
    assert!(lost > -2e-3, "{given} {lobes:?}: density integrates to {mass}, with deltas {delta_probability:?}");
    expected.push(lost.max(0.0));
    observed.push(failed);
    // ## Pearson's statistic, sparse bins pooled
    let n = SAMPLES as f64;
    let (mut chi2, mut freedom, mut pool) = (0.0, -1.0, [0.0f64; 2]);
    let mut worst = (0.0, 0, 0.0, 0.0);
    for (i, (e, o)) in expected.iter().zip(&observed).enumerate() {
        let e = e * n;
        if e < 6.0 {
            pool = [pool[0] + e, pool[1] + o];
            continue;
        }
        let term = (o - e) * (o - e) / e;
        chi2 += term;
        freedom += 1.0;
        if term > worst.0 {
            worst = (term, i, e, *o);
        }
    }
    // Twenty more than expected, for the quadrature's own error.
    chi2 += ((pool[1] - pool[0]).abs() - 20.0).max(0.0).powi(2) / pool[0].max(6.0);
    freedom += 1.0;
    let p = if freedom < 1.0 { if chi2 > 30.0 { 0.0 } else { 1.0 } } else { ChiSquared::new(freedom).unwrap().sf(chi2) };
    let evidence = format!(
        "chi2 {chi2:.1} on {freedom}, mass {mass:.5}, lost {lost:.5}, failed {}, worst bin (term, bin, expected, observed) {worst:?}, pool {pool:?}",
        failed / n
    );
    (p, evidence)
}

/// Parts of a bin along z and phi: lobes too narrow for eight nodes need more, above all across the plane of grazing incidence.
fn cells(name: &str, given: Vec3) -> [usize; 2] {
    let narrow = ["default", "0.05", "0.1", "aniso", "150"].iter().any(|n| name.contains(n));
    match (narrow, given.z.abs() < 0.2) {
        (true, true) => [2, 6],
        (true, false) => [3, 3],
        (false, true) => [2, 3],
        (false, false) => [1, 1],
    }
}

#[test]
fn samples_follow_their_density() {
    let mut tests = Vec::new();
    for (name, b) in materials() {
        // The sharpest lobes are left to the identities; what differs in value alone is sampled alike.
        if ["smooth", "-linear", "0.05", "-spectrum", "-named"].iter().any(|n| name.contains(n)) {
            continue;
        }
        for (i, given) in given_directions().into_iter().enumerate() {
            // Every filter meets every material, some direction each.
            let filters = if i == 0 { &FILTERS[..1] } else { &[FILTERS[0], FILTERS[i]][..] };
            for &lobes in filters {
                if b.admitted_by(lobes) && lobes != Lobes::Smooth(2.0) {
                    let (p, evidence) = p_value(b, given, lobes, tests.len() as u64, cells(name, given));
                    tests.push((p, format!("{name}, given {given}, {lobes:?}: {evidence}")));
                }
            }
        }
    }
    // Sidak: 1 % for the family.
    let level = 1.0 - 0.99f64.powf(1.0 / tests.len() as f64);
    tests.sort_by(|a, b| a.0.total_cmp(&b.0));
    let failed: Vec<_> = tests.iter().filter(|t| t.0 < level).map(|t| format!("p = {:.2e}: {}", t.0, t.1)).collect();
    assert!(failed.is_empty(), "{} of {} tests below {level:.1e}:\n{}", failed.len(), tests.len(), failed.join("\n"));
}
