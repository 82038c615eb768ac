"""Image metrics of synthetic pictures by independent implementations, stored in metrics.json and read by the tests of `image::metrics`.

numpy computes the plain metrics, scikit-image SSIM, flip-evaluator FLIP; only the rules for masked pixels, for negative values and for
black references are this script's own, since none of them has any.

Run: python3 tests/oracle/metrics.py > tests/oracle/metrics.json
     python3 tests/oracle/metrics.py --check        compares with the stored numbers; exit 1 if one differs
"""

import json
import pathlib
import sys
import warnings

import flip_evaluator
import numpy as np
from skimage.metrics import structural_similarity

f32 = np.float32
EPSILONS = ["0.01", "0.5"]
SIZES = [(50, 40), (37, 23), (64, 64), (11, 11), (12, 30), (8, 6), (1, 1)]
KINDS = "random noisy dark lamp equal edges fireflies mostly_black black_reference black negative masked".split()


def number(i, salt):
    """Integers 0..65535 from a hash in 64-bit unsigned integers; exact in float32."""
    h = (i.astype(np.uint64) * np.uint64(2654435761) + np.uint64(salt * 40503)) % np.uint64(1 << 32)
    h = (h ^ (h >> np.uint64(15))) * np.uint64(2246822519) % np.uint64(1 << 32)
    return ((h ^ (h >> np.uint64(13))) >> np.uint64(16)).astype(f32)


