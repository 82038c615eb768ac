//! All emitters of a scene with a choice by power: every question about light goes through here.

use super::{DirectSample, EmissionPdf, EmissionSample, Emitted, Emitter, EmitterError, EmitterKind, LightPoint, area};
use crate::math::distribution::{Choice, Discrete};
use crate::math::{AreaPdf, Frame, Rgb, SolidAnglePdf, warp};
use crate::scene::EmitterId;
use crate::scene::hit::{Endpoint, Hit};
use crate::scene::shape::surface::Surfaces;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

impl Emitter {
    /// What can reach it.
    pub fn kind(&self) -> EmitterKind {
        match self {
            Emitter::Area(_) => EmitterKind::Surface,
            Emitter::Point(_) | Emitter::Spot(_) => EmitterKind::DeltaPosition,
            Emitter::Directional(_) => EmitterKind::DeltaDirection,
            Emitter::Constant(_) | Emitter::Envmap(_) => EmitterKind::Infinite,
        }
    }

    /// Its plugin name in scene files.
    pub fn name(&self) -> &'static str {
        match self {
            Emitter::Area(_) => "area",
            Emitter::Point(_) => "point",
            Emitter::Spot(_) => "spot",
            Emitter::Directional(_) => "directional",
            Emitter::Constant(_) => "constant",
            Emitter::Envmap(_) => "envmap",
        }
    }
}

/// The ball that emitters at infinity shine on.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::scene) struct Ball {
    pub(in crate::scene) center: Vec3,
    pub(in crate::scene) radius: f32,
}

impl Ball {
    /// The ball around a box, with room for rounding.
    pub(in crate::scene) fn around(min: Vec3, max: Vec3) -> Self {
        let center = 0.5 * min + 0.5 * max;
        Self { center, radius: (max - center).length() * (1.0 + 16.0 * f32::EPSILON) + center.abs().max_element() * f32::EPSILON }
    }

    /// Area of its shadow.
    fn shadow(&self) -> f32 {
        PI * self.radius * self.radius
    }

    /// Density of positions on the disk as large as the shadow; infinite for a ball without extent, whose emitters have no power.
    fn pdf(&self) -> AreaPdf {
        AreaPdf(1.0 / self.shadow())
    }

    /// A point on the disk facing along the frame's normal, before the ball.
    fn start(&self, frame: &Frame, u: Vec2) -> Endpoint {
        let on_disk = warp::disk(u) * self.radius;
        Endpoint::free(self.center + frame.to_world(on_disk.extend(-self.radius)))
    }

    /// A point along `d` that is outside the ball.
    fn beyond(&self, from: Vec3, d: Vec3) -> Endpoint {
        Endpoint::free(from + d * (2.0 * (from.distance(self.center) + self.radius)))
    }
}

/// Every emitter, and how likely each is to be chosen.
#[derive(Debug)]
pub(in crate::scene) struct Emitters {
    list: Vec<Emitter>,
    powers: Vec<Rgb>,
    /// By power; `None` if there is no light at all.
    choice: Option<Discrete>,
    /// The emitter that surrounds the scene.
    environment: Option<EmitterId>,
    ball: Ball,
    /// Direct sampling always means a point uniform by area.
    by_area: bool,
}

impl Emitters {
    /// Refuses powers that are negative or not finite; the caller has counted the environments.
    pub(in crate::scene) fn new(list: Vec<Emitter>, ball: Ball, surfaces: &Surfaces) -> Result<Self, (usize, EmitterError)> {
        let mut powers = Vec::with_capacity(list.len());
        for (number, emitter) in list.iter().enumerate() {
            let (power, what) = power(emitter, &ball, surfaces);
            if !(power.is_finite() && power.to_array().iter().all(|&c| c >= 0.0)) {
                return Err((number, EmitterError::Value { what, value: power.to_array() }));
            }
            powers.push(power);
        }
        let choice = Discrete::new(powers.iter().map(|p| f64::from(p.mean())));
        let environment = list.iter().position(|e| e.kind() == EmitterKind::Infinite).map(|i| EmitterId(i as u32));
        let by_area = list.iter().all(|e| matches!(e, Emitter::Area(a) if a.by_area()));
        Ok(Self { list, powers, choice, environment, ball, by_area })
    }

