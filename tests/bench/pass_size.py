#!/usr/bin/env python3
"""Light paths an iteration against noise, with normalisations pooled over iterations and of each iteration alone, at equal total paths.

  pass_size.py SCENE.xml --reference NAME.mean.exr [--paths 4000000] [--sizes 50000,...] [--seeds 4] [--sampler spatial] [--program PROGRAM]

For each size and way: CPU seconds (median), the mean relMSE with its standard error over seeds, the mean reported relative standard error of
the last rung's b in the run's last iteration, and the relative deviation of that b over seeds. Settings: alpha 1, one thread, chains never rest. A
size's iterations are the total over the size, rounded. Camera subpaths are one a pixel an iteration: small sizes see the picture more often,
and pay for it. relMSE is as of `isophote compare`, nothing subtracted.
"""
import argparse
import os
import tempfile

import numpy as np

import runs


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("scene")
    p.add_argument("--reference", required=True)
    p.add_argument("--paths", type=int, default=4_000_000)
    p.add_argument("--sizes", default="50000,100000,200000,500000,1000000,2000000")
    p.add_argument("--seeds", type=int, default=4)
    p.add_argument("--sampler", default="spatial")
    p.add_argument("--program", default=os.environ.get("ISOPHOTE", "target/release/isophote"))
    a = p.parse_args()
    program, reference = runs.Program(a.program), runs.Reference(a.reference)
    print(f"{'size':>9} {'way':<7} {'CPU s':>7} {'relMSE':>9} {'+-':>8} {'s.e. b':>8} {'spread b':>8}")
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "run.exr")
        for size in map(int, a.sizes.split(",")):
            for way in ("pooled", "pass"):
                options = ["--resolution", reference.size, "--sampler", a.sampler, "--photons", str(size), "--alpha", "1", "--rest", "never", "--normaliser", way]
                seconds, errors, reported, b = [], [], [], []
                for seed in range(1, a.seeds + 1):
                    document = program.render(a.scene, options, seed, max(1, round(a.paths / size)), out)
                    last = document["diagnostics"]["sampler"]["rungs"][-1]
                    seconds.append(document["cpu_seconds"])
                    errors.append(reference.errors(runs.exr.read(out)[0])["relmse"])
                    reported.append(last["normalisation_relative_error"] or float("nan"))
                    b.append(last["normalisation"])
                spread = np.std(b, ddof=1) / np.mean(b)
                error = np.std(errors, ddof=1) / len(errors) ** 0.5
                print(f"{size:9} {way:<7} {np.median(seconds):7.2f} {np.mean(errors):9.4g} {error:8.2g} {np.mean(reported):8.3f} {spread:8.3f}", flush=True)


if __name__ == "__main__":
    main()
