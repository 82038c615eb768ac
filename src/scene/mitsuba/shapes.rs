//! Shapes.

use super::build::{Builder, Table, constructor, to_world};
use super::error::{Result, SceneError};
use super::files::resolve;
use super::plugin::{Kind, Plugin};
use crate::scene::obj;
use crate::scene::obj::{ObjOptions, VertexNormals};
use crate::scene::shape::{Cylinder, Disk, Geometry, Mesh, Shape, ShapeError, Sphere};
use glam::Vec3;

/// Every shape. Adding one is its constructor and one line here.
pub(super) const TABLE: Table<Geometry> =
    &[("obj", obj), ("rectangle", rectangle), ("cube", cube), ("sphere", sphere), ("disk", disk), ("cylinder", cylinder)];

const NOTED: &[(&str, &str)] = &[("silhouette_sampling_weight", "it matters to differentiable rendering only")];

/// A flat shape has one normal whatever is asked for.
const NOTED_FLAT: &[(&str, &str)] = &[NOTED[0], ("face_normals", "a rectangle is flat already")];

impl Builder<'_> {
    /// A shape of the scene with its material and, if it shines, its radiance.
    pub(super) fn shape(&mut self, plugin: &Plugin) -> Result<()> {
        let construct = constructor(TABLE, plugin)?;
        // Emitters are looked at first: a shape's default material depends on whether it shines.
        let emitters = plugin.children_of(Kind::Emitter, &self.tree.plugins);
        if let [_, second, ..] = emitters[..] {
            return Err(SceneError::new(&second.position, format!("a second emitter in the {}", plugin.title())));
        }
        let radiance = emitters.first().map(|child| self.radiance(child.target)).transpose()?;
        let bsdfs = plugin.children_of(Kind::Bsdf, &self.tree.plugins);
        let bsdf = match bsdfs[..] {
            [] => self.unnamed_bsdf(radiance.is_some()),
            [child] => self.bsdf_number(child.target).map_err(|e| {
                let written_here = child.position == self.plugin(child.target).position;
                if written_here { e } else { e.via("used at", &child.position) }
            })?,
            [_, second, ..] => {
                return Err(SceneError::new(&second.position, format!("a second bsdf in the {}", plugin.title()))
                    .help("nest them in a blendbsdf or a twosided"));
            }
        };
        let geometry = construct(self, plugin)?;
        let flat = plugin.type_name == "rectangle";
        self.finish(plugin, if flat { NOTED_FLAT } else { NOTED })?;
        let name = plugin.id.clone().unwrap_or_else(|| format!("{} {}", plugin.type_name, self.shapes.len()));
        self.shape_positions.push((name.clone(), plugin.position.clone()));
        self.shapes.push(Shape { name, geometry, bsdf, radiance });
        Ok(())
    }
}

fn rejected(plugin: &Plugin, e: &ShapeError) -> SceneError {
    SceneError::new(plugin.place("to_world"), format!("{}: {e}", plugin.title()))
}

fn flip_normals(plugin: &Plugin) -> Result<bool> {
    plugin.boolean("flip_normals", false)
}

fn vector(plugin: &Plugin, name: &'static str, default: Vec3) -> Result<Vec3> {
    Ok(plugin.vector_if_given(name)?.map_or(default, |v| v.value.as_vec3()))
}

fn radius(plugin: &Plugin) -> Result<f32> {
    Ok(plugin.float("radius", 1.0)?.check("radius", |r| (*r as f32).is_normal() && *r > 0.0, "positive")?.value as f32)
}

fn rectangle(_: &mut Builder<'_>, plugin: &Plugin) -> Result<Geometry> {
    Ok(Geometry::Mesh(Mesh::rectangle(to_world(plugin)?, flip_normals(plugin)?)))
}

fn cube(_: &mut Builder<'_>, plugin: &Plugin) -> Result<Geometry> {
    let mut mesh = Mesh::cube(to_world(plugin)?, flip_normals(plugin)?);
    // Seen only where to_world mirrors: the shading normals stay outside, those of the faces turn with the winding.
    if plugin.boolean("face_normals", false)? {
        mesh.normals = None;
    }
    Ok(Geometry::Mesh(mesh))
}

fn sphere(_: &mut Builder<'_>, plugin: &Plugin) -> Result<Geometry> {
    let center = vector(plugin, "center", Vec3::ZERO)?;
    let sphere = Sphere::new(center, radius(plugin)?, to_world(plugin)?, flip_normals(plugin)?);
    sphere.map(Geometry::Sphere).map_err(|e| rejected(plugin, &e))
}

fn disk(_: &mut Builder<'_>, plugin: &Plugin) -> Result<Geometry> {
    Disk::new(to_world(plugin)?, flip_normals(plugin)?).map(Geometry::Disk).map_err(|e| rejected(plugin, &e))
}

fn cylinder(_: &mut Builder<'_>, plugin: &Plugin) -> Result<Geometry> {
    let (p0, p1) = (vector(plugin, "p0", Vec3::ZERO)?, vector(plugin, "p1", Vec3::Z)?);
    if p0 == p1 {
        let place = plugin.place(if plugin.has("p1") { "p1" } else { "p0" });
        return Err(SceneError::new(place, "a cylinder's ends p0 and p1 are the same point"));
    }
    let cylinder = Cylinder::new(p0, p1, radius(plugin)?, to_world(plugin)?, flip_normals(plugin)?);
    cylinder.map(Geometry::Cylinder).map_err(|e| rejected(plugin, &e))
}

fn obj(builder: &mut Builder<'_>, plugin: &Plugin) -> Result<Geometry> {
    let filename = plugin.required_string("filename")?;
    let options = ObjOptions {
        // The map stays in double precision until it meets the vertices.
        to_world: {
            to_world(plugin)?;
            plugin.transform("to_world")?.value
        },
        normals: if plugin.boolean("face_normals", false)? { VertexNormals::None } else { VertexNormals::FileOrComputed },
        flip_tex_coords: plugin.boolean("flip_tex_coords", true)?,
        flip_normals: flip_normals(plugin)?,
    };
    let path = resolve(&filename.value, &plugin.folders, &filename.position)?;
    let bytes = builder.files.read(&path, &filename.position)?;
    let loaded = obj::read(&bytes, &options).map_err(|e| {
        let position = e.line.map_or_else(|| super::error::Position::whole(&path), |line| super::error::Position::line(&path, line));
        let error = SceneError::new(&position, e.message).via("named at", &filename.position);
        match e.help {
            Some(help) => error.help(help),
            None => error,
        }
    })?;
    for note in loaded.notes {
        builder.note(&filename.position, format!("{}: {note}", filename.value));
    }
    Ok(Geometry::Mesh(loaded.mesh))
}
