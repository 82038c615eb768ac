//! Second stage: a tree of plugins to the parts of a scene.

use super::error::{Position, Result, SceneError, excerpt, suggest};
use super::files::Files;
use super::plugin::{Child, Kind, Plugin, PluginId};
use super::xml::Tree;
use super::{FilmSize, LoadOptions, Note, RenderDefaults, sensor};
use crate::scene::bsdf::Bsdf;
use crate::scene::emitter::Emitter;
use crate::scene::shape::Shape;
use crate::scene::texture::Texels;
use crate::scene::{BsdfId, SceneParts};
use glam::{Affine3A, DMat4};
use std::collections::{HashMap, HashSet};
use std::path::PathBuf;
use std::sync::Arc;

/// What a scene's tree becomes.
pub(super) struct Built {
    pub(super) parts: SceneParts,
    pub(super) film: FilmSize,
    pub(super) defaults: RenderDefaults,
}

/// Carries what plugins share while they are built.
pub(super) struct Builder<'a> {
    pub(super) tree: &'a Tree,
    pub(super) files: &'a mut Files,
    notes: Vec<Note>,
    noted: HashSet<Note>,
    /// Materials that shapes use, and where each went.
    pub(super) bsdfs: Vec<Bsdf>,
    pub(super) bsdf_numbers: HashMap<PluginId, BsdfId>,
    /// Materials already built.
    pub(super) built_bsdfs: HashMap<PluginId, Bsdf>,
    /// Images already read; the flag is `raw`.
    pub(super) texels: HashMap<(PathBuf, bool), Arc<Texels>>,
    pub(super) shapes: Vec<Shape>,
    /// Where each shape is written, by name.
    pub(super) shape_positions: Vec<(String, Position)>,
    pub(super) emitters: Vec<Emitter>,
    /// The emitter around the scene, if one was built.
    pub(super) environment: Option<Position>,
    /// The material of shapes that name none: diffuse .5, and black for those that shine.
    pub(super) unnamed: [Option<BsdfId>; 2],
}

impl<'a> Builder<'a> {
    pub(super) fn new(tree: &'a Tree, files: &'a mut Files) -> Self {
        Self {
            tree,
            files,
            notes: Vec::new(),
            noted: HashSet::new(),
            bsdfs: Vec::new(),
            bsdf_numbers: HashMap::new(),
            built_bsdfs: HashMap::new(),
            texels: HashMap::new(),
            shapes: Vec::new(),
            shape_positions: Vec::new(),
            emitters: Vec::new(),
            environment: None,
            unnamed: [None; 2],
        }
    }

