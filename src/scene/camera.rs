//! The sensor: rays through the film, importance, and connections to it.
//!
//! Camera space has +z along the view, +y up and **+x to the left of the image**, as Mitsuba's. Row 0 is the top.

use super::hit::Endpoint;
use super::ray::Ray;
use crate::math::{SolidAnglePdf, warp};
use glam::{Affine3A, Vec2, Vec3};

/// A connection from a point of the scene to the camera.
#[derive(Clone, Copy, Debug)]
pub struct CameraConnection {
    /// Film position, in pixels of the film rendered (the crop window if there is one): pixel `i` spans `[i, i+1)`.
    pub film: Vec2,
    /// The point on the lens.
    pub end: Endpoint,
    /// Where the connection crosses the near plane: camera rays start there, so a visibility test ends there.
    pub near: Endpoint,
    /// Unit direction from the point towards the lens.
    pub wo: Vec3,
    /// Squared distance to the lens.
    pub distance2: f32,
    /// Density per steradian of the camera's own rays through **one given pixel** in direction `-wo`: `D^2/cos^3`, `D` the image plane's
    /// distance at which a pixel has unit area (\[VCM-TR\]). Also the importance of one pixel for this direction
    /// over `cos` at the lens, so a splat weighs `throughput f pdf_pixel cos_surface / distance2 / N`.
    pub pdf_pixel: SolidAnglePdf,
}

/// A camera ray.
#[derive(Clone, Copy, Debug)]
pub struct CameraRay {
    /// Starts at the near plane, ends at the far plane; unit direction.
    pub ray: Ray,
    /// The point on the lens (or the pinhole).
    pub end: Endpoint,
    /// Distance from the lens to the ray's start, along the ray: camera path lengths count from the lens.
    pub start: f32,
    /// As [`CameraConnection::pdf_pixel`], for this ray.
    pub pdf_pixel: SolidAnglePdf,
}

/// Along what the field of view is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FovAxis {
    /// Across the film.
    X,
    /// Down the film.
    Y,
    /// From corner to corner.
    Diagonal,
    /// The film's shorter side; a square film's is x.
    Smaller,
    /// The film's longer side; a square film's is y.
    Larger,
}

/// How wide the camera sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FieldOfView {
    /// An angle between 0 and 180 degrees, both excluded.
    Angle {
        /// Degrees.
        degrees: f32,
        /// What it spans.
        axis: FovAxis,
    },
    /// The focal length, millimetres, of a lens on a film as large across its diagonal as a 36 x 24 mm one.
    FocalLength(f32),
}

/// A lens of finite size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinLens {
    /// Radius, world units, positive.
    pub aperture_radius: f32,
    /// Distance along the view axis at which points are sharp, world units, positive.
    pub focus_distance: f32,
}

/// The film's size and the window of it that is rendered, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FilmSpec {
    /// Width and height of the whole film.
    pub size: [u32; 2],
    /// Left and top edge of the window.
    pub crop_offset: [u32; 2],
    /// Width and height of the window.
    pub crop_size: [u32; 2],
}

impl FilmSpec {
    /// The whole film.
    pub fn new(width: u32, height: u32) -> Self {
        Self { size: [width, height], crop_offset: [0, 0], crop_size: [width, height] }
    }
}

/// A camera as described, apart from its film.
#[derive(Clone, Copy, Debug)]
pub struct CameraDescription {
    /// Camera space to world: rotation and translation.
    pub to_world: Affine3A,
    /// How wide it sees.
    pub field_of_view: FieldOfView,
    /// Moves the image's content to the left and up by these shares of the film's width and height.
    pub principal_point_offset: Vec2,
    /// Depth along the view axis before which nothing is seen, world units, positive.
    pub near_clip: f32,
    /// Depth along the view axis beyond which nothing is seen, world units.
    pub far_clip: f32,
    /// `None` is a pinhole.
    pub lens: Option<ThinLens>,
}

impl Default for CameraDescription {
    /// Mitsuba's defaults: at the origin along +z, 50 mm, depths from 0.01 to 10,000.
    fn default() -> Self {
        Self {
            to_world: Affine3A::IDENTITY,
            field_of_view: FieldOfView::FocalLength(50.0),
            principal_point_offset: Vec2::ZERO,
            near_clip: 1e-2,
            far_clip: 1e4,
            lens: None,
        }
    }
}

