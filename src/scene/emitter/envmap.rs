//! An image of radiance from all around.

use super::EmitterError;
use crate::math::distribution::{BilinearGrid, bilinear, bilinear_pdf};
use crate::math::{Rgb, SolidAnglePdf};
use glam::{Affine3A, Mat3, Vec2, Vec3};
use std::f32::consts::PI;
use std::f64;

/// A latitude-longitude image at infinity, in Mitsuba's orientation: the top row is +y, the middle of the image looks along +z, a quarter
/// from the left along +x. Columns are bilinear between texel centres and periodic; the first and the last row lie on the poles.
#[derive(Clone, Debug)]
pub struct Envmap {
    width: usize,
    height: usize,
    /// Rows from the top, scaled.
    pixels: Vec<Rgb>,
    /// Directions: image to world, and back.
    to_world: Mat3,
    to_image: Mat3,
    /// `None` for an image that is black throughout.
    grid: Option<BilinearGrid>,
    /// The integral of radiance over all directions.
    integral: Rgb,
}

/// Where a direction falls in the image.
struct Place {
    /// Column and row of the upper left texel of the four around it.
    cell: [usize; 2],
    within: Vec2,
    sin_theta: f32,
}

impl Envmap {
    /// `pixels` are rows from the top, radiance in W/(m^2 sr) before `scale`; `to_world` rotates (and may mirror) the sphere of directions.
    pub fn new(width: usize, height: usize, mut pixels: Vec<Rgb>, scale: f32, to_world: Affine3A) -> Result<Self, EmitterError> {
        if width < 2 || height < 2 || width.checked_mul(height) != Some(pixels.len()) {
            return Err(EmitterError::EnvmapSize { width, height, found: pixels.len() });
        }
        for (i, pixel) in pixels.iter_mut().enumerate() {
            *pixel *= scale;
            if !(pixel.is_finite() && pixel.to_array().iter().all(|&c| c >= 0.0)) {
                return Err(EmitterError::EnvmapPixel { x: i % width, y: i / width, value: pixel.to_array() });
            }
        }
        let to_world = rotation(to_world)?;
        let mut map = Self { width, height, pixels, to_world, to_image: to_world.transpose(), grid: None, integral: Rgb::BLACK };
        map.tabulate();
        Ok(map)
    }

    /// Pixels across and down.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The table of cells and the integral, both by the exact share of each row of texels in the solid angle.
    fn tabulate(&mut self) {
        let (width, rows) = (self.width, self.height - 1);
        let step = f64::consts::PI / rows as f64;
        // Integrals of sin theta times the upper and the lower row's weight.
        let shares = |row: usize| {
            let (top, bottom) = (row as f64 * step, (row + 1) as f64 * step);
            let lower = (bottom.sin() - top.sin()) / step - bottom.cos();
            (top.cos() - bottom.cos() - lower, lower)
        };
        let weights: Vec<(f64, f64)> = (0..rows).map(shares).collect();
        let mut sum = [0.0f64; 3];
        for (row, &(upper, lower)) in weights.iter().enumerate() {
            for column in 0..width {
                let (above, below) = (self.texel(column, row), self.texel(column, row + 1));
                for (c, sum) in sum.iter_mut().enumerate() {
                    *sum += upper * f64::from(above[c]) + lower * f64::from(below[c]);
                }
            }
        }
        self.integral = Rgb::from(sum.map(|s| (s * f64::consts::TAU / width as f64) as f32));
        self.grid = BilinearGrid::new(width, rows, |column, row| {
            let [c00, c10, c01, c11] = self.corners([column, row]).map(f64::from);
            weights[row].0 * (c00 + c10) + weights[row].1 * (c01 + c11)
        });
    }

    #[inline(always)]
    fn texel(&self, column: usize, row: usize) -> Rgb {
        self.pixels[row * self.width + column]
    }

    #[inline(always)]
    fn right_of(&self, column: usize) -> usize {
        if column + 1 < self.width { column + 1 } else { 0 }
    }

