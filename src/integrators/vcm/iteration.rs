//! What all subpaths of one iteration have in common.

use super::super::Common;
use super::technique::Technique;
use crate::math::Rgb;
use crate::scene::bsdf::Mode;
use crate::scene::hit::Endpoint;
use crate::targets::aimed::Gain;
use crate::targets::points::DepthRange;
use crate::transport::class::Letters;
use crate::transport::mis::Techniques;
use crate::transport::shading::SurfacePoint;
use crate::transport::subpath::{EVENTS, Subpaths, event_values};
use glam::Vec3;
use regex::Regex;

/// One iteration of the engine.
#[derive(Clone, Copy)]
pub(super) struct Iteration<'a, 'w> {
    pub(super) subpaths: Subpaths<'a, 'w>,
    pub(super) techniques: Techniques,
    pub(super) common: &'w Common,
    /// Its absolute index.
    pub(super) index: u64,
    /// Width and height, pixels.
    pub(super) size: (usize, usize),
    /// Path lengths that count.
    pub(super) depths: DepthRange,
    /// Radius of merges, world units.
    pub(super) radius: f32,
    /// Light subpaths an iteration.
    pub(super) light_paths: f64,
    /// Camera subpaths of a pixel.
    pub(super) camera_paths: usize,
    /// One over the area of merges and the number of light subpaths.
    pub(super) merge_density: f32,
    /// How much denser light subpaths lie than independent ones, by place; `None` where they are independent.
    pub(super) gain: Option<Gain<'w>>,
    /// The one technique that counts, with weight 1; `None` for all of the set with their weights.
    pub(super) alone: Option<Technique>,
    /// Are images of single techniques kept?
    pub(super) records: bool,
}

/// A surface point on a path, the walk that came to it, and the direction in which the path goes on.
pub(super) type Way<'p, 'a> = (&'p SurfacePoint<'a>, Mode, Vec3);

impl Iteration<'_, '_> {
    pub(super) fn pixels(&self) -> u64 {
        (self.size.0 * self.size.1) as u64
    }

    /// Are light vertices asked for after their path is traced?
    pub(super) fn keeps_vertices(&self) -> bool {
        self.techniques.connections || self.techniques.merges
    }

    /// Density of camera rays through a pixel as weights take it: splats are as many as light subpaths lie at the surface.
    #[inline(always)]
    pub(super) fn pixel_density(&self, pixel: f32, end: &Endpoint) -> f32 {
        self.gain.map_or(pixel, |gain| pixel / gain.at(end))
    }

    /// The weight that counts.
    #[inline(always)]
    pub(super) fn weigh(&self, technique: Technique, weight: f32) -> f32 {
        match self.alone {
            None => weight,
            Some(alone) => f32::from(u8::from(alone == technique)),
        }
    }

    /// Share of the value at `way` whose event, between `light`'s and `camera`'s, makes a class that matches.
    pub(super) fn one_event(&self, pattern: &Regex, light: Letters, way: Way<'_, '_>, camera: Letters) -> Rgb {
        let matching = |letter: u8| light.join(&[letter], camera, pattern);
        let values = event_values(way.0, way.1, way.2);
        let sum: Rgb = EVENTS.iter().zip(values).filter(|((_, letter), _)| matching(*letter)).map(|(_, value)| value).sum();
        sum.over(values[0] + values[1])
    }

    /// As [`Iteration::one_event`], for two events on an edge that joins two subpaths: first the light's, then the camera's.
    pub(super) fn two_events(&self, pattern: &Regex, light: Letters, ways: [Way<'_, '_>; 2], camera: Letters) -> Rgb {
        let [near_light, near_camera] = ways.map(|way| event_values(way.0, way.1, way.2));
        let mut sum = Rgb::BLACK;
        for ((_, first), a) in EVENTS.iter().zip(near_light) {
            for ((_, second), b) in EVENTS.iter().zip(near_camera) {
                if light.join(&[*first, *second], camera, pattern) {
                    sum += a * b;
                }
            }
        }
        sum.over((near_light[0] + near_light[1]) * (near_camera[0] + near_camera[1]))
    }
}