    pub(in crate::scene) fn list(&self) -> &[Emitter] {
        &self.list
    }

    pub(in crate::scene) fn power(&self, emitter: EmitterId) -> Rgb {
        self.powers[emitter.0 as usize]
    }

    pub(in crate::scene) fn environment(&self) -> Option<EmitterId> {
        self.environment
    }

    pub(in crate::scene) fn memory(&self) -> usize {
        let own = |e: &Emitter| match e {
            Emitter::Area(a) => a.memory(),
            Emitter::Envmap(m) => m.memory(),
            _ => 0,
        };
        self.list.capacity() * size_of::<Emitter>()
            + self.list.iter().map(own).sum::<usize>()
            + self.powers.capacity() * size_of::<Rgb>()
            + self.choice.as_ref().map_or(0, Discrete::memory)
    }

    /// Probability with which an emitter is chosen.
    #[inline]
    pub(in crate::scene) fn pick_probability(&self, emitter: EmitterId) -> f32 {
        self.choice.as_ref().map_or(0.0, |choice| choice.probability(emitter.0 as usize))
    }

    #[inline(always)]
    fn pick(&self, u: f32) -> Option<(EmitterId, &Emitter, Choice)> {
        let choice = self.choice.as_ref()?.sample(u);
        Some((EmitterId(choice.index as u32), &self.list[choice.index], choice))
    }

    #[inline(always)]
    pub(in crate::scene) fn sample_direct(&self, surfaces: &Surfaces, from: Vec3, u_pick: f32, u: Vec2) -> Option<DirectSample> {
        let (id, emitter, choice) = self.pick(u_pick)?;
        let Emitter::Area(area) = emitter else {
            let DirectSample { emitter, kind, wi, end, distance, cos_light, radiance, pdf } =
                self.sample_no_surface(id, from, choice.probability, u)?;
            let Endpoint { p, n_g, offset } = end;
            return Some(DirectSample { emitter, kind, wi, end: Endpoint { p, n_g, offset }, distance, cos_light, radiance, pdf });
        };
        let s = area.sample_direct(surfaces, from, choice.rest, u)?;
        Some(DirectSample {
            emitter: id,
            kind: EmitterKind::Surface,
            wi: s.wi,
            end: s.end,
            distance: s.distance,
            cos_light: s.cos_light,
            radiance: s.radiance,
            pdf: s.pdf * choice.probability,
        })
    }

    /// The choice of an emitter and a point on it, of which [`Emitters::sample_direct`] makes a light sample. `None` if some emitter of the
    /// scene is not sampled by area, and in a scene without light.
    #[inline(always)]
    pub(in crate::scene) fn sample_point(&self, surfaces: &Surfaces, u_pick: f32, u: Vec2) -> Option<LightPoint> {
        match self.pick(u_pick)? {
            (_, Emitter::Area(area), choice) if self.by_area => Some(area.sample_point(surfaces, choice.probability, choice.rest, u)),
            _ => None,
        }
    }

    pub(in crate::scene) fn by_area(&self) -> bool {
        self.by_area && self.choice.is_some()
    }

