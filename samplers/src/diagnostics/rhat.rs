//! Convergence of several chains to one law.

use statrs::distribution::{ContinuousCDF, Normal};

/// Rank-normalised split R-hat [VEHTARI21 4], the larger of the bulk statistic and that of the distances from the median. Above 1.01 the
/// chains do not agree. `None` if fewer than two chains have four points, or if all points are equal.
pub(crate) fn r_hat(chains: &[Vec<f32>]) -> Option<f64> {
    let length = chains.iter().map(Vec::len).filter(|n| *n >= 4).min()? / 2;
    let halves: Vec<Vec<f64>> = chains
        .iter()
        .filter(|chain| chain.len() >= 4)
        .flat_map(|chain| [&chain[..length], &chain[chain.len() - length..]])
        .map(|half| half.iter().map(|x| f64::from(*x)).collect())
        .collect();
    if halves.len() < 4 {
        return None;
    }
    let mut sorted: Vec<f64> = halves.iter().flatten().copied().collect();
    sorted.sort_by(f64::total_cmp);
    let median = (sorted[sorted.len() / 2] + sorted[(sorted.len() - 1) / 2]) / 2.0;
    let folded: Vec<Vec<f64>> = halves.iter().map(|half| half.iter().map(|x| (x - median).abs()).collect()).collect();
    [normal_scores(&halves), normal_scores(&folded)].iter().filter_map(|z| potential_scale_reduction(z)).reduce(f64::max)
}

/// Every point replaced by the normal quantile of its rank among all, ties sharing their mean rank [VEHTARI21 (14)] with Blom's offsets.
fn normal_scores(halves: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut order: Vec<(f64, usize, usize)> =
        halves.iter().enumerate().flat_map(|(i, half)| half.iter().enumerate().map(move |(j, x)| (*x, i, j))).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let normal = Normal::standard();
    let count = order.len() as f64;
    let mut scores: Vec<Vec<f64>> = halves.iter().map(|half| vec![0.0; half.len()]).collect();
    let mut first = 0;
    for ties in order.chunk_by(|a, b| a.0 == b.0) {
        let rank = first as f64 + (ties.len() as f64 + 1.0) / 2.0;
        let score = normal.inverse_cdf((rank - 0.375) / (count + 0.25));
        for (_, i, j) in ties {
            scores[*i][*j] = score;
        }
        first += ties.len();
    }
    scores
}

/// `sqrt(((n-1)/n W + B/n) / W)` of chains of equal length n [VEHTARI21 (1)-(4)].
fn potential_scale_reduction(chains: &[Vec<f64>]) -> Option<f64> {
    let n = chains.first()?.len() as f64;
    let m = chains.len() as f64;
    let means: Vec<f64> = chains.iter().map(|chain| chain.iter().sum::<f64>() / n).collect();
    let mean = means.iter().sum::<f64>() / m;
    let between = means.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (m - 1.0);
    let within = |(chain, mean): (&Vec<f64>, &f64)| chain.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let within = chains.iter().zip(&means).map(within).sum::<f64>() / m;
    (within > 0.0).then(|| ((n - 1.0) / n + between / within).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{Key, Purpose, Stream};

    fn chains(shift: f32, scale: f32) -> Vec<Vec<f32>> {
        let chain = |index: u64| {
            let mut stream = Key { seed: 5, iteration: 0, index, purpose: Purpose::Test }.stream();
            let (shift, scale) = if index == 0 { (shift, scale) } else { (0.0, 1.0) };
            (0..512).map(|_| shift + scale * (stream.next_1d() + stream.next_1d() - 1.0)).collect()
        };
        (0..16).map(chain).collect()
    }

    #[test]
    fn equal_chains_agree_and_a_shifted_or_wider_one_is_seen() {
        assert!(r_hat(&chains(0.0, 1.0)).unwrap() < 1.01);
        assert!(r_hat(&chains(0.5, 1.0)).unwrap() > 1.03);
        assert!(r_hat(&chains(0.0, 6.0)).unwrap() > 1.02);
    }

    #[test]
    fn a_drift_within_all_chains_is_seen() {
        let mut drifting = chains(0.0, 1.0);
        for chain in &mut drifting {
            for (i, x) in chain.iter_mut().enumerate() {
                *x += i as f32 / 512.0;
            }
        }
        assert!(r_hat(&drifting).unwrap() > 1.1);
    }

    /// Two chains of four points without ties: halves have ranks {1,5}, {2,6}, {3,7}, {4,8} of 8.
    #[test]
    fn the_bulk_statistic_by_hand() {
        let halves = [vec![1.0, 5.0], vec![2.0, 6.0], vec![3.0, 7.0], vec![4.0, 8.0]];
        let normal = Normal::standard();
        let z = |rank: f64| normal.inverse_cdf((rank - 0.375) / 8.25);
        let scores = normal_scores(&halves);
        assert!((scores[2][1] - z(7.0)).abs() < 1e-15);
        let means = [1.0, 2.0, 3.0, 4.0].map(|r| (z(r) + z(r + 4.0)) / 2.0);
        let within = [1.0, 2.0, 3.0, 4.0].map(|r| (z(r) - z(r + 4.0)).powi(2) / 2.0).iter().sum::<f64>() / 4.0;
        let mean = means.iter().sum::<f64>() / 4.0;
        let between = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / 3.0;
        assert!((potential_scale_reduction(&scores).unwrap() - (0.5 + between / within).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn too_little_to_compare_is_none() {
        assert_eq!(r_hat(&[]), None);
        assert_eq!(r_hat(&[vec![1.0; 3], vec![2.0; 3]]), None);
        assert_eq!(r_hat(&[vec![1.0; 8], vec![1.0; 8]]), None);
    }
}
