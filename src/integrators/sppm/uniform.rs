//! Independent light paths: photons into a grid, then each measurement point gathers and is gone.

use super::{Counts, DENSITY, IterationStats, Sppm};
use crate::image::film::Film;
use crate::math::{Rgb, fetch};
use crate::photons::radius::shrink;
use crate::photons::{Photon, Store};
use crate::samplers::{Drawn, PhotonSampler, Purpose, Uniform};
use crate::targets::LightPath;
use crate::targets::points::MeasurementPoint;
use crate::transport::merge::{accepts, merge};
use crate::transport::walk::Tally;
use glam::Vec3;

/// What a row of pixels counts, and the densities it reads by pixel, where they are asked for.
#[derive(Default)]
struct Row {
    tally: Tally,
    counts: Counts,
    densities: Vec<(usize, f64)>,
}

impl Sppm<'_> {
    /// An iteration; it depends on its index, settings and seed alone.
    pub(super) fn iterate_uniform(&self, i: u64, film: &mut Film, stats: &mut IterationStats) -> Counts {
        let (photons, scales) = self.shoot(i, stats);
        let radius = self.radius_at(i);
        let width = self.eye.size.0;
        let mut readings = film.take_readings();
        let reads = readings.is_some();
        // One stratum, in which every path weighs 1.
        let share: f64 = scales.iter().sum();
        let sample = |Row { tally, counts, densities }: &mut Row, x: usize, y: usize| {
            let pixel = y * width + x;
            let seen = self.eye.sample((i, Purpose::Camera), pixel, radius, tally);
            counts.glossy.see(&seen);
            let before = counts.deposits;
            let gathered = seen.measured.as_ref().map_or(Rgb::BLACK, |m| self.gather(m, &photons, &scales, &mut counts.deposits));
            if let Some(m) = seen.measured.as_ref().filter(|_| reads) {
                densities.push((pixel, (counts.deposits - before) as f64 * share / f64::from(m.kernel_size())));
            }
            tally.finite(self.emission(&seen) + gathered)
        };
        let mut all = Counts::default();
        film.add_eye_samples(Default::default, sample, |row: Row| {
            stats.count(&row.tally);
            all.add(&row.counts);
            if let Some(readings) = &mut readings {
                row.densities.into_iter().for_each(|(pixel, density)| readings.add(DENSITY, pixel, density));
            }
        });
        if let Some(readings) = readings {
            film.keep_readings(readings);
        }
        all
    }

    /// Light subpaths to photons, sorted into a grid.
    fn shoot(&self, i: u64, stats: &mut IterationStats) -> (Store<Photon>, Vec<f64>) {
        let paths = self.light_paths();
        let keep = |(photons, tally): &mut (Vec<(Vec3, Photon)>, Tally), path: &LightPath, drawn: &[Drawn]| {
            tally.add(&path.tally);
            for drawn in drawn {
                photons.extend(path.vertices.iter().map(|v| {
                    let flux = v.flux * drawn.weight as f32;
                    (v.end.p, Photon { n_g: v.end.n_g, wi: v.wi, flux, depth: v.depth as u16, stratum: drawn.stratum as u16 })
                }));
            }
        };
        let mut sampler = Uniform { seed: self.eye.common.seed };
        let count = if paths.max_depth == 0 { 0 } else { self.photon_count };
        let draw = sampler.draw(&paths, i, count, || (Vec::new(), Tally::default()), keep);
        let mut photons = Vec::with_capacity(draw.batches.iter().map(|(p, _)| p.len()).sum());
        for (batch, tally) in draw.batches {
            photons.extend(batch);
            stats.count(&tally);
        }
        stats.light_paths += draw.traced;
        let cell = self.cell * shrink(i, self.settings.alpha) as f32;
        let ahead = |i: usize| fetch(&photons[i].1);
        (Store::build_in(Vec::new(), photons.len(), |i| photons[i].0, ahead, |i| photons[i].1, cell), draw.scales)
    }

    /// Flux density around a measurement point, strata scaled, times throughput and BSDF. Counts the photons it takes.
    fn gather(&self, at: &MeasurementPoint<'_>, photons: &Store<Photon>, scales: &[f64], taken: &mut u64) -> Rgb {
        let mut sum = Rgb::BLACK;
        let depths = self.eye.depths();
        let (n_g, n_s) = (at.point.end.n_g, at.point.frame.n);
        photons.query(at.point.end.p, at.radius, |photon, _| {
            let depth = at.depth + u32::from(photon.depth);
            if depth <= depths.max && depth >= depths.min && accepts(n_g, n_s, photon.n_g, photon.wi) {
                *taken += 1;
                let scale = scales[usize::from(photon.stratum)] as f32;
                sum += merge(&at.point, photon.wi, self.eye.threshold) * photon.flux * scale;
            }
        });
        at.throughput * sum * (1.0 / at.kernel_size())
    }
}