/// A camera that cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// The map is no rigid motion.
    #[error("the camera's to_world must only rotate, move and mirror: take the scale or shear out")]
    Scale,
    /// The angle is out of range.
    #[error("the camera's fov is {0} degrees: it must lie between 0 and 180, both excluded")]
    Fov(f32),
    /// The focal length is not positive.
    #[error("the camera's focal length is {0} mm: it must be positive")]
    FocalLength(f32),
    /// The clipping planes are not in order.
    #[error("the camera clips at {near} and {far}: it needs 0 < near_clip < far_clip")]
    Clip {
        /// Near depth.
        near: f32,
        /// Far depth.
        far: f32,
    },
    /// The lens is not positive.
    #[error("the camera's lens has aperture radius {radius} and focus distance {focus}: both must be positive")]
    Lens {
        /// Aperture radius.
        radius: f32,
        /// Focus distance.
        focus: f32,
    },
    /// The principal point is not finite.
    #[error("the camera's principal point offset is not finite")]
    PrincipalPoint,
    /// The window does not fit the film.
    #[error("the film's crop window ({width}x{height} at {x},{y}) must be at least one pixel and lie within {film_width}x{film_height}")]
    Crop {
        /// Left edge.
        x: u32,
        /// Top edge.
        y: u32,
        /// Window width.
        width: u32,
        /// Window height.
        height: u32,
        /// Film width.
        film_width: u32,
        /// Film height.
        film_height: u32,
    },
}

/// Departure from a rigid motion that rounding of a product of a few f32 matrices explains.
const RIGID: f32 = 1e-3;

/// A pinhole or thin-lens camera with its film.
#[derive(Clone, Debug)]
pub struct Camera {
    description: CameraDescription,
    film: FilmSpec,
    /// World to camera space.
    to_camera: Affine3A,
    /// Film position to `x, y` on the plane z = 1: `corner + film * step`, both steps negative.
    corner: Vec2,
    step: Vec2,
    /// Area of a pixel on the plane z = 1.
    pixel_area: f32,
}

impl Camera {
    /// Checks a description and binds it to a film.
    pub fn new(description: CameraDescription, film: FilmSpec) -> Result<Self, CameraError> {
        check(&description, &film)?;
        let [width, height] = film.size.map(f64::from);
        // Half the film's extent on the plane z = 1.
        let half_x = half_width(description.field_of_view, width, height);
        let half_y = half_x * height / width;
        let offset = description.principal_point_offset.as_dvec2();
        let [crop_x, crop_y] = film.crop_offset.map(f64::from);
        let step = glam::DVec2::new(-2.0 * half_x / width, -2.0 * half_y / height);
        let corner = glam::DVec2::new((1.0 - 2.0 * offset.x) * half_x + step.x * crop_x, (1.0 - 2.0 * offset.y) * half_y + step.y * crop_y);
        Ok(Self {
            to_camera: description.to_world.inverse(),
            description,
            film,
            corner: corner.as_vec2(),
            step: step.as_vec2(),
            pixel_area: (step.x * step.y) as f32,
        })
    }

    /// The same camera with another film: another resolution or window.
    pub fn with_film(&self, film: FilmSpec) -> Result<Self, CameraError> {
        Self::new(self.description, film)
    }

    /// As described.
    pub fn description(&self) -> &CameraDescription {
        &self.description
    }

    /// The film's size and window.
    pub fn film(&self) -> FilmSpec {
        self.film
    }

    /// Pixels across and down the image rendered: the window's size.
    pub fn resolution(&self) -> (usize, usize) {
        (self.film.crop_size[0] as usize, self.film.crop_size[1] as usize)
    }

    /// Position of the pinhole or of the lens's centre.
    pub fn position(&self) -> Vec3 {
        self.description.to_world.translation.into()
    }

    /// Unit direction of view.
    pub fn forward(&self) -> Vec3 {
        Vec3::from(self.description.to_world.matrix3.z_axis)
    }

    /// Longer side of a pixel on the plane z = 1: a footprint is this times the length of the camera path.
    pub fn pixel_on_unit_plane(&self) -> f32 {
        self.step.abs().max_element()
    }

    /// Area of a pixel on the plane z = 1.
    pub fn pixel_area(&self) -> f32 {
        self.pixel_area
    }

    /// The ray through `film`, a position in pixels of the window rendered; `lens` in `[0, 1)^2` chooses the point on the lens, if there is one.
    #[inline]
    pub fn ray(&self, film: Vec2, lens: Vec2) -> CameraRay {
        let on_plane = (self.corner + film * self.step).extend(1.0);
        let (origin, d) = match self.description.lens {
            None => (Vec3::ZERO, on_plane),
            Some(thin) => {
                let origin = lens_point(thin, lens);
                (origin, on_plane * thin.focus_distance - origin)
            }
        };
        let d = d.normalize();
        let cos = d.z;
        let start = self.description.near_clip / cos;
        let world = self.description.to_world;
        let end = world.transform_point3(origin);
        let d = world.transform_vector3(d);
        CameraRay {
            ray: Ray { o: end + d * start, d, t_max: self.description.far_clip / cos - start },
            end: Endpoint::free(end),
            start,
            pdf_pixel: self.pdf_pixel_at(cos),
        }
    }

