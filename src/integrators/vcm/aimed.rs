//! Light subpaths of samplers with targets: what the camera sees first, then chains that aim at it.
//!
//! A path counts for `W_p`, the sum over its strata of scale times weight; an independent one would count for `1/N`. Flux at its vertices and
//! what it splats are multiplied by `N W_p`, so that all that follows may take the path for an independent one.
//!
//! Weights of techniques sum to 1 for every path whoever draws it, if they are functions of the path that the iteration's own samples do not
//! move. They take splats and merges at a vertex to be `N g` samples, `g` the density of light subpaths there over that of independent ones, as the
//! ladder foresees it ([`Gain`](crate::targets::aimed::Gain)); `g` is 1 in the first iteration.

use super::super::IterationStats;
use super::super::aimed::{Aimed, Sights, look};
use super::super::eye::Radius;
use super::Engine;
use super::iteration::Iteration;
use super::light::{Batch, LightSide};
use super::pairing::Pairing;
use crate::image::film::Film;
use crate::photons::radius::shrink;
use crate::samplers::{Key, Purpose};
use crate::targets::deposits::{Collected, Deposits, collect};
use rayon::prelude::*;

impl Engine<'_> {
    /// How wide what the camera sees is in iteration `i`, and that relative to iteration 0: as merges are, and without them a pixel.
    pub(super) fn measured_radius(&self, i: u64) -> (Radius, f64) {
        if !self.techniques.merges {
            return (Radius::Footprints(1.0), 1.0);
        }
        let factor = shrink(i, self.photons.alpha);
        (Radius::World((self.radius * factor) as f32), factor)
    }

    /// Where the camera sees something in iteration `i`. Not by the subpaths that make its image: weights are made of what is seen here, and must not
    /// know the paths they weigh.
    pub(super) fn aim<'s>(&'s self, aimed: &mut Aimed, i: u64, stats: &mut IterationStats) -> Sights<'s> {
        let eye = self.eye();
        let (radius, shrink) = self.measured_radius(i);
        let (_, measured) = look(&eye, radius, (i, Purpose::Look), stats, |(): &mut (), _| {});
        stats.camera_paths += eye.pixels() as u64;
        aimed.aim(&eye, measured, shrink)
    }

    /// Light subpaths of an iteration, aimed at the first vertices of its camera subpaths; their splats in the film.
    pub(super) fn shoot_aimed(
        &self,
        (aimed, sights): (&mut Aimed, &Sights<'_>),
        iteration: &Iteration<'_, '_>,
        film: &mut Film,
        stats: &mut IterationStats,
    ) -> (LightSide, Option<Vec<Collected>>) {
        let count = self.light_paths();
        let points = &sights.points;
        let start = || (sights.has_regions().then(|| Deposits::new(points.all().len(), true)), Batch::with_room(self.room));
        let draw = aimed.draw(
            *iteration,
            sights,
            (iteration.index, count),
            start,
            |(deposits, batch): &mut (Option<Deposits<()>>, Batch), path, drawn| {
                if let Some(deposits) = deposits {
                    deposits.add(points, &path.light, drawn, |_, _, _| ());
                }
                iteration.keep_weighted(batch, &path.light, drawn);
            },
            stats,
        );
        let (deposits, mut batches): (Vec<_>, Vec<_>) = draw.batches.into_iter().unzip();
        let deposits: Option<Vec<Deposits<()>>> = deposits.into_iter().collect();
        let sums = deposits.map(|deposits| collect(&deposits, &draw.scales, points.all().len()));

        iteration.finish(&mut batches);
        let weights: Vec<Vec<f32>> = batches.par_iter_mut().map(|batch| batch.weigh(&draw.scales, count)).collect();
        batches.iter().for_each(|batch| stats.count(&batch.tally));
        if self.techniques.light_tracing {
            film.add_splats(&batches, count);
            iteration.record_splats(film, batches.iter().flat_map(|batch| &batch.recorded), stats);
        }
        let pairing = self.techniques.connections.then(|| {
            let mut stream = Key { seed: self.common.seed, iteration: iteration.index, index: 0, purpose: Purpose::Pair }.stream();
            Pairing::new(&weights.concat(), iteration.pixels() as usize * iteration.camera_paths, count, &mut stream)
        });
        (LightSide::new(batches, pairing), sums)
    }
}
