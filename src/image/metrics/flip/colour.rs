//! Colour spaces of FLIP, and the display that its HDR variant assumes.

use crate::math::Rgb;
use glam::DMat3;

/// Linear sRGB to XYZ over the white point's; rows sum to one. Numerators of the primaries' matrix that FLIP is defined with.
const TO_XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 23_359_437.0, 8_788_810.0 / 23_359_437.0, 4_435_075.0 / 23_359_437.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 80_288_307.0, 8_788_810.0 / 80_288_307.0, 70_074_185.0 / 80_288_307.0],
];

/// ACES filmic curve \[NARKOWICZ15\] with the exposure of 0.6 in it that the fit expects: (a x^2 + b x) / (c x^2 + d x + e).
const ACES: [f64; 5] = [0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14];

/// Exposed values from which the curve is above 1, by far; squares of larger ones might overflow.
const SATURATED: f64 = 1e3;

/// The display's value, in `[0, 1]`, of a linear one; negative is black.
pub(super) fn aces(value: f32, gain: f64) -> f32 {
    const CURVE: [f32; 5] = [ACES[0] as f32, ACES[1] as f32, ACES[2] as f32, ACES[3] as f32, ACES[4] as f32];
    let [a, b, c, d, e] = CURVE;
    let x = (f64::from(value.max(0.0)) * gain).min(SATURATED) as f32;
    ((a * x + b) * x / ((c * x + d) * x + e)).min(1.0)
}

/// The exposed value that the display shows as `target`, in (0, 1).
pub(super) fn aces_inverse(target: f64) -> f64 {
    let [a, b, c, d, e] = ACES;
    let (square, linear, constant) = (a - target * c, b - target * d, -target * e);
    let half = -0.5 * linear / square;
    half + (half * half - constant / square).sqrt()
}

/// Luminance, negative components taken as black.
pub(super) fn luminance(pixel: Rgb) -> f64 {
    let [r, g, b] = pixel.at_least(0.0).to_array().map(f64::from);
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

const fn row(i: usize) -> [f32; 3] {
    [TO_XYZ[i][0] as f32, TO_XYZ[i][1] as f32, TO_XYZ[i][2] as f32]
}

/// XYZ over the white point's.
fn xyz(linear: Rgb) -> [f32; 3] {
    const ROWS: [[f32; 3]; 3] = [row(0), row(1), row(2)];
    ROWS.map(|[r, g, b]| r * linear.r() + g * linear.g() + b * linear.b())
}

/// Luma, red-green and blue-yellow: Y'CxCz of \[ANDERSSON20\] but for factors and offsets, which commute with normalised filters:
/// Y, X - Y, Y - Z.
pub(super) fn opponent(linear: Rgb) -> [f32; 3] {
    let [x, y, z] = xyz(linear);
    [y, x - y, y - z]
}

/// Back from [`opponent`].
pub(super) struct FromOpponent([[f32; 3]; 3]);

impl FromOpponent {
    pub(super) fn new() -> Self {
        let inverse = DMat3::from_cols_array_2d(&TO_XYZ).transpose().inverse();
        Self([0, 1, 2].map(|i| inverse.row(i).as_vec3().to_array()))
    }

    /// Linear sRGB.
    pub(super) fn linear(&self, [luma, red_green, blue_yellow]: [f32; 3]) -> Rgb {
        let (x, y, z) = (luma + red_green, luma, luma - blue_yellow);
        Rgb::from(self.0.map(|[a, b, c]| a * x + b * y + c * z))
    }
}

/// CIELAB whose chroma is scaled by lightness (Hunt effect, \[ANDERSSON20\]).
#[derive(Clone, Copy)]
pub(super) struct Lab {
    lightness: f32,
    a: f32,
    b: f32,
}

impl Lab {
    /// Of a linear colour in `[0, 1]`.
    pub(super) fn of_linear(linear: Rgb) -> Self {
        const DELTA: f32 = 6.0 / 29.0;
        let curve = |t: f32| if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
        let [x, y, z] = xyz(linear).map(curve);
        let lightness = 116.0 * y - 16.0;
        let hunt = 0.01 * lightness;
        Self { lightness, a: hunt * 500.0 * (x - y), b: hunt * 200.0 * (y - z) }
    }

    /// HyAB distance \[ANDERSSON20\].
    pub(super) fn distance(self, other: Lab) -> f32 {
        let (a, b) = (self.a - other.a, self.b - other.b);
        (self.lightness - other.lightness).abs() + (a * a + b * b).sqrt()
    }
}
