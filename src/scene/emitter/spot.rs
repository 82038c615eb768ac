//! Light from one position into a cone.

use super::EmitterError;
use crate::math::{Frame, Rgb, SolidAnglePdf, warp};
use glam::{Affine3A, Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// A cone of light: full intensity within the beam, falling off linearly in the angle to nothing at the cutoff.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// World-space position.
    position: Vec3,
    /// `n` is the cone's axis.
    frame: Frame,
    /// Radiant intensity on the axis, W/sr.
    intensity: Rgb,
    /// Half-angle of the whole cone, radians.
    cutoff: f32,
    /// Half-angle of full intensity, radians.
    beam: f32,
}

impl Spot {
    /// A spot at the origin along +z under `to_world`; angles in degrees, `0 <= beam_width <= cutoff_angle <= 180`, `cutoff_angle > 0`.
    pub fn new(to_world: Affine3A, intensity: Rgb, cutoff_angle: f32, beam_width: f32) -> Result<Self, EmitterError> {
        if !(cutoff_angle > 0.0 && cutoff_angle <= 180.0 && beam_width >= 0.0 && beam_width <= cutoff_angle) {
            return Err(EmitterError::SpotAngles { cutoff_angle, beam_width });
        }
        let axis = to_world.transform_vector3(Vec3::Z).try_normalize().ok_or(EmitterError::Singular("spot"))?;
        Ok(Self {
            position: to_world.translation.into(),
            frame: Frame::from_normal(axis),
            intensity,
            cutoff: cutoff_angle.to_radians(),
            beam: beam_width.to_radians(),
        })
    }

    /// World-space position.
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// Radiant intensity along `d` (unit, away from the light), W/sr.
    pub(super) fn intensity(&self, d: Vec3) -> Rgb {
        let theta = self.angle(d);
        if theta <= self.beam {
            self.intensity
        } else if theta < self.cutoff {
            self.intensity * ((self.cutoff - theta) / (self.cutoff - self.beam))
        } else {
            Rgb::BLACK
        }
    }

    /// Flux, W: `2 pi I (1 - (sin c - sin b)/(c - b))`, the integral of the falloff over the cone.
    pub(super) fn power(&self) -> Rgb {
        let (c, b) = (f64::from(self.cutoff), f64::from(self.beam));
        let slope = if c > b { (c.sin() - b.sin()) / (c - b) } else { c.cos() };
        self.intensity * (TAU * (1.0 - slope) as f32)
    }

    /// A direction of the cone, uniform in solid angle.
    pub(super) fn sample_direction(&self, u: Vec2) -> Vec3 {
        self.frame.to_world(warp::cone(u, self.one_minus_cos()))
    }

    /// Density of [`Spot::sample_direction`].
    pub(super) fn pdf_direction(&self, d: Vec3) -> SolidAnglePdf {
        if self.angle(d) < self.cutoff { warp::cone_pdf(self.one_minus_cos()) } else { SolidAnglePdf(0.0) }
    }

    /// `1 - cos(cutoff)` without cancellation.
    fn one_minus_cos(&self) -> f32 {
        2.0 * (0.5 * self.cutoff.min(PI)).sin().powi(2)
    }

    /// Angle between `d` and the axis, radians; accurate near the axis, where an arc cosine is not.
    fn angle(&self, d: Vec3) -> f32 {
        let local = self.frame.to_local(d);
        local.truncate().length().atan2(local.z)
    }
}