    pub(super) fn plugin(&self, id: PluginId) -> &'a Plugin {
        &self.tree.plugins[id]
    }

    pub(super) fn note(&mut self, position: &Position, message: impl Into<String>) {
        let note = Note::new(position, message.into());
        // A material shared by many shapes would say the same many times.
        if self.noted.insert(note.clone()) {
            self.notes.push(note);
        }
    }

    pub(super) fn into_notes(self) -> Vec<Note> {
        self.notes
    }

    /// Ends a plugin: what nobody asked for is an error, or a note if it is one of `noted`.
    pub(super) fn finish(&mut self, plugin: &Plugin, noted: &[(&'static str, &'static str)]) -> Result<()> {
        let mut notes = Vec::new();
        plugin.finish(noted, &self.tree.plugins, |position, message| notes.push(Note::new(position, message)))?;
        for note in notes {
            if self.noted.insert(note.clone()) {
                self.notes.push(note);
            }
        }
        Ok(())
    }

    /// The objects of the scene, in the order written.
    pub(super) fn scene(&mut self, options: &LoadOptions) -> Result<Built> {
        let root = self.plugin(self.tree.root);
        let sensor = self.only(root, Kind::Sensor)?;
        let integrator = self.only(root, Kind::Integrator)?;

        for child in &root.children {
            child.read.set(true);
            let plugin = self.plugin(child.target);
            match plugin.kind {
                Kind::Shape => self.shape(plugin)?,
                Kind::Emitter => self.emitter(plugin)?,
                // Materials and textures that nothing uses are checked all the same.
                Kind::Bsdf => drop(self.bsdf(child.target)?),
                Kind::Texture => drop(self.texture(child.target)?),
                Kind::Sensor | Kind::Integrator => {}
                Kind::Film | Kind::Rfilter | Kind::Sampler | Kind::Scene => {
                    let message = format!("a {} directly in the scene", plugin.kind.element());
                    return Err(
                        SceneError::new(&child.position, message).help("films and samplers stand in the sensor, an rfilter in the film")
                    );
                }
            }
        }
        self.finish(root, &[])?;

        let Some(sensor) = sensor else {
            return Err(
                SceneError::new(&root.position, "the scene has no sensor").help(format!("add one of {}", sensor::SENSORS.join(", ")))
            );
        };
        let mut defaults = RenderDefaults { sample_count: 4, max_depth: None, rr_depth: 5, hide_emitters: false, integrator: None };
        if let Some(integrator) = integrator {
            self.integrator(self.plugin(integrator.target), &mut defaults)?;
        }
        let (camera, film) = self.sensor(self.plugin(sensor.target), options, &mut defaults)?;
        let parts = SceneParts {
            shapes: std::mem::take(&mut self.shapes),
            bsdfs: std::mem::take(&mut self.bsdfs),
            emitters: std::mem::take(&mut self.emitters),
            camera,
        };
        Ok(Built { parts, film, defaults })
    }

    /// The object of a kind of which there may be at most one.
    pub(super) fn only(&self, owner: &'a Plugin, kind: Kind) -> Result<Option<&'a Child>> {
        let found = owner.children_of(kind, &self.tree.plugins);
        if let [first, second, ..] = found[..] {
            let message = format!("a second {} in the {}", kind.element(), owner.title());
            return Err(SceneError::new(&second.position, message).help(format!("one is supported; the first is at {}", first.position)));
        }
        Ok(found.first().copied())
    }
}

/// Makes a `T` of a plugin.
pub(super) type Constructor<T> = fn(&mut Builder<'_>, &Plugin) -> Result<T>;

/// The plugins of a kind: what `type` names them, and how each is made.
pub(super) type Table<T> = &'static [(&'static str, Constructor<T>)];

/// How a plugin is made; an error with the names of the table if it is not in it.
pub(super) fn constructor<T>(table: Table<T>, plugin: &Plugin) -> Result<Constructor<T>> {
    let found = table.iter().find(|(name, _)| *name == plugin.type_name);
    let names = || table.iter().map(|(name, _)| *name).collect::<Vec<_>>();
    found.map(|(_, construct)| *construct).ok_or_else(|| unsupported(plugin, &names()))
}

/// The error for a type that is not in a kind's table.
pub(super) fn unsupported(plugin: &Plugin, names: &[&str]) -> SceneError {
    let message = format!("the {} type \"{}\" is not supported", plugin.kind.element(), excerpt(&plugin.type_name));
    SceneError::new(&plugin.type_position, message).help(suggest(&plugin.type_name, names))
}

/// `to_world` in single precision; an error if it is singular.
pub(super) fn to_world(plugin: &Plugin) -> Result<Affine3A> {
    let given = plugin.transform("to_world")?;
    affine(&given.value).ok_or_else(|| degenerate(&given.position, "to_world"))
}

pub(super) fn degenerate(position: &Position, name: &str) -> SceneError {
    SceneError::new(position, format!("\"{name}\" is degenerate: it flattens space, or overflows single precision"))
        .help("a scale of zero or a matrix without inverse is the usual cause")
}

fn affine(m: &DMat4) -> Option<Affine3A> {
    let single = Affine3A::from_mat4(m.as_mat4());
    // A map that is fine in double precision may still vanish in single.
    let usable = single.is_finite() && single.matrix3.determinant().is_normal();
    (!super::transform::singular(m) && usable).then_some(single)
}
