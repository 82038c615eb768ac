//! Rays, connections and importance belong together.

use super::kit::{apart, pair, stream};
use crate::samplers::Stream;
use crate::scene::camera::{Camera, CameraDescription, CameraError, FieldOfView, FilmSpec, FovAxis, ThinLens};
use crate::scene::hit::Endpoint;
use glam::{Affine3A, Vec2, Vec3};

/// Cameras of every kind, with a name each.
fn cameras() -> Vec<(String, Camera)> {
    let mut list = Vec::new();
    let lens = ThinLens { aperture_radius: 0.2, focus_distance: 3.0 };
    let crop = FilmSpec { size: [60, 40], crop_offset: [10, 5], crop_size: [24, 20] };
    let films = [FilmSpec::new(60, 40), FilmSpec::new(30, 50), FilmSpec::new(32, 32), crop];
    for axis in [FovAxis::X, FovAxis::Y, FovAxis::Diagonal, FovAxis::Smaller, FovAxis::Larger] {
        for film in films {
            for (lens, offset) in [(None, Vec2::ZERO), (None, Vec2::new(0.2, -0.1)), (Some(lens), Vec2::ZERO)] {
                let description = CameraDescription {
                    to_world: Affine3A::from_rotation_translation(glam::Quat::from_rotation_y(0.7), Vec3::new(1.0, 2.0, 3.0)),
                    field_of_view: FieldOfView::Angle { degrees: 50.0, axis },
                    principal_point_offset: offset,
                    lens,
                    ..CameraDescription::default()
                };
                list.push((format!("{axis:?} {film:?} {lens:?} {offset}"), Camera::new(description, film).unwrap()));
            }
        }
    }
    list
}

#[test]
fn a_connection_from_a_point_on_a_ray_finds_the_ray() {
    let mut numbers = stream(10);
    for (name, camera) in cameras() {
        let size = Vec2::new(camera.resolution().0 as f32, camera.resolution().1 as f32);
        for _ in 0..200 {
            let (film, lens) = (pair(&mut numbers) * size, pair(&mut numbers));
            let ray = camera.ray(film, lens);
            let distance = 0.1 + 20.0 * numbers.next_1d();
            let p = ray.end.p + ray.ray.d * distance;
            // Too near an edge for rounding to leave it inside.
            if film.min_element() < 1e-3 || (size - film).min_element() < 1e-3 {
                continue;
            }
            let back = camera.connect(&Endpoint::free(p), lens).unwrap_or_else(|| panic!("{name}: {film} is lost"));
            assert!((back.film - film).abs().max_element() < 1e-3, "{name}: {film} became {}", back.film);
            assert!(apart(back.wo, -ray.ray.d) < 1e-5 && apart(back.end.p, ray.end.p) < 1e-5, "{name}");
            assert!((back.distance2.sqrt() / distance - 1.0).abs() < 1e-5, "{name}");
            assert!((back.pdf_pixel.0 / ray.pdf_pixel.0 - 1.0).abs() < 1e-4, "{name}");
            assert!((camera.pdf_pixel(ray.ray.d).0 / ray.pdf_pixel.0 - 1.0).abs() < 1e-4, "{name}");
            assert!(apart(back.near.p, ray.ray.o) < 1e-5, "{name}: {} {}", back.near.p, ray.ray.o);
            assert!((ray.start - ray.ray.o.distance(ray.end.p)).abs() < 1e-6, "{name}");
        }
    }
}

#[test]
fn nothing_connects_outside_the_window_or_the_clipping_planes() {
    for (name, camera) in cameras() {
        let forward = camera.forward();
        let at = |depth: f32| {
            Endpoint::free(
                camera.ray(Vec2::splat(3.0), Vec2::splat(0.4)).end.p + camera.ray(Vec2::splat(3.0), Vec2::splat(0.4)).ray.d * depth,
            )
        };
        assert!(camera.connect(&at(1.0), Vec2::splat(0.4)).is_some(), "{name}");
        assert!(camera.connect(&at(0.5 * 1e-2), Vec2::splat(0.4)).is_none(), "{name}: before the near plane");
        assert!(camera.connect(&at(-1.0), Vec2::splat(0.4)).is_none(), "{name}: behind");
        assert!(camera.connect(&at(2e4), Vec2::splat(0.4)).is_none(), "{name}: beyond the far plane");
        let size = Vec2::new(camera.resolution().0 as f32, camera.resolution().1 as f32);
        for film in [Vec2::new(-0.1, 1.0), Vec2::new(1.0, -0.1), size + Vec2::new(0.1, -1.0), size + Vec2::new(-1.0, 0.1)] {
            let ray = camera.ray(film, Vec2::splat(0.4));
            let p = ray.end.p + ray.ray.d * 5.0;
            assert!(camera.connect(&Endpoint::free(p), Vec2::splat(0.4)).is_none(), "{name}: {film}");
        }
        assert_eq!(camera.pdf_pixel(-forward).0, 0.0, "{name}");
    }
}

