//! An iteration with chains of light paths: measurement points first, then light that is aimed at them.

use super::super::aimed::{Aimed, look};
use super::{Counts, DENSITY, Glossy, IterationStats, REGION_DENSITY, Sppm};
use crate::image::film::Film;
use crate::math::Rgb;
use crate::photons::radius::shrink;
use crate::samplers::Purpose;
use crate::targets::LightVertex;
use crate::targets::deposits::{Deposits, collect, vertices};
use crate::transport::walk::Tally;

/// What a row of pixels sees, and how often through smooth lobes alone.
#[derive(Default)]
struct Row {
    values: Vec<Rgb>,
    glossy: Glossy,
}

impl Sppm<'_> {
    /// An iteration: camera subpaths first, then light paths aimed at what they found.
    pub(super) fn iterate_aimed(&self, aimed: &mut Aimed, i: u64, film: &mut Film, stats: &mut IterationStats) -> Counts {
        let eye = &self.eye;
        let (rows, measured) = look(eye, self.radius_at(i), (i, Purpose::Camera), stats, |row: &mut Row, seen| {
            row.glossy.see(seen);
            row.values.push(self.emission(seen));
        });
        let (mut values, mut glossy) = (Vec::with_capacity(eye.pixels()), Glossy::default());
        for row in rows {
            values.extend(row.values);
            glossy.add(&row.glossy);
        }

        let sights = aimed.aim(eye, measured, shrink(i, self.settings.alpha));
        let points = &sights.points;
        let count = points.all().len();
        let light = self.light_paths();
        let paths = if light.max_depth == 0 { 0 } else { self.photon_count };
        let value = |tally: &mut Tally, point, vertex: &LightVertex| tally.finite(points.value(point, vertex));
        let start = || Deposits::new(count, sights.has_regions());
        let draw = aimed.draw(
            light,
            &sights,
            (i, paths),
            start,
            |deposits: &mut Deposits<Rgb>, path, drawn| {
                deposits.add(points, &path.light, drawn, value);
            },
            stats,
        );
        draw.batches.iter().for_each(|deposits| stats.count(&deposits.tally));
        let sums = collect(&draw.batches, &draw.scales, count);

        for (at, sum) in points.all().iter().zip(&sums) {
            let scale = 1.0 / f64::from(at.kernel_size());
            let [r, g, b] = sum.flux.map(|v| (v * scale) as f32);
            values[at.pixel as usize] += at.throughput * Rgb::new(r, g, b);
        }
        if let Some(mut readings) = film.take_readings() {
            let counts = vertices(&draw.batches, &draw.scales, count);
            for (number, (at, taken)) in points.all().iter().zip(counts).enumerate() {
                readings.add(DENSITY, at.pixel as usize, taken / f64::from(at.kernel_size()));
                if let Some(density) = sights.region_density(number) {
                    readings.add(REGION_DENSITY, at.pixel as usize, density);
                }
            }
            film.keep_readings(readings);
        }
        let width = eye.size.0;
        let sample = |tally: &mut Tally, x: usize, y: usize| tally.finite(values[y * width + x]);
        film.add_eye_samples(Tally::default, sample, |tally| stats.count(&tally));
        aimed.learn(sights, Some(&sums));
        Counts { deposits: draw.batches.iter().map(Deposits::count).sum(), glossy }
    }
}
