"""Opens pages in Chromium from the disk and checks what a reader relies on. One line a check; exit 1 if one failed."""
import argparse
import json
import pathlib
import shutil
import statistics
import sys

from playwright.sync_api import sync_playwright

DESKTOP = {"viewport": {"width": 1280, "height": 900}}
PHONE = {"viewport": {"width": 360, "height": 760}, "is_mobile": True, "has_touch": True, "device_scale_factor": 2}
LOAD_LIMIT = 2.0

# Elements that reach out of the page, but for those in a box of their own that scrolls or hides them.
TOO_WIDE = """() => {
  const width = document.documentElement.clientWidth;
  const boxed = e => { for (let p = e.parentElement; p && p !== document.body; p = p.parentElement)
    if (["auto", "scroll", "hidden", "clip"].includes(getComputedStyle(p).overflowX)) return true; return false; };
  return [...document.body.querySelectorAll("*")].filter(e => !e.closest("svg *") && !boxed(e)).filter(e => {
    const b = e.getBoundingClientRect(); return b.width && (b.right > width + 0.5 || b.left < -0.5);
  }).map(e => `${e.tagName.toLowerCase()}.${e.className} ${Math.round(e.getBoundingClientRect().right)} px`)
    .concat(document.documentElement.scrollWidth > width ? [`the page scrolls to ${document.documentElement.scrollWidth} px`] : []);
}"""

# A hash of what the stage of a section shows, after what was asked for has been drawn.
SHOWN = """async section => {
  await new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)));
  const canvas = section.querySelector(".viewer-stage canvas");
  const hash = new Uint8Array(await crypto.subtle.digest("SHA-256", new TextEncoder().encode(canvas.toDataURL())));
  return [...hash].slice(0, 8).map(b => b.toString(16).padStart(2, "0")).join("");
}"""

# Relative luminance of what is written and what is behind it.
COLOURS = """() => {
  const luminance = text => { const [r, g, b] = text.match(/[\\d.]+/g).map(v => v / 255)
    .map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const style = getComputedStyle(document.body);
  const behind = [document.body, document.documentElement].map(e => getComputedStyle(e).backgroundColor).find(c => c !== "rgba(0, 0, 0, 0)");
  return { ink: luminance(style.color), paper: behind ? luminance(behind) : 1 };
}"""

CHARTS = """() => [...document.querySelectorAll("svg[role=img]")].map(svg =>
  ({ name: svg.querySelector("title")?.textContent ?? "", series: [...svg.querySelectorAll("[data-series]")].map(e => e.dataset.series) }))"""

# Seconds until the page is loaded and every viewer in the window is unpacked.
OPENED = """async () => {
  const inWindow = e => { const b = e.getBoundingClientRect(); return b.top < innerHeight && b.bottom > 0; };
  const pending = () => [...document.querySelectorAll("section.viewer")].some(s => inWindow(s) && !["ready", "failed"].includes(s.dataset.state));
  while (document.readyState !== "complete" || pending()) await new Promise(done => setTimeout(done, 5));
  return performance.now() / 1000;
}"""

# Viewers far below the window that were unpacked all the same.
EAGER = """() => [...document.querySelectorAll("section.viewer")].filter(s =>
  s.getBoundingClientRect().top > innerHeight + 600 && s.dataset.state !== "waiting").map(s => s.id)"""

FOCUS = """section => { const stage = section.querySelector(".viewer-stage"); stage.focus();
  const style = getComputedStyle(stage); return style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2; }"""

UNNAMED = """() => [...document.querySelectorAll("button, select, input, [tabindex]")].filter(e =>
  !(e.getAttribute("aria-label") || e.getAttribute("aria-labelledby") || e.textContent.trim() || e.closest("label")?.textContent.trim()))
  .map(e => e.outerHTML.slice(0, 80))"""


class Check:
    """Results of one page."""

    def __init__(self, name):
        self.name = name
        self.failed = []

    def __call__(self, what, good, evidence=""):
        if not good:
            self.failed.append(what)
        print(f"{'ok  ' if good else 'FAIL'} {self.name}: {what}{'' if good else f': {evidence}'}")


