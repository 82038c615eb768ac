//! What a file holds, and where it is wrong, before tobj reads it.

use super::ObjError;
use std::io::{self, BufRead, Read};

/// Statements that change nothing in the image: names, groups, materials (a shape has its own), display hints.
const IGNORED: &[&str] =
    &["o", "g", "s", "mg", "usemtl", "mtllib", "usemap", "maplib", "bevel", "c_interp", "d_interp", "lod", "shadow_obj", "trace_obj", "vp"];

/// Curves and surfaces, which are no triangles.
const FREE_FORM: &[&str] =
    &["cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "parm", "trim", "hole", "scrv", "sp", "end", "con", "call", "csh"];

/// A file's statements, line by line: `(line number, keyword, rest)`, remarks and blank lines left out.
fn statements(content: &[u8]) -> impl Iterator<Item = (u32, &[u8], &[u8])> {
    content.split(|byte| *byte == b'\n').zip(1u32..).filter_map(|(line, number)| {
        let line = line.split(|byte| *byte == b'#').next().unwrap_or_default().trim_ascii();
        if line.is_empty() {
            return None;
        }
        let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
        Some((number, &line[..end], &line[end..]))
    })
}

fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

fn shown(word: &[u8]) -> String {
    String::from_utf8_lossy(&word[..word.len().min(40)]).into_owned()
}

/// How many of what a file holds.
#[derive(Debug, Default)]
pub(super) struct Survey {
    positions: usize,
    texcoords: usize,
    normals: usize,
    faces: usize,
    corners: usize,
    /// Corners of faces that name a texture coordinate, and a normal.
    with_texcoord: usize,
    with_normal: usize,
    /// First face with a corner that names no normal.
    first_without_normal: Option<u32>,
    /// Lines and points.
    not_surfaces: usize,
}

impl Survey {
    /// Checks every statement; an error names the first line that is wrong.
    pub(super) fn of(content: &[u8], keep_normals: bool) -> Result<Self, ObjError> {
        let mut survey = Survey::default();
        // Largest positive index of each kind; only then is a second look at the file needed.
        let mut largest = [0usize; 3];
        for (line, keyword, rest) in statements(content) {
            match keyword {
                b"v" => {
                    check_numbers(line, "v", rest, 3)?;
                    check_weight(line, rest)?;
                    survey.positions += 1;
                }
                b"vt" => {
                    check_numbers(line, "vt", rest, 2)?;
                    survey.texcoords += 1;
                }
                b"vn" => {
                    check_numbers(line, "vn", rest, 3)?;
                    survey.normals += 1;
                }
                b"f" => survey.face(line, rest, &mut largest)?,
                b"l" | b"p" => survey.not_surfaces += 1,
                _ => check_keyword(line, keyword)?,
            }
        }
        survey.check_indices(content, largest)?;
        if survey.faces == 0 {
            return Err(ObjError::whole("the file has no faces").help("an OBJ file needs v and f statements"));
        }
        let mixed = survey.with_normal > 0 && survey.with_normal < survey.corners;
        if let (true, true, Some(line)) = (keep_normals, mixed, survey.first_without_normal) {
            let message = format!("this face names no normals, but {} of {} corners in the file do", survey.with_normal, survey.corners);
            return Err(ObjError::at(line, message).help("give every face normals or none, or set face_normals to true"));
        }
        Ok(survey)
    }

    /// Some corners name a texture coordinate and some do not.
    fn mixed_texcoords(&self) -> bool {
        self.with_texcoord > 0 && self.with_texcoord < self.corners
    }

    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.mixed_texcoords() {
            let without = self.corners - self.with_texcoord;
            notes.push(format!("{without} of {} corners have no texture coordinates and get (0, 0)", self.corners));
        }
        if self.not_surfaces > 0 {
            notes.push(format!("{} lines and points are left out", self.not_surfaces));
        }
        notes
    }

    fn face(&mut self, line: u32, rest: &[u8], largest: &mut [usize; 3]) -> Result<(), ObjError> {
        let counts = [self.positions, self.texcoords, self.normals];
        let mut corners = 0;
        for word in words(rest) {
            let corner = corner(line, word, counts)?;
            for (largest, index) in largest.iter_mut().zip(corner) {
                *largest = (*largest).max(index.unwrap_or(0));
            }
            self.with_texcoord += usize::from(corner[1].is_some());
            self.with_normal += usize::from(corner[2].is_some());
            if corner[2].is_none() && self.first_without_normal.is_none() {
                self.first_without_normal = Some(line);
            }
            corners += 1;
        }
        if corners < 3 {
            return Err(ObjError::at(line, format!("a face with {corners} corners")).help("a face has at least three"));
        }
        self.faces += 1;
        self.corners += corners;
        Ok(())
    }

    /// Indices may run ahead of the statements they name, so they are compared with the totals at the end.
    fn check_indices(&self, content: &[u8], largest: [usize; 3]) -> Result<(), ObjError> {
        let counts = [self.positions, self.texcoords, self.normals];
        let Some(kind) = (0..3).find(|kind| largest[*kind] > counts[*kind]) else { return Ok(()) };
        let what = ["vertex", "texture coordinate", "normal"][kind];
        let count = counts[kind];
        let named = |word: &[u8]| corner(0, word, [usize::MAX; 3]).ok().and_then(|c| c[kind]);
        let outside = |(line, keyword, rest): (u32, &[u8], &[u8])| {
            // Relative indices were checked when they were read.
            let word = words(rest).find(|word| !word.contains(&b'-') && named(word).is_some_and(|index| index > count))?;
            (keyword == b"f").then_some((line, named(word)?))
        };
        match statements(content).find_map(outside) {
            Some((line, index)) => Err(ObjError::at(line, format!("a face names {what} {index}, but the file has {count}"))),
            None => Err(ObjError::whole(format!("a face names {what} {}, but the file has {count}", largest[kind]))),
        }
    }
}

