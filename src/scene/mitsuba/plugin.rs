//! What an XML element says before anything is built from it: typed parameters that remember whether they were read.

use super::error::{Position, Result, SceneError, suggest};
use glam::{DMat4, DVec3};
use std::cell::{Cell, RefCell};
use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::Arc;

/// What an object element is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scene,
    Sensor,
    Film,
    Rfilter,
    Sampler,
    Integrator,
    Shape,
    Bsdf,
    Emitter,
    Texture,
}

impl Kind {
    /// Every kind with its element.
    pub(super) const ALL: [(&'static str, Kind); 10] = [
        ("scene", Kind::Scene),
        ("sensor", Kind::Sensor),
        ("film", Kind::Film),
        ("rfilter", Kind::Rfilter),
        ("sampler", Kind::Sampler),
        ("integrator", Kind::Integrator),
        ("shape", Kind::Shape),
        ("bsdf", Kind::Bsdf),
        ("emitter", Kind::Emitter),
        ("texture", Kind::Texture),
    ];

    /// The element's name.
    pub(super) fn element(self) -> &'static str {
        Kind::ALL.iter().find(|(_, kind)| *kind == self).map_or("object", |(element, _)| element)
    }
}

/// A parameter's value as its element types it.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Float(f64),
    Integer(i64),
    Boolean(bool),
    String(String),
    /// Linear Rec. 709 components.
    Rgb([f64; 3]),
    /// A spectrum that is the same at every wavelength.
    Spectrum(f64),
    /// A point or a vector.
    Vector([f64; 3]),
    Transform(DMat4),
}

impl Value {
    /// The element that gives such a value.
    fn element(&self) -> &'static str {
        match self {
            Value::Float(_) => "float",
            Value::Integer(_) => "integer",
            Value::Boolean(_) => "boolean",
            Value::String(_) => "string",
            Value::Rgb(_) => "rgb",
            Value::Spectrum(_) => "spectrum",
            Value::Vector(_) => "point or vector",
            Value::Transform(_) => "transform",
        }
    }
}

/// A named parameter.
#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) value: Value,
    /// Where its element starts.
    pub(super) position: Position,
    /// Where its value starts.
    pub(super) value_position: Position,
    pub(super) read: Cell<bool>,
}

/// Index of a plugin in its [`super::xml::Tree`].
pub(super) type PluginId = usize;

/// An object inside another one, written there or referred to.
#[derive(Debug)]
pub(super) struct Child {
    /// The parameter it stands for; empty if it has no name.
    pub(super) name: String,
    /// Where it is written; for a reference the `ref`.
    pub(super) position: Position,
    pub(super) target: PluginId,
    pub(super) read: Cell<bool>,
}

/// An object element.
#[derive(Debug)]
pub(super) struct Plugin {
    pub(super) kind: Kind,
    /// The `type` attribute.
    pub(super) type_name: String,
    pub(super) id: Option<String>,
    /// Where the element starts.
    pub(super) position: Position,
    /// Where the `type` attribute stands.
    pub(super) type_position: Position,
    /// Folders that a file name is looked up in, in this order.
    pub(super) folders: Arc<[PathBuf]>,
    pub(super) properties: Vec<Property>,
    pub(super) children: Vec<Child>,
    /// Names that were asked for: what the plugin supports.
    asked: RefCell<Vec<&'static str>>,
}

/// A number a plugin asked for, with its place.
#[derive(Clone, Debug)]
pub(super) struct Given<T> {
    pub(super) value: T,
    /// Where the value is written, or where the plugin is if this is the default.
    pub(super) position: Position,
}

impl Plugin {
    pub(super) fn new(kind: Kind, type_name: String, id: Option<String>, position: Position, folders: Arc<[PathBuf]>) -> Self {
        let type_position = position.clone();
        Self {
            kind,
            type_name,
            id,
            position,
            type_position,
            folders,
            properties: Vec::new(),
            children: Vec::new(),
            asked: RefCell::default(),
        }
    }

    /// `diffuse bsdf`, for messages.
    pub(super) fn title(&self) -> String {
        if self.kind == Kind::Scene { "scene".to_owned() } else { format!("{} {}", self.type_name, self.kind.element()) }
    }

    /// The parameter of this name, which is read from now on.
    pub(super) fn property(&self, name: &'static str) -> Option<&Property> {
        self.ask(name);
        let found = self.properties.iter().find(|p| p.name == name)?;
        found.read.set(true);
        Some(found)
    }

    /// The nested object of this name, which is read from now on.
    pub(super) fn child(&self, name: &'static str) -> Option<&Child> {
        self.ask(name);
        let found = self.children.iter().find(|c| c.name == name)?;
        found.read.set(true);
        Some(found)
    }

