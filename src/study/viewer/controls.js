// The elements of a section, and what they show.

const MODE_NAMES = { image: "Image", signed: MAPS.signed.name, relative: MAPS.relative.name, squared: MAPS.squared.name };
const METRIC_NAMES = ["relmse", "mse", "rmse", "mape", "smape", "srrmse"];
const KEYS = [
  ["1 … 9", "this picture"],
  ["← →", "picture before, after"],
  ["m M", "next mode, mode before"],
  ["e E", "exposure up, down by half a stop"],
  ["[ ]", "range of the error halved, doubled"],
  ["+ −", "zoom"],
  ["Shift + arrows", "pan"],
  ["c", "draw a crop"],
  ["C", "crop what is seen"],
  ["f", "fit the picture"],
  ["r", "reset all"],
];

/** An element; attributes that start with `on` are listeners. */
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children.filter(child => child !== null));
  return made;
}

const button = (text, title, action) => element("button", { type: "button", title, onclick: action }, text);

/** Fills in `viewer.controls`: the elements that change, and functions that change them. */
function buildControls(viewer) {
  const { section } = viewer;
  const title = section.querySelector("h2").textContent;
  const canvas = element("canvas", { class: "viewer-canvas" });
  const badge = element("div", { class: "viewer-badge", role: "status" });
  const stage = element("div", {
    class: "viewer-stage",
    tabindex: "0",
    role: "application",
    "aria-label": `Pictures of ${title}. Number keys or left and right flip, plus and minus zoom, shift and arrows pan, m changes the mode.`,
  }, canvas, badge);
  const layers = element("div", { class: "viewer-layers", role: "group", "aria-label": "Picture" }, ...viewer.layers.map((layer, index) =>
    element("button", { type: "button", "aria-pressed": "false", "data-layer": index, onclick: () => viewer.flip(index) },
      index < 9 ? element("kbd", {}, String(index + 1)) : null, layer.name)));
  const controls = { canvas, stage, badge, layers };
  viewer.controls = controls;
  const bar = buildBar(viewer, controls);
  controls.status = element("div", { class: "viewer-status" });
  controls.readout = element("div", { class: "viewer-readout", "aria-label": "Pixel" });
  controls.caption = element("dl", { class: "viewer-caption" });
  controls.crops = element("div", { class: "viewer-crops" });
  const keys = element("details", { class: "viewer-keys" }, element("summary", {}, "Keys and touch"),
    element("dl", {}, ...KEYS.flatMap(([key, what]) => [element("dt", {}, key), element("dd", {}, what)])),
    element("p", {}, "The wheel zooms once the picture was clicked, or with Ctrl. On a touch screen: swipe to flip, pinch to zoom, drag to pan, tap for a pixel."));
  section.append(bar, layers, element("div", { class: "viewer-body" },
    element("div", { class: "viewer-main" }, stage, controls.status),
    element("div", { class: "viewer-side" }, controls.caption, controls.readout, controls.crops, keys)));
  controls.showCrops = () => showCrops(viewer);
  controls.update = () => update(viewer);
  controls.fail = message => controls.status.replaceChildren(element("p", { role: "alert" }, message));
  listen(viewer);
}

