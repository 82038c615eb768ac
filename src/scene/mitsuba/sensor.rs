//! The sensor, its film, and what a scene asks of the renderer.

use super::build::{Builder, to_world, unsupported};
use super::error::{Position, Result, SceneError, excerpt};
use super::plugin::{Given, Kind, Plugin};
use super::{FilmSize, LoadOptions, RenderDefaults};
use crate::scene::camera::{Camera, CameraDescription, FieldOfView, FilmSpec, FovAxis, ThinLens};
use glam::Vec2;

/// Every sensor.
pub(super) const SENSORS: &[&str] = &["perspective", "thinlens"];

/// More pixels than this are a mistake: a film of them would take more than six gigabytes.
const MOST_PIXELS: u64 = 1 << 28;

const STATIC: &str = "nothing moves, so exposure time is without effect";

impl Builder<'_> {
    /// The camera on the film that the scene and the options ask for.
    pub(super) fn sensor(&mut self, plugin: &Plugin, options: &LoadOptions, defaults: &mut RenderDefaults) -> Result<(Camera, FilmSize)> {
        if !SENSORS.contains(&plugin.type_name.as_str()) {
            return Err(unsupported(plugin, SENSORS));
        }
        if let Some(sampler) = self.only(plugin, Kind::Sampler)? {
            self.sampler(self.plugin(sampler.target), defaults)?;
        }
        let film = match self.only(plugin, Kind::Film)? {
            Some(film) => self.film(self.plugin(film.target), options)?,
            None => {
                self.note(&plugin.position, "no film: 768 x 576 pixels, Mitsuba's default");
                film_size(&plugin.position, [768, 576], None, options)?
            }
        };
        let (near, far) = clip(plugin)?;
        let description = CameraDescription {
            to_world: to_world(plugin)?,
            field_of_view: field_of_view(plugin)?,
            principal_point_offset: Vec2::new(
                plugin.float("principal_point_offset_x", 0.0)?.value as f32,
                plugin.float("principal_point_offset_y", 0.0)?.value as f32,
            ),
            near_clip: near,
            far_clip: far,
            lens: lens(plugin, far)?,
        };
        let unfocused = ("focus_distance", "a pinhole is sharp everywhere");
        self.finish(plugin, &[("shutter_open", STATIC), ("shutter_close", STATIC), unfocused])?;

        let spec = match film.crop {
            None => FilmSpec::new(film.width, film.height),
            Some([x, y, width, height]) => FilmSpec { size: [film.width, film.height], crop_offset: [x, y], crop_size: [width, height] },
        };
        let camera = Camera::new(description, spec).map_err(|e| SceneError::new(plugin.place("to_world"), e.to_string()))?;
        Ok((camera, film))
    }

    fn film(&mut self, plugin: &Plugin, options: &LoadOptions) -> Result<FilmSize> {
        if plugin.type_name != "hdrfilm" {
            return Err(unsupported(plugin, &["hdrfilm"]));
        }
        let size = [pixels(plugin, "width", 768)?, pixels(plugin, "height", 576)?];
        let offset = |name| {
            plugin
                .integer(name, 0)?
                .check(name, |n| (0..=i64::from(u32::MAX)).contains(n), "a number of pixels, zero or more")
                .map(|g| g.value as u32)
        };
        let window = [
            offset("crop_offset_x")?,
            offset("crop_offset_y")?,
            pixels(plugin, "crop_width", size[0])?,
            pixels(plugin, "crop_height", size[1])?,
        ];
        let crop = (window != [0, 0, size[0], size[1]]).then_some(window);
        if let Some([x, y, width, height]) = crop
            && !(fits(x, width, size[0]) && fits(y, height, size[1]))
        {
            let names = ["crop_width", "crop_height", "crop_offset_x", "crop_offset_y"];
            let name = names.into_iter().find(|name| plugin.has(name)).unwrap_or("width");
            let message = format!("the crop window, {width} x {height} at ({x}, {y}), leaves the film of {} x {}", size[0], size[1]);
            let help = "crop_width and crop_height default to the film's size, whatever the offset";
            return Err(SceneError::new(plugin.place(name), message).help(help));
        }
        match self.only(plugin, Kind::Rfilter)? {
            Some(filter) if self.plugin(filter.target).type_name == "box" => {}
            Some(filter) => {
                let name = excerpt(&self.plugin(filter.target).type_name);
                self.note(&filter.position, format!("the {name} rfilter is replaced by the box filter"));
            }
            None => self.note(&plugin.position, "no rfilter: the box filter is used, where Mitsuba has a Gaussian one"),
        }
        let written = "images are written as OpenEXR, RGB, 32-bit float";
        let border = "the box filter needs no border";
        let noted = [
            ("file_format", written),
            ("pixel_format", written),
            ("component_format", written),
            ("banner", written),
            ("sample_border", border),
            ("compensate", "sums are kept in double precision"),
        ];
        self.finish(plugin, &noted)?;
        film_size(&plugin.position, size, crop, options)
    }

    fn sampler(&mut self, plugin: &Plugin, defaults: &mut RenderDefaults) -> Result<()> {
        let count = plugin.integer("sample_count", i64::from(defaults.sample_count))?;
        let count = count.check("sample_count", |n| (1..=i64::from(u32::MAX)).contains(n), "at least 1 and below 2^32")?;
        defaults.sample_count = count.value as u32;
        if plugin.type_name != "independent" {
            self.note(
                &plugin.position,
                format!("the {} sampler is not used: samples are independent, or chosen on the command line", excerpt(&plugin.type_name)),
            );
        }
        self.note_the_rest(plugin, "samplers are chosen on the command line");
        Ok(())
    }

    pub(super) fn integrator(&mut self, plugin: &Plugin, defaults: &mut RenderDefaults) -> Result<()> {
        defaults.integrator = Some(plugin.type_name.clone());
        let unlimited = defaults.max_depth.map_or(-1, i64::from);
        let depth = plugin.integer("max_depth", unlimited)?.check(
            "max_depth",
            |n| (-1..=i64::from(i32::MAX)).contains(n),
            "-1 (no limit), or zero or more",
        )?;
        defaults.max_depth = u32::try_from(depth.value).ok();
        let rr = plugin.integer("rr_depth", i64::from(defaults.rr_depth))?.check(
            "rr_depth",
            |n| (1..=i64::from(i32::MAX)).contains(n),
            "positive",
        )?;
        defaults.rr_depth = rr.value as u32;
        defaults.hide_emitters = plugin.boolean("hide_emitters", defaults.hide_emitters)?;
        // Integrators that wrap another one (aov, moment) leave these numbers to it.
        if let Some(nested) = self.only(plugin, Kind::Integrator)? {
            let outer = defaults.integrator.take();
            self.integrator(self.plugin(nested.target), defaults)?;
            defaults.integrator = outer;
        }
        self.note_the_rest(plugin, "methods and their options are chosen on the command line");
        Ok(())
    }

    /// Notes what nobody read, whatever it is.
    fn note_the_rest(&mut self, plugin: &Plugin, why: &str) {
        for property in plugin.properties.iter().filter(|p| !p.read.get()) {
            self.note(&property.position, format!("\"{}\" of the {} is not used: {why}", excerpt(&property.name), plugin.title()));
        }
        for child in plugin.children.iter().filter(|c| !c.read.get()) {
            self.note(&child.position, format!("a {} in the {} is not used: {why}", self.plugin(child.target).title(), plugin.title()));
        }
    }
}

