// One viewer a section: state, drawing. The page's elements are made in controls.js.

const MODES = ["image", "signed", "relative", "squared"];
const MOST_ZOOM_PIXELS = 96;

class Viewer {
  constructor(section) {
    this.section = section;
    const header = JSON.parse(section.querySelector("script[data-viewer=header]").textContent);
    this.layers = header.layers.map(layer => ({ ...layer, codes: null, maps: {} }));
    this.width = this.layers[0].width;
    this.height = this.layers[0].height;
    this.epsilon = header.epsilon;
    /** Takes stored values to the picture's. */
    this.unit = 2 ** -header.stops;
    this.defaultExposure = Math.round(10 * (header.exposure ?? 0)) / 10;
    this.reference = this.layers[0].reference ? this.layers[0] : null;
    this.current = 0;
    this.crops = [];
    this.hover = null;
    this.drawing = false;
    this.drawn = null;
    this.painted = document.createElement("canvas");
    this.paintedKey = "";
    this.frame = 0;
    this.restState();
    buildControls(this);
    for (const [x, y, width, height] of header.insets) this.addCrop({ x, y, width, height });
    section.dataset.state = "waiting";
  }

  restState() {
    this.mode = "image";
    this.exposure = this.defaultExposure;
    this.rangeStops = 0;
    this.fit();
  }

  fit() {
    this.zoom = 1;
    this.centre = [this.width / 2, this.height / 2];
  }

  /** Whether errors of this layer against the reference can be shown. */
  comparable(layer) {
    return this.reference !== null && layer !== this.reference && layer.width === this.width && layer.height === this.height;
  }

  /** Unpacks every picture, the first first. Called once, when the section comes near the window. */
  async load() {
    this.section.dataset.state = "unpacking";
    try {
      const scripts = [...this.section.querySelectorAll("script[data-viewer=picture]")];
      for (const [index, layer] of this.layers.entries()) {
        layer.codes = await unpack(scripts[index].textContent, layer.width, layer.height);
        scripts[index].remove();
        this.refresh();
      }
      this.section.dataset.state = "ready";
      this.measureCrops();
      this.refresh();
    } catch (error) {
      this.section.dataset.state = "failed";
      this.controls.fail(`The pictures of this section cannot be unpacked: ${error.message}.`);
    }
  }

  get ready() {
    return this.section.dataset.state === "ready";
  }

  layer() {
    return this.layers[this.current];
  }

  flip(index) {
    if (index < 0 || index >= this.layers.length) return;
    this.current = index;
    this.refresh();
  }

  step(by) {
    this.flip((this.current + by + this.layers.length) % this.layers.length);
  }

  setMode(mode) {
    if (mode !== "image" && !this.layers.some(layer => this.comparable(layer))) return;
    this.mode = mode;
    this.rangeStops = 0;
    // An error of the reference with itself says nothing: go to the first method.
    if (mode !== "image" && this.layer() === this.reference) this.current = 1;
    this.refresh();
  }

  stepMode(by) {
    this.setMode(MODES[(MODES.indexOf(this.mode) + by + MODES.length) % MODES.length]);
  }

  setExposure(stops) {
    this.exposure = Math.max(this.defaultExposure - 12, Math.min(this.defaultExposure + 12, Math.round(10 * stops) / 10));
    this.refresh();
  }

  setRange(stops) {
    this.rangeStops = Math.max(-8, Math.min(8, stops));
    this.refresh();
  }

  reset() {
    this.restState();
    this.refresh();
  }

  /** Error values of a layer in a mode, computed once. */
  map(layer, mode) {
    layer.maps[mode] ??= errorMap(MAPS[mode], layer.codes, this.reference.codes, this.unit, this.epsilon);
    return layer.maps[mode];
  }

  /** The magnitude at the end of the legend: the 0.9 quantile over all layers, so that they can be compared, times the slider's factor. */
  range() {
    this.quantiles ??= {};
    this.quantiles[this.mode] ??= quantile(this.layers.filter(l => this.comparable(l)).map(l => this.map(l, this.mode)), 0.9);
    return this.quantiles[this.mode] * 2 ** this.rangeStops;
  }

