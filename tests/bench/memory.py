#!/usr/bin/env python3
"""Memory for each measurement point: how the largest resident memory of `sppm` grows with the film.

  memory.py SCENE.xml [--sizes 256x192,1024x768] [--photons 100000] [--samplers uniform,visibility,spatial] [--iterations 2]

Prints JSON: per sampler the peak bytes at both sizes and the bytes a pixel between them, and the same less `uniform`'s, which keeps no points (its film
and its image in the file are in it): what a measurement point costs where each pixel has one, with everything that is kept or built for it.
"""
import argparse
import json
import os
import subprocess
import tempfile
import time

import runs


def peak(command):
    """Largest resident memory, read while the process runs: what is told of it after its end counts this script's own memory too."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    highest = 0
    while process.poll() is None:
        with open(f"/proc/{process.pid}/status") as f:
            highest = max([highest, *(1024 * int(line.split()[1]) for line in f if line.startswith("VmHWM"))])
        time.sleep(0.002)
    if process.returncode:
        raise SystemExit(f"{' '.join(command)}\nended with {process.returncode}")
    return highest


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("scene")
    p.add_argument("--program", default=os.environ.get("ISOPHOTE", "target/release/isophote"))
    p.add_argument("--sizes", default="256x192,1024x768")
    p.add_argument("--photons", default="100000")
    p.add_argument("--samplers", default="uniform,visibility,spatial")
    p.add_argument("--iterations", type=int, default=2)
    a = p.parse_args()
    sizes = a.sizes.split(",")
    if len(sizes) != 2:
        p.error("--sizes takes two films, as in 256x192,1024x768")
    pixels = [int(w) * int(h) for w, h in (s.split("x") for s in sizes)]
    program, found = runs.Program(a.program), {}
    with tempfile.TemporaryDirectory() as folder:
        for sampler in a.samplers.split(","):
            options = [["--resolution", size, "--photons", a.photons, "--sampler", sampler] for size in sizes]
            peaks = [peak(program.command(a.scene, o, 1, a.iterations, os.path.join(folder, "image.exr"))) for o in options]
            found[sampler] = {"peak_bytes": peaks, "bytes_per_pixel": round((peaks[1] - peaks[0]) / (pixels[1] - pixels[0]), 1)}
    if "uniform" in found:
        for values in found.values():
            values["less_uniform"] = round(values["bytes_per_pixel"] - found["uniform"]["bytes_per_pixel"], 1)
    print(json.dumps({"scene": a.scene, "sizes": sizes, "photons": a.photons, "iterations": a.iterations, "samplers": found}, indent=1))


if __name__ == "__main__":
    main()