/// A corner's indices, from 1, relative ones resolved; `counts` statements came before.
fn corner(line: u32, word: &[u8], counts: [usize; 3]) -> Result<[Option<usize>; 3], ObjError> {
    let wrong = |why: &str| {
        ObjError::at(line, format!("\"{}\" is no corner of a face: {why}", shown(word))).help("write v, v/vt, v//vn or v/vt/vn")
    };
    let mut indices = [None; 3];
    for (kind, part) in word.split(|byte| *byte == b'/').enumerate() {
        if kind > 2 {
            return Err(wrong("more than three indices"));
        }
        if part.is_empty() {
            continue;
        }
        let index: i64 = std::str::from_utf8(part).ok().and_then(|t| t.parse().ok()).ok_or_else(|| wrong("not an integer"))?;
        indices[kind] = Some(match index {
            0 => return Err(wrong("indices start at 1")),
            // tobj reads into machine words and adds; what it is given must not overflow.
            1..=0xffff_ffff => index as usize,
            -0xffff_ffff..0 if index.unsigned_abs() <= counts[kind] as u64 => counts[kind] - index.unsigned_abs() as usize + 1,
            _ if index < 0 => return Err(wrong("a relative index before the first statement")),
            _ => return Err(wrong("an index beyond any file")),
        });
    }
    if indices[0].is_none() {
        return Err(wrong("no vertex"));
    }
    Ok(indices)
}

/// At least so many numbers, all finite; what may follow is not looked at beyond its letters.
fn check_numbers(line: u32, keyword: &str, rest: &[u8], least: usize) -> Result<(), ObjError> {
    let plain = |byte: &u8| byte.is_ascii_digit() || byte.is_ascii_whitespace() || b"+-.eE".contains(byte);
    let count = words(rest).count();
    if rest.iter().all(plain) && count >= least {
        return Ok(());
    }
    check_each_number(line, keyword, rest, least)
}

/// The slow check: every number is parsed.
fn check_each_number(line: u32, keyword: &str, rest: &[u8], least: usize) -> Result<(), ObjError> {
    let mut count = 0;
    for word in words(rest).take(least) {
        let value: Option<f32> = std::str::from_utf8(word).ok().and_then(|t| t.parse().ok());
        match value {
            Some(value) if value.is_finite() => count += 1,
            Some(_) => return Err(ObjError::at(line, format!("{keyword} has the value {}, which is not finite", shown(word)))),
            None => return Err(ObjError::at(line, format!("\"{}\" of {keyword} is not a number", shown(word)))),
        }
    }
    if count < least { Err(ObjError::at(line, format!("{keyword} has {count} numbers, {least} are needed"))) } else { Ok(()) }
}

/// A vertex may carry a weight or a colour after its three coordinates; a weight other than 1 would move it.
fn check_weight(line: u32, rest: &[u8]) -> Result<(), ObjError> {
    let mut more = words(rest).skip(3);
    let (fourth, fifth) = (more.next(), more.next());
    let (Some(fourth), None) = (fourth, fifth) else { return Ok(()) };
    let weight: Option<f32> = std::str::from_utf8(fourth).ok().and_then(|t| t.parse().ok());
    if weight == Some(1.0) {
        return Ok(());
    }
    Err(ObjError::at(line, format!("a vertex of weight {}", shown(fourth))).help("rational vertices are not supported: write x y z"))
}

fn check_keyword(line: u32, keyword: &[u8]) -> Result<(), ObjError> {
    let name = shown(keyword);
    if IGNORED.contains(&name.as_str()) {
        return Ok(());
    }
    let error = ObjError::at(line, format!("\"{name}\" is not a statement of an OBJ file"));
    if FREE_FORM.contains(&name.as_str()) {
        return Err(ObjError::at(line, format!("\"{name}\": curves and free-form surfaces are not supported"))
            .help("convert the model to polygons"));
    }
    Err(error.help("v, vt, vn and f are read; names, groups, materials and smoothing groups are left out"))
}

