// Half floats, metrics and colours: what a picture's numbers are and how they look. No page in here.

/** A half float's place among all half floats, ascending; the inverse of `ascending` in packing.rs. */
const bitsOfCode = code => (code & 0x8000 ? code ^ 0x8000 : ~code & 0xffff);

/** The value of every code, as stored: the picture's times 2^stops. */
const VALUES = (() => {
  const values = new Float32Array(65536);
  for (let code = 0; code < 65536; code++) {
    const bits = bitsOfCode(code);
    const exponent = (bits >> 10) & 31;
    const mantissa = bits & 1023;
    let value = exponent === 0 ? mantissa * 2 ** -24 : (1 + mantissa / 1024) * 2 ** (exponent - 15);
    if (exponent === 31) value = mantissa ? NaN : Infinity;
    values[code] = bits & 0x8000 ? -value : value;
  }
  return values;
})();

const LARGEST = 65504;

// What a component is; the largest of a pixel's three counts.
const PLAIN = 0;
const BEYOND = 1;
const INFINITE = 2;
const NOT_A_NUMBER = 3;
const KINDS = Uint8Array.from(VALUES, value => {
  if (Number.isNaN(value)) return NOT_A_NUMBER;
  if (!Number.isFinite(value)) return INFINITE;
  return Math.abs(value) === LARGEST ? BEYOND : PLAIN;
});

/** Colours of pixels without a usable number, by kind, and what they are called. */
const MARKS = [null, [255, 200, 0], [0, 225, 255], [255, 0, 255]];

/** Opaque pixel for ImageData's bytes read as one number. */
const LITTLE = new Uint8Array(new Uint32Array([1]).buffer)[0] === 1;
const opaque = LITTLE
  ? (r, g, b) => ((255 << 24) | (b << 16) | (g << 8) | r) >>> 0
  : (r, g, b) => ((r << 24) | (g << 16) | (b << 8) | 255) >>> 0;

function bytesOfBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

/** The codes of a packed picture, red, green and blue of each pixel after another. */
async function unpack(text, width, height) {
  if (typeof DecompressionStream === "undefined") throw new Error("this browser is too old: it has no DecompressionStream");
  const stream = new Blob([bytesOfBase64(text)]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const count = width * height;
  if (bytes.length !== 6 * count) throw new Error(`${bytes.length} bytes for ${width} × ${height} pixels`);
  const codes = new Uint16Array(3 * count);
  [1, 0, 2].forEach((channel, plane) => addPlane(codes, bytes, channel, 2 * plane * count, width, height));
  for (let i = 0; i < codes.length; i += 3) {
    codes[i] += codes[i + 1];
    codes[i + 2] += codes[i + 1];
  }
  return codes;
}

/** Undoes the prediction from the left and the upper neighbour; Uint16Array does the arithmetic modulo 2^16. */
function addPlane(codes, bytes, channel, start, width, height) {
  const count = width * height;
  const row = 3 * width;
  for (let y = 0, i = 0, at = channel; y < height; y++) {
    for (let x = 0; x < width; x++, i++, at += 3) {
      let expected = 0;
      if (x > 0) expected = y > 0 ? (codes[at - 3] + codes[at - row]) >> 1 : codes[at - 3];
      else if (y > 0) expected = codes[at - row];
      codes[at] = expected + bytes[start + i] + (bytes[start + count + i] << 8);
    }
  }
}

/** The sRGB curve from linear [0, 1], as a byte. */
function encoded(linear) {
  if (!(linear > 0)) return 0;
  if (linear >= 1) return 255;
  return Math.round(255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055));
}

/** The byte of every code under a factor. */
function encodingTable(factor) {
  return Uint8Array.from(VALUES, value => encoded(value * factor));
}

/** matplotlib's inferno at 17 places (CC0). */
const INFERNO = ("000004 0b0724 210c4a 3d0965 57106e 71196e 8a226a a32c61 bc3754 d24644 e45a31 f1731d f98e09 fcac11 f9cb35 f2ea69 " +
  "fcffa4").split(" ").map(hex => [0, 2, 4].map(at => parseInt(hex.slice(at, at + 2), 16)));

/** A false colour of t in [0, 1]. */
function inferno(t) {
  const place = t * (INFERNO.length - 1);
  const below = Math.min(Math.floor(place), INFERNO.length - 2);
  return INFERNO[below].map((from, c) => Math.round(from + (place - below) * (INFERNO[below + 1][c] - from)));
}

/** Brighter than the reference is green, darker red, t in [-1, 1]. */
function redGreen(t) {
  const full = t < 0 ? [255, 64, 48] : [40, 230, 90];
  return full.map(c => Math.round(255 * ((c / 255) * Math.sqrt(Math.abs(t)))));
}

