//! Wavefront OBJ files, through tobj.