def pictures(kind, width, height):
    """Reference and image, shape (height, width, 3), float32; every step is exact or one rounded operation."""
    i = np.arange(3 * width * height, dtype=np.int64).reshape(height, width, 3)
    x, y, c = i // 3 % width, i // 3 // width, i % 3
    ramp = (x + 2 * y + 5 * c + 1).astype(f32) / f32(64)
    noisy = ramp * (number(i, 2) / f32(32768))
    if kind == "random":
        return number(i, 1) / f32(16384), number(i, 2) / f32(16384)
    if kind == "noisy":
        return ramp, noisy
    if kind == "dark":
        return ramp / f32(1024), noisy / f32(1024)
    if kind == "lamp":
        lamp = np.where((4 * x >= width) & (2 * x < width) & (4 * y >= height) & (2 * y < height), f32(512), f32(1))
        return ramp * lamp, noisy * lamp
    if kind == "equal":
        return ramp, ramp.copy()
    if kind == "edges":
        board = lambda x: np.where((x // 8 + y // 8) % 2 == 0, f32(1), f32(0.0625))
        return board(x), board(x + 1)
    if kind == "fireflies":
        return ramp, np.where(i % 97 == 5, noisy * f32(1000), noisy)
    if kind == "mostly_black":
        lit = 3 * x >= 2 * width
        return np.where(lit, ramp, f32(0)), np.where(lit | (i % 11 == 0), noisy, f32(0))
    if kind == "black_reference":
        return np.zeros_like(ramp), np.where(y % 3 == 0, noisy, f32(0))
    if kind == "black":
        return np.zeros_like(ramp), np.zeros_like(ramp)
    if kind == "negative":
        return np.where(i % 13 == 0, -ramp, ramp), np.where(i % 7 == 0, -noisy, noisy)
    if kind == "masked":
        p = i // 3
        reference = np.where((p % 41 == 7) & (c == 1), f32("inf"), ramp)
        return reference, np.where((p % 29 == 3) & (c == 2), f32("nan"), noisy)
    raise ValueError(kind)


def srgb(v):
    v = np.clip(v, 0, 1)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)


def plain(r, x, e):
    """Metrics of values that are all finite, float64."""
    d = x - r
    rel = np.sort(d**2 / (r**2 + e))
    s = x + r
    usable = (s > 0) | (x == r)
    relative = np.where(s > 0, d / np.where(s > 0, s / 2, 1), 0) ** 2
    values = {
        "mse": np.mean(d**2),
        "rmse": np.sqrt(np.mean(d**2)),
        "relmse": np.mean(rel),
        "relmse_trimmed": np.mean(rel[: len(rel) - int(np.floor(0.001 * len(rel)))]),
        "mape": np.mean(np.abs(d) / (np.abs(r) + e)),
        "smape": np.mean(2 * np.abs(d) / (np.abs(x) + np.abs(r) + 2 * e)),
        "srrmse": np.sqrt(np.mean(relative[usable])) if usable.any() else None,
    }
    return values, int(np.sum(~usable))


def ssim(r, x, used):
    if min(r.shape[:2]) < 11:
        return None
    luma = lambda v: srgb(v.astype(np.float64) @ [0.212671, 0.715160, 0.072169])
    options = dict(gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1, full=True)
    mean, full = structural_similarity(luma(r), luma(x), **options)
    inside = np.s_[5:-5, 5:-5]
    chosen = full[inside][used[inside]]
    assert not used.all() or abs(np.mean(chosen) - mean) < 1e-12
    return float(np.mean(chosen)) if chosen.size else None


def exposures(r, x, used):
    """The published rule where it applies; else the rules of docs/metrics.md."""
    a, b, c = (n - 0.85 * d for n, d in [(0.36 * 2.51, 0.36 * 2.43), (0.6 * 0.03, 0.6 * 0.59), (0, 0.14)])
    target = max(np.roots([a, b, c]))
    for picture in (r, x):
        luminance = np.sort(picture[used].astype(np.float64) @ [0.2126, 0.7152, 0.0722])
        lit = luminance[luminance > 0]
        if lit.size:
            median = luminance[len(luminance) // 2]
            median = median if median > 0 else lit[len(lit) // 2]
            return float(np.log2(target / luminance[-1])), float(np.log2(target / median))
    return None


def flip(r, x, used):
    r, x = np.maximum(r, 0), np.maximum(x, 0)
    mean = lambda error: float(np.mean(error[..., 0][used], dtype=np.float64))
    error, _, _ = flip_evaluator.evaluate(np.clip(r, 0, 1), np.clip(x, 0, 1), "LDR", inputsRGB=False, applyMagma=False)
    values = {"flip_ldr": mean(error), "exposures": None}
    found = exposures(r, x, used)
    if found is None:
        values["flip"] = 0.0
        return values
    asked = {}
    if not (used.all() and np.median(r.sum(axis=2)) > 0):
        asked = {"startExposure": found[0], "stopExposure": found[1]}
    error, _, told = flip_evaluator.evaluate(r, x, "HDR", applyMagma=False, parameters=asked)
    assert abs(told["startExposure"] - found[0]) < 1e-5 and abs(told["stopExposure"] - found[1]) < 1e-5, (told, found)
    values["flip"] = mean(error)
    values["exposures"] = [*found, told["numExposures"]]
    return values


def case(kind, width, height):
    r, x = pictures(kind, width, height)
    good_r, good_x = np.isfinite(r).all(axis=2), np.isfinite(x).all(axis=2)
    used = good_r & good_x
    found = {"kind": kind, "width": width, "height": height, "masked": int(np.sum(~used))}
    for e in EPSILONS:
        found[e], found["srrmse_left_out"] = plain(r[used].ravel().astype(np.float64), x[used].ravel().astype(np.float64), float(e))
        found[e] = {key: None if value is None else float(value) for key, value in found[e].items()}
    shown_r = np.where(good_r[..., None], r, f32(0))
    shown_x = np.where(used[..., None], x, shown_r)
    found["ssim"] = ssim(shown_r, shown_x, used)
    return found | flip(shown_r, shown_x, used)


def values():
    return {"cases": [case(kind, *size) for kind in KINDS for size in SIZES]}


def differences(stored, found, where=""):
    """Numbers that differ by more than rounding on another processor explains; FLIP's map is single precision."""
    if type(stored) is not type(found):
        yield f"{where}: {stored} is stored, {found} found"
    elif isinstance(stored, dict):
        for key in stored.keys() | found.keys():
            yield from differences(stored.get(key), found.get(key), f"{where}/{key}")
    elif isinstance(stored, list):
        if len(stored) != len(found):
            yield f"{where}: {len(stored)} are stored, {len(found)} found"
        for n, pair in enumerate(zip(stored, found)):
            yield from differences(*pair, f"{where}/{n}")
    elif isinstance(stored, float):
        if abs(stored - found) > (1e-6 if "flip" in where else 1e-9 * abs(stored) + 1e-15):
            yield f"{where}: {stored} is stored, {found} found"
    elif stored != found:
        yield f"{where}: {stored} is stored, {found} found"


if __name__ == "__main__":
    warnings.simplefilter("error")
    if sys.argv[1:] == ["--check"]:
        stored = json.loads(pathlib.Path(__file__).with_suffix(".json").read_text())
        wrong = list(differences(stored, values()))
        print("\n".join(wrong) or f"metrics.json: {len(stored['cases'])} cases are what the independent implementations say")
        sys.exit(1 if wrong else 0)
    print(json.dumps(values(), indent=1))