    /// The connection from `p` to the lens point that `lens` chooses; `None` where `p` is before the near plane, beyond the far plane, or
    /// seen outside the window.
    pub fn connect(&self, p: &Endpoint, lens: Vec2) -> Option<CameraConnection> {
        let local = self.to_camera.transform_point3(p.p);
        let depth = local.z;
        if !(depth > self.description.near_clip && depth < self.description.far_clip) {
            return None;
        }
        let (origin, on_plane) = match self.description.lens {
            None => (Vec3::ZERO, local / depth),
            Some(thin) => {
                let origin = lens_point(thin, lens);
                // Where the line from the lens point meets the plane in focus, brought to z = 1.
                (origin, origin / thin.focus_distance + (local - origin) / depth)
            }
        };
        let film = (on_plane.truncate() - self.corner) / self.step;
        let [width, height] = self.film.crop_size.map(|n| n as f32);
        if !(film.x >= 0.0 && film.x < width && film.y >= 0.0 && film.y < height) {
            return None;
        }
        let to_point = local - origin;
        let distance2 = to_point.length_squared();
        let distance = distance2.sqrt();
        let cos = depth / distance;
        let world = self.description.to_world;
        let end = world.transform_point3(origin);
        let wo = (end - p.p) / distance;
        Some(CameraConnection {
            film,
            end: Endpoint::free(end),
            near: Endpoint::free(world.transform_point3(origin + to_point * (self.description.near_clip / depth))),
            wo,
            distance2,
            pdf_pixel: self.pdf_pixel_at(cos),
        })
    }

    /// [`CameraRay::pdf_pixel`] for a unit direction `d` away from the camera; 0 backwards. Whether the window sees it is not asked.
    pub fn pdf_pixel(&self, d: Vec3) -> SolidAnglePdf {
        let cos = d.dot(self.forward());
        if cos > 0.0 { self.pdf_pixel_at(cos) } else { SolidAnglePdf(0.0) }
    }

    /// `1/(A cos^3)`, with `A` the area of a pixel on the plane z = 1 ([VEACH 8.3], \[VCM-TR\]).
    fn pdf_pixel_at(&self, cos: f32) -> SolidAnglePdf {
        SolidAnglePdf(1.0 / (self.pixel_area * cos * cos * cos))
    }
}

/// The point of the lens that `u` chooses, camera space.
fn lens_point(thin: ThinLens, u: Vec2) -> Vec3 {
    (warp::disk(u) * thin.aperture_radius).extend(0.0)
}

/// Half the film's width on the plane z = 1.
fn half_width(field_of_view: FieldOfView, width: f64, height: f64) -> f64 {
    let diagonal = width.hypot(height);
    match field_of_view {
        // A film of the same diagonal as 36 x 24 mm.
        FieldOfView::FocalLength(millimetres) => 0.5 * 36f64.hypot(24.0) / f64::from(millimetres) * width / diagonal,
        FieldOfView::Angle { degrees, axis } => {
            let half = (0.5 * f64::from(degrees)).to_radians().tan();
            match axis {
                FovAxis::X => half,
                FovAxis::Y => half * width / height,
                FovAxis::Diagonal => half * width / diagonal,
                FovAxis::Smaller if width > height => half * width / height,
                FovAxis::Smaller => half,
                FovAxis::Larger if width > height => half,
                FovAxis::Larger => half * width / height,
            }
        }
    }
}

/// Everything that can be wrong with a camera.
fn check(description: &CameraDescription, film: &FilmSpec) -> Result<(), CameraError> {
    let m = description.to_world.matrix3;
    let rigid = |a: glam::Vec3A, b: glam::Vec3A, expected: f32| (a.dot(b) - expected).abs() <= RIGID;
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    let unit = rigid(x, x, 1.0) && rigid(y, y, 1.0) && rigid(z, z, 1.0);
    if !(unit && rigid(x, y, 0.0) && rigid(y, z, 0.0) && rigid(z, x, 0.0) && description.to_world.translation.is_finite()) {
        return Err(CameraError::Scale);
    }
    match description.field_of_view {
        FieldOfView::Angle { degrees, .. } if !(degrees > 0.0 && degrees < 180.0) => return Err(CameraError::Fov(degrees)),
        FieldOfView::FocalLength(mm) if !(mm > 0.0 && mm.is_finite()) => return Err(CameraError::FocalLength(mm)),
        _ => {}
    }
    let (near, far) = (description.near_clip, description.far_clip);
    if !(near > 0.0 && near < far && near.is_finite()) {
        return Err(CameraError::Clip { near, far });
    }
    if !description.principal_point_offset.is_finite() {
        return Err(CameraError::PrincipalPoint);
    }
    let positive = |x: f32| x > 0.0 && x.is_finite();
    if let Some(ThinLens { aperture_radius: radius, focus_distance: focus }) = description.lens
        && !(positive(radius) && positive(focus))
    {
        return Err(CameraError::Lens { radius, focus });
    }
    let ([film_width, film_height], [x, y], [width, height]) = (film.size, film.crop_offset, film.crop_size);
    let fits = |offset: u32, size: u32, whole: u32| size > 0 && offset.checked_add(size).is_some_and(|end| end <= whole);
    if !(fits(x, width, film_width) && fits(y, height, film_height)) {
        return Err(CameraError::Crop { x, y, width, height, film_width, film_height });
    }
    Ok(())
}
