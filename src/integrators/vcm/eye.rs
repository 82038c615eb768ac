//! The camera's side: a subpath a pixel, and everything it is joined with.

use super::iteration::Iteration;
use super::light::{LightSide, LightVertex};
use super::technique::Technique;
use crate::math::Rgb;
use crate::samplers::{Key, Purpose, Stream};
use crate::scene::bsdf::Mode;
use crate::scene::hit::Hit;
use crate::transport::class::Letters;
use crate::transport::mis::{Connector, Edge, LightEnd};
use crate::transport::shading::SurfacePoint;
use crate::transport::subpath::{Departure, Start, SubpathVertex};
use crate::transport::walk::{Tally, beyond_emitters};
use glam::Vec2;

impl<'a> Iteration<'a, '_> {
    /// What a pixel's camera subpath finds.
    pub(super) fn pixel(&self, x: usize, y: usize, light: &LightSide, tally: &mut Tally) -> Rgb {
        let number = y * self.size.0 + x;
        let mut stream = Key { seed: self.common.seed, iteration: self.index, index: number as u64, purpose: Purpose::Camera }.stream();
        let film = Vec2::new(x as f32, y as f32) + Vec2::from(stream.next_2d());
        let lens = Vec2::from(stream.next_2d());
        let seen = self.subpaths.scene.camera().ray(film, lens);
        let mut ray = seen.ray;
        if self.common.hide_emitters {
            ray = beyond_emitters(self.subpaths.scene, ray, tally).0;
        }
        let first = |hit: &Hit, share: f32| {
            let edge = Edge::between(1.0, ray.d.dot(hit.end.n_g).abs(), seen.end.p.distance_squared(hit.end.p));
            self.subpaths.weights.from_camera(seen.pdf_pixel.0, edge, share)
        };
        let start = Start { ray, from: seen.end, throughput: Rgb::WHITE };
        let mut sum = Rgb::BLACK;
        let departure = self.subpaths.walk(Mode::Radiance, start, &mut stream, tally, first, |vertex, stream, tally| {
            if vertex.hit.emitter.is_some() {
                sum += tally.finite(self.hit(vertex));
            }
            let goes_on = vertex.carried.edges < self.depths.max;
            if let Some(point) = vertex.point.filter(|point| goes_on && point.bsdf.max_roughness() > 0.0) {
                if self.techniques.connections {
                    let found = self.next_event(vertex, &point, stream, tally);
                    sum += tally.finite(found);
                    for (partner, letters) in light.partner(number) {
                        let found = self.connect(vertex, &point, partner, letters, tally);
                        sum += tally.finite(found);
                    }
                }
            }
            goes_on
        });
        if let Some(departure) = departure {
            sum += tally.finite(self.escape(&departure));
        }
        sum
    }

    /// Does emission count that is met after so many edges?
    fn emission_counts(&self, edges: u32, letters: Letters) -> bool {
        let hidden = edges == 1 && self.common.hide_emitters;
        let matches = || self.common.paths.as_ref().is_none_or(|pattern| Letters::default().join(&[], letters, pattern));
        !hidden && self.depths.contains(edges) && matches()
    }

    /// A light that was hit.
    fn hit(&self, vertex: &SubpathVertex<'a>) -> Rgb {
        let (scene, weights) = (self.subpaths.scene, self.subpaths.weights);
        let emitted = scene.emitted(&vertex.hit, -vertex.d, vertex.from.p);
        if emitted.radiance.is_black() || !self.emission_counts(vertex.carried.edges, vertex.letters) {
            return Rgb::BLACK;
        }
        let weight = match vertex.carried.edges {
            1 => 1.0,
            _ => LightEnd::of_hit(scene, &vertex.hit, vertex.d, &vertex.from)
                .map_or(0.0, |end| weights.emitter_hit(&vertex.carried, &end.emission)),
        };
        vertex.throughput * emitted.radiance * self.weigh(Technique::Connection(0), weight)
    }

    /// The light all around.
    fn escape(&self, departure: &Departure) -> Rgb {
        let (scene, weights) = (self.subpaths.scene, self.subpaths.weights);
        let emitted = scene.escaped(departure.d);
        if emitted.radiance.is_black() || !self.emission_counts(departure.edges, departure.letters) {
            return Rgb::BLACK;
        }
        let weight = departure.last.map_or(1.0, |(from, carried, scatter)| {
            LightEnd::of_escape(scene, departure.d, &from).map_or(0.0, |end| {
                let carried = weights.extend(&carried, scatter, end.edge.reversed(), 0.0);
                weights.emitter_hit(&carried, &end.emission)
            })
        });
        departure.throughput * emitted.radiance * self.weigh(Technique::Connection(0), weight)
    }

    /// A light sample.
    fn next_event<S: Stream>(&self, vertex: &SubpathVertex<'a>, point: &SurfacePoint<'a>, stream: &mut S, tally: &mut Tally) -> Rgb {
        let scene = self.subpaths.scene;
        let (u_emitter, u) = (stream.next_1d(), Vec2::from(stream.next_2d()));
        if !self.depths.contains(vertex.carried.edges + 1) {
            return Rgb::BLACK;
        }
        let Some(sample) = scene.sample_direct(point.end.p, u_emitter, u) else { return Rgb::BLACK };
        let Some(met) = point.meet(Mode::Radiance, sample.wi) else { return Rgb::BLACK };
        let LightEnd { emission, edge } = LightEnd::of_direct(scene, &sample, &point.end);
        let weight = self.subpaths.weights.next_event(&vertex.carried, &emission, edge, met.fwd, met.rev);
        let cos = point.cosine(Mode::Radiance, sample.wi);
        let factor = self.weigh(Technique::Connection(1), weight) * cos / sample.pdf.0;
        let mut value = vertex.throughput * met.f * sample.radiance * factor;
        if let Some(pattern) = &self.common.paths {
            value *= self.one_event(pattern, Letters::default(), (point, Mode::Radiance, sample.wi), vertex.letters);
        }
        if value.is_black() {
            return value;
        }
        tally.rays += 1;
        if scene.visible(&point.end, &sample) { value } else { Rgb::BLACK }
    }

    /// A connection to a light vertex.
    fn connect(
        &self,
        vertex: &SubpathVertex<'a>,
        point: &SurfacePoint<'a>,
        partner: &LightVertex,
        letters: Letters,
        tally: &mut Tally,
    ) -> Rgb {
        if !self.depths.contains(vertex.carried.edges + partner.carried.edges + 1) {
            return Rgb::BLACK;
        }
        let scene = self.subpaths.scene;
        let between = partner.end.p - point.end.p;
        let distance2 = between.length_squared();
        if distance2 == 0.0 {
            return Rgb::BLACK;
        }
        let w = between / distance2.sqrt();
        let other = partner.point(scene);
        let (Some(here), Some(there)) = (point.meet(Mode::Radiance, w), other.meet(Mode::Importance, -w)) else { return Rgb::BLACK };
        let edge = Edge::between(w.dot(partner.end.n_g).abs(), w.dot(point.end.n_g).abs(), distance2);
        let weight = self.subpaths.weights.connection(
            &Connector { carried: &partner.carried, rev: there.rev, found: here.fwd * edge.back },
            &Connector { carried: &vertex.carried, rev: here.rev, found: there.fwd * edge.ahead },
        );
        let cosines = point.cosine(Mode::Radiance, w) * other.cosine(Mode::Importance, -w);
        let factor = self.weigh(Technique::Connection(partner.carried.edges + 1), weight) * cosines / distance2;
        let mut value = vertex.throughput * here.f * there.f * partner.flux * factor;
        if let Some(pattern) = &self.common.paths {
            let ways = [(&other, Mode::Importance, -w), (point, Mode::Radiance, w)];
            value *= self.two_events(pattern, letters, ways, vertex.letters);
        }
        if value.is_black() {
            return value;
        }
        tally.rays += 1;
        if scene.occluded(&point.end, &partner.end) { Rgb::BLACK } else { value }
    }
}
