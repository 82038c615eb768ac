//! Many tests at once.

/// Level of one of `tests` independent tests so that the family keeps `family` (\[SIDAK67\]).
pub fn sidak(family: f64, tests: usize) -> f64 {
    -((-family).ln_1p() / tests.max(1) as f64).exp_m1()
}

/// Which of the tests with these p-values are rejected so that the expected share of false rejections among all rejections is at most
/// `level` (\[BENJAMINI95\]); for independent tests, and for tests whose statistics depend on each other positively.
///
/// In the order of `p`. What is no probability (NaN, below 0, above 1) is never rejected and still counts as one of the tests; with a
/// `level` outside (0, 1) nothing is rejected.
pub fn benjamini_hochberg(p: &[f64], level: f64) -> Vec<bool> {
    let mut order: Vec<usize> = (0..p.len()).filter(|&i| (0.0..=1.0).contains(&p[i])).collect();
    order.sort_by(|&i, &j| p[i].total_cmp(&p[j]));
    let below = |rank: usize| p[order[rank]] <= level * (rank + 1) as f64 / p.len() as f64;
    let rejected = if level > 0.0 && level < 1.0 { (0..order.len()).rev().find(|&rank| below(rank)).map_or(0, |rank| rank + 1) } else { 0 };
    let mut decided = vec![false; p.len()];
    for &i in &order[..rejected] {
        decided[i] = true;
    }
    decided
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sidak_keeps_the_family() {
        for n in [1, 10, 1000] {
            assert!((1.0 - (1.0 - sidak(0.01, n)).powi(n as i32) - 0.01).abs() < 1e-12);
        }
    }

    /// The example of \[BENJAMINI95\] 4.1: fifteen p-values; Bonferroni rejects three of them, the step-up rule four.
    #[test]
    fn benjamini_hochberg_rejects_as_in_the_paper() {
        let p = [0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240, 0.4262, 0.5719, 0.6528, 0.7590, 1.0000];
        let mut turned: Vec<f64> = p.iter().rev().copied().collect();
        assert_eq!(benjamini_hochberg(&p, 0.05).iter().filter(|r| **r).count(), 4);
        assert_eq!(benjamini_hochberg(&turned, 0.05)[11..], [true; 4]);
        // A rank further down lifts those before it, even one that misses its own line.
        assert_eq!(benjamini_hochberg(&[0.03, 0.04, 0.045], 0.05), [true; 3]);
        // What is no p-value is not rejected, and makes the others' lines no easier.
        turned[11] = f64::NAN;
        assert_eq!(benjamini_hochberg(&turned, 0.05).iter().filter(|r| **r).count(), 3);
        assert_eq!(benjamini_hochberg(&[f64::NAN, -1.0, 2.0, 0.02], 0.05), [false; 4]);
        assert_eq!(benjamini_hochberg(&[], 0.05), Vec::<bool>::new());
        assert_eq!(benjamini_hochberg(&[0.0], f64::NAN), [false]);
    }
}