// ---- the line of what a later step found -----------------------------------------------------------------------------------------

fn numbers_needed(keyword: &[u8]) -> Option<(&'static str, usize)> {
    match keyword {
        b"v" => Some(("v", 3)),
        b"vt" => Some(("vt", 2)),
        b"vn" => Some(("vn", 3)),
        _ => None,
    }
}

/// The first statement whose numbers cannot be read.
pub(super) fn locate(content: &[u8]) -> Option<ObjError> {
    statements(content).find_map(|(line, keyword, rest)| {
        let (name, least) = numbers_needed(keyword)?;
        check_each_number(line, name, rest, least).err()
    })
}

/// The first statement of this keyword whose numbers overflow.
pub(super) fn locate_overflow(content: &[u8], wanted: &str) -> Option<ObjError> {
    statements(content).filter(|(_, keyword, _)| *keyword == wanted.as_bytes()).find_map(|(line, keyword, rest)| {
        let (name, least) = numbers_needed(keyword)?;
        check_each_number(line, name, rest, least).err()
    })
}

/// The first normal without length.
pub(super) fn locate_zero_normal(content: &[u8]) -> Option<ObjError> {
    statements(content).filter(|(_, keyword, _)| *keyword == b"vn").find_map(|(line, _, rest)| {
        let zero = words(rest).take(3).all(|w| std::str::from_utf8(w).ok().and_then(|t| t.parse::<f64>().ok()) == Some(0.0));
        if zero { Some(ObjError::at(line, "a normal without length")) } else { check_each_number(line, "vn", rest, 3).err() }
    })
}

// ---- what tobj gets to read ------------------------------------------------------------------------------------------------------

/// The statements that make triangles, as a stream of lines.
pub(super) struct Statements<'a> {
    source: Box<dyn Iterator<Item = (u32, &'a [u8], &'a [u8])> + 'a>,
    keep_normals: bool,
    /// Texture coordinate that corners without one get, if only some have one: tobj would shift the others'.
    stand_in: Option<usize>,
    stand_in_written: bool,
    line: Vec<u8>,
    read: usize,
}

impl<'a> Statements<'a> {
    pub(super) fn new(content: &'a [u8], survey: &Survey, keep_normals: bool) -> Self {
        let stand_in = survey.mixed_texcoords().then_some(survey.texcoords + 1);
        Self { source: Box::new(statements(content)), keep_normals, stand_in, stand_in_written: false, line: Vec::new(), read: 0 }
    }

    /// Writes the next statement to `line`; `false` at the end.
    fn next_line(&mut self) -> bool {
        self.line.clear();
        self.read = 0;
        for (_, keyword, rest) in self.source.by_ref() {
            match keyword {
                b"v" => write_words(&mut self.line, keyword, words(rest).take(3)),
                b"vt" => write_words(&mut self.line, keyword, words(rest).take(2)),
                b"vn" if self.keep_normals => write_words(&mut self.line, keyword, words(rest).take(3)),
                b"f" => match self.stand_in {
                    None => write_words(&mut self.line, keyword, words(rest)),
                    Some(stand_in) => write_face(&mut self.line, rest, stand_in),
                },
                _ => continue,
            }
            return true;
        }
        // At the very end, so that it moves no relative index.
        if self.stand_in.is_some() && !self.stand_in_written {
            self.stand_in_written = true;
            self.line.extend_from_slice(b"vt 0 0\n");
            return true;
        }
        false
    }
}

fn write_words<'w>(line: &mut Vec<u8>, keyword: &[u8], words: impl Iterator<Item = &'w [u8]>) {
    line.extend_from_slice(keyword);
    for word in words {
        line.push(b' ');
        line.extend_from_slice(word);
    }
    line.push(b'\n');
}

fn write_face(line: &mut Vec<u8>, rest: &[u8], stand_in: usize) {
    line.push(b'f');
    for word in words(rest) {
        let mut parts = word.split(|byte| *byte == b'/');
        let (v, vt, vn) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
        line.push(b' ');
        line.extend_from_slice(v);
        line.push(b'/');
        if vt.is_empty() {
            line.extend_from_slice(stand_in.to_string().as_bytes());
        } else {
            line.extend_from_slice(vt);
        }
        if !vn.is_empty() {
            line.push(b'/');
            line.extend_from_slice(vn);
        }
    }
    line.push(b'\n');
}

impl Read for Statements<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let available = self.fill_buf()?;
        let count = available.len().min(out.len());
        out[..count].copy_from_slice(&available[..count]);
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for Statements<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.read >= self.line.len() && !self.next_line() {
            return Ok(&[]);
        }
        Ok(&self.line[self.read..])
    }

    fn consume(&mut self, count: usize) {
        self.read += count;
    }
}