    /// What sampling goes by, at the corners of a cell: the mean colour, so that nothing that shines is left out.
    #[inline]
    fn corners(&self, [column, row]: [usize; 2]) -> [f32; 4] {
        let right = self.right_of(column);
        [self.texel(column, row), self.texel(right, row), self.texel(column, row + 1), self.texel(right, row + 1)].map(Rgb::mean)
    }

    #[inline]
    fn place(&self, d: Vec3) -> Place {
        let local = self.to_image * d;
        let sin_theta = local.x.hypot(local.z);
        let v = sin_theta.atan2(local.y) / PI;
        let u = local.x.atan2(-local.z) / (2.0 * PI);
        let x = u * self.width as f32 - 0.5;
        let y = v * (self.height - 1) as f32;
        let (left, above) = (x.floor(), y.floor().min((self.height - 2) as f32));
        let column = (left as i64).rem_euclid(self.width as i64) as usize;
        Place { cell: [column, above as usize], within: Vec2::new(x - left, y - above), sin_theta }
    }

    #[inline]
    fn value(&self, place: &Place) -> Rgb {
        let [column, row] = place.cell;
        let right = self.right_of(column);
        let above = self.texel(column, row).lerp(self.texel(right, row), place.within.x);
        let below = self.texel(column, row + 1).lerp(self.texel(right, row + 1), place.within.x);
        above.lerp(below, place.within.y)
    }

    /// Radiance and the density of [`Envmap::sample`] along the unit direction `d`.
    #[inline]
    pub(super) fn eval_pdf(&self, d: Vec3) -> (Rgb, SolidAnglePdf) {
        let place = self.place(d);
        let Some(grid) = &self.grid else {
            return (Rgb::BLACK, SolidAnglePdf(0.0));
        };
        let probability = grid.probability(place.cell);
        if probability <= 0.0 {
            return (Rgb::BLACK, SolidAnglePdf(0.0));
        }
        let density = probability * bilinear_pdf(place.within, self.corners(place.cell));
        (self.value(&place), self.per_steradian(density, place.sin_theta))
    }

    /// A unit direction towards the light, in proportion to the mean colour but for the sine of the polar angle within a cell; `None` if the
    /// image is black.
    #[inline]
    pub(super) fn sample(&self, u: Vec2) -> Option<(Vec3, Rgb, SolidAnglePdf)> {
        let (mut point, probability) = self.grid.as_ref()?.sample(u);
        let (within, density) = bilinear(point.within, self.corners(point.cell));
        point.within = within;
        let phi = 2.0 * PI * (point.cell[0] as f32 + within.x + 0.5) / self.width as f32;
        let theta = PI * (point.cell[1] as f32 + within.y) / (self.height - 1) as f32;
        let ((sin_phi, cos_phi), (sin_theta, cos_theta)) = (phi.sin_cos(), theta.sin_cos());
        let d = self.to_world * Vec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi);
        let radiance = self.value(&Place { cell: point.cell, within, sin_theta });
        Some((d, radiance, self.per_steradian(probability * density, sin_theta)))
    }

    /// A density over a cell, of unit area, as a density over directions. At the poles themselves, which have no area, it is finite.
    #[inline]
    fn per_steradian(&self, density: f32, sin_theta: f32) -> SolidAnglePdf {
        let cells = self.width as f32 * (self.height - 1) as f32;
        SolidAnglePdf(density * cells / (2.0 * PI * PI * sin_theta.max(f32::EPSILON)))
    }

    /// The integral of radiance over all directions, W/m^2.
    pub(super) fn integral(&self) -> Rgb {
        self.integral
    }

    pub(super) fn memory(&self) -> usize {
        self.pixels.capacity() * size_of::<Rgb>() + self.grid.as_ref().map_or(0, BilinearGrid::memory)
    }
}

/// The rotation of a map, its equal scale taken out.
fn rotation(map: Affine3A) -> Result<Mat3, EmitterError> {
    let m = Mat3::from(map.matrix3);
    let scale = m.x_axis.length();
    let m = m * (1.0 / scale);
    let product = m * m.transpose();
    // A thousandth is far beyond rounding and far below any stretch one would mean.
    let rigid = product.abs_diff_eq(Mat3::IDENTITY, 1e-3);
    if rigid { Ok(m) } else { Err(EmitterError::EnvmapTransform) }
}