function buildBar(viewer, controls) {
  const slider = (name, attributes, action) => {
    const input = element("input", { type: "range", ...attributes, oninput: () => action(Number(input.value)) });
    const output = element("output");
    const label = element("label", { class: "viewer-slider" }, element("span", {}, name), input, output);
    return { input, output, label };
  };
  const from = viewer.defaultExposure;
  controls.exposure = slider("Exposure", { min: (from - 12).toFixed(1), max: (from + 12).toFixed(1), step: "0.1" }, v => viewer.setExposure(v));
  controls.range = slider("Range", { min: "-8", max: "8", step: "0.25" }, v => viewer.setRange(v));
  const compared = viewer.layers.some(layer => viewer.comparable(layer));
  controls.modes = element("div", { class: "viewer-modes", role: "group", "aria-label": "What is shown" },
    ...(compared ? MODES : ["image"]).map(mode =>
      element("button", { type: "button", "aria-pressed": "false", "data-mode": mode, onclick: () => viewer.setMode(mode) }, MODE_NAMES[mode])));
  controls.draw = button("Crop", "Draw a rectangle; its numbers appear beside (c)", () => startDrawing(viewer));
  return element("div", { class: "viewer-bar" }, controls.modes, controls.exposure.label, controls.range.label,
    element("div", { class: "viewer-actions", role: "group", "aria-label": "View" },
      button("−", "Zoom out (−)", () => viewer.zoomBy(1 / 1.5)), button("+", "Zoom in (+)", () => viewer.zoomBy(1.5)),
      button("Fit", "Fit the picture (f)", () => { viewer.fit(); viewer.refresh(); }), controls.draw,
      button("Reset", "Exposure, range, mode and zoom as they were (r)", () => viewer.reset())));
}

/** Brings every element up to date with the viewer's state. */
function update(viewer) {
  const { controls } = viewer;
  const layer = viewer.layer();
  for (const tab of controls.layers.children) tab.setAttribute("aria-pressed", String(Number(tab.dataset.layer) === viewer.current));
  for (const mode of controls.modes.children) mode.setAttribute("aria-pressed", String(mode.dataset.mode === viewer.mode));
  controls.exposure.input.value = viewer.exposure;
  controls.exposure.output.textContent = `${viewer.exposure < 0 ? "−" : "+"}${Math.abs(viewer.exposure).toFixed(1)} EV`;
  controls.exposure.label.hidden = viewer.mode !== "image";
  controls.range.label.hidden = viewer.mode === "image";
  controls.draw.setAttribute("aria-pressed", String(viewer.drawing));
  controls.stage.classList.toggle("viewer-drawing", viewer.drawing);
  // A picture that fits leaves vertical swipes to the page.
  controls.canvas.style.touchAction = viewer.zoom > 1.001 || viewer.drawing ? "none" : "pan-y";
  const shown = viewer.mode === "image" ? layer.name : `${layer.name} · ${viewer.plain(layer) ? "image" : MODE_NAMES[viewer.mode].toLowerCase()}`;
  if (controls.badge.textContent !== shown) controls.badge.textContent = shown;
  if (viewer.mode !== "image" && viewer.ready) {
    controls.range.input.value = viewer.rangeStops;
    controls.range.output.textContent = digits(viewer.range());
  }
  if (viewer.section.dataset.state !== "failed") updateStatus(viewer);
  updateCaption(viewer);
  updateReadout(viewer);
  updateCrops(viewer);
}

/** Under the picture: the legend of an error, and the pixels that have no number. */
function updateStatus(viewer) {
  const { controls } = viewer;
  const layer = viewer.layer();
  const key = [viewer.current, viewer.mode, viewer.rangeStops, viewer.section.dataset.state, viewer.drawing, Boolean(layer.codes)].join();
  if (controls.statusKey === key) return;
  controls.statusKey = key;
  const parts = [];
  if (viewer.drawing) parts.push(element("p", {}, "Drag a rectangle over the picture; Esc gives up."));
  if (!viewer.ready) parts.push(element("p", {}, "Unpacking the pictures …"));
  else if (viewer.mode !== "image") parts.push(legend(viewer));
  const most = digits(LARGEST * viewer.unit);
  const counts = [
    [layer.nan, NOT_A_NUMBER, "not a number"],
    [layer.infinite, INFINITE, "infinite"],
    [layer.beyond, BEYOND, `beyond half floats, shown as ${most}`],
  ].filter(([count]) => count > 0);
  if (counts.length) {
    parts.push(element("p", { class: "viewer-marks" }, ...counts.map(([count, kind, what]) =>
      element("span", {}, element("i", { style: `background:rgb(${MARKS[kind]})` }), `${count} ${count === 1 ? "pixel" : "pixels"} ${what}`))));
  }
  controls.status.replaceChildren(...parts);
}