#[test]
fn a_pixels_density_integrates_to_one_over_its_solid_angle() {
    for (name, camera) in cameras() {
        for pixel in [Vec2::ZERO, Vec2::new(7.0, 11.0)] {
            // Solid angle of each of n x n parts of the pixel by the two triangles of its directions, as spherical area to second order.
            let n = 8;
            let d = |x: usize, y: usize| {
                // Half the lens's square is its centre.
                let ray = camera.ray(pixel + Vec2::new(x as f32, y as f32) / n as f32, Vec2::splat(0.5));
                (ray.ray.d.as_dvec3(), f64::from(ray.pdf_pixel.0))
            };
            let mut sum = 0.0;
            for y in 0..n {
                for x in 0..n {
                    let [a, b, c, e] = [d(x, y), d(x + 1, y), d(x + 1, y + 1), d(x, y + 1)];
                    let omega = 0.5 * (b.0 - a.0).cross(c.0 - a.0).length() + 0.5 * (c.0 - a.0).cross(e.0 - a.0).length();
                    sum += omega * 0.25 * (a.1 + b.1 + c.1 + e.1);
                }
            }
            assert!((sum - 1.0).abs() < 2e-3, "{name}: {sum}");
        }
    }
}

#[test]
fn the_footprints_factor_is_a_pixel_at_unit_depth() {
    for (name, camera) in cameras() {
        let at = |film: Vec2| {
            let ray = camera.ray(film, Vec2::splat(0.5));
            let d = ray.ray.d;
            ray.end.p + d / d.dot(camera.forward())
        };
        let sides = [at(Vec2::new(1.0, 0.0)), at(Vec2::new(0.0, 1.0))].map(|p| p.distance(at(Vec2::ZERO)));
        assert!((sides[0].max(sides[1]) / camera.pixel_on_unit_plane() - 1.0).abs() < 1e-3, "{name}: {sides:?}");
        assert!((sides[0] * sides[1] / camera.pixel_area() - 1.0).abs() < 2e-3, "{name}: {sides:?}");
    }
}

#[test]
fn splats_measure_what_rays_see() {
    // A patch of radiance 1 in front of the camera: light-side estimates of the pixels' mean must equal the share of rays that meet it.
    use super::kit::{Mean, expect_same};
    let list = cameras();
    for (index, (name, camera)) in list.iter().enumerate() {
        let mut numbers = stream(100 + index as u64);
        let (pixels, size) = (camera.resolution().0 * camera.resolution().1, camera.resolution());
        let center = camera.ray(Vec2::new(size.0 as f32, size.1 as f32) * 0.5, Vec2::splat(0.5));
        let (middle, side) = (center.end.p + center.ray.d * 4.0, 4.5f32);
        let n = -camera.forward();
        let (s, t) = n.any_orthonormal_pair();
        let (mut eye, mut light) = (Mean::default(), Mean::default());
        for _ in 0..20_000 {
            let film = pair(&mut numbers) * Vec2::new(size.0 as f32, size.1 as f32);
            let ray = camera.ray(film, pair(&mut numbers));
            let on_plane = ray.end.p + ray.ray.d * ((middle - ray.end.p).dot(n) / ray.ray.d.dot(n));
            let inside = (on_plane - middle).dot(s).abs().max((on_plane - middle).dot(t).abs()) < 0.5 * side;
            eye.add(f64::from(u8::from(inside)));
            let u = (pair(&mut numbers) - 0.5) * side;
            let p = Endpoint::free(middle + s * u.x + t * u.y);
            let splat = camera.connect(&p, pair(&mut numbers)).map_or(0.0, |c| c.pdf_pixel.0 * c.wo.dot(n) / c.distance2);
            light.add(f64::from(splat * side * side) / pixels as f64);
        }
        expect_same(name, &eye, &light, list.len());
    }
}

#[test]
fn impossible_cameras_are_refused() {
    let film = FilmSpec::new(4, 4);
    let good = CameraDescription::default();
    let scaled = CameraDescription { to_world: Affine3A::from_scale(Vec3::splat(2.0)), ..good };
    assert_eq!(Camera::new(scaled, film).err(), Some(CameraError::Scale));
    let wide = CameraDescription { field_of_view: FieldOfView::Angle { degrees: 180.0, axis: FovAxis::X }, ..good };
    assert_eq!(Camera::new(wide, film).err(), Some(CameraError::Fov(180.0)));
    let clip = CameraDescription { near_clip: 0.0, ..good };
    assert!(matches!(Camera::new(clip, film), Err(CameraError::Clip { .. })));
    let outside = FilmSpec { size: [4, 4], crop_offset: [3, 0], crop_size: [2, 4] };
    assert!(matches!(Camera::new(good, outside), Err(CameraError::Crop { .. })));
    let empty = FilmSpec { size: [4, 4], crop_offset: [0, 0], crop_size: [0, 4] };
    assert!(matches!(Camera::new(good, empty), Err(CameraError::Crop { .. })));
    let shut = CameraDescription { lens: Some(ThinLens { aperture_radius: 0.0, focus_distance: 1.0 }), ..good };
    assert!(matches!(Camera::new(shut, film), Err(CameraError::Lens { .. })));
}