class Page:
    """A page in a context of its own, everything it says and asks for written down."""

    def __init__(self, browser, path, dark=False, **device):
        self.context = browser.new_context(color_scheme="dark" if dark else "light", **device)
        self.url = path.resolve().as_uri()
        self.told, self.asked = [], []
        self.context.route("**/*", self.answer)
        self.page = self.context.new_page()
        self.page.on("console", lambda m: self.told.append(f"{m.type}: {m.text}") if m.type in ("error", "warning", "assert") else None)
        self.page.on("pageerror", lambda e: self.told.append(f"exception: {e}"))
        self.page.on("websocket", lambda w: self.asked.append(w.url))
        self.page.on("request", lambda r: self.note(r.url))
        self.page.goto(self.url, wait_until="load")

    def note(self, url):
        if url.split("#")[0] != self.url and not url.startswith(("data:", "blob:")) and url not in self.asked:
            self.asked.append(url)

    def answer(self, route):
        self.note(route.request.url)
        if route.request.url.split("#")[0] == self.url:
            route.continue_()
        else:
            route.abort()

    def sections(self):
        """The viewers, each unpacked."""
        sections = self.page.query_selector_all("section.viewer")
        for section in sections:
            section.query_selector(".viewer-stage").scroll_into_view_if_needed()
            self.page.wait_for_function("s => ['ready', 'failed'].includes(s.dataset.state)", arg=section, timeout=20000)
        return sections

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.context.close()


def check_keys(check, page, sections):
    press = page.page.keyboard.press
    for section in sections:
        name = section.get_attribute("id")
        check(f"section {name} is unpacked", section.get_attribute("data-state") == "ready", section.inner_text()[:200])
        check(f"section {name} shows its focus", section.evaluate(FOCUS))
        layers = len(section.query_selector_all(".viewer-layers button"))
        if layers < 2:
            continue
        shown = [section.evaluate(SHOWN)]
        for key in ["2", "1", "ArrowRight", "ArrowLeft", "e", "E", "+", "Shift+ArrowRight", "f"]:
            press(key)
            shown.append(section.evaluate(SHOWN))
        first, two, one, right, left, brighter, darker, near, panned, fitted = shown
        check(f"{name}: key 2 shows another picture", first != two, shown)
        check(f"{name}: key 1 brings the first back", first == one, shown)
        check(f"{name}: the arrows flip as well", right == two and left == first, shown)
        check(f"{name}: e and E change the exposure", brighter != first and darker == first, shown)
        check(f"{name}: +, shift and f zoom, pan and fit", len({near, panned, first}) == 3 and fitted == first, shown)
        if len(section.query_selector_all(".viewer-modes button")) > 1:
            modes = []
            for _ in range(4):
                press("m")
                modes.append(section.evaluate(SHOWN))
            check(f"{name}: m goes through four modes", len(set(modes)) == 4, modes)
            press("1")
            check(f"{name}: m comes back to the image", section.evaluate(SHOWN) == first, modes)


def check_crop(check, page, section):
    """Draws a rectangle with the mouse."""
    before = len(section.query_selector_all(".viewer-crop"))
    stage = section.query_selector(".viewer-stage")
    stage.scroll_into_view_if_needed()
    stage.focus()
    page.page.keyboard.press("c")
    box = stage.bounding_box()
    mouse = page.page.mouse
    mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.3 * box["height"])
    mouse.down()
    mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"], steps=4)
    mouse.up()
    section.evaluate(SHOWN)
    crops = section.query_selector_all(".viewer-crop")
    numbers = [e.inner_text().strip() for e in crops[-1].query_selector_all(".viewer-crop-number")] if crops else []
    measured = len(section.query_selector_all(".viewer-modes button")) == 1 or all(numbers[1:])
    check("a drawn crop appears with its numbers", len(crops) == before + 1 and measured, (before, len(crops), numbers))


def check_touch(check, page, section):
    """A swipe flips."""
    stage = section.query_selector(".viewer-stage")
    stage.scroll_into_view_if_needed()
    box = stage.bounding_box()
    client = page.context.new_cdp_session(page.page)
    y = box["y"] + box["height"] / 2
    before = section.evaluate(SHOWN)
    points = [box["x"] + box["width"] * share for share in (0.8, 0.7, 0.5, 0.3)]
    client.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": points[0], "y": y}]})
    for x in points[1:]:
        client.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [{"x": x, "y": y}]})
    client.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    check("a swipe flips the pictures", section.evaluate(SHOWN) != before)


