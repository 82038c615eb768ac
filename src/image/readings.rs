//! Numbers that camera-side samples read off where they came to something that has one, and their means: further images beside the film's.

/// Sums of what was read, and how often, by image and pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Readings {
    names: &'static [&'static str],
    /// An image's sums and counts, row-major from the top left.
    sums: Vec<Vec<[f64; 2]>>,
}

impl Readings {
    /// Nothing read yet in images of so many pixels each.
    pub fn new(names: &'static [&'static str], pixels: usize) -> Self {
        Self { names, sums: vec![vec![[0.0; 2]; pixels]; names.len()] }
    }

    /// Bytes that so many images of so many pixels take.
    pub fn bytes(images: usize, pixels: u64) -> u64 {
        images as u64 * pixels * size_of::<[f64; 2]>() as u64
    }

    /// Names in the file, in the order of the images' numbers.
    pub fn names(&self) -> &'static [&'static str] {
        self.names
    }

    /// Adds what a sample read.
    ///
    /// # Panics
    /// If there is no such image or pixel.
    pub fn add(&mut self, image: usize, pixel: usize, value: f64) {
        let [sum, count] = &mut self.sums[image][pixel];
        *sum += value;
        *count += 1.0;
    }

    /// An image's mean over the samples that read something; NaN where none did.
    ///
    /// # Panics
    /// If there is no such image.
    pub fn mean(&self, image: usize) -> Vec<f32> {
        self.sums[image].iter().map(|[sum, count]| (sum / count) as f32).collect()
    }

    /// Adds another's; `false` if they are not of the same images, and then nothing is added.
    pub(super) fn merge(&mut self, other: &Readings) -> bool {
        if self.names != other.names || self.sums.iter().map(Vec::len).ne(other.sums.iter().map(Vec::len)) {
            return false;
        }
        for (left, right) in self.sums.iter_mut().flatten().zip(other.sums.iter().flatten()) {
            left.iter_mut().zip(right).for_each(|(left, right)| *left += right);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_over_the_samples_that_read_something() {
        let mut one = Readings::new(&["a", "b"], 3);
        one.add(0, 1, 2.0);
        let mut two = one.clone();
        two.add(0, 1, 5.0);
        two.add(1, 2, 7.0);
        assert!(one.merge(&two));
        assert_eq!(one.mean(0)[1], 3.0);
        assert_eq!(one.mean(1)[2], 7.0);
        assert!(one.mean(0)[0].is_nan() && one.mean(1)[1].is_nan());
        let before = one.clone();
        assert!(!one.merge(&Readings::new(&["a"], 3)) && !one.merge(&Readings::new(&["a", "b"], 2)));
        assert_eq!(one.mean(0)[1], before.mean(0)[1]);
        assert_eq!(Readings::bytes(2, 3), 96);
    }
}
