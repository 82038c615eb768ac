//! Just enough of Mitsuba's XML for the gold values: one element, its numbers, its transform.

use crate::math::Rgb;
use crate::scene::camera::{Camera, CameraDescription, FieldOfView, FilmSpec, FovAxis, ThinLens};
use crate::scene::emitter::{Constant, Directional, Emitter, Envmap, Point, Spot};
use crate::scene::shape::{Cylinder, Disk, Geometry, Mesh, Sphere};
use glam::{Affine3A, Mat4, Vec2, Vec3};
use roxmltree::Node;

/// The attributes of an element as a vector, `value` or x, y, z.
fn vector(node: Node, default: f32) -> Vec3 {
    if let Some(value) = node.attribute("value") {
        let n = numbers(value);
        return if n.len() == 1 { Vec3::splat(n[0]) } else { Vec3::new(n[0], n[1], n[2]) };
    }
    let of = |name| node.attribute(name).map_or(default, |v| v.parse().unwrap());
    Vec3::new(of("x"), of("y"), of("z"))
}

fn numbers(text: &str) -> Vec<f32> {
    text.split([',', ' ']).filter(|s| !s.is_empty()).map(|s| s.parse().unwrap()).collect()
}

/// The child that describes a property.
fn property<'a, 'b>(node: Node<'a, 'b>, name: &str) -> Option<Node<'a, 'b>> {
    node.children().find(|c| c.attribute("name") == Some(name))
}

fn number(node: Node, name: &str, default: f32) -> f32 {
    property(node, name).map_or(default, |n| n.attribute("value").unwrap().parse().unwrap())
}

fn flag(node: Node, name: &str) -> bool {
    property(node, name).is_some_and(|n| n.attribute("value") == Some("true"))
}

fn color(node: Node, name: &str) -> Rgb {
    Rgb::from(vector(property(node, name).unwrap(), 0.0).to_array())
}

fn to_world(node: Node) -> Affine3A {
    let mut map = Affine3A::IDENTITY;
    for step in property(node, "to_world").iter().flat_map(|t| t.children()).filter(Node::is_element) {
        let step = match step.tag_name().name() {
            "translate" => Affine3A::from_translation(vector(step, 0.0)),
            "scale" => Affine3A::from_scale(vector(step, 1.0)),
            "rotate" => {
                let angle: f32 = step.attribute("angle").unwrap().parse().unwrap();
                Affine3A::from_axis_angle(vector(step, 0.0).normalize(), angle.to_radians())
            }
            "lookat" => {
                let [origin, target, up] = ["origin", "target", "up"].map(|n| Vec3::from_slice(&numbers(step.attribute(n).unwrap())));
                let dir = (target - origin).normalize();
                let left = up.cross(dir).normalize();
                Affine3A::from_mat4(Mat4::from_cols(left.extend(0.0), dir.cross(left).extend(0.0), dir.extend(0.0), origin.extend(1.0)))
            }
            "matrix" => {
                let m: [f32; 16] = numbers(step.attribute("value").unwrap()).try_into().unwrap();
                Affine3A::from_mat4(Mat4::from_cols_array(&m).transpose())
            }
            other => panic!("transform {other}"),
        };
        map = step * map;
    }
    map
}