function legend(viewer) {
  const map = MAPS[viewer.mode];
  const range = viewer.range();
  const stops = Array.from({ length: 33 }, (_, i) => `rgb(${map.colour(map.low + ((1 - map.low) * i) / 32)})`);
  const formula = typeof map.formula === "string" ? map.formula : map.formula(viewer.epsilon);
  const ticks = map.low < 0
    ? [`≤ ${digits(-range)} darker`, "0", `brighter ≥ ${digits(range)}`]
    : ["0", digits(range / 2), `≥ ${digits(range)}`];
  const clip = viewer.rangeStops === 0 ? "clipped at the 0.9 quantile over all pictures" : `range set by hand, 0.9 quantile ${digits(viewer.quantiles[viewer.mode])}`;
  return element("div", { class: "viewer-legend" },
    element("div", { class: "viewer-legend-bar", style: `background:linear-gradient(to right,${stops})`, role: "img", "aria-label": `Colours from ${ticks[0]} to ${ticks[2]}` }),
    element("div", { class: "viewer-legend-ticks" }, ...ticks.map(tick => element("span", {}, tick))),
    element("p", {}, `${formula}; ${clip}`));
}

function updateCaption(viewer) {
  const { controls } = viewer;
  if (controls.captionOf === viewer.current) return;
  controls.captionOf = viewer.current;
  const layer = viewer.layer();
  const rows = [[layer.name, `${layer.width} × ${layer.height} pixels`], ...layer.caption];
  controls.caption.replaceChildren(...rows.map(([label, value]) => element("div", {}, element("dt", {}, label), element("dd", {}, value))));
}

/** The pixel under the pointer, or in the middle of the stage: this picture, the reference, their error. */
function updateReadout(viewer) {
  const { controls, reference } = viewer;
  const layer = viewer.layer();
  const x = viewer.hover ? viewer.hover.x : Math.min(viewer.width - 1, Math.floor(viewer.centre[0]));
  const y = viewer.hover ? viewer.hover.y : Math.min(viewer.height - 1, Math.floor(viewer.centre[1]));
  const rgb = of => {
    if (!of.codes || x >= of.width || y >= of.height) return ["–", "–", "–"];
    const at = 3 * (y * of.width + x);
    return [0, 1, 2].map(c => {
      const code = of.codes[at + c];
      const text = digits(VALUES[code] * viewer.unit);
      return KINDS[code] !== BEYOND ? text : (VALUES[code] > 0 ? "≥ " : "≤ ") + text;
    });
  };
  const row = (name, values) => element("tr", {}, element("th", { scope: "row" }, name), ...values.map(value => element("td", {}, value)));
  const rows = [row(layer.name, rgb(layer))];
  const comparable = viewer.comparable(layer) && viewer.ready;
  if (reference) rows.push(layer === reference ? row("\u00a0", ["", "", ""]) : row("Reference", rgb(reference)));
  if (reference) rows.push(comparable ? row("Difference", differences(viewer, layer, x, y)) : row("\u00a0", ["", "", ""]));
  const error = comparable && viewer.mode !== "image" ? ` · ${MODE_NAMES[viewer.mode].toLowerCase()} ${digits(viewer.map(layer, viewer.mode)[y * viewer.width + x])}` : "";
  controls.readout.replaceChildren(element("table", {},
    element("caption", {}, `Pixel ${x}, ${y}${viewer.hover ? "" : " (centre)"} · half precision · zoom ${digits(Number(viewer.zoom.toFixed(2)))}${error}`),
    element("thead", {}, element("tr", {}, ...["", "R", "G", "B"].map(name => element("th", { scope: "col" }, name)))),
    element("tbody", {}, ...rows)));
}