    fn ask(&self, name: &'static str) {
        let mut asked = self.asked.borrow_mut();
        if !asked.contains(&name) {
            asked.push(name);
        }
    }

    /// Is a parameter or a nested object of this name given?
    pub(super) fn has(&self, name: &str) -> bool {
        self.properties.iter().any(|p| p.name == name) || self.children.iter().any(|c| c.name == name)
    }

    /// Where a parameter is written, else where the plugin is.
    pub(super) fn place(&self, name: &str) -> &Position {
        let property = self.properties.iter().find(|p| p.name == name).map(|p| &p.value_position);
        property.or_else(|| self.children.iter().find(|c| c.name == name).map(|c| &c.position)).unwrap_or(&self.position)
    }

    fn get<T>(&self, name: &'static str, expected: &str, take: impl Fn(&Value) -> Option<T>) -> Result<Option<Given<T>>> {
        if let Some(child) = self.children.iter().find(|c| c.name == name) {
            return Err(SceneError::new(
                &child.position,
                format!("\"{name}\" of a {} takes a <{expected}>, no nested object", self.title()),
            ));
        }
        let Some(property) = self.property(name) else { return Ok(None) };
        match take(&property.value) {
            Some(value) => Ok(Some(Given { value, position: property.value_position.clone() })),
            None => Err(property.mismatch(expected)),
        }
    }

    fn or_default<T>(&self, given: Option<Given<T>>, default: T) -> Given<T> {
        given.unwrap_or_else(|| Given { value: default, position: self.position.clone() })
    }

    /// A number, if given. An integer passes for a float, as in Mitsuba.
    pub(super) fn float_if_given(&self, name: &'static str) -> Result<Option<Given<f64>>> {
        self.get(name, "float", |value| match value {
            Value::Float(v) => Some(*v),
            Value::Integer(v) => Some(*v as f64),
            _ => None,
        })
    }

    /// A number.
    pub(super) fn float(&self, name: &'static str, default: f64) -> Result<Given<f64>> {
        Ok(self.or_default(self.float_if_given(name)?, default))
    }

    /// A whole number, if given.
    pub(super) fn integer_if_given(&self, name: &'static str) -> Result<Option<Given<i64>>> {
        self.get(name, "integer", |value| if let Value::Integer(v) = value { Some(*v) } else { None })
    }

    /// A whole number.
    pub(super) fn integer(&self, name: &'static str, default: i64) -> Result<Given<i64>> {
        Ok(self.or_default(self.integer_if_given(name)?, default))
    }

    /// True or false.
    pub(super) fn boolean(&self, name: &'static str, default: bool) -> Result<bool> {
        let given = self.get(name, "boolean", |value| if let Value::Boolean(v) = value { Some(*v) } else { None })?;
        Ok(given.map_or(default, |g| g.value))
    }

    /// Text, if given.
    pub(super) fn string_if_given(&self, name: &'static str) -> Result<Option<Given<String>>> {
        self.get(name, "string", |value| if let Value::String(v) = value { Some(v.clone()) } else { None })
    }

    /// Text that has to be given.
    pub(super) fn required_string(&self, name: &'static str) -> Result<Given<String>> {
        self.string_if_given(name)?.ok_or_else(|| self.missing(name, "string"))
    }

    /// The value that goes with one of a few words.
    pub(super) fn choice<T: Copy>(&self, name: &'static str, choices: &[(&str, T)], default: T) -> Result<T> {
        let Some(given) = self.string_if_given(name)? else { return Ok(default) };
        // Mitsuba compares these words without regard to case.
        match choices.iter().find(|(word, _)| word.eq_ignore_ascii_case(&given.value)) {
            Some((_, value)) => Ok(*value),
            None => {
                let words: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
                let message = format!("\"{}\" is no {name} of a {}", super::error::excerpt(&given.value), self.title());
                Err(SceneError::new(&given.position, message).help(suggest(&given.value, &words)))
            }
        }
    }

    /// A point or a vector, if given.
    pub(super) fn vector_if_given(&self, name: &'static str) -> Result<Option<Given<DVec3>>> {
        self.get(name, "point or vector", |value| if let Value::Vector(v) = value { Some(DVec3::from_array(*v)) } else { None })
    }

    /// A transform; the identity if not given.
    pub(super) fn transform(&self, name: &'static str) -> Result<Given<DMat4>> {
        let given = self.get(name, "transform", |value| if let Value::Transform(m) = value { Some(*m) } else { None })?;
        Ok(self.or_default(given, DMat4::IDENTITY))
    }

