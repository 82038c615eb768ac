//! Orthonormal frames: local directions have z along the normal.

use glam::Vec3;

/// A right-handed orthonormal basis `(s, t, n)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent.
    pub s: Vec3,
    /// Second tangent, `n x s`.
    pub t: Vec3,
    /// Normal.
    pub n: Vec3,
}

impl Frame {
    /// Any frame around a unit normal, continuous but at `n.z = 0` sign changes (Duff et al. 2017).
    #[inline(always)]
    pub fn from_normal(n: Vec3) -> Self {
        let sign = 1.0f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self { s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), t: Vec3::new(b, sign + n.y * n.y * a, -n.y), n }
    }

    /// The frame whose first tangent is `dp_du` made orthogonal to the unit normal; any frame where that degenerates.
    pub fn from_normal_and_tangent(n: Vec3, dp_du: Vec3) -> Self {
        let s = dp_du - n * n.dot(dp_du);
        let length2 = s.length_squared();
        if length2.is_normal() && length2 > 1e-12 * dp_du.length_squared() {
            let s = s / length2.sqrt();
            Self { s, t: n.cross(s), n }
        } else {
            Self::from_normal(n)
        }
    }

    /// World direction to local.
    #[inline(always)]
    pub fn to_local(&self, w: Vec3) -> Vec3 {
        Vec3::new(w.dot(self.s), w.dot(self.t), w.dot(self.n))
    }

    /// Local direction to world.
    #[inline(always)]
    pub fn to_world(&self, w: Vec3) -> Vec3 {
        self.s * w.x + self.t * w.y + self.n * w.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        for n in [Vec3::X, -Vec3::X, Vec3::Y, Vec3::Z, -Vec3::Z, Vec3::new(1.0, -2.0, 0.5).normalize()] {
            for f in [Frame::from_normal(n), Frame::from_normal_and_tangent(n, Vec3::new(0.3, 0.4, 2.0))] {
                assert!(f.s.cross(f.t).dot(f.n) > 1.0 - 1e-5);
                let w = Vec3::new(0.1, 0.7, -0.2);
                assert!(f.to_world(f.to_local(w)).distance(w) < 1e-6);
            }
        }
    }
}
