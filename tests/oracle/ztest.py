#!/usr/bin/env python3
"""Do the images of a renderer have the reference's mean? A Welch test on tile means over independent runs.

  ztest.py REF.mean.exr RUN1.exr RUN2.exr ...  [--ref-var REF.var.exr] [--tile 16] [--level 0.001] [--cut 0.001]
  ztest.py REF.mean.exr CAND.mean.exr --cand-var CAND.var.exr [--cand-runs K]

The unit is the run: the pixels of a run may be correlated (shared photon maps, Markov chains), so a tile's mean is one
observation per run, and its variance is that between runs. Two images or more of independent seeds are needed; eight or
more are advised. With --cand-var the candidate is a mean with the variance of the mean per pixel, and its pixels must be
independent, as the reference's are.

Each tile and channel gives a p-value; the family is held to --level by Sidak's threshold 1-(1-level)^(1/tests). The
image mean is one more member of the family per channel. A tile of zero variance on both sides (a constant) passes if it
differs by less than 1e-5 of its value (--exact-tolerance). --cut F leaves out the brightest fraction F of the pixels,
chosen by the reference alone (its luminance), from both sides.

Exit status: 0 the test passes, 1 it fails (a p-value map is written, --heat), 2 unusable input. --json prints a document.
"""
import argparse
import json
import os
import sys

import numpy as np
from scipy import stats

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import exr  # noqa: E402


def tile_sums(x, tile):
    rows, cols = np.arange(0, x.shape[-3], tile), np.arange(0, x.shape[-2], tile)
    return np.add.reduceat(np.add.reduceat(x, rows, axis=-3), cols, axis=-2)


def from_pixels(var, mask, count, tile, runs):
    """Variance of tile means and its degrees of freedom (Welch-Satterthwaite), pixels independent."""
    v = tile_sums(var * mask, tile)
    v2 = tile_sums((var * mask) ** 2, tile)
    dof = np.where(v > 0, v * v / np.maximum(v2, 1e-300) * (runs - 1), runs - 1.0)
    return v / np.maximum(count, 1) ** 2, dof


def welch(diff, va, da, vb, db):
    v = va + vb
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(v > 0, diff / np.sqrt(v), 0.0)
        dof = np.where(v > 0, v * v / (va * va / da + vb * vb / db), 1.0)
    return t, dof, np.where(v > 0, 2 * stats.t.sf(np.abs(t), dof), np.nan)


def compare(ref, ref_var, ref_runs, runs=None, cand=None, cand_var=None, cand_runs=None, tile=16, level=1e-3, cut=0.0, tolerance=1e-5):
    """`runs`: (K, H, W, 3) independent images; or `cand`, `cand_var`, `cand_runs`."""
    h, w, _ = ref.shape
    mask = np.ones((h, w, 1))
    if cut > 0:
        lum = ref @ np.array([0.2126, 0.7152, 0.0722])
        k = int(np.floor(cut * h * w + 0.5)) or 1
        mask.reshape(-1)[np.argsort(lum, axis=None)[h * w - k:]] = 0
    non_finite = 0
    out = {}

    def side(size):
        count = tile_sums(mask, size)
        vr, dr = from_pixels(ref_var, mask, count, size, ref_runs)
        rm = tile_sums(ref * mask, size) / np.maximum(count, 1)
        if runs is not None:
            means = tile_sums(np.nan_to_num(runs, nan=0, posinf=0, neginf=0) * mask, size) / np.maximum(count, 1)
            k = len(runs)
            return count, rm, vr, dr, means.mean(0), means.var(0, ddof=1) / k, np.full(rm.shape, k - 1.0)
        vc, dc = from_pixels(cand_var, mask, count, size, cand_runs)
        return count, rm, vr, dr, tile_sums(cand * mask, size) / np.maximum(count, 1), vc, dc

    data = runs if runs is not None else np.stack([cand])
    non_finite = int((~np.isfinite(data)).sum())
    whole = max(h, w)
    results = []
    for size in (tile, whole):
        count, rm, vr, dr, cm, vc, dc = side(size)
        t, dof, p = welch(cm - rm, vc, dc, vr, dr)
        exact = np.isnan(p)
        same = np.abs(cm - rm) <= tolerance * np.maximum(np.abs(rm), 1e-6)
        p = np.where(exact, np.where(same, 1.0, 0.0), p)
        p = np.where(count > 0, p, 1.0)
        results.append((rm, vr, cm, vc, t, dof, p, exact))
    p, whole_p = results[0][6], results[1][6].reshape(3)
    tests = p.size + 3
    threshold = 1 - (1 - level) ** (1 / tests)
    rm, vr, cm, vc, t, dof, _, _ = (x.reshape(3) if x.size == 3 else x for x in results[1])
    # ratio of the means of all channels; its interval from the channel sums, treated as fully correlated (the widest)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = cm / rm
        se = ratio * np.sqrt(vc / cm ** 2 + vr / rm ** 2)
        q = stats.t.ppf(0.975, dof)
        all_ratio = cm.sum() / rm.sum()
        all_se = all_ratio * np.sqrt((np.sqrt(vc).sum() / cm.sum()) ** 2 + (np.sqrt(vr).sum() / rm.sum()) ** 2)
    failed = p < threshold
    inner = p[~results[0][7]]
    out = {
        "pass": bool(not failed.any() and not (whole_p < threshold).any() and not non_finite),
        "runs": None if runs is None else len(runs), "reference_runs": ref_runs, "tile": tile, "level": level, "cut": cut,
        "tests": tests, "threshold": threshold, "failed_tiles": int(failed.any(-1).sum()), "tiles": int(p.shape[0] * p.shape[1]),
        "smallest_p": float(min(p.min(), whole_p.min())), "share_below_0.05": float((inner < 0.05).mean()) if inner.size else None,
        "non_finite": non_finite,
        "mean": {"t": [float(x) for x in t], "p": [float(x) for x in whole_p],
                 "ratio": [float(x) for x in ratio], "interval_95": [[float(r - s * k), float(r + s * k)] for r, s, k in zip(ratio, se, q)],
                 "ratio_all": float(all_ratio), "interval_95_all": [float(all_ratio - q.max() * all_se), float(all_ratio + q.max() * all_se)]},
        "worst": None,
    }
    i = np.unravel_index(np.argmin(p), p.shape)
    rm0, cm0 = results[0][0], results[0][2]
    out["worst"] = {"tile_row": int(i[0]), "tile_column": int(i[1]), "channel": "RGB"[i[2]], "p": float(p[i]),
                    "reference": float(rm0[i]), "candidate": float(cm0[i])}
    return out, p, threshold


