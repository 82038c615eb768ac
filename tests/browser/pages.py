"""Makes pages with `isophote compare --html` and checks what they show against the files: every pixel, the numbers of crops, the marks."""
import argparse
import json
import pathlib
import shutil
import subprocess
import sys

import numpy as np
import OpenEXR
from PIL import Image
from playwright.sync_api import sync_playwright

from check import DESKTOP, Check, Page

SIZE = 64

# Bytes of a crop's pictures: the viewer paints them pixel by pixel.
PAINTED = """section => [...section.querySelectorAll(".viewer-crop")[0].querySelectorAll("canvas")].map(canvas =>
  new Promise((done, failed) => { const image = new Image(); image.onerror = failed; image.onload = () => {
    const copy = document.createElement("canvas"); copy.width = canvas.width; copy.height = canvas.height;
    const context = copy.getContext("2d", { willReadFrequently: true }); context.drawImage(image, 0, 0);
    done([...context.getImageData(0, 0, copy.width, copy.height).data]); }; image.src = canvas.toDataURL(); }))
  .reduce(async (all, one) => [...await all, await one], Promise.resolve([]))"""


def write(path, pixels):
    pixels = np.asarray(pixels, np.float32)
    channels = {c: np.ascontiguousarray(pixels[..., i]) for i, c in enumerate("RGB")}
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels) as file:
        file.write(str(path))


def srgb(linear):
    linear = np.clip(np.nan_to_num(linear, nan=0, posinf=1, neginf=0), 0, 1)
    return np.round(255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055))


def exposure_of(section):
    text = section.query_selector(".viewer-slider output").inner_text()
    return float(text.replace("−", "-").split()[0])


def painted(section):
    return [np.array(p, np.int64).reshape(SIZE, SIZE, 4)[..., :3] for p in section.evaluate(PAINTED)]


def settle(page):
    page.page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def renders(check, browser, program, folder):
    """Renders of a scene: the preview's bytes, the numbers of the program."""
    scene = ["scenes/box/scene.xml", "--resolution", f"{SIZE}x{SIZE}", "-q"]
    files = {"ref": ["path", "--iterations", "64", "--seed", "9"], "path": ["path", "--iterations", "4"], "sppm": ["sppm", "--iterations", "4"]}
    command = lambda name, *more: [program, "render", files[name][0], *scene, *files[name][1:], "-o", str(folder / f"{name}.exr"), *more]
    for name in files:
        subprocess.run(command(name), check=True)
    page = folder / "compare.html"
    crops = [f"0,0,{SIZE},{SIZE}", "20,30,16,12"]
    told = subprocess.run([program, "compare", *(str(folder / f"{n}.exr") for n in files), "--html", str(page), "--json",
                           *(word for crop in crops for word in ("--inset", crop))], check=True, capture_output=True, text=True)
    images = json.loads(told.stdout)["images"]
    with Page(browser, page, **DESKTOP) as opened:
        section = opened.sections()[0]
        settle(opened)
        exposure, shown = exposure_of(section), painted(section)
        for name, pixels in zip(files, shown):
            preview = folder / f"{name}.png"
            subprocess.run(command(name, "--preview", str(preview), "--exposure", str(exposure)), check=True)
            difference = np.abs(pixels - np.asarray(Image.open(preview).convert("RGB"), np.int64))
            check(f"{name} looks like its preview, pixel by pixel", difference.max() <= 1, difference.max())
        for metric in ["relmse", "mse", "rmse", "mape", "smape", "srrmse"]:
            section.query_selector("select").select_option(metric)
            settle(opened)
            for index, crop in enumerate(section.query_selector_all(".viewer-crop")):
                found = [float(e.inner_text().replace("−", "-")) for e in crop.query_selector_all(".viewer-crop-number")[1:]]
                true = [image["insets"][index][metric] for image in images]
                check(f"{metric} of crop {crops[index]}", np.allclose(found, true, rtol=3e-3), (found, true))
    return page


