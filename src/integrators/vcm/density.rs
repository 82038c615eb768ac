//! How densely photons lie, by the map that weights ask, where each pixel's camera subpath first merges: for `--aov density`.

use super::eye::{TILE, Tile, TileMemory};
use super::iteration::Iteration;
use super::light::{LightSide, Merging};
use super::pyramid::Recorder;
use super::technique::Technique;
use crate::image::film::Film;
use crate::integrators::IterationStats;
use crate::math::Rgb;
use crate::photons::density::DensityMap;
use crate::scene::hit::Endpoint;
use crate::transport::walk::Tally;

/// What camera subpaths are joined with.
pub(super) struct Joined<'l> {
    pub(super) light: &'l LightSide,
    pub(super) merging: Option<&'l Merging>,
    pub(super) density: Option<&'l DensityMap>,
}

/// Takes down what another does, and the map's density where a pixel's subpath first merges.
struct Reading<'d, R> {
    of: R,
    map: &'d DensityMap,
    pixel: usize,
    /// Pixels, with light vertices per world unit squared and pass.
    found: Vec<(usize, f32)>,
}

impl<R: Recorder> Recorder for Reading<'_, R> {
    // What is taken down is told apart by pixel.
    const ON: bool = true;
    #[inline(always)]
    fn add(&mut self, edges: u32, technique: Technique, weighted: Rgb, unweighted: Rgb) {
        self.of.add(edges, technique, weighted, unweighted);
    }
    fn start(&mut self, pixel: usize) {
        self.pixel = pixel;
        self.of.start(pixel);
    }
    fn merges_at(&mut self, end: &Endpoint) {
        if self.found.last().is_none_or(|(pixel, _)| *pixel != self.pixel) {
            self.found.extend(self.map.density(end.p).map(|density| (self.pixel, density)));
        }
    }
}

impl Iteration<'_, '_> {
    /// A camera subpath a pixel into the film, with densities if it keeps readings. `start` makes what takes down a tile, `finish` is given it, tiles
    /// in order.
    pub(super) fn trace_reading<R: Recorder + Send>(
        &self,
        film: &mut Film,
        joined: &Joined<'_>,
        stats: &mut IterationStats,
        start: impl Fn() -> R + Sync,
        mut finish: impl FnMut(R, &mut IterationStats),
    ) {
        let Some((map, mut readings)) = joined.density.and_then(|map| Some((map, film.take_readings()?))) else {
            return self.trace_recording(film, joined, stats, start, finish);
        };
        let start = || Reading { of: start(), map, pixel: 0, found: Vec::new() };
        self.trace_recording(film, joined, stats, start, |tile, stats| {
            for (pixel, density) in tile.found {
                readings.add(0, pixel, f64::from(density) / self.light_paths);
            }
            finish(tile.of, stats);
        });
        film.keep_readings(readings);
    }

    fn trace_recording<'t, R: Recorder + Send>(
        &'t self,
        film: &mut Film,
        joined: &'t Joined<'t>,
        stats: &mut IterationStats,
        start: impl Fn() -> R + Sync,
        mut finish: impl FnMut(R, &mut IterationStats),
    ) {
        let sample = |memory: &mut TileMemory<'t>, pixels: &[usize], values: &mut [Rgb]| {
            let mut tile = Tile { tally: Tally::default(), record: start(), memory };
            self.tile(pixels, values, joined, &mut tile);
            (tile.tally, tile.record)
        };
        film.add_eye_tiles(TILE, TileMemory::default, sample, |(tally, record)| {
            stats.count(&tally);
            finish(record, stats);
        });
    }
}
