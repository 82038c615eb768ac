// Keys, mouse and touch.

function startDrawing(viewer, on = !viewer.drawing) {
  viewer.drawing = on;
  viewer.drawn = null;
  viewer.refresh();
}

function listen(viewer) {
  const { canvas, stage } = viewer.controls;
  new ResizeObserver(() => {
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(stage.clientWidth * ratio));
    canvas.height = Math.max(1, Math.round(stage.clientHeight * ratio));
    viewer.refresh();
  }).observe(stage);
  stage.addEventListener("wheel", event => {
    // A page must scroll past its pictures: the wheel zooms where the user has pointed before.
    if (!event.ctrlKey && !viewer.section.contains(document.activeElement)) return;
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 16 : 1;
    viewer.zoomBy(Math.exp(-event.deltaY * lines * 0.002), event.offsetX, event.offsetY);
  }, { passive: false });
  stage.addEventListener("dblclick", event => {
    if (viewer.zoom > 1.001) viewer.fit();
    else viewer.zoomBy(4, event.offsetX, event.offsetY);
    viewer.refresh();
  });
  viewer.section.addEventListener("pointerenter", () => { pointed = viewer; });
  listenToPointers(viewer);
}

function listenToPointers(viewer) {
  const { canvas } = viewer.controls;
  /** Pointers that are down, by id, where they were last. */
  const down = new Map();
  let start = null;
  let moved = false;

  const place = event => {
    const box = canvas.getBoundingClientRect();
    return { left: event.clientX - box.left, top: event.clientY - box.top };
  };
  const pixelAt = at => {
    const [x, y] = viewer.pictureAt(at.left, at.top).map(Math.floor);
    return x >= 0 && y >= 0 && x < viewer.width && y < viewer.height ? { x, y } : null;
  };
  const rectangle = (from, to) => {
    const clamp = ([x, y]) => [Math.max(0, Math.min(viewer.width, x)), Math.max(0, Math.min(viewer.height, y))];
    const [a, b] = [clamp(viewer.pictureAt(from.left, from.top)), clamp(viewer.pictureAt(to.left, to.top))];
    const [x, y] = [Math.floor(Math.min(a[0], b[0])), Math.floor(Math.min(a[1], b[1]))];
    return { x, y, width: Math.ceil(Math.max(a[0], b[0])) - x, height: Math.ceil(Math.max(a[1], b[1])) - y };
  };

  canvas.addEventListener("pointerdown", event => {
    if (event.button > 0) return;
    canvas.setPointerCapture(event.pointerId);
    down.set(event.pointerId, place(event));
    start = down.size === 1 ? place(event) : null;
    moved = false;
  });
  canvas.addEventListener("pointermove", event => {
    const now = place(event);
    const before = down.get(event.pointerId);
    if (!before) {
      viewer.hover = pixelAt(now);
      viewer.refresh();
      return;
    }
    if (start && Math.hypot(now.left - start.left, now.top - start.top) > 6) moved = true;
    if (down.size === 2) pinch(viewer, down, event.pointerId, now);
    else if (viewer.drawing) viewer.drawn = start && rectangle(start, now);
    else if (viewer.zoom > 1.001 && moved) viewer.panBy(now.left - before.left, now.top - before.top);
    if (event.pointerType === "mouse") viewer.hover = pixelAt(now);
    down.set(event.pointerId, now);
    viewer.refresh();
  });
  canvas.addEventListener("pointerup", event => {
    const now = place(event);
    if (!down.delete(event.pointerId) || !start) return;
    const [right, below] = [now.left - start.left, now.top - start.top];
    if (viewer.drawing && moved) {
      viewer.addCrop(rectangle(start, now));
      startDrawing(viewer, false);
    } else if (!moved) {
      viewer.hover = pixelAt(now);
      viewer.refresh();
    } else if (event.pointerType !== "mouse" && viewer.zoom <= 1.001 && Math.abs(right) > 40 && Math.abs(right) > 2 * Math.abs(below)) {
      viewer.step(right < 0 ? 1 : -1);
    }
    start = null;
  });
  canvas.addEventListener("pointercancel", event => {
    down.delete(event.pointerId);
    start = null;
    viewer.drawn = null;
    viewer.refresh();
  });
  canvas.addEventListener("pointerleave", event => {
    if (event.pointerType !== "mouse") return;
    viewer.hover = null;
    viewer.refresh();
  });
}

