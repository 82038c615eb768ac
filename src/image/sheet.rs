//! Contact sheets: many pictures of one size in rows and columns.

use super::picture::Picture;
use crate::math::Rgb;

/// Widest and highest that a picture stands on a sheet, pixels.
const LARGEST: usize = 192;
/// Pixels between pictures.
const GAP: usize = 2;
/// Colour of gaps and of places without a picture, where 1 is white.
const EMPTY: Rgb = Rgb::splat(0.05);

/// Pictures by row and column, each made smaller by the same whole number where they are large, its pixels means of squares, and multiplied by `scale`.
///
/// # Panics
/// If the pictures are not of one size.
pub fn contact_sheet(pictures: &[([usize; 2], Picture)], scale: f32) -> Picture {
    let Some((_, first)) = pictures.first() else { return Picture::new(0, 0, Vec::new()) };
    let (width, height) = first.size();
    let side = width.max(height).div_ceil(LARGEST).max(1);
    let (across, down) = (width.div_ceil(side), height.div_ceil(side));
    let count = |axis: usize| pictures.iter().map(|(place, _)| place[axis] + 1).max().unwrap_or(0);
    let (columns, rows) = (count(1), count(0));
    let mut sheet = Picture::new(
        columns * (across + GAP) + GAP,
        rows * (down + GAP) + GAP,
        vec![EMPTY; (columns * (across + GAP) + GAP) * (rows * (down + GAP) + GAP)],
    );
    for ([row, column], picture) in pictures {
        assert_eq!(picture.size(), (width, height), "pictures of one size");
        let (left, top) = (GAP + column * (across + GAP), GAP + row * (down + GAP));
        for y in 0..down {
            for x in 0..across {
                let values = (y * side..height.min((y + 1) * side))
                    .flat_map(|py| picture.pixels[py * width + x * side..py * width + width.min((x + 1) * side)].iter());
                let n = (width.min((x + 1) * side) - x * side) * (height.min((y + 1) * side) - y * side);
                let place = (top + y) * sheet.width + left + x;
                sheet.pixels[place] = values.copied().sum::<Rgb>() * (scale / n as f32);
            }
        }
    }
    sheet
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_in_their_places() {
        let grey = |v: f32| Picture::new(3, 2, vec![Rgb::splat(v); 6]);
        let sheet = contact_sheet(&[([0, 0], grey(1.0)), ([1, 2], grey(2.0))], 0.25);
        assert_eq!(sheet.size(), (3 * 5 + 2, 2 * 4 + 2));
        let at = |x: usize, y: usize| sheet.pixels[y * sheet.width + x];
        assert_eq!([at(2, 2), at(4, 3), at(12, 6), at(14, 7)], [0.25, 0.25, 0.5, 0.5].map(Rgb::splat));
        assert_eq!([at(1, 2), at(5, 3), at(7, 2), at(11, 6), at(2, 6)], [EMPTY; 5]);
        assert_eq!(contact_sheet(&[], 1.0).size(), (0, 0));
    }

    #[test]
    fn large_pictures_become_means_of_squares() {
        // 385 wide: squares of three, the last column one pixel wide.
        let picture = Picture::new(385, 4, (0..385 * 4).map(|i| Rgb::splat((i % 385) as f32)).collect());
        let sheet = contact_sheet(&[([0, 0], picture)], 1.0);
        assert_eq!(sheet.size(), (129 + 4, 2 + 4));
        let at = |x: usize, y: usize| sheet.pixels[(y + 2) * sheet.width + x + 2].r();
        assert_eq!([at(0, 0), at(1, 1), at(127, 0), at(128, 1)], [1.0, 4.0, 382.0, 384.0]);
    }
}