  /** Whether a layer is shown as it is although the mode is an error. */
  plain(layer) {
    return this.mode === "image" || !this.comparable(layer) || !this.ready;
  }

  /** The pixels of a rectangle of a layer under the present settings. */
  paint(layer, { x, y, width, height }) {
    const image = new ImageData(width, height);
    const pixels = new Uint32Array(image.data.buffer);
    const marks = MARKS.map(mark => (mark ? opaque(...mark) : 0));
    const plain = this.plain(layer);
    const bytes = plain ? this.encoding() : null;
    const map = plain ? null : this.map(layer, this.mode);
    const colours = plain ? null : this.colours();
    const factor = plain ? 0 : 255 / this.range();
    const zero = plain ? 0 : -255 * MAPS[this.mode].low;
    for (let row = 0, to = 0; row < height; row++) {
      for (let column = 0, from = (y + row) * layer.width + x; column < width; column++, from++, to++) {
        const at = 3 * from;
        const kind = kindAt(layer.codes, at);
        if (kind) pixels[to] = marks[kind];
        else if (plain) pixels[to] = opaque(bytes[layer.codes[at]], bytes[layer.codes[at + 1]], bytes[layer.codes[at + 2]]);
        else if (Number.isNaN(map[from])) pixels[to] = marks[kindAt(this.reference.codes, at)];
        else pixels[to] = colours[Math.max(0, Math.min(colours.length - 1, zero + Math.round(map[from] * factor)))];
      }
    }
    return image;
  }

  encoding() {
    if (this.encodingOf !== this.exposure) {
      this.encodingOf = this.exposure;
      this.encodingBytes = encodingTable(this.unit * 2 ** this.exposure);
    }
    return this.encodingBytes;
  }

  colours() {
    this.tables ??= {};
    return (this.tables[this.mode] ??= colourTable(MAPS[this.mode]));
  }

  /** Adds a crop, cut to the picture; nothing if it lies outside. */
  addCrop(rectangle) {
    const x = Math.max(0, rectangle.x);
    const y = Math.max(0, rectangle.y);
    const width = Math.min(this.width, rectangle.x + rectangle.width) - x;
    const height = Math.min(this.height, rectangle.y + rectangle.height) - y;
    if (width < 1 || height < 1) return;
    this.crops.push({ x, y, width, height, numbers: null });
    this.controls.showCrops();
    this.measureCrops();
    this.refresh();
  }

  removeCrop(crop) {
    this.crops = this.crops.filter(other => other !== crop);
    this.controls.showCrops();
    this.refresh();
  }

  measureCrops() {
    if (!this.ready) return;
    for (const crop of this.crops) {
      crop.numbers ??= this.layers.map(layer =>
        this.comparable(layer) ? measure(layer.codes, this.reference.codes, this.width, crop, this.unit, this.epsilon) : null);
    }
  }

  /** Device pixels a picture's pixel takes. */
  scale() {
    const { width, height } = this.controls.canvas;
    return Math.min(width / this.width, height / this.height) * this.zoom;
  }

  /** Picture coordinates, fractional, of a place on the canvas in CSS pixels. */
  pictureAt(left, top) {
    const { canvas } = this.controls;
    const ratio = canvas.width / canvas.clientWidth;
    const scale = this.scale();
    return [this.centre[0] + (left * ratio - canvas.width / 2) / scale, this.centre[1] + (top * ratio - canvas.height / 2) / scale];
  }

  /** Zooms by a factor and keeps what is under a place of the canvas where it is. */
  zoomBy(factor, left = this.controls.canvas.clientWidth / 2, top = this.controls.canvas.clientHeight / 2) {
    const before = this.pictureAt(left, top);
    const most = (MOST_ZOOM_PIXELS * this.zoom) / this.scale();
    this.zoom = Math.max(1, Math.min(Math.max(1, most), this.zoom * factor));
    const after = this.pictureAt(left, top);
    this.centre = this.centre.map((c, i) => c + before[i] - after[i]);
    this.refresh();
  }