/** Two fingers: the distance zooms, the middle pans. */
function pinch(viewer, down, id, now) {
  const other = [...down].find(([key]) => key !== id)[1];
  const before = down.get(id);
  const apart = at => Math.hypot(at.left - other.left, at.top - other.top);
  viewer.panBy((now.left - before.left) / 2, (now.top - before.top) / 2);
  viewer.zoomBy(apart(now) / Math.max(1, apart(before)), (now.left + other.left) / 2, (now.top + other.top) / 2);
}

/** What a key does; false if nothing. */
function act(viewer, event) {
  const pan = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] }[event.key];
  if (pan && event.shiftKey) {
    viewer.panBy(...pan);
    return true;
  }
  if (/^[1-9]$/.test(event.key)) {
    viewer.flip(Number(event.key) - 1);
    return true;
  }
  const actions = {
    ArrowLeft: () => viewer.step(-1),
    ArrowRight: () => viewer.step(1),
    "+": () => viewer.zoomBy(1.5),
    "=": () => viewer.zoomBy(1.5),
    "-": () => viewer.zoomBy(1 / 1.5),
    e: () => viewer.setExposure(viewer.exposure + 0.5),
    E: () => viewer.setExposure(viewer.exposure - 0.5),
    m: () => viewer.stepMode(1),
    M: () => viewer.stepMode(-1),
    "[": () => viewer.setRange(viewer.rangeStops - 1),
    "]": () => viewer.setRange(viewer.rangeStops + 1),
    c: () => startDrawing(viewer),
    C: () => viewer.addCrop(viewer.seen()),
    f: () => { viewer.fit(); viewer.refresh(); },
    r: () => viewer.reset(),
    Escape: () => startDrawing(viewer, false),
  };
  if (!actions[event.key] || (event.key === "Escape" && !viewer.drawing)) return false;
  actions[event.key]();
  return true;
}

/** The viewer the pointer was over last. */
let pointed = null;

/** Whose keys these are: the section with the focus, else, where nothing has it, the one pointed at or most in view. */
function addressed(viewers) {
  const focused = document.activeElement;
  const around = viewers.find(viewer => viewer.section.contains(focused));
  if (around || (focused && focused !== document.body)) return around;
  const share = viewer => {
    const box = viewer.controls.stage.getBoundingClientRect();
    return Math.min(box.bottom, window.innerHeight) - Math.max(box.top, 0);
  };
  if (pointed && share(pointed) > 0) return pointed;
  const best = viewers.reduce((a, b) => (share(b) > share(a) ? b : a));
  return share(best) > 0 ? best : undefined;
}

function start() {
  const viewers = [...document.querySelectorAll("section.viewer")].filter(section => section.querySelector("script[data-viewer=header]"))
    .map(section => new Viewer(section));
  if (!viewers.length) return;
  const bySection = new Map(viewers.map(viewer => [viewer.section, viewer]));
  const near = new IntersectionObserver(entries => {
    for (const entry of entries) {
      if (!entry.isIntersecting) continue;
      near.unobserve(entry.target);
      bySection.get(entry.target).load();
    }
  }, { rootMargin: "300px" });
  viewers.forEach(viewer => near.observe(viewer.section));
  document.addEventListener("keydown", event => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const field = event.target.closest?.("input, select, textarea, [contenteditable]");
    // A slider needs the arrows only.
    if (field && (field.type !== "range" || event.key.startsWith("Arrow"))) return;
    const viewer = addressed(viewers);
    if (viewer && act(viewer, event)) event.preventDefault();
  });
}

if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
else start();