    /// The error for a parameter that has to be given.
    pub(super) fn missing(&self, name: &str, element: &str) -> SceneError {
        SceneError::new(&self.position, format!("a {} needs a <{element}> \"{name}\"", self.title()))
    }

    /// Nested objects of a kind, which are read from now on.
    pub(super) fn children_of<'a>(&'a self, kind: Kind, plugins: &'a [Plugin]) -> Vec<&'a Child> {
        let found: Vec<&Child> = self.children.iter().filter(|c| plugins[c.target].kind == kind).collect();
        for child in &found {
            child.read.set(true);
        }
        found
    }

    /// Parameters and nested objects nobody asked for: those named in `noted` become notes (with the reason why they do not matter),
    /// any other is an error.
    pub(super) fn finish(
        &self,
        noted: &[(&'static str, &'static str)],
        plugins: &[Plugin],
        mut note: impl FnMut(&Position, String),
    ) -> Result<()> {
        let reason = |name: &str| noted.iter().find(|(known, _)| *known == name).map(|(_, why)| *why);
        for property in self.properties.iter().filter(|p| !p.read.get()) {
            match reason(&property.name) {
                Some(why) => note(&property.position, format!("\"{}\" of the {} is not used: {why}", property.name, self.title())),
                None => return Err(self.unknown(&property.name, &property.position, noted)),
            }
        }
        for child in self.children.iter().filter(|c| !c.read.get()) {
            let what = &plugins[child.target];
            match reason(&child.name) {
                Some(why) => note(&child.position, format!("\"{}\" of the {} is not used: {why}", child.name, self.title())),
                None if child.name.is_empty() => {
                    let hint = match what.kind {
                        Kind::Texture => "give the texture a name: the parameter it stands for".to_owned(),
                        _ => format!("it takes {}", self.takes(noted)),
                    };
                    return Err(
                        SceneError::new(&child.position, format!("a {} has no place for a {}", self.title(), what.title())).help(hint)
                    );
                }
                None => return Err(self.unknown(&child.name, &child.position, noted)),
            }
        }
        Ok(())
    }

    fn takes(&self, noted: &[(&'static str, &'static str)]) -> String {
        let names: Vec<&str> = self.asked.borrow().iter().copied().chain(noted.iter().map(|(name, _)| *name)).collect();
        if names.is_empty() { "no parameters".to_owned() } else { format!("the parameters {}", names.join(", ")) }
    }

    fn unknown(&self, name: &str, position: &Position, noted: &[(&'static str, &'static str)]) -> SceneError {
        let known: Vec<&str> = self.asked.borrow().iter().copied().chain(noted.iter().map(|(name, _)| *name)).collect();
        let message = format!("a {} has no parameter \"{}\" here", self.title(), super::error::excerpt(name));
        SceneError::new(position, message).help(suggest(name, &known))
    }
}

impl Property {
    /// The error for a parameter given as the wrong element.
    pub(super) fn mismatch(&self, expected: &str) -> SceneError {
        SceneError::new(
            &self.value_position,
            format!("\"{}\" is given as a <{}>, a <{expected}> is expected", self.name, self.value.element()),
        )
    }
}

impl<T> Given<T> {
    /// The value if it passes the test, else the error `what is value, must be rule`.
    pub(super) fn check(self, name: &str, holds: impl Fn(&T) -> bool, rule: &str) -> Result<Self>
    where
        T: std::fmt::Debug,
    {
        if holds(&self.value) {
            Ok(self)
        } else {
            Err(SceneError::new(&self.position, format!("\"{name}\" is {:?}, it must be {rule}", self.value)))
        }
    }
}

/// An object that contains itself through references has no end.
pub(super) fn check_cycles(plugins: &[Plugin]) -> Result<()> {
    let mut done: HashSet<PluginId> = HashSet::new();
    for start in 0..plugins.len() {
        // Depth first without recursion: (plugin, next child); the chain of open plugins is the stack itself.
        let mut stack = vec![(start, 0)];
        let mut open: HashSet<PluginId> = HashSet::from([start]);
        while let Some((plugin, next)) = stack.pop() {
            if done.contains(&plugin) {
                open.remove(&plugin);
                continue;
            }
            let Some(child) = plugins[plugin].children.get(next) else {
                done.insert(plugin);
                open.remove(&plugin);
                continue;
            };
            stack.push((plugin, next + 1));
            if !open.insert(child.target) {
                return Err(SceneError::new(
                    &child.position,
                    format!("the {} contains itself through this reference", plugins[child.target].title()),
                ));
            }
            stack.push((child.target, 0));
        }
    }
    Ok(())
}