def check_charts(check, page, records):
    cells = [json.loads(line) for line in records.read_text().splitlines() if '"cell"' in line]
    done = [cell for cell in cells if cell.get("kind") == "cell" and cell["status"] == "done"]
    methods = {cell["method"] for cell in done}
    with_photons = {cell["method"] for cell in done if cell["light_paths"] > 0}
    charts = page.page.evaluate(CHARTS)
    check("there are charts", bool(charts))
    for chart in charts:
        # A method without light paths has no place on their axis.
        expected = with_photons if "against light paths" in chart["name"] else methods
        check(f"chart {chart['name']!r} has its {len(expected)} series", sorted(chart["series"]) == sorted(expected), chart["series"])


def check_page(browser, path, records, screenshots):
    check = Check(path.name if path.name != "report.html" else f"{path.resolve().parent.name}/{path.name}")
    with Page(browser, path, **DESKTOP) as page:
        sections = page.sections()
        check("has a viewer", bool(sections))
        check_keys(check, page, sections)
        if records:
            check_charts(check, page, records)
        check("every control has a name", not page.page.evaluate(UNNAMED), page.page.evaluate(UNNAMED))
        if sections:
            check_crop(check, page, sections[0])
        check("the console is silent", not page.told, page.told[:5])
        check("no request leaves the file", not page.asked, page.asked[:5])
    paper = {}
    for device, options in [("desktop", DESKTOP), ("phone", PHONE)]:
        for dark in [False, True]:
            with Page(browser, path, dark=dark, **options) as page:
                sections = page.sections()
                if device == "phone":
                    wide = page.page.evaluate(TOO_WIDE)
                    check(f"nothing is wider than 360 px{', dark' if dark else ''}", not wide, wide[:5])
                    if sections and not dark:
                        check_touch(check, page, sections[0])
                colours = page.page.evaluate(COLOURS)
                lighter, darker = max(colours.values()), min(colours.values())
                check(f"text stands out, {device}{', dark' if dark else ''}", (lighter + 0.05) / (darker + 0.05) >= 7, colours)
                paper[device, dark] = colours["paper"]
                page.page.evaluate("scrollTo(0, 0)")
                page.page.screenshot(path=screenshots / f"{check.name.replace('/', '-')}.{device}{'-dark' if dark else ''}.png", full_page=True)
                check(f"silent, {device}{', dark' if dark else ''}", not page.told and not page.asked, page.told + page.asked)
    check("dark is dark and light is light", paper["desktop", True] < 0.05 and paper["desktop", False] > 0.8, paper)
    return check.failed


def check_speed(browser, path):
    """By the page's own clock, from the start of its loading to its end and to the viewers in the window unpacked; the median of five."""
    check = Check(path.name)
    times = []
    for _ in range(5):
        with Page(browser, path, **DESKTOP) as page:
            times.append(page.page.evaluate(OPENED))
            eager = page.page.evaluate(EAGER)
            check("viewers out of sight wait", not eager, eager)
            check("the console is silent while loading", not page.told, page.told[:5])
    median = statistics.median(times)
    check(f"opens in {median:.2f} s ({min(times):.2f} to {max(times):.2f}), {path.stat().st_size / 1e6:.1f} MB", median < LOAD_LIMIT, times)
    return check.failed


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pages", nargs="*", type=pathlib.Path, help="pages; a records.jsonl beside one tells its methods")
    parser.add_argument("--big", type=pathlib.Path, action="append", default=[], help=f"a page that has to open in {LOAD_LIMIT} s")
    parser.add_argument("--chromium", default=shutil.which("chromium"))
    parser.add_argument("--screenshots", type=pathlib.Path, default=pathlib.Path("target/browser"))
    arguments = parser.parse_args()
    arguments.screenshots.mkdir(parents=True, exist_ok=True)
    if not arguments.chromium or not arguments.pages + arguments.big:
        parser.error("needs Chromium and a page")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=arguments.chromium, args=["--no-sandbox"])
        failed = []
        for path in arguments.pages:
            records = path.resolve().parent / "records.jsonl"
            failed += check_page(browser, path, records if records.is_file() else None, arguments.screenshots)
        for path in arguments.big:
            failed += check_speed(browser, path)
        browser.close()
    print(f"{len(failed)} checks failed" if failed else "every check passed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
