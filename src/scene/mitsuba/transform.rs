//! The operations of a `transform`, in double precision, applied in the order written.

use super::error::{Position, Result, SceneError};
use super::number;
use glam::{DMat3, DMat4, DVec3};

/// An attribute's text and place.
pub(super) struct Attribute<'a> {
    pub(super) name: &'a str,
    pub(super) value: String,
    pub(super) position: Position,
}

/// Operations that may stand in a `transform`, with the attributes they take.
pub(super) const OPERATIONS: [(&str, &[&str]); 5] = [
    ("translate", &["value", "x", "y", "z"]),
    ("scale", &["value", "x", "y", "z"]),
    ("rotate", &["value", "x", "y", "z", "angle"]),
    ("lookat", &["origin", "target", "up"]),
    ("matrix", &["value"]),
];

/// The matrix of one operation; what has to be remarked about it goes to `note`.
pub(super) fn operation(
    element: &str,
    at: &Position,
    attributes: &[Attribute<'_>],
    note: &mut dyn FnMut(&Position, String),
) -> Result<DMat4> {
    let find = |name: &str| attributes.iter().find(|a| a.name == name);
    let need = |name: &str| find(name).ok_or_else(|| SceneError::new(at, format!("<{element}> needs the attribute \"{name}\"")));
    let scalar = |a: &Attribute<'_>| {
        number::number(&a.value).map_err(|why| SceneError::new(&a.position, format!("{} of <{element}>: {why}", a.name)))
    };
    let triple = |a: &Attribute<'_>| {
        let read = number::triple(&a.value).map_err(|why| SceneError::new(&a.position, format!("{} of <{element}>: {why}", a.name)))?;
        Ok::<_, SceneError>(DVec3::from_array(read))
    };
    // x, y and z, or one "value" with one or three numbers
    let components = |default: f64| -> Result<DVec3> {
        let separate: Vec<_> = ["x", "y", "z"].into_iter().map(find).collect();
        if let Some(all) = find("value") {
            if separate.iter().any(Option::is_some) {
                return Err(
                    SceneError::new(&all.position, format!("<{element}> has both \"value\" and x, y, z")).help("give one of the two")
                );
            }
            let read =
                number::one_or_three(&all.value).map_err(|why| SceneError::new(&all.position, format!("value of <{element}>: {why}")))?;
            return Ok(DVec3::from_array(read));
        }
        let mut v = DVec3::splat(default);
        for (axis, attribute) in separate.into_iter().enumerate() {
            if let Some(attribute) = attribute {
                v[axis] = scalar(attribute)?;
            }
        }
        Ok(v)
    };

    match element {
        "translate" => Ok(DMat4::from_translation(components(0.0)?)),
        "scale" => Ok(DMat4::from_scale(components(1.0)?)),
        "rotate" => {
            let axis = components(0.0)?;
            let angle = scalar(need("angle")?)?;
            if axis == DVec3::ZERO {
                return Err(SceneError::new(at, "<rotate> has no axis").help("give x, y and z of a unit vector"));
            }
            if (axis.length() - 1.0).abs() > 1e-3 {
                let unit = axis.normalize();
                note(
                    at,
                    format!(
                        "<rotate> about an axis of length {:.4}: like Mitsuba 3, this scales and shears; the unit axis is ({:.6}, {:.6}, {:.6})",
                        axis.length(),
                        unit.x,
                        unit.y,
                        unit.z
                    ),
                );
            }
            Ok(rotate(axis, angle.to_radians()))
        }
        "lookat" => {
            let (origin, target) = (triple(need("origin")?)?, triple(need("target")?)?);
            let up = find("up").map(&triple).transpose()?.unwrap_or(DVec3::ZERO);
            look_at(origin, target, up).ok_or_else(|| {
                SceneError::new(at, "<lookat> is degenerate")
                    .help("origin and target must differ, and \"up\" must not point along the line between them")
            })
        }
        _ => {
            let value = need("value")?;
            matrix(value)
        }
    }
}