  /** Moves the picture by CSS pixels. */
  panBy(right, down) {
    const perPixel = this.controls.canvas.width / this.controls.canvas.clientWidth / this.scale();
    this.centre = [this.centre[0] - right * perPixel, this.centre[1] - down * perPixel];
    this.refresh();
  }

  /** What is seen, in whole pixels. */
  seen() {
    const { canvas } = this.controls;
    const [left, top] = this.pictureAt(0, 0).map(Math.floor);
    const [right, bottom] = this.pictureAt(canvas.clientWidth, canvas.clientHeight).map(Math.ceil);
    return { x: left, y: top, width: right - left, height: bottom - top };
  }

  showCrop(crop) {
    const { canvas } = this.controls;
    const fitted = this.scale() / this.zoom;
    const wanted = (0.8 * Math.min(canvas.width / crop.width, canvas.height / crop.height)) / fitted;
    this.zoom = Math.max(1, Math.min(wanted, Math.max(1, MOST_ZOOM_PIXELS / fitted)));
    this.centre = [crop.x + crop.width / 2, crop.y + crop.height / 2];
    this.refresh();
  }

  /** Keeps the picture on the stage. */
  holdCentre() {
    const { canvas } = this.controls;
    const scale = this.scale();
    const held = (centre, size, room) => {
      const half = room / scale / 2;
      return 2 * half >= size ? size / 2 : Math.max(half, Math.min(size - half, centre));
    };
    this.centre = [held(this.centre[0], this.width, canvas.width), held(this.centre[1], this.height, canvas.height)];
  }

  /** Draws everything anew with the next frame. */
  refresh() {
    if (this.frame) return;
    this.frame = requestAnimationFrame(() => {
      this.frame = 0;
      this.holdCentre();
      this.draw();
      this.controls.update();
    });
  }

  draw() {
    const { canvas } = this.controls;
    const layer = this.layer();
    const context = canvas.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    if (!layer.codes || !canvas.width) return;
    const key = [this.current, this.plain(layer), this.mode, this.exposure, this.rangeStops].join();
    if (key !== this.paintedKey) {
      this.paintedKey = key;
      this.painted.width = layer.width;
      this.painted.height = layer.height;
      this.painted.getContext("2d").putImageData(this.paint(layer, { x: 0, y: 0, width: layer.width, height: layer.height }), 0, 0);
    }
    const scale = this.scale();
    const left = canvas.width / 2 - this.centre[0] * scale;
    const top = canvas.height / 2 - this.centre[1] * scale;
    // Enlarged pixels keep their edges.
    context.imageSmoothingEnabled = scale < 1;
    context.imageSmoothingQuality = "high";
    context.drawImage(this.painted, left, top, this.width * scale, this.height * scale);
    this.crops.forEach((crop, index) => this.outline(context, crop, left, top, scale, String(index + 1)));
    if (this.drawn) this.outline(context, this.drawn, left, top, scale, "");
    if (this.hover && scale >= 8) this.outline(context, { ...this.hover, width: 1, height: 1 }, left, top, scale, "");
  }

  outline(context, { x, y, width, height }, left, top, scale, label) {
    const pixel = canvasPixel(context.canvas);
    const box = [left + x * scale, top + y * scale, width * scale, height * scale].map(Math.round);
    for (const [colour, line] of [["rgba(0,0,0,.7)", 3], ["#fff", 1]]) {
      context.strokeStyle = colour;
      context.lineWidth = line * pixel;
      context.strokeRect(...box);
    }
    if (!label) return;
    context.font = `600 ${12 * pixel}px system-ui, sans-serif`;
    context.lineWidth = 3 * pixel;
    context.strokeStyle = "rgba(0,0,0,.8)";
    context.fillStyle = "#fff";
    context.strokeText(label, box[0] + 5 * pixel, box[1] + 15 * pixel);
    context.fillText(label, box[0] + 5 * pixel, box[1] + 15 * pixel);
  }
}

/** Device pixels a CSS pixel of the canvas takes. */
const canvasPixel = canvas => canvas.width / Math.max(1, canvas.clientWidth);
