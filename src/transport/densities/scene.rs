//! Full paths of a scene: every density asked of scene, materials, lights and camera again, from the places alone.

use super::{FullPath, PathError, PathVertex};
use crate::scene::Scene;
use crate::scene::bsdf::{Bsdf, Lobes};
use crate::scene::emitter::{DirectSample, EmitterKind};
use crate::scene::hit::{Endpoint, Hit};
use crate::transport::mis::LightEnd;
use crate::transport::survival::CEILING;
use glam::{Vec2, Vec3};

/// Where a path's light comes from.
#[derive(Clone, Copy, Debug)]
pub enum PathLight {
    /// A surface that shines: the hit on it.
    Surface(Hit),
    /// All around: the unit direction towards the light.
    Around(Vec3),
    /// A single position or direction: any light sample of it, drawn from the path's next vertex.
    Single(DirectSample),
}

/// A vertex between light and camera.
#[derive(Clone, Copy, Debug)]
pub struct PathPlace {
    /// The hit there; whose ray it was does not matter.
    pub hit: Hit,
    /// The event is at a delta lobe.
    pub delta: bool,
    /// As [`PathVertex::photons`].
    pub photons: f64,
}

/// What a scene says of a path.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ScenePathError {
    /// The light does not shine towards the path.
    #[error("the path's light does not shine towards its next vertex")]
    Dark,
    /// No delta lobe joins the directions.
    #[error("vertex {0} of the path, counted from the light, is said to be a delta, but no delta lobe joins its directions")]
    NoDelta(usize),
    /// A density is impossible.
    #[error(transparent)]
    Path(#[from] PathError),
}

/// The densities of the path `light`, `places` (light first, at least one), `lens` (the camera's end). Surfaces merge whose roughest lobe is at
/// least as rough as `roughness_threshold`. Visibility is not asked.
pub fn full_path(
    scene: &Scene,
    light: &PathLight,
    places: &[PathPlace],
    lens: Vec3,
    roughness_threshold: f32,
) -> Result<FullPath, ScenePathError> {
    let (Some(first), Some(last)) = (places.first(), places.last()) else { return Err(PathError::Short(2).into()) };
    let to_light = match light {
        PathLight::Surface(hit) => (hit.end.p - first.hit.end.p).normalize(),
        PathLight::Around(d) => *d,
        PathLight::Single(sample) => sample.wi,
    };
    let (kind, end) = match light {
        PathLight::Surface(hit) => (EmitterKind::Surface, LightEnd::of_hit(scene, hit, to_light, &first.hit.end)),
        PathLight::Around(_) => (EmitterKind::Infinite, LightEnd::of_escape(scene, to_light, &first.hit.end)),
        PathLight::Single(sample) => (sample.kind, Some(LightEnd::of_direct(scene, sample, &first.hit.end))),
    };
    let end = end.ok_or(ScenePathError::Dark)?;

    // --- what happens at each place, then how the edges spread it
    let place = |i: usize| places.get(i).map(|place| place.hit.end.p);
    let mut events = Vec::with_capacity(places.len());
    for (i, here) in places.iter().enumerate() {
        let p = here.hit.end.p;
        let towards_light = i.checked_sub(1).and_then(place).map_or(to_light, |before| (before - p).normalize());
        let towards_camera = (place(i + 1).unwrap_or(lens) - p).normalize();
        events.push(Event::ask(scene, here, towards_light, towards_camera).ok_or(ScenePathError::NoDelta(i + 1))?);
    }
    let mut vertices = vec![PathVertex::default(); places.len() + 2];
    let camera = vertices.len() - 1;
    vertices[camera].from_camera = 1.0;
    // The emission's density stands at x_1 as a whole: nothing asks for the two factors apart but connection 1, which has its own.
    vertices[0].from_light = 1.0;
    vertices[1].from_light = f64::from(end.emission.sampled) * f64::from(end.edge.ahead);
    vertices[0].from_camera = match kind {
        EmitterKind::DeltaPosition | EmitterKind::DeltaDirection => 0.0,
        EmitterKind::Surface | EmitterKind::Infinite => events[0].to_light * f64::from(end.edge.back),
    };
    for (i, (here, event)) in places.iter().zip(&events).enumerate() {
        let v = &mut vertices[i + 1];
        (v.delta, v.photons) = (here.delta, here.photons);
        v.merges = !here.delta && Lobes::Rough(roughness_threshold).admit(scene.bsdf(here.hit.shape).max_roughness());
        if let Some(next) = places.get(i + 1) {
            vertices[i + 2].from_light = event.to_camera * per_area(&here.hit.end, &next.hit.end);
            vertices[i + 1].from_camera = events[i + 1].to_light * per_area(&next.hit.end, &here.hit.end);
        }
    }
    let ray = (last.hit.end.p - lens).normalize();
    let pixel = f64::from(scene.camera().pdf_pixel(ray).0);
    vertices[camera - 1].from_camera = pixel * per_area(&Endpoint::free(lens), &last.hit.end);
    Ok(FullPath::new(vertices, f64::from(end.emission.direct))?)
}

/// What turns a density per steradian at `a` into one per area at `b`.
fn per_area(a: &Endpoint, b: &Endpoint) -> f64 {
    let edge = (b.p - a.p).as_dvec3();
    (edge.normalize().dot(b.n_g.as_dvec3())).abs() / edge.length_squared()
}

/// Densities at a vertex per steradian towards the light, both ways.
struct Event {
    /// Of the direction towards the camera for a walk from the light, for a delta in the measure of the direction towards the light.
    to_camera: f64,
    /// Of the direction towards the light, for a walk from the camera.
    to_light: f64,
}

impl Event {
    fn ask(scene: &Scene, at: &PathPlace, towards_light: Vec3, towards_camera: Vec3) -> Option<Self> {
        let (bsdf, uv) = (scene.bsdf(at.hit.shape), at.hit.uv);
        let (wi, wo) = (at.hit.frame.to_local(towards_light), at.hit.frame.to_local(towards_camera));
        if at.delta {
            return Self::delta(bsdf, uv, wi, wo);
        }
        let f = bsdf.eval(uv, wi, wo, Lobes::All);
        let index = f64::from(bsdf.relative_index(wo, wi));
        let [to_camera, to_light] = [(wi, wo), (wo, wi)].map(|(given, sampled)| f64::from(bsdf.pdf(uv, given, sampled, Lobes::All)));
        let kept = |cos: f32| f64::from(f.max_component()) * f64::from(cos.abs());
        let ceiling = f64::from(CEILING);
        Some(Self { to_camera: (ceiling * to_camera).min(kept(wo.z)), to_light: (ceiling * to_light).min(kept(wi.z) * index * index) })
    }

    fn delta(bsdf: &Bsdf, uv: Vec2, wi: Vec3, wo: Vec3) -> Option<Self> {
        let (to_camera, to_light) = (bsdf.delta(uv, wi, wo)?, bsdf.delta(uv, wo, wi)?);
        let kept = f64::from(to_camera.value.max_component());
        let survive = |probability: f32| (f64::from(CEILING) * f64::from(probability)).min(kept);
        // d omega towards the camera over d omega towards the light.
        let eta = f64::from(to_camera.eta);
        let spread = f64::from(wi.z.abs()) / (eta * eta * f64::from(wo.z.abs()));
        let spread = if to_camera.eta == 1.0 { 1.0 } else { spread };
        Some(Self { to_camera: survive(to_camera.probability) / spread, to_light: survive(to_light.probability) })
    }
}
