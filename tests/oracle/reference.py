#!/usr/bin/env python3
"""References by Mitsuba 3: the mean and the variance of the mean over independent runs.

  reference.py SCENE.xml -o NAME [--runs 16] [--spp 64] [--max-depth D] [--width W --height H] [-D name=value]
  reference.py --manifest tests/scenes/manifest.json [--only NAME...] [--force]

writes NAME.mean.exr, NAME.var.exr (the sample variance between runs over the number of runs, per pixel and channel) and
NAME.json (settings, hash of the scene and of every file it names, mean and its standard error). Every sample must fall
into one pixel: the film is given a box filter, the sampler `independent`, the components 32-bit floats, whatever the
scene says. With --manifest every scene listed there that has no up-to-date reference is rendered with its own settings.
"""
import argparse
import hashlib
import json
import os
import sys
import time
import xml.etree.ElementTree as ET

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import exr  # noqa: E402

WAVEFRONT = 1 << 23  # samples per launch of a vectorised variant


def prepared(path, width, height):
    """The scene's XML with a film that keeps pixels independent."""
    root = ET.parse(path).getroot()
    sensors = [s for s in root.iter("sensor")]
    if not sensors:
        raise ValueError(f"{path}: no <sensor> in the file itself")
    for s in sensors:
        film = s.find("film")
        if film is None:
            film = ET.SubElement(s, "film")
        film.set("type", "hdrfilm")
        drop = {"component_format", "pixel_format", "file_format", "sample_border"}
        size = {"width": width, "height": height} if width or height else {}
        if size:
            drop |= {"width", "height", "crop_offset_x", "crop_offset_y", "crop_width", "crop_height"}
        for child in list(film):
            if child.tag == "rfilter" or child.get("name") in drop:
                film.remove(child)
        ET.SubElement(film, "rfilter", type="box")
        ET.SubElement(film, "string", name="component_format", value="float32")
        ET.SubElement(film, "string", name="pixel_format", value="rgb")
        for name, value in size.items():
            ET.SubElement(film, "integer", name=name, value=str(value))
        for child in s.findall("sampler"):
            s.remove(child)
        ET.SubElement(s, "sampler", type="independent")
    return ET.tostring(root, encoding="unicode")


def content_hash(path):
    """SHA-256 over the scene file and every file named in it (includes are followed)."""
    h, seen, queue = hashlib.sha256(), set(), [os.path.abspath(path)]
    base = os.path.dirname(queue[0])
    while queue:
        f = queue.pop(0)
        if f in seen or not os.path.isfile(f):
            continue
        seen.add(f)
        with open(f, "rb") as fh:
            data = fh.read()
        h.update(os.path.relpath(f, base).encode() + b"\0" + data)
        if f.endswith(".xml"):
            for e in ET.fromstring(data).iter():
                name = e.get("filename") if e.tag == "include" else e.get("value") if e.get("name") == "filename" else None
                if name:
                    queue.append(os.path.join(base, name))
    return h.hexdigest()


