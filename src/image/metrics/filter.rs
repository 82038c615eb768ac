//! What filters along rows and columns share.

use std::ops::{AddAssign, Mul};

/// `out += weight * values`, for as many as there are in `out`.
pub(super) fn add_scaled<T: Copy + Mul<Output = T> + AddAssign>(out: &mut [T], values: &[T], weight: T) {
    for (out, value) in out.iter_mut().zip(values) {
        *out += weight * *value;
    }
}