/// The camera of a `sensor` element.
pub(super) fn camera(xml: &str) -> Camera {
    let document = roxmltree::Document::parse(xml).unwrap();
    let node = document.root_element();
    let text = |name| property(node, name).and_then(|n| n.attribute("value"));
    let axis = match text("fov_axis") {
        None | Some("x") => FovAxis::X,
        Some("y") => FovAxis::Y,
        Some("diagonal") => FovAxis::Diagonal,
        Some("smaller") => FovAxis::Smaller,
        Some("larger") => FovAxis::Larger,
        Some(other) => panic!("fov_axis {other}"),
    };
    let field_of_view = match (text("fov"), text("focal_length")) {
        (Some(fov), _) => FieldOfView::Angle { degrees: fov.parse().unwrap(), axis },
        (None, focal) => FieldOfView::FocalLength(focal.unwrap_or("50mm").trim_end_matches("mm").parse().unwrap()),
    };
    let film = node.children().find(|c| c.has_tag_name("film")).unwrap();
    let pixels = |name, default: u32| number(film, name, default as f32) as u32;
    let size = [pixels("width", 768), pixels("height", 576)];
    let film = FilmSpec {
        size,
        crop_offset: [pixels("crop_offset_x", 0), pixels("crop_offset_y", 0)],
        crop_size: [pixels("crop_width", size[0]), pixels("crop_height", size[1])],
    };
    let lens = (node.attribute("type") == Some("thinlens"))
        .then(|| ThinLens { aperture_radius: number(node, "aperture_radius", 0.0), focus_distance: number(node, "focus_distance", 0.0) });
    let description = CameraDescription {
        to_world: to_world(node),
        field_of_view,
        principal_point_offset: Vec2::new(number(node, "principal_point_offset_x", 0.0), number(node, "principal_point_offset_y", 0.0)),
        near_clip: number(node, "near_clip", 1e-2),
        far_clip: number(node, "far_clip", 1e4),
        lens,
    };
    Camera::new(description, film).unwrap()
}

/// The geometry of a `shape` element, and its radiance; `None` for what the scene loader alone can read.
pub(super) fn shape(xml: &str) -> Option<(Geometry, Option<Rgb>)> {
    let document = roxmltree::Document::parse(xml).unwrap();
    let node = document.root_element();
    let (map, flip) = (to_world(node), flag(node, "flip_normals"));
    let point = |name, default| property(node, name).map_or(default, |n| vector(n, 0.0));
    let radius = number(node, "radius", 1.0);
    let geometry = match node.attribute("type").unwrap() {
        "rectangle" => Geometry::Mesh(Mesh::rectangle(map, flip)),
        "cube" => Geometry::Mesh(Mesh::cube(map, flip)),
        "sphere" => Geometry::Sphere(Sphere::new(point("center", Vec3::ZERO), radius, map, flip).unwrap()),
        "disk" => Geometry::Disk(Disk::new(map, flip).unwrap()),
        "cylinder" => Geometry::Cylinder(Cylinder::new(point("p0", Vec3::ZERO), point("p1", Vec3::Z), radius, map, flip).unwrap()),
        _ => return None,
    };
    let radiance = match node.children().find(|c| c.has_tag_name("emitter")) {
        None => None,
        Some(e) if property(e, "radiance").is_some_and(|r| r.has_tag_name("rgb")) => Some(color(e, "radiance")),
        Some(_) => return None,
    };
    Some((geometry, radiance))
}

/// The emitter of an `emitter` element; `env` is the image that all envmaps use.
pub(super) fn emitter(xml: &str, env: &(usize, usize, Vec<Rgb>)) -> Emitter {
    let document = roxmltree::Document::parse(xml).unwrap();
    let node = document.root_element();
    let map = to_world(node);
    match node.attribute("type").unwrap() {
        "point" => {
            let position = property(node, "position").map_or(map.translation.into(), |n| vector(n, 0.0));
            Emitter::Point(Point { position, intensity: color(node, "intensity") })
        }
        "spot" => {
            let cutoff = number(node, "cutoff_angle", 20.0);
            Emitter::Spot(Spot::new(map, color(node, "intensity"), cutoff, number(node, "beam_width", 0.75 * cutoff)).unwrap())
        }
        "directional" => {
            let direction = property(node, "direction").map_or(map.transform_vector3(Vec3::Z), |n| vector(n, 0.0));
            Emitter::Directional(Directional::new(direction, color(node, "irradiance")).unwrap())
        }
        "constant" => Emitter::Constant(Constant { radiance: color(node, "radiance") }),
        "envmap" => {
            let (width, height, pixels) = env.clone();
            Emitter::Envmap(Envmap::new(width, height, pixels, number(node, "scale", 1.0), map).unwrap())
        }
        other => panic!("emitter {other}"),
    }
}