    /// A light sample on an emitter that has no surface, chosen with probability `pick`.
    #[inline(never)]
    fn sample_no_surface(&self, id: EmitterId, from: Vec3, pick: f32, u: Vec2) -> Option<DirectSample> {
        let emitter = &self.list[id.0 as usize];
        let kind = emitter.kind();
        let infinite = |wi: Vec3, radiance: Rgb, pdf: SolidAnglePdf| DirectSample {
            emitter: id,
            kind,
            wi,
            end: self.ball.beyond(from, wi),
            distance: f32::INFINITY,
            cos_light: 1.0,
            radiance,
            pdf: pdf * pick,
        };
        let delta = |position: Vec3, intensity: &dyn Fn(Vec3) -> Rgb| {
            let to_light = position - from;
            let distance2 = to_light.length_squared();
            let distance = distance2.sqrt();
            let wi = to_light / distance;
            let radiance = intensity(-wi) / distance2;
            (distance > 0.0 && !radiance.is_black()).then_some(DirectSample {
                emitter: id,
                kind,
                wi,
                end: Endpoint::free(position),
                distance,
                cos_light: 1.0,
                radiance,
                pdf: SolidAnglePdf(pick),
            })
        };
        match emitter {
            Emitter::Area(_) => None,
            Emitter::Point(p) => delta(p.position, &|_| p.intensity),
            Emitter::Spot(s) => delta(s.position(), &|d| s.intensity(d)),
            Emitter::Directional(d) => Some(infinite(-d.direction(), d.irradiance, SolidAnglePdf(1.0))),
            Emitter::Constant(c) => Some(infinite(warp::sphere(u), c.radiance, warp::SPHERE_PDF)),
            Emitter::Envmap(m) => m.sample(u).map(|(wi, radiance, pdf)| infinite(wi, radiance, pdf)),
        }
    }

    #[inline]
    pub(in crate::scene) fn sample_emission(
        &self,
        surfaces: &Surfaces,
        u_pick: f32,
        u_position: Vec2,
        u_direction: Vec2,
    ) -> Option<EmissionSample> {
        let (id, emitter, choice) = self.pick(u_pick)?;
        let (end, d, cos_light, light, pdf) = match emitter {
            Emitter::Area(a) => {
                let (end, d, cos_light, radiance) = a.sample_emission(surfaces, choice.rest, u_position, u_direction)?;
                (end, d, cos_light, radiance, a.emission_pdf(cos_light))
            }
            Emitter::Point(p) => {
                let d = warp::sphere(u_direction);
                (Endpoint::free(p.position), d, 1.0, p.intensity, EmissionPdf { position: AreaPdf(1.0), direction: p.pdf_direction() })
            }
            Emitter::Spot(s) => {
                let d = s.sample_direction(u_direction);
                let pdf = EmissionPdf { position: AreaPdf(1.0), direction: s.pdf_direction(d) };
                (Endpoint::free(s.position()), d, 1.0, s.intensity(d), pdf)
            }
            Emitter::Directional(d) => {
                let pdf = EmissionPdf { position: self.ball.pdf(), direction: SolidAnglePdf(1.0) };
                (self.ball.start(&d.frame, u_position), d.direction(), 1.0, d.irradiance, pdf)
            }
            Emitter::Constant(c) => {
                let frame = Frame::from_normal(warp::sphere(u_direction));
                let pdf = EmissionPdf { position: self.ball.pdf(), direction: warp::SPHERE_PDF };
                (self.ball.start(&frame, u_position), frame.n, 1.0, c.radiance, pdf)
            }
            Emitter::Envmap(m) => {
                let (wi, radiance, direction) = m.sample(u_direction)?;
                let pdf = EmissionPdf { position: self.ball.pdf(), direction };
                (self.ball.start(&Frame::from_normal(-wi), u_position), -wi, 1.0, radiance, pdf)
            }
        };
        let pdf_position = pdf.position * choice.probability;
        let flux = light * (cos_light / (pdf_position.0 * pdf.direction.0));
        (!light.is_black() && pdf.direction.0 > 0.0).then_some(EmissionSample {
            emitter: id,
            kind: emitter.kind(),
            end,
            d,
            cos_light,
            flux,
            pdf_position,
            pdf_direction: pdf.direction,
        })
    }

    #[inline]
    pub(in crate::scene) fn emitted(&self, hit: &Hit, wo: Vec3, from: Vec3) -> Emitted {
        let Some((id, Emitter::Area(a))) = hit.emitter.map(|id| (id, &self.list[id.0 as usize])) else {
            return Emitted::default();
        };
        let mut emitted = a.emitted(&hit.end, hit.frame.n, hit.uv, wo, from);
        emitted.pdf_direct = emitted.pdf_direct * self.pick_probability(id);
        emitted
    }

    #[inline]
    pub(in crate::scene) fn escaped(&self, d: Vec3) -> Emitted {
        let Some(id) = self.environment else {
            return Emitted::default();
        };
        let (radiance, pdf) = self.environment_along(id, d);
        Emitted { radiance, pdf_direct: pdf * self.pick_probability(id) }
    }

