#!/usr/bin/env python3
"""Noise of settings of `sppm` over seeds, per CPU second, one thread.

  noise.py SCENE.xml [--resolution WxH] [--iterations N] [--seeds K] [--reference REF.exr] 'LABEL=OPTIONS'...

For each: CPU seconds a run, light paths a CPU second, the mean over pixels and channels of variance / (r^2 + 0.01) (relMSE without its
bias), that times CPU seconds, NSD, the coefficient of variation of the relative deviation over tiles of 8 x 8 pixels, and the mean image. `r` is the
reference, or the mean of all runs weighted by their noise. Needs numpy and OpenEXR; ISOPHOTE names the binary.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "oracle"))
import exr  # noqa: E402

TILE = 8


def run(binary, scene, options, seed, folder):
    out = os.path.join(folder, "run.exr")
    command = [binary, "render", "sppm", scene, "--threads", "1", "-q", "--json", "--seed", str(seed), "-o", out] + options
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return exr.read(out)[0], json.loads(done.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--resolution", default="96x72")
    parser.add_argument("--iterations", default="24")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--reference")
    parser.add_argument("settings", nargs="+")
    a = parser.parse_args()
    binary = os.environ.get("ISOPHOTE", "target/release/isophote")
    images, cpu, paths = {}, {}, {}
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(1, a.seeds + 1):
            for setting in a.settings:
                label, options = setting.split("=", 1)
                common = ["--resolution", a.resolution, "--iterations", a.iterations, "--alpha", "1"]
                image, record = run(binary, a.scene, common + options.split(), seed, folder)
                images.setdefault(label, []).append(image)
                cpu[label] = cpu.get(label, 0) + record["cpu_seconds"]
                paths[label] = paths.get(label, 0) + record["light_paths"]
    stacks = {label: np.array(runs) for label, runs in images.items()}
    if a.reference:
        r = exr.read(a.reference)[0]
    else:
        weight = {label: 1 / s.var(axis=0, ddof=1).mean() for label, s in stacks.items()}
        r = sum(weight[label] * s.mean(axis=0) for label, s in stacks.items()) / sum(weight.values())
    print(f"{'':16s} {'CPU s':>6s} {'Mpaths/s':>8s} {'noise':>9s} {'x CPU s':>9s} {'nsd':>6s} {'cv':>5s} {'mean':>8s}")
    for label, stack in stacks.items():
        variance = stack.var(axis=0, ddof=1)
        noise, seconds = (variance / (r * r + 0.01)).mean(), cpu[label] / a.seeds
        nsd = np.mean(np.sqrt(variance.mean(axis=2)) / np.maximum(stack.mean(axis=(0, 3)), 1e-9))
        relative = np.sqrt(variance.mean(axis=2)) / np.maximum(r.mean(axis=2), 1e-6)
        h, w = (n // TILE * TILE for n in relative.shape)
        tiles = relative[:h, :w].reshape(h // TILE, TILE, w // TILE, TILE).mean(axis=(1, 3))
        means = stack.mean(axis=(1, 2, 3))
        print(f"{label:16s} {seconds:6.2f} {paths[label] / cpu[label] / 1e6:8.3f} {noise:9.3g} {noise * seconds:9.3g} {nsd:6.3f} "
              f"{tiles.std() / tiles.mean():5.2f} {means.mean():8.4f} +- {means.std(ddof=1) / a.seeds ** 0.5:.4f}", flush=True)


if __name__ == "__main__":
    main()
