//! First stage: XML files to a tree of plugins with typed parameters. Nothing here knows what a plugin means.

use super::Note;
use super::element::{check_attribute_counts, check_attributes, check_version, kind_of, required, syntax_error, unknown_element, value_of};
use super::error::{Position, Result, SceneError, excerpt, suggest};
use super::files::{Files, resolve};
use super::plugin::{Child, Kind, Plugin, PluginId, Property, Value, check_cycles};
use super::transform::{self, Attribute, OPERATIONS};
use glam::DMat4;
use roxmltree::{Document, Node, ParsingOptions};
use std::cell::Cell;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

// Limits that no scene meets and that keep a malicious or broken one from hanging the loader.
const DEEPEST_INCLUDE: usize = 15;
const DEEPEST_OBJECT: usize = 32;
const LARGEST_XML: usize = 64 << 20;
const LONGEST_ATTRIBUTE: usize = 1 << 20;
const LONGEST_NAME: usize = 64;
const MOST_NODES: u32 = 4_000_000;
const MOST_PLUGINS: usize = 1_000_000;

/// Every plugin of a scene, the files' nesting and the references resolved.
pub(super) struct Tree {
    pub(super) plugins: Vec<Plugin>,
    pub(super) root: PluginId,
    pub(super) notes: Vec<Note>,
}

/// Reads `path` and everything it includes; `defines` fill `$name`.
pub(super) fn read(path: &Path, defines: &[(String, String)], files: &mut Files) -> Result<Tree> {
    let mut reader = Reader {
        files,
        parameters: HashMap::new(),
        plugins: Vec::new(),
        references: Vec::new(),
        ids: HashMap::new(),
        names: HashSet::new(),
        notes: Vec::new(),
        open: Vec::new(),
    };
    for (name, value) in defines {
        reader.parameters.insert(name.clone(), Parameter { value: value.clone(), defined: true, used: false });
    }
    let root = reader.file(path, &[], None, &Position::whole(path))?;
    reader.check_defines(path)?;
    if reader.plugins[root].kind != Kind::Scene {
        let position = reader.plugins[root].position.clone();
        return Err(SceneError::new(&position, format!("the file holds a {}, not a scene", reader.plugins[root].title()))
            .help("the outermost element must be <scene version=\"3.0.0\">"));
    }
    reader.link()?;
    check_cycles(&reader.plugins)?;
    Ok(Tree { plugins: reader.plugins, root, notes: reader.notes })
}

/// What `$name` stands for.
struct Parameter {
    value: String,
    /// Given with `-D`, not by a `default`.
    defined: bool,
    used: bool,
}

/// A `ref`, resolved when everything is read.
struct Reference {
    owner: PluginId,
    /// Where among the owner's children it belongs: order matters to nested materials.
    child: usize,
    id: String,
}

/// A file being read.
struct Source<'a> {
    document: &'a Document<'a>,
    file: Arc<Path>,
    line_starts: Vec<usize>,
    folders: Arc<[PathBuf]>,
    /// The byte and the column of the last position.
    last: Cell<(usize, usize)>,
}

impl Source<'_> {
    /// Line and column of a byte, as `Document::text_pos_at` counts them, but without a scan from the start: the file may be one long line,
    /// so the column is counted from the last one asked for.
    fn position(&self, byte: usize) -> Position {
        let line = self.line_starts.partition_point(|start| *start <= byte).max(1);
        let start = self.line_starts[line - 1];
        let characters = |from: usize, to: usize| self.document.input_text().get(from..to).map_or(0, |text| text.chars().count());
        let column = match self.last.get() {
            (last_byte, last) if last_byte >= start && last_byte <= byte => last + characters(last_byte, byte),
            (last_byte, last) if last_byte > byte && self.line_starts.get(line).is_none_or(|next| last_byte < *next) => {
                last - characters(byte, last_byte)
            }
            _ => characters(start, byte) + 1,
        };
        self.last.set((byte, column));
        Position { file: self.file.clone(), line: Some(line as u32), column: Some(column as u32) }
    }

    fn at(&self, node: Node<'_, '_>) -> Position {
        self.position(node.range().start)
    }
}

