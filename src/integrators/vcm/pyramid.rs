//! What each technique brings to the paths of each length, with its weight and without: the pyramid of [VEACH 10.2].

use super::density::Joined;
use super::iteration::Iteration;
use super::light::{LightSide, Merging};
use super::technique::Technique;
use crate::image::film::Film;
use crate::image::layers::{Layer, LayerSums};
use crate::integrators::IterationStats;
use crate::math::Rgb;
use crate::photons::density::DensityMap;
use crate::scene::hit::Endpoint;
use crate::targets::points::DepthRange;
use crate::transport::mis::Techniques;
use crate::transport::walk::Tally;

/// The longest paths that are told apart: there are as many images as their square, twice.
pub(super) const LONGEST: u32 = 16;

/// Takes down what a technique found, where that is asked for.
pub(super) trait Recorder {
    /// Is it?
    const ON: bool;
    /// A path of so many edges: its value with the technique's weight, and with weight 1.
    fn add(&mut self, edges: u32, technique: Technique, weighted: Rgb, unweighted: Rgb);
    /// What follows is of this pixel.
    #[inline(always)]
    fn start(&mut self, _pixel: usize) {}
    /// The pixel's subpath has come to a surface where it merges.
    #[inline(always)]
    fn merges_at(&mut self, _end: &Endpoint) {}
}

/// Takes down nothing.
pub(super) struct Nothing;

impl Recorder for Nothing {
    const ON: bool = false;
    #[inline(always)]
    fn add(&mut self, _: u32, _: Technique, _: Rgb, _: Rgb) {}
}

/// A splat of a path of so many edges.
#[derive(Clone, Copy, Debug)]
pub(super) struct RecordedSplat {
    pub(super) pixel: u32,
    pub(super) edges: u32,
    pub(super) weighted: Rgb,
    pub(super) unweighted: Rgb,
}

/// Which images there are: of each length and technique one with weights; after all of these, in the same order, those without.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pyramid {
    techniques: Techniques,
    depths: DepthRange,
}

impl Pyramid {
    /// Of the set's techniques and the lengths that count; `None` if these have no end or one beyond [`LONGEST`].
    pub(super) fn new(techniques: Techniques, depths: DepthRange) -> Option<Self> {
        (depths.max <= LONGEST).then_some(Self { techniques, depths })
    }

    /// Connections, the emitter hit among them, splats and merges that can make a path of so many edges.
    fn counts(&self, edges: u32) -> [u32; 3] {
        let Techniques { connections, light_tracing, merges } = self.techniques;
        let beyond_the_hit = edges - 1;
        let count = |on: bool, most: u32| if on { most } else { 0 };
        // A light seen directly is left to the emitter hit.
        [1 + count(connections, beyond_the_hit), count(light_tracing, beyond_the_hit.min(1)), count(merges, beyond_the_hit)]
    }

    fn lengths(&self) -> impl Iterator<Item = u32> {
        self.depths.min.max(1)..=self.depths.max
    }

    /// Number of the image with weights.
    fn number(&self, edges: u32, technique: Technique) -> usize {
        let shorter: u32 = self.lengths().take_while(|&k| k < edges).map(|k| self.counts(k).iter().sum::<u32>()).sum();
        let [connections, splats, _] = self.counts(edges);
        let within = match technique {
            Technique::Connection(s) => s,
            Technique::Splat => connections,
            Technique::Merge(i) => connections + splats + i - 1,
        };
        (shorter + within) as usize
    }

    /// How many images have weights; as many have none.
    fn half(&self) -> usize {
        self.lengths().map(|k| self.counts(k).iter().sum::<u32>() as usize).sum()
    }

