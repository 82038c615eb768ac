//! The global radius schedule.

/// Factor on the first iteration's radius: `(i+1)^((alpha-1)/2)`, `i = 0, 1, ...` the iteration's absolute index (\[KNAUS11\] in the
/// closed form of the interface; alpha in (0, 1], 1 keeps the radius constant). It depends on the index alone, so that iterations may
/// be rendered in any order.
pub fn shrink(i: u64, alpha: f64) -> f64 {
    ((i + 1) as f64).powf(0.5 * (alpha - 1.0))
}

#[cfg(test)]
mod tests {
    use super::shrink;

    #[test]
    fn squared_radii_follow_the_power_law() {
        assert_eq!(shrink(0, 0.75), 1.0);
        assert_eq!(shrink(99, 1.0), 1.0);
        let alpha = 2.0 / 3.0;
        for i in [0u64, 1, 5, 1000] {
            // Independent form: r^2 proportional to (i+1)^(alpha-1).
            let r2 = shrink(i, alpha).powi(2);
            assert!((r2.ln() - (alpha - 1.0) * ((i + 1) as f64).ln()).abs() < 1e-12);
        }
    }
}