struct Reader<'f> {
    files: &'f mut Files,
    parameters: HashMap<String, Parameter>,
    plugins: Vec<Plugin>,
    references: Vec<Reference>,
    ids: HashMap<String, PluginId>,
    /// Names of parameters and nested objects given so far.
    names: HashSet<(PluginId, String)>,
    notes: Vec<Note>,
    /// Files being read, outermost first: a file that includes itself never ends.
    open: Vec<PathBuf>,
}

impl Reader<'_> {
    // ---- files ----------------------------------------------------------------------------------------------------------------

    /// Reads one file. With `parent` the children of its scene element join that plugin; the plugin its root became is returned.
    fn file(&mut self, path: &Path, outer: &[PathBuf], parent: Option<PluginId>, named: &Position) -> Result<PluginId> {
        let identity = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        if self.open.contains(&identity) {
            return Err(SceneError::new(named, format!("{} includes itself", path.display())));
        }
        if self.open.len() > DEEPEST_INCLUDE {
            return Err(SceneError::new(named, format!("includes are nested more than {DEEPEST_INCLUDE} deep")));
        }
        let text = self.text(path, named)?;
        check_attribute_counts(path, &text)?;
        let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
        let document = Document::parse_with_options(&text, options).map_err(|e| syntax_error(path, &text, &e))?;

        let folder = path.parent().map_or_else(PathBuf::new, Path::to_path_buf);
        let mut folders = vec![folder];
        folders.extend_from_slice(outer);
        let line_starts = std::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect();
        let source =
            Source { document: &document, file: Arc::from(path), line_starts, folders: Arc::from(folders), last: Cell::new((0, 1)) };

        self.open.push(identity);
        let root = self.root(&source, parent);
        self.open.pop();
        root
    }

    fn text(&mut self, path: &Path, named: &Position) -> Result<String> {
        let bytes = self.files.read(path, named)?;
        if bytes.len() > LARGEST_XML {
            return Err(SceneError::new(&Position::whole(path), format!("{} bytes of XML, at most {LARGEST_XML} are read", bytes.len())));
        }
        String::from_utf8(bytes).map_err(|e| {
            let before = &e.as_bytes()[..e.utf8_error().valid_up_to()];
            let line = before.iter().filter(|byte| **byte == b'\n').count() + 1;
            SceneError::new(&Position::line(path, line as u32), "the file is not UTF-8 text").help("save it as UTF-8")
        })
    }

    fn root(&mut self, source: &Source<'_>, parent: Option<PluginId>) -> Result<PluginId> {
        let node = source.document.root_element();
        let at = source.at(node);
        let attributes = self.attributes(source, node)?;
        let version = attributes.iter().find(|a| a.name == "version");
        let Some(version) = version else {
            return Err(SceneError::new(&at, format!("<{}> has no version", node.tag_name().name())).help("write version=\"3.0.0\""));
        };
        check_version(version)?;
        let Some(kind) = kind_of(node) else { return Err(unknown_element(&at, node.tag_name().name())) };

        if kind != Kind::Scene {
            check_attributes(node, &attributes, &["version", "type", "id", "name"])?;
            return self.object(source, node, kind, attributes, 0);
        }
        check_attributes(node, &attributes, &["version"])?;
        let id = match parent {
            Some(parent) => parent,
            None => self.add(Plugin::new(Kind::Scene, "scene".to_owned(), None, at, source.folders.clone()))?,
        };
        self.contents(source, node, id, 0)?;
        Ok(id)
    }

    // ---- objects --------------------------------------------------------------------------------------------------------------

    fn add(&mut self, plugin: Plugin) -> Result<PluginId> {
        if self.plugins.len() >= MOST_PLUGINS {
            return Err(SceneError::new(&plugin.position, format!("more than {MOST_PLUGINS} objects")));
        }
        self.plugins.push(plugin);
        Ok(self.plugins.len() - 1)
    }

    fn object(
        &mut self,
        source: &Source<'_>,
        node: Node<'_, '_>,
        kind: Kind,
        attributes: Vec<Attribute<'_>>,
        depth: usize,
    ) -> Result<PluginId> {
        let at = source.at(node);
        if depth > DEEPEST_OBJECT {
            return Err(SceneError::new(&at, format!("objects are nested more than {DEEPEST_OBJECT} deep")));
        }
        let text = |name: &str| attributes.iter().find(|a| a.name == name);
        let Some(type_name) = text("type") else {
            return Err(
                SceneError::new(&at, format!("<{}> has no type", kind.element())).help(format!("write <{} type=\"...\">", kind.element()))
            );
        };
        let id = text("id");
        let mut plugin = Plugin::new(kind, type_name.value.clone(), id.map(|a| a.value.clone()), at, source.folders.clone());
        plugin.type_position = type_name.position.clone();
        let number = self.add(plugin)?;
        if let Some(id) = id
            && let Some(previous) = self.ids.insert(id.value.clone(), number)
        {
            let message = format!("the id \"{}\" is taken by {}", excerpt(&id.value), self.plugins[previous].position);
            return Err(SceneError::new(&id.position, message).help("give every object an id of its own"));
        }
        self.contents(source, node, number, depth)?;
        Ok(number)
    }

    fn contents(&mut self, source: &Source<'_>, node: Node<'_, '_>, owner: PluginId, depth: usize) -> Result<()> {
        for child in node.children() {
            if child.is_text() && child.text().is_some_and(|t| !t.trim().is_empty()) {
                let text = child.text().unwrap_or_default();
                let at = source.position(child.range().start + (text.len() - text.trim_start().len()));
                let shown = excerpt(text.trim());
                return Err(SceneError::new(&at, format!("stray text \"{shown}\"")).help("values stand in attributes, remarks in <!-- -->"));
            }
            if child.is_element() {
                self.element(source, child, owner, depth)?;
            }
        }
        Ok(())
    }

    fn element(&mut self, source: &Source<'_>, node: Node<'_, '_>, owner: PluginId, depth: usize) -> Result<()> {
        let at = source.at(node);
        let attributes = self.attributes(source, node)?;
        let element = node.tag_name().name();
        if element == "spectrum" && attributes.iter().any(|a| a.name == "type") {
            return Err(SceneError::new(&at, "spectrum plugins are not supported")
                .help("write <spectrum name=\"...\" value=\"ONE NUMBER\"/> or <rgb>"));
        }
        if let Some(kind) = kind_of(node) {
            if kind == Kind::Scene {
                return Err(SceneError::new(&at, "a scene inside a scene").help("there is one <scene>, the outermost element"));
            }
            check_attributes(node, &attributes, &["type", "id", "name"])?;
            let name = attributes.iter().find(|a| a.name == "name").map(|a| a.value.clone()).unwrap_or_default();
            // The place among the siblings is taken before the contents are read, which may add plugins of their own.
            let number = self.object(source, node, kind, attributes, depth + 1)?;
            return self.adopt(owner, name, at, number);
        }
        match element {
            "ref" => self.reference(node, &attributes, owner, at),
            "include" => self.include(source, node, &attributes, owner, at),
            "default" => self.default(node, &attributes, at),
            _ => self.property(source, node, &attributes, owner, at),
        }
    }

    fn adopt(&mut self, owner: PluginId, name: String, position: Position, target: PluginId) -> Result<()> {
        self.check_free(owner, &name, &position)?;
        self.plugins[owner].children.push(Child { name, position, target, read: Cell::new(false) });
        Ok(())
    }

    fn check_free(&mut self, owner: PluginId, name: &str, position: &Position) -> Result<()> {
        if !name.is_empty() && !self.names.insert((owner, name.to_owned())) {
            let message = format!("\"{}\" of the {} is given twice", excerpt(name), self.plugins[owner].title());
            return Err(SceneError::new(position, message).help(format!("the other is at {}", self.plugins[owner].place(name))));
        }
        Ok(())
    }

    fn reference(&mut self, node: Node<'_, '_>, attributes: &[Attribute<'_>], owner: PluginId, at: Position) -> Result<()> {
        check_attributes(node, attributes, &["id", "name"])?;
        let id = required(node, attributes, "id", &at)?;
        let name = attributes.iter().find(|a| a.name == "name").map(|a| a.value.clone()).unwrap_or_default();
        self.check_childless(node, &at)?;
        let child = self.plugins[owner].children.len();
        self.references.push(Reference { owner, child, id: id.value.clone() });
        // The target is set by `link`.
        self.adopt(owner, name, at, owner)
    }

    fn include(
        &mut self,
        source: &Source<'_>,
        node: Node<'_, '_>,
        attributes: &[Attribute<'_>],
        owner: PluginId,
        at: Position,
    ) -> Result<()> {
        check_attributes(node, attributes, &["filename", "name"])?;
        self.check_childless(node, &at)?;
        let file = required(node, attributes, "filename", &at)?;
        let path = resolve(&file.value, &source.folders, &file.position)?;
        let number = self.file(&path, &source.folders, Some(owner), &file.position).map_err(|e| e.via("included at", &at))?;
        if number == owner {
            return Ok(());
        }
        let name = attributes.iter().find(|a| a.name == "name").map(|a| a.value.clone()).unwrap_or_default();
        self.adopt(owner, name, at, number)
    }

    fn default(&mut self, node: Node<'_, '_>, attributes: &[Attribute<'_>], at: Position) -> Result<()> {
        check_attributes(node, attributes, &["name", "value"])?;
        self.check_childless(node, &at)?;
        let name = required(node, attributes, "name", &at)?;
        let value = required(node, attributes, "value", &at)?;
        let named = !name.value.is_empty() && name.value.len() <= LONGEST_NAME;
        if !named || !name.value.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            return Err(SceneError::new(&name.position, format!("\"{}\" is no name for a parameter", excerpt(&name.value)))
                .help(format!("up to {LONGEST_NAME} letters, digits and _ are allowed")));
        }
        let value = value.value.clone();
        // What was given before, with -D or by an earlier default, stays. A -D of a declared name is known even where nothing uses it.
        self.parameters.entry(name.value.clone()).and_modify(|p| p.used = true).or_insert(Parameter { value, defined: false, used: true });
        Ok(())
    }

    fn check_childless(&self, node: Node<'_, '_>, at: &Position) -> Result<()> {
        if node.children().any(|c| c.is_element()) {
            return Err(SceneError::new(at, format!("<{}> cannot have elements inside it", node.tag_name().name())));
        }
        Ok(())
    }

    // ---- parameters -----------------------------------------------------------------------------------------------------------

    fn property(
        &mut self,
        source: &Source<'_>,
        node: Node<'_, '_>,
        attributes: &[Attribute<'_>],
        owner: PluginId,
        at: Position,
    ) -> Result<()> {
        let element = node.tag_name().name();
        let allowed: &[&str] = match element {
            "transform" => &["name"],
            "point" | "vector" => &["name", "value", "x", "y", "z"],
            "spectrum" => &["name", "value", "filename"],
            "float" | "integer" | "boolean" | "string" | "rgb" => &["name", "value"],
            _ if OPERATIONS.iter().any(|(operation, _)| *operation == element) => {
                return Err(SceneError::new(&at, format!("<{element}> outside a <transform>"))
                    .help("write <transform name=\"to_world\"> around it"));
            }
            _ => return Err(unknown_element(&at, element)),
        };
        check_attributes(node, attributes, allowed)?;
        let name = required(node, attributes, "name", &at)?;
        if name.value.is_empty() {
            return Err(SceneError::new(&name.position, format!("<{element}> has an empty name")));
        }
        self.check_free(owner, &name.value, &at)?;
        let (value, value_position) = if element == "transform" {
            (Value::Transform(self.transform(source, node)?), at.clone())
        } else {
            self.check_childless(node, &at)?;
            value_of(element, node, attributes, &at)?
        };
        let property = Property { name: name.value.clone(), value, position: at, value_position, read: Cell::new(false) };
        self.plugins[owner].properties.push(property);
        Ok(())
    }

    fn transform(&mut self, source: &Source<'_>, node: Node<'_, '_>) -> Result<DMat4> {
        let mut total = DMat4::IDENTITY;
        for child in node.children().filter(Node::is_element) {
            let at = source.at(child);
            let element = child.tag_name().name();
            let Some((_, allowed)) = OPERATIONS.iter().find(|(operation, _)| *operation == element) else {
                let names: Vec<&str> = OPERATIONS.iter().map(|(operation, _)| *operation).collect();
                return Err(SceneError::new(&at, format!("<{}> inside a <transform>", excerpt(element))).help(suggest(element, &names)));
            };
            let attributes = self.attributes(source, child)?;
            check_attributes(child, &attributes, allowed)?;
            self.check_childless(child, &at)?;
            let notes = &mut self.notes;
            let matrix =
                transform::operation(element, &at, &attributes, &mut |position, message| notes.push(Note::new(position, message)))?;
            // In the order written: a later operation acts on what the earlier ones gave.
            total = matrix * total;
            if !total.is_finite() {
                return Err(SceneError::new(&at, "the transform is not finite from here on"));
            }
        }
        Ok(total)
    }

    // ---- $name ----------------------------------------------------------------------------------------------------------------

    fn attributes<'n>(&mut self, source: &Source<'_>, node: Node<'n, '_>) -> Result<Vec<Attribute<'n>>> {
        let mut list = Vec::new();
        for attribute in node.attributes() {
            let position = source.position(attribute.range().start);
            let value = self.substitute(attribute.value(), &position)?;
            list.push(Attribute { name: attribute.name(), value, position });
        }
        Ok(list)
    }

    /// The text with every `$name` replaced; `\$` is a dollar sign.
    fn substitute(&mut self, text: &str, at: &Position) -> Result<String> {
        if !text.contains('$') {
            return Ok(text.to_owned());
        }
        if text.len() > LONGEST_ATTRIBUTE {
            return Err(SceneError::new(at, format!("an attribute of {} bytes with a $ in it", text.len())));
        }
        let mut out = String::new();
        let mut rest = text;
        while let Some(dollar) = rest.find('$') {
            let (before, after) = (&rest[..dollar], &rest[dollar + 1..]);
            if let Some(escaped) = before.strip_suffix('\\') {
                out.push_str(escaped);
                out.push('$');
                rest = after;
                continue;
            }
            out.push_str(before);
            let length = after.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(after.len());
            // No known name is longer.
            let length = length.min(LONGEST_NAME);
            // The longest name that is known, as in Mitsuba: "$resx" may be "$res" followed by an x.
            let known = (1..=length).rev().find(|end| self.parameters.contains_key(&after[..*end]));
            let Some(parameter) = known.and_then(|end| self.parameters.get_mut(&after[..end]).map(|p| (end, p))) else {
                let names: Vec<&str> = self.parameters.keys().map(String::as_str).collect();
                let message = format!("${} has no value", excerpt(&after[..length]));
                let help = format!(
                    "give it with -D {}=..., or write <default> before this line; {}",
                    excerpt(&after[..length]),
                    suggest(&after[..length], &names)
                );
                return Err(SceneError::new(at, message).help(help));
            };
            let (end, parameter) = parameter;
            parameter.used = true;
            out.push_str(&parameter.value);
            rest = &after[end..];
            if out.len() > LONGEST_ATTRIBUTE {
                return Err(SceneError::new(at, format!("the attribute grows beyond {LONGEST_ATTRIBUTE} bytes")));
            }
        }
        out.push_str(rest);
        Ok(out)
    }

    fn check_defines(&self, path: &Path) -> Result<()> {
        let mut unused: Vec<&str> = self.parameters.iter().filter(|(_, p)| p.defined && !p.used).map(|(name, _)| name.as_str()).collect();
        unused.sort_unstable();
        let Some(name) = unused.first() else { return Ok(()) };
        let known: Vec<&str> = self.parameters.iter().filter(|(_, p)| p.used).map(|(name, _)| name.as_str()).collect();
        Err(SceneError::new(&Position::whole(path), format!("-D {}: the scene has no ${}", excerpt(name), excerpt(name)))
            .help(suggest(name, &known)))
    }

    // ---- references -----------------------------------------------------------------------------------------------------------

    fn link(&mut self) -> Result<()> {
        for reference in std::mem::take(&mut self.references) {
            let Some(target) = self.ids.get(&reference.id) else {
                let names: Vec<&str> = self.ids.keys().map(String::as_str).collect();
                let position = &self.plugins[reference.owner].children[reference.child].position;
                let message = format!("no object has the id \"{}\"", excerpt(&reference.id));
                return Err(SceneError::new(position, message).help(suggest(&reference.id, &names)));
            };
            self.plugins[reference.owner].children[reference.child].target = *target;
        }
        Ok(())
    }
}