/** Picture less reference, by channel; nothing where either has no usable number. */
function differences(viewer, layer, x, y) {
  const at = 3 * (y * viewer.width + x);
  const codes = [layer.codes, viewer.reference.codes];
  if (codes.some(of => kindAt(of, at))) return ["–", "–", "–"];
  return [0, 1, 2].map(c => digits((VALUES[codes[0][at + c]] - VALUES[codes[1][at + c]]) * viewer.unit));
}

/** Makes the elements of all crops. */
function showCrops(viewer) {
  const { controls } = viewer;
  controls.cropsKey = "";
  controls.metric ??= "relmse";
  const compared = viewer.layers.some(layer => viewer.comparable(layer));
  const choose = element("select", { "aria-label": "Metric of the crops", onchange: () => { controls.metric = choose.value; controls.cropsKey = ""; viewer.refresh(); } },
    ...METRIC_NAMES.map(name => element("option", { value: name }, name)));
  choose.value = controls.metric;
  const head = element("div", { class: "viewer-crops-head" }, element("h3", {}, "Crops"),
    compared ? choose : null, element("span", {}, compared ? "half precision; the least is bold" : ""));
  controls.crops.replaceChildren(...(viewer.crops.length ? [head] : []), ...viewer.crops.map((crop, index) => cropElement(viewer, crop, index)));
}

function cropElement(viewer, crop, index) {
  const place = `${crop.x}, ${crop.y}, ${crop.width} × ${crop.height}`;
  const cells = viewer.layers.map((layer, at) => {
    const canvas = element("canvas", { width: crop.width, height: crop.height, style: `aspect-ratio:${crop.width}/${crop.height}` });
    return element("button", { type: "button", class: "viewer-crop-cell", "data-layer": at, "aria-pressed": "false", onclick: () => viewer.flip(at) },
      canvas, element("span", { class: "viewer-crop-name" }, `${at + 1} ${layer.name}`), element("span", { class: "viewer-crop-number" }));
  });
  crop.element = element("figure", { class: "viewer-crop" },
    element("figcaption", {}, element("b", {}, String(index + 1)), element("span", {}, place),
      button("Show", `Zoom to crop ${index + 1}`, () => viewer.showCrop(crop)), button("Remove", `Remove crop ${index + 1}`, () => viewer.removeCrop(crop))),
    element("div", { class: "viewer-crop-cells" }, ...cells));
  return crop.element;
}

function updateCrops(viewer) {
  const { controls } = viewer;
  for (const crop of viewer.crops) {
    for (const cell of crop.element.querySelectorAll(".viewer-crop-cell")) cell.setAttribute("aria-pressed", String(Number(cell.dataset.layer) === viewer.current));
  }
  const key = [viewer.mode, viewer.exposure, viewer.rangeStops, viewer.section.dataset.state].join();
  if (!viewer.ready || controls.cropsKey === key) return;
  controls.cropsKey = key;
  for (const crop of viewer.crops) {
    const values = crop.numbers.map(numbers => (numbers ? numbers[controls.metric] : null));
    const least = Math.min(...values.filter(value => value !== null));
    [...crop.element.querySelectorAll(".viewer-crop-cell")].forEach((cell, index) => {
      const layer = viewer.layers[index];
      if (crop.x + crop.width <= layer.width && crop.y + crop.height <= layer.height) {
        cell.querySelector("canvas").getContext("2d").putImageData(viewer.paint(layer, crop), 0, 0);
      }
      const numbers = crop.numbers[index];
      const number = cell.querySelector(".viewer-crop-number");
      number.textContent = numbers ? digits(values[index]) + (numbers.masked ? ` (${numbers.masked} left out)` : "") : "\u00a0";
      number.classList.toggle("viewer-least", numbers !== null && values[index] === least);
      cell.title = numbers ? METRIC_NAMES.map(name => `${name} ${digits(numbers[name])}`).join("\n") : layer.name;
    });
  }
}
