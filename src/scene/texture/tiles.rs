//! Texels laid out so that neighbours share a cache line.

use crate::math::fetch;

/// Columns of a tile: twenty texels of three bytes fill a cache line.
const WIDTH: usize = 5;
/// Rows of a tile.
const HEIGHT: usize = 4;

#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Tile<T>([T; WIDTH * HEIGHT]);

/// An image in small tiles, row by row of tiles from the top.
///
/// A look-up reads four texels at an unpredictable place and waits for memory, not for arithmetic: in rows the four lie in two cache
/// lines or three, in tiles of bytes in one and a half on average.
#[derive(Debug)]
pub(super) struct Tiles<T> {
    tiles: Vec<Tile<T>>,
    /// Tiles in a row of tiles.
    across: usize,
}

impl<T: Copy> Tiles<T> {
    /// From the texels row by row from the top; `size` is not zero, and there are as many as it says.
    pub(super) fn new(size: [usize; 2], texels: &[T]) -> Self {
        let [width, height] = size;
        let (across, down) = (width.div_ceil(WIDTH), height.div_ceil(HEIGHT));
        // Tiles that reach beyond the image hold its first texel there, which is never asked for.
        let mut tiles = vec![Tile([texels[0]; WIDTH * HEIGHT]); across * down];
        for (y, row) in texels.chunks_exact(width).enumerate() {
            for (x, texel) in row.iter().enumerate() {
                tiles[y / HEIGHT * across + x / WIDTH].0[y % HEIGHT * WIDTH + x % WIDTH] = *texel;
            }
        }
        Self { tiles, across }
    }

    /// The texel in column `x` and row `y`, both within the image.
    #[inline(always)]
    pub(super) fn at(&self, x: usize, y: usize) -> T {
        self.tiles[y / HEIGHT * self.across + x / WIDTH].0[y % HEIGHT * WIDTH + x % WIDTH]
    }

    /// Fetches what [`Tiles::at`] will soon ask for at two opposite corners of a square: nearly always all four.
    #[inline(always)]
    pub(super) fn prefetch(&self, [x0, y0, x1, y1]: [usize; 4]) {
        let tile = |x: usize, y: usize| &self.tiles[y / HEIGHT * self.across + x / WIDTH];
        fetch(tile(x0, y0));
        fetch(tile(x1, y1));
    }

    /// Bytes held.
    pub(super) fn memory(&self) -> usize {
        size_of_val(self.tiles.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_texel_is_found_where_it_was_put() {
        for size in [[1, 1], [5, 4], [4, 5], [6, 9], [13, 1], [1, 13], [20, 16]] {
            let [width, height] = size;
            let texels: Vec<usize> = (0..width * height).collect();
            let tiles = Tiles::new(size, &texels);
            for y in 0..height {
                for x in 0..width {
                    assert_eq!(tiles.at(x, y), y * width + x, "{size:?}");
                }
            }
        }
        assert_eq!(size_of::<Tile<[u8; 3]>>(), 64);
    }
}