def heat_map(path, p, threshold, tile, shape):
    """PNG: grey for unremarkable tiles, orange below 0.05, red below the threshold (smallest p over the channels)."""
    from PIL import Image
    small = p.min(-1)
    level = np.clip(-np.log10(np.maximum(small, 1e-30)) / -np.log10(threshold), 0, 1)
    img = np.empty(small.shape + (3,), dtype=np.uint8)
    img[..., 0] = 60 + 195 * level
    img[..., 1] = 60 + 60 * np.where(small < 0.05, level, 0)
    img[..., 2] = 60
    img[small < threshold] = (255, 0, 0)
    big = img.repeat(tile, 0).repeat(tile, 1)[:shape[0], :shape[1]]
    k = max(1, 384 // max(shape[:2]))
    Image.fromarray(big.repeat(k, 0).repeat(k, 1)).save(path)


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("reference")
    ap.add_argument("images", nargs="+")
    ap.add_argument("--ref-var", help="default: NAME.var.exr beside NAME.mean.exr")
    ap.add_argument("--ref-runs", type=int, help="default: the attribute `runs` of the reference, or NAME.json")
    ap.add_argument("--cand-var")
    ap.add_argument("--cand-runs", type=int)
    ap.add_argument("--tile", type=int, default=16)
    ap.add_argument("--level", type=float, default=1e-3)
    ap.add_argument("--cut", type=float, default=0.0)
    ap.add_argument("--exact-tolerance", type=float, default=1e-5)
    ap.add_argument("--heat", help="default: NAME.pvalues.png of the first image, on failure only")
    ap.add_argument("--json", action="store_true")
    a = ap.parse_args()
    try:
        ref, header = exr.read(a.reference)
        var_path = a.ref_var or a.reference.replace(".mean.exr", ".var.exr")
        if var_path == a.reference:
            raise ValueError("give --ref-var")
        ref_var, _ = exr.read(var_path)
        ref_runs = a.ref_runs or exr.attribute(header, "runs")
        if not ref_runs:
            raise ValueError("the reference does not say its number of runs: give --ref-runs")
        images = np.stack([exr.read(f)[0] for f in a.images])
        if images.shape[1:] != ref.shape or ref_var.shape != ref.shape:
            raise ValueError(f"sizes differ: images {images.shape[2]}x{images.shape[1]}, reference {ref.shape[1]}x{ref.shape[0]}")
        if not (np.isfinite(ref).all() and np.isfinite(ref_var).all()):
            raise ValueError("the reference has values that are not finite")
        kw = dict(tile=a.tile, level=a.level, cut=a.cut, tolerance=a.exact_tolerance)
        if a.cand_var:
            cand_var, h2 = exr.read(a.cand_var)
            cand_runs = a.cand_runs or exr.attribute(h2, "runs")
            if not cand_runs or len(images) != 1:
                raise ValueError("--cand-var needs one image and its number of runs (--cand-runs)")
            out, p, thr = compare(ref, ref_var, int(ref_runs), cand=images[0], cand_var=cand_var, cand_runs=int(cand_runs), **kw)
        else:
            if len(images) < 2:
                raise ValueError("two independent runs at least")
            out, p, thr = compare(ref, ref_var, int(ref_runs), runs=images, **kw)
    except (OSError, ValueError, RuntimeError) as e:
        print(f"ztest: {e}", file=sys.stderr)
        sys.exit(2)
    if not out["pass"] or a.heat:
        path = a.heat or os.path.splitext(a.images[0])[0] + ".pvalues.png"
        heat_map(path, p, thr, a.tile, ref.shape)
        out["heat"] = path
    if a.json:
        print(json.dumps(out, indent=1))
    else:
        m = out["mean"]
        print(f"{'PASS' if out['pass'] else 'FAIL'}  tiles failed {out['failed_tiles']} of {out['tiles']}  smallest p {out['smallest_p']:.3g}"
              f" (threshold {out['threshold']:.3g})  p<.05 {out['share_below_0.05']}")
        print(f"mean ratio {m['ratio_all']:.5f} [{m['interval_95_all'][0]:.5f}, {m['interval_95_all'][1]:.5f}]  "
              f"RGB {' '.join('%.5f' % x for x in m['ratio'])}  p {' '.join('%.3g' % x for x in m['p'])}  non-finite {out['non_finite']}")
        if not out["pass"]:
            b = out["worst"]
            print(f"worst tile ({b['tile_column']}, {b['tile_row']}) {b['channel']}: {b['candidate']:.6g} where the reference has {b['reference']:.6g}"
                  f"; map: {out['heat']}")
    sys.exit(0 if out["pass"] else 1)


if __name__ == "__main__":
    main()