/// Mitsuba does not normalise the axis; with a unit axis this is Rodrigues' rotation.
fn rotate(axis: DVec3, angle: f64) -> DMat4 {
    let (s, c) = angle.sin_cos();
    let (x, y, z) = (axis.x, axis.y, axis.z);
    let cross = DMat3::from_cols(DVec3::new(0.0, z, -y), DVec3::new(-z, 0.0, x), DVec3::new(y, -x, 0.0));
    let outer = DMat3::from_cols(axis * x, axis * y, axis * z);
    DMat4::from_mat3(DMat3::from_diagonal(DVec3::splat(c)) + cross * s + outer * (1.0 - c))
}

/// Columns left, up, direction, origin; `None` where they are not defined.
fn look_at(origin: DVec3, target: DVec3, up: DVec3) -> Option<DMat4> {
    let direction = (target - origin).try_normalize()?;
    // A missing "up" becomes any vector across the direction, by the rule Mitsuba's coordinate_system follows ([DUFF17]).
    let up = if up == DVec3::ZERO { any_tangent(direction) } else { up };
    let left = up.cross(direction);
    // Relative to up, this is the sine between the two: nothing but rounding is left below this.
    if left.length() <= 1e-12 * up.length() {
        return None;
    }
    let left = left.normalize();
    let new_up = direction.cross(left);
    Some(DMat4::from_cols(left.extend(0.0), new_up.extend(0.0), direction.extend(0.0), origin.extend(1.0)))
}

fn any_tangent(n: DVec3) -> DVec3 {
    let sign = 1.0_f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    DVec3::new(1.0 + sign * n.x * n.x * a, sign * n.x * n.y * a, -sign * n.x)
}

/// Rows of 3 x 3 or 4 x 4 numbers; the last row of four must be 0 0 0 1.
fn matrix(value: &Attribute<'_>) -> Result<DMat4> {
    let fail = |why: String| SceneError::new(&value.position, format!("value of <matrix>: {why}"));
    let m = number::numbers(&value.value, 16).map_err(fail)?;
    match m.len() {
        9 => Ok(DMat4::from_mat3(DMat3::from_cols_slice(&m).transpose())),
        16 => {
            if m[12..] != [0.0, 0.0, 0.0, 1.0] {
                return Err(fail("the last row is not 0 0 0 1".to_owned()).help("only affine transforms are supported"));
            }
            Ok(DMat4::from_cols_slice(&m).transpose())
        }
        n => Err(fail(format!("{n} numbers, 9 or 16 expected"))),
    }
}

/// Is the linear part so flat that it has no inverse worth the name in single precision?
pub(super) fn singular(m: &DMat4) -> bool {
    let linear = DMat3::from_mat4(*m);
    let (x, y, z) = (linear.x_axis.length(), linear.y_axis.length(), linear.z_axis.length());
    // Relative to the box the three columns would span if they were orthogonal.
    let volume = linear.determinant().abs();
    !(volume.is_finite() && volume > 1e-12 * x * y * z && volume > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotation_about_a_unit_axis_is_a_rotation() {
        let m = rotate(DVec3::new(0.6, 0.0, 0.8), 0.7);
        let expected = DMat4::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7);
        assert!(m.abs_diff_eq(expected, 1e-12), "{m} {expected}");
    }

    #[test]
    fn look_at_without_up_follows_mitsuba() {
        // Measured with Mitsuba 3.9.1: from the origin along +z the columns are (0, -1, 0), (1, 0, 0), (0, 0, 1).
        let m = look_at(DVec3::ZERO, DVec3::Z, DVec3::ZERO).unwrap();
        assert!(m.x_axis.truncate().abs_diff_eq(-DVec3::Y, 1e-12) && m.y_axis.truncate().abs_diff_eq(DVec3::X, 1e-12), "{m}");
        assert!(look_at(DVec3::ZERO, DVec3::Y, DVec3::Y).is_none() && look_at(DVec3::ONE, DVec3::ONE, DVec3::Y).is_none());
    }

    #[test]
    fn flat_transforms_are_singular() {
        assert!(singular(&DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0))));
        assert!(!singular(&DMat4::from_scale(DVec3::new(1e-6, 1e3, 1.0))));
    }
}