/** Error maps: a number per pixel, its colours, how it is written. */
const MAPS = {
  signed: {
    name: "Signed error",
    formula: "mean over channels of x − r",
    low: -1,
    colour: redGreen,
    of: (x, r) => x - r,
  },
  relative: {
    name: "Relative error",
    formula: epsilon => `mean over channels of (x − r)² / (r² + ${epsilon})`,
    low: 0,
    colour: inferno,
    of: (x, r, epsilon) => ((x - r) * (x - r)) / (r * r + epsilon),
  },
  squared: {
    name: "Squared error",
    formula: "mean over channels of (x − r)²",
    low: 0,
    colour: inferno,
    of: (x, r) => (x - r) * (x - r),
  },
};

/** Opaque pixels from a map's lowest to its highest value, 256 to a side, so that no error is one of them. */
function colourTable(map) {
  const last = 255 * (1 - map.low);
  return Uint32Array.from({ length: last + 1 }, (_, i) => opaque(...map.colour(map.low + i / 255)));
}

/** Kind of the worst component of the pixel whose red code is at `at`. */
const kindAt = (codes, at) => Math.max(KINDS[codes[at]], KINDS[codes[at + 1]], KINDS[codes[at + 2]]);

/** A map's values; NaN where picture or reference has no usable number. `unit` takes stored values to the picture's. */
function errorMap(map, codes, reference, unit, epsilon) {
  const values = new Float32Array(codes.length / 3);
  for (let i = 0, at = 0; i < values.length; i++, at += 3) {
    if (kindAt(codes, at) || kindAt(reference, at)) {
      values[i] = NaN;
      continue;
    }
    let sum = 0;
    for (let c = at; c < at + 3; c++) sum += map.of(VALUES[codes[c]] * unit, VALUES[reference[c]] * unit, epsilon);
    values[i] = sum / 3;
  }
  return values;
}

/**
 * The value that a share of all magnitudes in the arrays does not exceed, within 1 %: from a histogram over the upper half of the
 * float's pattern, which ascends with the value. 1 if there is no error at all.
 */
function quantile(arrays, share) {
  const histogram = new Uint32Array(65536);
  const pattern = new Uint32Array(1);
  const value = new Float32Array(pattern.buffer);
  let total = 0;
  for (const array of arrays) {
    for (const error of array) {
      if (!Number.isFinite(error)) continue;
      value[0] = Math.abs(error);
      histogram[pattern[0] >>> 16]++;
      total++;
    }
  }
  let last = 0;
  for (let bin = 0, seen = 0; bin < 65536; bin++) {
    if (!histogram[bin]) continue;
    last = bin;
    seen += histogram[bin];
    if (seen >= share * total && bin > 0) break;
  }
  // The middle of the bin, so that a constant error is hit and not missed by a bin.
  pattern[0] = last * 65536 + (last ? 32768 : 0);
  return value[0] || 1;
}

/** Metrics of a rectangle by the names and formulas of `isophote list metrics`; null where no pixel is left. */
function measure(codes, reference, width, rectangle, unit, epsilon) {
  const sums = { mse: 0, relmse: 0, mape: 0, smape: 0, srrmse: 0 };
  let count = 0;
  let ratios = 0;
  let masked = 0;
  for (let y = rectangle.y; y < rectangle.y + rectangle.height; y++) {
    for (let x = rectangle.x; x < rectangle.x + rectangle.width; x++) {
      const at = 3 * (y * width + x);
      if (kindAt(codes, at) || kindAt(reference, at)) {
        masked++;
        continue;
      }
      for (let c = at; c < at + 3; c++) {
        const value = VALUES[codes[c]] * unit;
        const truth = VALUES[reference[c]] * unit;
        const difference = value - truth;
        count++;
        sums.mse += difference * difference;
        sums.relmse += (difference * difference) / (truth * truth + epsilon);
        sums.mape += Math.abs(difference) / (Math.abs(truth) + epsilon);
        sums.smape += (2 * Math.abs(difference)) / (Math.abs(value) + Math.abs(truth) + 2 * epsilon);
        if (value + truth > 0 || value === truth) ratios++;
        if (value + truth > 0) sums.srrmse += (difference / (0.5 * (value + truth))) ** 2;
      }
    }
  }
  const mean = (sum, n) => (n ? sum / n : null);
  const root = value => (value === null ? null : Math.sqrt(value));
  const mse = mean(sums.mse, count);
  return {
    relmse: mean(sums.relmse, count),
    mse,
    rmse: root(mse),
    mape: mean(sums.mape, count),
    smape: mean(sums.smape, count),
    srrmse: root(mean(sums.srrmse, ratios)),
    masked,
  };
}

/** A number with four digits; half floats have three and a bit. */
function digits(value) {
  if (value === null || value === undefined) return "–";
  if (Number.isNaN(value)) return "NaN";
  if (!Number.isFinite(value)) return value > 0 ? "inf" : "−inf";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const text = size >= 1e-3 && size < 1e5 ? String(Number(value.toPrecision(4))) : value.toExponential(3).replace("e+", "e");
  return text.replace(/-/g, "−");
}