    /// The images: rows of the contact sheet are lengths, columns techniques; the rows without weights stand below the others.
    pub(super) fn layers(&self) -> Vec<Layer> {
        let most = self.counts(self.depths.max.max(1));
        let rows = self.lengths().count();
        let mut layers = Vec::new();
        for (part, name) in ["weighted", "unweighted"].into_iter().enumerate() {
            for (row, edges) in self.lengths().enumerate() {
                let [connections, splats, merges] = self.counts(edges);
                let of = |count: u32, from: u32, technique: fn(u32) -> Technique| (0..count).map(move |i| (from + i, technique(i)));
                let all = of(connections, 0, Technique::Connection).chain(of(splats, most[0], |_| Technique::Splat));
                for (column, technique) in all.chain(of(merges, most[0] + most[1], |i| Technique::Merge(i + 1))) {
                    layers.push(Layer {
                        name: format!("{name}.{edges}.{}", String::from(technique)),
                        place: [part * rows + row, column as usize],
                        splats: technique == Technique::Splat,
                    });
                }
            }
        }
        layers
    }
}

/// What is added to an image and to its counterpart without weights.
#[derive(Clone, Copy, Debug)]
struct Found {
    pixel: u32,
    /// Of the image with weights.
    number: u32,
    weighted: Rgb,
    unweighted: Rgb,
}

impl Found {
    /// Values that are not finite count as zero. They are counted here where the film has not done so.
    fn new(pixel: u32, number: usize, weighted: Rgb, unweighted: Rgb, tally: &mut Tally) -> Self {
        let black = Self { pixel, number: number as u32, weighted: Rgb::BLACK, unweighted: Rgb::BLACK };
        if weighted.is_finite() { Self { weighted, unweighted: tally.finite(unweighted), ..black } } else { black }
    }

    fn add_to(&self, layers: &mut LayerSums, half: usize) {
        let Self { pixel, number, weighted, unweighted } = *self;
        layers.add(number as usize, pixel as usize, weighted);
        layers.add(half + number as usize, pixel as usize, unweighted);
    }
}

/// What the camera subpaths of some pixels found, one entry a pixel and technique.
struct Record<'p> {
    pyramid: &'p Pyramid,
    pixel: u32,
    /// Where the pixel's entries begin.
    first: usize,
    found: Vec<Found>,
    tally: Tally,
}

impl Recorder for Record<'_> {
    const ON: bool = true;
    fn start(&mut self, pixel: usize) {
        (self.pixel, self.first) = (pixel as u32, self.found.len());
    }
    fn add(&mut self, edges: u32, technique: Technique, weighted: Rgb, unweighted: Rgb) {
        let number = self.pyramid.number(edges, technique);
        let new = Found::new(self.pixel, number, weighted, unweighted, &mut self.tally);
        match self.found[self.first..].iter_mut().find(|found| found.number == new.number) {
            Some(found) => {
                found.weighted += new.weighted;
                found.unweighted += new.unweighted;
            }
            None => self.found.push(new),
        }
    }
}

impl Iteration<'_, '_> {
    /// A camera subpath a pixel, and what it is joined with, into the film.
    pub(super) fn camera_side(
        &self,
        film: &mut Film,
        light: &LightSide,
        merging: Option<&Merging>,
        density: Option<&DensityMap>,
        stats: &mut IterationStats,
    ) {
        let joined = Joined { light, merging, density };
        let Some((pyramid, mut layers)) = Pyramid::new(self.techniques, self.depths).zip(film.take_layers()) else {
            return self.trace_reading(film, &joined, stats, || Nothing, |_, _| {});
        };
        let record = || Record { pyramid: &pyramid, pixel: 0, first: 0, found: Vec::new(), tally: Tally::default() };
        let half = pyramid.half();
        self.trace_reading(film, &joined, stats, record, |record, stats| {
            record.found.iter().for_each(|found| found.add_to(&mut layers, half));
            stats.count(&record.tally);
        });
        film.keep_layers(layers);
    }