fn pixels(plugin: &Plugin, name: &'static str, default: u32) -> Result<u32> {
    let given = plugin.integer(name, i64::from(default))?;
    Ok(given.check(name, |n| (1..=i64::from(u32::MAX)).contains(n), "a number of pixels, at least 1")?.value as u32)
}

/// Does a window lie on the film, along one axis, and hold a pixel?
fn fits(offset: u32, size: u32, whole: u32) -> bool {
    size > 0 && u64::from(offset) + u64::from(size) <= u64::from(whole)
}

/// The film's size and window after the options; a window of the scene's does not carry over to another resolution.
fn film_size(at: &Position, size: [u32; 2], crop: Option<[u32; 4]>, options: &LoadOptions) -> Result<FilmSize> {
    let [width, height] = options.resolution.map_or(size, |(width, height)| [width, height]);
    if options.resolution.is_some() && crop.is_some() && options.crop.is_none() {
        return Err(SceneError::new(at, "another resolution for a film with a crop window")
            .help("give the window in the new pixels too, with --crop"));
    }
    if width == 0 || height == 0 || u64::from(width) * u64::from(height) > MOST_PIXELS {
        return Err(SceneError::new(at, format!("a film of {width} x {height} pixels"))
            .help(format!("between 1 and {MOST_PIXELS} pixels are supported")));
    }
    let crop = options.crop.or(crop);
    if let Some([x, y, w, h]) = crop
        && !(fits(x, w, width) && fits(y, h, height))
    {
        let message = format!("a crop window of {w} x {h} at ({x}, {y}) on a film of {width} x {height}");
        return Err(SceneError::new(at, message).help("the window must lie on the film and hold at least one pixel"));
    }
    Ok(FilmSize { width, height, crop })
}

