//! Light subpaths of samplers with targets: what the camera sees first, then chains that aim at it.
//!
//! A path counts for `W_p`, the sum over its strata of scale times weight; an independent one would count for `1/N`. Flux at its vertices and
//! what it splats are multiplied by `N W_p`, so that all that follows may take the path for an independent one. Weights of techniques are those of
//! uniform densities: they sum to 1 for every path whoever draws it.

use super::super::aimed::{Aimed, look};
use super::super::eye::Radius;
use super::super::IterationStats;
use super::Engine;
use super::iteration::Iteration;
use super::light::{Batch, LightSide};
use super::pairing::Pairing;
use crate::image::film::Film;
use crate::photons::radius::shrink;
use crate::samplers::{Key, Purpose};
use crate::targets::deposits::{Deposits, collect};
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

    /// Light subpaths of an iteration, aimed at the first vertices of its camera subpaths; their splats in the film.
    pub(super) fn shoot_aimed(
        &self,
        aimed: &mut Aimed,
        iteration: &Iteration<'_, '_>,
        film: &mut Film,
        stats: &mut IterationStats,
    ) -> LightSide {
        let (eye, count) = (self.eye(), self.light_paths());
        let (radius, shrink) = self.measured_radius(iteration.index);
        let (_, measured) = look(&eye, radius, iteration.index, stats, |(): &mut (), _| {});
        let sights = aimed.aim(&eye, measured, shrink);
        let points = &sights.points;
        let start = || (sights.has_regions().then(|| Deposits::new(points.all().len(), true)), Batch::default());
        let draw = aimed.draw(
            *iteration,
            &sights,
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
        aimed.learn(sights, sums.as_deref());

        let weights: Vec<Vec<f32>> = batches.par_iter_mut().map(|batch| batch.weigh(&draw.scales, count)).collect();
        batches.iter().for_each(|batch| stats.count(&batch.tally));
        if self.techniques.light_tracing {
            film.add_splats(&batches, count);
        }
        let pairing = self.techniques.connections.then(|| {
            let mut stream = Key { seed: self.common.seed, iteration: iteration.index, index: 0, purpose: Purpose::Pair }.stream();
            let flat = std::env::var("ISO_PAIR").is_ok();
            let mut weights = weights;
            if flat { weights.iter_mut().flatten().for_each(|w| *w = 1.0); }
            Pairing::new(&weights.concat(), iteration.pixels() as usize, count, &mut stream)
        });
        LightSide::new(batches, pairing)
    }
}