    /// Splats into the film's layers, batch after batch.
    pub(super) fn record_splats<'s>(&self, film: &mut Film, splats: impl Iterator<Item = &'s RecordedSplat>, stats: &mut IterationStats) {
        let Some((pyramid, mut layers)) = Pyramid::new(self.techniques, self.depths).zip(film.take_layers()) else { return };
        let (half, mut tally) = (pyramid.half(), Tally::default());
        for splat in splats {
            let number = pyramid.number(splat.edges, Technique::Splat);
            Found::new(splat.pixel, number, splat.weighted, splat.unweighted, &mut tally).add_to(&mut layers, half);
        }
        stats.count(&tally);
        film.keep_layers(layers);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrators::photon_settings::{PhotonSettings, SamplerName};
    use crate::integrators::vcm::{BdptSettings, MergeWeightsName, SharedSettings, VcmSettings};
    use crate::integrators::{BoxedSettings, Common, MethodError};
    use crate::scene::Scene;
    use crate::scene::mitsuba::{LoadOptions, load};
    use std::path::Path;

    const SIZE: (usize, usize) = (24, 18);
    const COMMON: Common = Common { seed: 3, max_depth: Some(5), min_depth: 1, rr_depth: 5, hide_emitters: false, paths: None };

    fn scene(name: &str) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).join("scene.xml");
        load(&path, &LoadOptions { resolution: Some((SIZE.0 as u32, SIZE.1 as u32)), ..LoadOptions::default() }).expect("loads").scene
    }

    /// Three iterations, with images of techniques or without.
    fn film(scene: &Scene, settings: &dyn BoxedSettings, common: &Common, keeps: bool) -> Film {
        let mut method = settings.build(scene, SIZE, common).expect("builds");
        let mut film = Film::new(SIZE.0, SIZE.1, false);
        method.prepare().expect("prepares");
        if keeps {
            film.keep_layers(LayerSums::new(method.technique_layers().expect("short enough"), SIZE.0 * SIZE.1));
        }
        for i in 0..3 {
            method.iterate(i, &mut film);
            film.finish_iteration();
        }
        film
    }

    fn star(alone: Option<Technique>) -> VcmSettings {
        VcmSettings {
            merge_weights: MergeWeightsName::VcmStar,
            shared: SharedSettings { alone, ..SharedSettings::default() },
            ..VcmSettings::default()
        }
    }

    /// The layers whose name begins so.
    fn images<'f>(film: &'f Film, start: &'f str) -> impl Iterator<Item = Vec<Rgb>> + 'f {
        let layers = film.layers().expect("kept").layers();
        layers.iter().zip(film.layer_means()).filter(move |(layer, _)| layer.name.starts_with(start)).map(|(_, mean)| mean)
    }

    /// Sums of the same numbers in another order and precision.
    fn agree(a: &[Rgb], b: &[Rgb], what: &str) {
        assert_eq!(a.len(), b.len());
        for (i, (a, b)) in a.iter().zip(b).enumerate() {
            for c in 0..3 {
                assert!((a[c] - b[c]).abs() <= 1e-5 * b[c].abs() + 1e-7, "{what}, pixel {i}: {a:?}, {b:?}");
            }
        }
    }

    #[test]
    fn images_with_weights_add_up_to_the_image() {
        let classes = Common { paths: Some(crate::transport::class::pattern("L.*D.*E").expect("a pattern")), min_depth: 2, ..COMMON };
        let photons = PhotonSettings { sampler: SamplerName::Visibility, photons: Some(2000), ..PhotonSettings::default() };
        let chains = VcmSettings { photons, ..VcmSettings::default() };
        let (vcm, bdpt) = (star(None), BdptSettings::default());
        let settings: [&dyn BoxedSettings; 3] = [&vcm, &bdpt, &chains];
        for (name, settings, common) in [
            ("glass-room", settings[0], &COMMON),
            ("glass-room", settings[1], &COMMON),
            ("glass-room", settings[2], &COMMON),
            ("spheres", settings[0], &classes),
        ] {
            let scene = scene(name);
            let film = film(&scene, settings, common, true);
            let mut sum = vec![Rgb::BLACK; SIZE.0 * SIZE.1];
            for image in images(&film, "weighted.") {
                sum.iter_mut().zip(image).for_each(|(sum, value)| *sum += value);
            }
            agree(&sum, &film.mean(), name);
            assert!(film.mean().iter().any(|pixel| !pixel.is_black()));
            let plain = self::film(&scene, settings, common, false);
            assert_eq!(film.mean(), plain.mean(), "the image is the same with a pyramid and without");
        }
    }

    /// Every technique and length that has any light, against a render of nothing else.
    #[test]
    fn images_without_weights_are_those_of_single_techniques() {
        let scene = scene("glass-room");
        let pyramid = film(&scene, &star(None), &COMMON, true);
        let layers = pyramid.layers().expect("kept").layers().to_vec();
        let mut lit = 0;
        for (layer, image) in layers.iter().zip(pyramid.layer_means()) {
            let Some((edges, technique)) = layer.name.strip_prefix("unweighted.").and_then(|rest| rest.split_once('.')) else { continue };
            let (edges, technique): (u32, Technique) = (edges.parse().expect("a number"), technique.parse().expect("a technique"));
            // Lengths share their techniques: one long one and one short one will do.
            if ![2, 5].contains(&edges) {
                continue;
            }
            let common = Common { min_depth: edges, max_depth: Some(edges), ..COMMON };
            agree(&image, &film(&scene, &star(Some(technique)), &common, false).mean(), &layer.name);
            lit += usize::from(image.iter().any(|pixel| !pixel.is_black()));
        }
        assert!(lit >= 8, "{lit} images have light");
    }

    #[test]
    fn threads_change_no_bit() {
        let scene = scene("double-merge");
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| film(&scene, &star(None), &COMMON, true))
        };
        assert!(on(1) == on(3));
    }

    #[test]
    fn a_pyramid_needs_an_end() {
        let scene = scene("box");
        for (max_depth, fits) in [(None, false), (Some(LONGEST + 1), false), (Some(LONGEST), true)] {
            let method = BoxedSettings::build(&star(None), &scene, SIZE, &Common { max_depth, ..COMMON }).expect("builds");
            let layers = method.technique_layers();
            assert_eq!(layers.is_ok(), fits, "{max_depth:?}");
            assert!(fits || matches!(layers, Err(MethodError::PyramidDepth { most: LONGEST })));
        }
    }

    /// Every length and technique has its own number, and the layer of that number its name.
    #[test]
    fn numbers_and_names_agree() {
        let sets = [Techniques::VCM, Techniques::BDPT, Techniques::BPM, Techniques::LIGHT_TRACING];
        for (techniques, min) in sets.into_iter().flat_map(|set| [(set, 0), (set, 1), (set, 3)]) {
            let pyramid = Pyramid::new(techniques, DepthRange { min, max: 6 }).expect("short enough");
            let layers = pyramid.layers();
            assert_eq!(layers.len(), 2 * pyramid.half());
            let mut places: Vec<[usize; 2]> = layers.iter().map(|layer| layer.place).collect();
            places.sort_unstable();
            places.dedup();
            assert_eq!(places.len(), layers.len(), "no two in one place");
            for (i, layer) in layers.iter().enumerate() {
                let [part, edges, technique] = layer.name.split('.').collect::<Vec<_>>()[..] else { panic!("{}", layer.name) };
                let number = pyramid.number(edges.parse().expect("a number"), technique.parse().expect("a technique"));
                assert_eq!(i, number + if part == "weighted" { 0 } else { pyramid.half() }, "{}", layer.name);
            }
        }
    }

    #[test]
    fn the_set_and_the_length_say_what_there_is() {
        let names = |techniques, min, max| -> String {
            let layers = Pyramid::new(techniques, DepthRange { min, max }).expect("short enough").layers();
            let weighted = layers.iter().filter_map(|layer| layer.name.strip_prefix("weighted."));
            weighted.collect::<Vec<_>>().join(" ")
        };
        assert_eq!(names(Techniques::VCM, 1, 3), "1.vc0 2.vc0 2.vc1 2.lt 2.vm1 3.vc0 3.vc1 3.vc2 3.lt 3.vm1 3.vm2");
        assert_eq!(names(Techniques::BDPT, 2, 2), "2.vc0 2.vc1 2.lt");
        assert_eq!(names(Techniques::BPM, 2, 3), "2.vc0 2.vm1 3.vc0 3.vm1 3.vm2");
        assert!(Pyramid::new(Techniques::VCM, DepthRange { min: 1, max: LONGEST + 1 }).is_none());
    }
}