fn clip(plugin: &Plugin) -> Result<(f32, f32)> {
    let near = plugin.float("near_clip", 1e-2)?.check("near_clip", |v| (*v as f32).is_normal() && *v > 0.0, "positive")?;
    let far = plugin.float("far_clip", 1e4)?;
    let far = far.check("far_clip", |v| *v as f32 > near.value as f32, &format!("greater than near_clip, {}", near.value))?;
    Ok((near.value as f32, far.value as f32))
}

fn field_of_view(plugin: &Plugin) -> Result<FieldOfView> {
    let axes =
        [("x", FovAxis::X), ("y", FovAxis::Y), ("diagonal", FovAxis::Diagonal), ("smaller", FovAxis::Smaller), ("larger", FovAxis::Larger)];
    let axis = plugin.choice("fov_axis", &axes, FovAxis::X)?;
    let fov = plugin.float_if_given("fov")?;
    let focal_length = plugin.string_if_given("focal_length")?;
    match (fov, focal_length) {
        (Some(_), Some(length)) => {
            Err(SceneError::new(&length.position, "both \"fov\" and \"focal_length\" are given").help("give one of the two"))
        }
        (Some(fov), None) => {
            let fov = fov.check("fov", |v| *v as f32 > 0.0 && (*v as f32) < 180.0, "in (0, 180) degrees")?;
            Ok(FieldOfView::Angle { degrees: fov.value as f32, axis })
        }
        (None, Some(length)) => millimetres(&length).map(FieldOfView::FocalLength),
        (None, None) => Ok(FieldOfView::FocalLength(50.0)),
    }
}

fn millimetres(length: &Given<String>) -> Result<f32> {
    let text = length.value.trim();
    let text = text.strip_suffix("mm").unwrap_or(text).trim();
    let value = super::number::number(text)
        .map_err(|why| SceneError::new(&length.position, format!("\"focal_length\": {why}")).help("write millimetres, as in 50mm"))?;
    if value as f32 > 0.0 {
        Ok(value as f32)
    } else {
        Err(SceneError::new(&length.position, format!("\"focal_length\" is {value}, it must be positive")))
    }
}

fn lens(plugin: &Plugin, far_clip: f32) -> Result<Option<ThinLens>> {
    if plugin.type_name != "thinlens" {
        return Ok(None);
    }
    let Some(radius) = plugin.float_if_given("aperture_radius")? else { return Err(plugin.missing("aperture_radius", "float")) };
    let radius = radius.check("aperture_radius", |v| *v as f32 > 0.0, "positive; without a lens use perspective")?.value as f32;
    let focus = plugin.float("focus_distance", f64::from(far_clip))?.check("focus_distance", |v| *v as f32 > 0.0, "positive")?.value as f32;
    Ok(Some(ThinLens { aperture_radius: radius, focus_distance: focus }))
}