def unusual(check, browser, program, folder):
    """NaN, infinities, values that half floats cannot reach, and a picture far from 1."""
    pixels = np.random.default_rng(1).uniform(0.05, 2, (SIZE, SIZE, 3)).astype(np.float32)
    write(folder / "plain.exr", pixels)
    odd = pixels.copy()
    odd[0, 0, 1], odd[0, 1, 2], odd[0, 2, 0], odd[0, 3, 0], odd[0, 4], odd[0, 5, 0] = np.nan, np.inf, -np.inf, 1e9, (-2, 0, 6e-8), -1e6
    write(folder / "odd.exr", odd)
    write(folder / "faint.exr", pixels * np.float32(2.0**-40))
    write(folder / "faint-odd.exr", odd * np.float32(2.0**-40))
    compare = lambda a, b: subprocess.run([program, "compare", str(folder / f"{a}.exr"), str(folder / f"{b}.exr"), "--html", str(folder / f"{a}.html"),
                                           "--inset", f"0,0,{SIZE},{SIZE}"], check=True, capture_output=True)
    for reference, image, factor in [("plain", "odd", 1.0), ("faint", "faint-odd", 2.0**-40)]:
        compare(reference, image)
        with Page(browser, folder / f"{reference}.html", **DESKTOP) as opened:
            section = opened.sections()[0]
            opened.page.keyboard.press("2")
            settle(opened)
            status = section.query_selector(".viewer-status").inner_text()
            counts = ["1 pixel not a number", "2 pixels infinite", "2 pixels beyond half floats"]
            check(f"{image}: what has no number is counted", all(count in status for count in counts), status)
            shown, exposure = painted(section)[1], exposure_of(section)
            expected = srgb(odd.astype(np.float64) * factor * 2.0**exposure)
            expected[0, 0], expected[0, 1:3], expected[0, [3, 5]] = (255, 0, 255), (0, 225, 255), (255, 200, 0)
            difference = np.abs(shown - expected)
            check(f"{image}: every pixel, the marks in their colours", difference.max() <= 1, np.argwhere(difference > 1)[:5].tolist())
            section.query_selector(".viewer-modes [data-mode=signed]").click()
            settle(opened)
            marks = painted(section)[1][0, [0, 1, 3]]
            check(f"{image}: marks stay in the error", marks.tolist() == [[255, 0, 255], [0, 225, 255], [255, 200, 0]], marks.tolist())
            stage = section.query_selector(".viewer-stage")
            stage.scroll_into_view_if_needed()
            box = stage.bounding_box()
            cell = box["width"] / SIZE
            for column, texts in [(0, ["NaN"]), (1, ["inf"]), (2, ["−inf"]), (3, ["≥ "]), (5, ["≤ −"])]:
                opened.page.mouse.move(box["x"] + (column + 0.5) * cell, box["y"] + 0.5 * cell)
                settle(opened)
                readout = section.query_selector(".viewer-readout").inner_text()
                check(f"{image}: pixel {column}, 0 says {texts[0].strip()}", f"Pixel {column}, 0" in readout and all(t in readout for t in texts), readout)
            opened.page.mouse.move(box["x"] + 7.5 * cell, box["y"] + 9.5 * cell)
            settle(opened)
            row = section.query_selector_all(".viewer-readout tbody tr")[1].inner_text().split()[1:]
            read = [float(v.replace("−", "-")) for v in row]
            check(f"{reference}: the reference's pixel", np.allclose(read, pixels[9, 7] * factor, rtol=1e-3), (read, pixels[9, 7]))
            check(f"{image}: silent", not opened.told and not opened.asked, opened.told + opened.asked)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("folder", type=pathlib.Path)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    check = Check("compare")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        renders(check, browser, arguments.program, arguments.folder)
        unusual(check, browser, arguments.program, arguments.folder)
        browser.close()
    print(f"{len(check.failed)} checks failed" if check.failed else "every check passed")
    return 1 if check.failed else 0


if __name__ == "__main__":
    sys.exit(main())
