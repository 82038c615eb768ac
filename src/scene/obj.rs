//! Wavefront OBJ files, through tobj.
//!
//! A survey of the file comes first, line by line: it finds what is wrong together with its line, and tells which statements matter. Only
//! those reach tobj, which reads the numbers, fans polygons and shares vertices. Groups, materials and smoothing groups are left out, so
//! that vertices are shared across them, as Mitsuba does.

mod normals;
mod survey;

use super::shape::Mesh;
use glam::{DMat3, DMat4, DVec3, Vec2, Vec3};
use survey::{Statements, Survey};

/// Where shading normals come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VertexNormals {
    /// The file's `vn`; computed from the faces, weighted by their angles at the vertex, if it has none. Mitsuba's default.
    FileOrComputed,
    /// Nowhere: faces are flat, and the file's are dropped. Mitsuba's `face_normals`.
    None,
}

/// How a file becomes a mesh.
#[derive(Clone, Debug)]
pub struct ObjOptions {
    /// Applied to positions, and its inverse transpose to normals. Not singular.
    pub to_world: DMat4,
    /// Where shading normals come from.
    pub normals: VertexNormals,
    /// `v` becomes `1 - v`: Mitsuba's default.
    pub flip_tex_coords: bool,
    /// Turns normals around.
    pub flip_normals: bool,
}

/// A mesh read, and what was remarkable about the file.
#[derive(Debug)]
pub struct ObjMesh {
    /// At least one triangle, none without area.
    pub mesh: Mesh,
    /// What was left out or made up, with counts.
    pub notes: Vec<String>,
}

/// What is wrong with a file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}{message}", line.map_or_else(String::new, |l| format!("line {l}: ")))]
pub struct ObjError {
    /// Line, from 1; `None` where the file as a whole is at fault.
    pub line: Option<u32>,
    /// What is wrong, without a full stop.
    pub message: String,
    /// What to do.
    pub help: Option<String>,
}

impl ObjError {
    fn at(line: u32, message: impl Into<String>) -> Self {
        Self { line: Some(line), message: message.into(), help: None }
    }

    fn whole(message: impl Into<String>) -> Self {
        Self { line: None, message: message.into(), help: None }
    }

    fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// Reads a file's content.
pub fn read(content: &[u8], options: &ObjOptions) -> Result<ObjMesh, ObjError> {
    let content = content.strip_prefix(b"\xef\xbb\xbf").unwrap_or(content);
    let keep_normals = options.normals == VertexNormals::FileOrComputed;
    let survey = Survey::of(content, keep_normals)?;
    let mut notes = survey.notes();
    let raw = parse(content, &survey, keep_normals)?;

    // ---- attributes of the vertices -------------------------------------------------------------------------------------------
    let positions: Vec<Vec3> = triples(&raw.positions).map(|p| options.to_world.transform_point3(p).as_vec3()).collect();
    if !positions.iter().all(|p| p.is_finite()) {
        return Err(
            survey::locate_overflow(content, "v").unwrap_or_else(|| ObjError::whole("a vertex leaves single precision under to_world"))
        );
    }
    let uvs = (!raw.texcoords.is_empty()).then(|| texture_coordinates(&raw.texcoords, options.flip_tex_coords));
    if uvs.iter().flatten().any(|t| !t.is_finite()) {
        return Err(
            survey::locate_overflow(content, "vt").unwrap_or_else(|| ObjError::whole("a texture coordinate leaves single precision"))
        );
    }
    let normals = if keep_normals && !raw.normals.is_empty() { Some(given_normals(&raw.normals, options, content)?) } else { None };

    // ---- triangles ------------------------------------------------------------------------------------------------------------
    let all = raw.indices.as_chunks::<3>().0;
    let triangles: Vec<[u32; 3]> = all.iter().copied().filter(|t| has_area(t.map(|i| positions[i as usize]))).collect();
    let flat = all.len() - triangles.len();
    if triangles.is_empty() {
        return Err(ObjError::whole(format!("none of the file's {} triangles has an area", all.len())));
    }
    if flat > 0 {
        notes.push(format!("{flat} of {} triangles have no area and are left out", all.len()));
    }

    // ---- shading normals ------------------------------------------------------------------------------------------------------
    let normals = match normals {
        None if keep_normals => {
            let (computed, undefined) = normals::angle_weighted(&positions, &triangles);
            if undefined > 0 {
                notes.push(format!("{undefined} vertices have faces whose normals cancel; they take the normal of one face"));
            }
            Some(computed)
        }
        given => given,
    };
    let mesh = Mesh { positions, normals, uvs, triangles, flip_normals: options.flip_normals };
    check_lengths(&mesh)?;
    Ok(ObjMesh { mesh, notes })
}

fn parse(content: &[u8], survey: &Survey, keep_normals: bool) -> Result<tobj::Mesh, ObjError> {
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let mut statements = Statements::new(content, survey, keep_normals);
    // Materials never reach tobj, so that nothing is read beside the file.
    let no_materials = |_: &std::path::Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut statements, &options, no_materials)
        .map_err(|e| survey::locate(content).unwrap_or_else(|| ObjError::whole(format!("tobj cannot read the file: {e}"))))?;
    models.into_iter().map(|model| model.mesh).next().ok_or_else(|| ObjError::whole("the file has no faces"))
}

fn triples(values: &[f32]) -> impl Iterator<Item = DVec3> {
    values.as_chunks::<3>().0.iter().map(|v| Vec3::from_array(*v).as_dvec3())
}

fn texture_coordinates(values: &[f32], flip: bool) -> Vec<Vec2> {
    values.as_chunks::<2>().0.iter().map(|[u, v]| Vec2::new(*u, if flip { 1.0 - v } else { *v })).collect()
}

/// The file's normals in world space, unit length.
fn given_normals(values: &[f32], options: &ObjOptions, content: &[u8]) -> Result<Vec<Vec3>, ObjError> {
    let to_world = DMat3::from_mat4(options.to_world).inverse().transpose();
    let normals: Vec<Vec3> = triples(values).map(|n| (to_world * n).try_normalize().map_or(Vec3::NAN, DVec3::as_vec3)).collect();
    if normals.iter().all(|n| n.is_finite()) {
        return Ok(normals);
    }
    Err(survey::locate_zero_normal(content).unwrap_or_else(|| ObjError::whole("a normal has no length")))
}

/// Does a triangle have an area that single precision can tell from zero?
fn has_area([a, b, c]: [Vec3; 3]) -> bool {
    let single = (b - a).cross(c - a);
    let (e1, e2, e3) = ((b - a).as_dvec3(), (c - a).as_dvec3(), (c - b).as_dvec3());
    let longest2 = e1.length_squared().max(e2.length_squared()).max(e3.length_squared());
    // What double precision leaves of a cross product of parallel vectors.
    single.is_finite() && single != Vec3::ZERO && e1.cross(e2).length() > 1e-14 * longest2
}

/// tobj gives one attribute a vertex or none; anything else would shade with another vertex's.
fn check_lengths(mesh: &Mesh) -> Result<(), ObjError> {
    let count = mesh.positions.len();
    let even = mesh.normals.as_ref().is_none_or(|n| n.len() == count) && mesh.uvs.as_ref().is_none_or(|t| t.len() == count);
    if even { Ok(()) } else { Err(ObjError::whole("normals or texture coordinates do not belong to every vertex")) }
}

#[cfg(test)]
mod tests;