    /// Radiance and density of direction, the choice not included.
    fn environment_along(&self, id: EmitterId, d: Vec3) -> (Rgb, SolidAnglePdf) {
        match &self.list[id.0 as usize] {
            Emitter::Constant(c) => (c.radiance, warp::SPHERE_PDF),
            Emitter::Envmap(m) => m.eval_pdf(d),
            _ => (Rgb::BLACK, SolidAnglePdf(0.0)),
        }
    }

    #[inline]
    pub(in crate::scene) fn emission_pdf(&self, hit: &Hit, d: Vec3) -> EmissionPdf {
        let Some((id, Emitter::Area(a))) = hit.emitter.map(|id| (id, &self.list[id.0 as usize])) else {
            return EmissionPdf::default();
        };
        match area::emission_cosine(hit.end.n_g, hit.frame.n, d) {
            Some(cos_light) => self.with_choice(id, a.emission_pdf(cos_light)),
            None => EmissionPdf::default(),
        }
    }

    pub(in crate::scene) fn emission_pdf_escaped(&self, d: Vec3) -> EmissionPdf {
        let Some(id) = self.environment.filter(|id| self.pick_probability(*id) > 0.0) else {
            return EmissionPdf::default();
        };
        let direction = self.environment_along(id, d).1;
        self.with_choice(id, EmissionPdf { position: self.ball.pdf(), direction })
    }

    #[inline]
    pub(in crate::scene) fn emission_pdf_direct(&self, sample: &DirectSample) -> EmissionPdf {
        let id = sample.emitter;
        let pdf = match &self.list[id.0 as usize] {
            Emitter::Area(a) => a.emission_pdf(sample.cos_light),
            Emitter::Point(p) => EmissionPdf { position: AreaPdf(1.0), direction: p.pdf_direction() },
            Emitter::Spot(s) => EmissionPdf { position: AreaPdf(1.0), direction: s.pdf_direction(-sample.wi) },
            Emitter::Directional(_) => EmissionPdf { position: self.ball.pdf(), direction: SolidAnglePdf(1.0) },
            Emitter::Constant(_) | Emitter::Envmap(_) => {
                EmissionPdf { position: self.ball.pdf(), direction: self.environment_along(id, sample.wi).1 }
            }
        };
        self.with_choice(id, pdf)
    }

    #[inline]
    pub(in crate::scene) fn direct_pdf(&self, sample: &EmissionSample, from: Vec3) -> SolidAnglePdf {
        let id = sample.emitter;
        let pdf = match &self.list[id.0 as usize] {
            Emitter::Area(a) => a.pdf_direct(&sample.end, sample.cos_light, from),
            Emitter::Point(_) | Emitter::Spot(_) | Emitter::Directional(_) => SolidAnglePdf(1.0),
            Emitter::Constant(_) | Emitter::Envmap(_) => self.environment_along(id, -sample.d).1,
        };
        pdf * self.pick_probability(id)
    }

    #[inline(always)]
    fn with_choice(&self, id: EmitterId, pdf: EmissionPdf) -> EmissionPdf {
        EmissionPdf { position: pdf.position * self.pick_probability(id), direction: pdf.direction }
    }
}

/// Flux into the scene, W, and the name of the quantity behind it.
fn power(emitter: &Emitter, ball: &Ball, surfaces: &Surfaces) -> (Rgb, &'static str) {
    match emitter {
        Emitter::Area(a) => (a.power(surfaces), "power (radiance)"),
        Emitter::Point(p) => (p.power(), "power (intensity)"),
        Emitter::Spot(s) => (s.power(), "power (intensity)"),
        Emitter::Directional(d) => (d.irradiance * ball.shadow(), "power (irradiance)"),
        // Radiance over the sphere of directions, each onto the ball's shadow.
        Emitter::Constant(c) => (c.radiance * (4.0 * PI * ball.shadow()), "power (radiance)"),
        Emitter::Envmap(m) => (m.integral() * ball.shadow(), "power (radiance)"),
    }
}