def render(path, runs, spp, seed=0, max_depth=None, rr_depth=5, hide_emitters=False, width=None, height=None, variant="llvm_ad_rgb",
           defines=(), integrator="path", keep=None, threads=1):
    import drjit as dr
    import mitsuba as mi
    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)
    folder = os.path.dirname(os.path.abspath(path))
    mi.file_resolver().prepend(folder)
    dr.set_thread_count(max(2, threads))  # an environment map never finishes loading on one thread
    scene = mi.load_string(prepared(path, width, height), **dict(d.split("=", 1) for d in defines))
    dr.set_thread_count(threads)
    if max_depth is None:
        inside = scene.integrator()
    else:
        inside = mi.load_dict({"type": integrator, "max_depth": max_depth, "rr_depth": rr_depth, "hide_emitters": hide_emitters})
    film = scene.sensors()[0].film()
    w, h = (int(x) for x in film.crop_size())
    per = spp if variant.startswith("scalar") else max(1, min(spp, WAVEFRONT // (w * h)))
    parts = [per] * (spp // per) + ([spp % per] if spp % per else [])
    if keep:
        os.makedirs(os.path.dirname(os.path.abspath(keep)), exist_ok=True)
    images, bad, cpu, wall = [], 0, time.process_time(), time.perf_counter()
    for i in range(runs):
        total = np.zeros((h, w, 3))
        for j, n in enumerate(parts):
            img = mi.render(scene, integrator=inside, spp=n, seed=(seed * runs + i) * len(parts) + j)
            total += np.array(img, dtype=np.float64)[..., :3] * n
        image = total / spp
        finite = np.isfinite(image)
        bad += int((~finite).sum())
        image[~finite] = 0
        images.append(image)
        if keep:
            exr.write(f"{keep}.{i:02d}.exr", image)
    images = np.stack(images)
    mean, var = images.mean(0), images.var(0, ddof=1) / runs
    run_means = images.mean((1, 2))
    tile = 16
    rows, cols = range(0, h, tile), range(0, w, tile)
    rel = []
    for r in rows:
        for c in cols:
            t = images[:, r:r + tile, c:c + tile].mean((1, 2, 3))
            if t.mean() > 0:
                rel.append(t.std(ddof=1) / np.sqrt(runs) / t.mean())
    info = {"sha256": content_hash(path), "mitsuba": mi.__version__, "variant": variant, "integrator": " ".join(str(inside).split()),
            "width": w, "height": h, "runs": runs, "spp": spp, "seed": seed, "defines": list(defines), "non_finite": bad,
            "mean": [float(f"{x:.7g}") for x in run_means.mean(0)],
            "mean_stderr": [float(f"{x:.3g}") for x in run_means.std(0, ddof=1) / np.sqrt(runs)],
            "tile_relative_stderr": {"largest": float(f"{max(rel, default=0):.3g}"), "median": float(f"{np.median(rel or [0]):.3g}")},
            "cpu_seconds": round(time.process_time() - cpu, 1), "seconds": round(time.perf_counter() - wall, 1)}
    return mean, var, info


def save(name, mean, var, info):
    os.makedirs(os.path.dirname(os.path.abspath(name)), exist_ok=True)
    exr.write(name + ".mean.exr", mean, runs=info["runs"])
    exr.write(name + ".var.exr", var, runs=info["runs"])
    with open(name + ".json", "w") as f:
        json.dump(info, f, indent=1)
        f.write("\n")


def report(label, info):
    rel = max((e / m for e, m in zip(info["mean_stderr"], info["mean"]) if m), default=0)
    print(f"{label:32s} mean {' '.join('%.5g' % m for m in info['mean'])}  stderr {100*rel:.3f} %  tiles: largest "
          f"{100*info['tile_relative_stderr']['largest']:.2f} % median {100*info['tile_relative_stderr']['median']:.2f} %"
          f"  {info['cpu_seconds']} CPU s" + (f"  NON-FINITE {info['non_finite']}" if info["non_finite"] else ""), flush=True)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("scene", nargs="?")
    p.add_argument("-o", "--out", metavar="NAME")
    p.add_argument("--manifest")
    p.add_argument("--only", nargs="*", default=[])
    p.add_argument("--force", action="store_true", help="with --manifest: also the scenes whose reference is up to date")
    p.add_argument("--runs", type=int, default=16)
    p.add_argument("--spp", type=int, default=64, help="samples per pixel of each run")
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--integrator", default="path", help="with --max-depth: path, ptracer, volpath")
    p.add_argument("--max-depth", type=int, help="default: the scene's own integrator")
    p.add_argument("--rr-depth", type=int, default=5)
    p.add_argument("--hide-emitters", action="store_true")
    p.add_argument("--width", type=int)
    p.add_argument("--height", type=int)
    p.add_argument("--variant", default="llvm_ad_rgb")
    p.add_argument("--threads", type=int, default=1)
    p.add_argument("-D", dest="defines", action="append", default=[], metavar="NAME=VALUE")
    p.add_argument("--exact", type=float, metavar="VALUE", help="no rendering: the image is known to be VALUE everywhere (variance 0)")
    p.add_argument("--keep-runs", action="store_true", help="also NAME.00.exr, NAME.01.exr, ...")
    a = p.parse_args()
    if bool(a.scene) == bool(a.manifest) or bool(a.scene) != bool(a.out) or a.runs < 2:
        p.error("give SCENE and -o NAME, or --manifest; at least two runs")
    if a.scene and a.exact is not None:
        if not (a.width and a.height):
            p.error("--exact needs --width and --height")
        shape = (a.height, a.width, 3)
        save(a.out, np.full(shape, a.exact), np.zeros(shape), {"sha256": content_hash(a.scene), "exact": a.exact, "width": a.width,
                                                              "height": a.height, "runs": a.runs, "mean": [a.exact] * 3, "mean_stderr": [0.0] * 3})
        return
    if a.scene:
        mean, var, info = render(a.scene, a.runs, a.spp, a.seed, a.max_depth, a.rr_depth, a.hide_emitters, a.width, a.height, a.variant,
                                 a.defines, a.integrator, a.out if a.keep_runs else None, a.threads)
        save(a.out, mean, var, info)
        report(os.path.basename(a.out), info)
        return
    with open(a.manifest) as f:
        manifest = json.load(f)
    base = os.path.dirname(os.path.abspath(a.manifest))
    for e in manifest["scenes"]:
        if a.only and e["name"] not in a.only:
            continue
        scene = os.path.join(base, e["scene"])
        name = os.path.join(base, e["reference"])
        if not a.force and os.path.isfile(name + ".json") and os.path.isfile(name + ".var.exr"):
            with open(name + ".json") as f:
                old = json.load(f)
            if all(old[k] == e[k] for k in ("runs", "spp", "seed")) and old["sha256"] == content_hash(scene):
                continue
        mean, var, info = render(scene, e["runs"], e["spp"], e["seed"], variant=a.variant, defines=e.get("defines", []), threads=a.threads)
        save(name, mean, var, info)
        report(e["name"], info)


if __name__ == "__main__":
    main()
