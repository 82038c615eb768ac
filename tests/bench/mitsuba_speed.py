#!/usr/bin/env python3
"""Times Mitsuba's `path` on one thread, alone or against another renderer, round by round.

  mitsuba_speed.py SCENE.xml [--spp 64] [--rounds 5] [--width W --height H] [--variants scalar_rgb,llvm_ad_rgb]
                   [--vs 'COMMAND']

Settings: max_depth 8, rr_depth 5, box filter. What is timed is the process's CPU time of rendering: loading the scene and
compiling kernels (a full render is made first) are left out. With --vs each round also runs COMMAND, which must print a
JSON document with the key `cpu_seconds` on standard output (as `isophote render ... --json` does); since the two alternate,
a ratio comes from one round, and drifts of the machine cancel. {spp}, {width} and {height} in COMMAND are filled in.

Prints JSON: per variant `cpu_seconds` of every round, their median, `samples_per_cpu_second`; and under `vs` the same for
COMMAND, with `ratio` = COMMAND's samples per CPU second over the variant's (median of the rounds' ratios, and their range).
Each variant runs in a process of its own.
"""
import argparse
import json
import os
import shlex
import statistics
import subprocess
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "oracle"))


def worker(a):
    """Renders once per line read from standard input; prints one JSON line each time."""
    import drjit as dr
    import mitsuba as mi
    import numpy as np
    import reference
    mi.set_variant(a.worker)
    mi.set_log_level(mi.LogLevel.Error)
    mi.file_resolver().prepend(os.path.dirname(os.path.abspath(a.scene)))
    scene = mi.load_string(reference.prepared(a.scene, a.width, a.height))
    integrator = mi.load_dict({"type": "path", "max_depth": a.max_depth, "rr_depth": a.rr_depth})
    if a.worker.startswith("llvm"):
        dr.set_thread_count(1)  # only now: an environment map never finishes loading on one thread
    w, h = (int(x) for x in scene.sensors()[0].film().crop_size())

    def once(spp, seed):
        c, t = time.process_time(), time.perf_counter()
        image = np.array(mi.render(scene, integrator=integrator, spp=spp, seed=seed))
        return time.process_time() - c, time.perf_counter() - t, float(image.mean())

    once(a.spp, 1000)
    once(a.spp, 1001)
    print(json.dumps({"width": w, "height": h}), flush=True)
    for k, _ in enumerate(sys.stdin):
        cpu, wall, mean = once(a.spp, k)
        print(json.dumps({"cpu_seconds": cpu, "seconds": wall, "mean": mean}), flush=True)


class Renderer:
    """Mitsuba in a process of its own, warm: `render` renders once more and gives what `worker` says of it; `size` is the film's."""

    def __init__(self, variant, scene, options):
        # scalar variants take their number of threads from the size of Mitsuba's pool: pin them to one processor
        cpu = sorted(os.sched_getaffinity(0))[-1]
        pin = (lambda: os.sched_setaffinity(0, {cpu})) if variant.startswith("scalar") else None
        self.variant = variant
        self.process = subprocess.Popen([sys.executable, os.path.abspath(__file__), scene, "--worker", variant, *options], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True, preexec_fn=pin)
        first = self.process.stdout.readline()
        if not first:
            sys.exit(f"{variant} did not start")
        self.size = json.loads(first)

    def render(self):
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            sys.exit(f"{self.variant} stopped")
        return json.loads(line)

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def summary(rounds, samples):
    cpu = [r["cpu_seconds"] for r in rounds]
    return {"cpu_seconds": [round(c, 4) for c in cpu], "median_cpu_seconds": round(statistics.median(cpu), 4),
            "samples_per_cpu_second": round(samples / statistics.median(cpu), 1)}


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("scene")
    p.add_argument("--spp", type=int, default=64)
    p.add_argument("--rounds", type=int, default=5)
    p.add_argument("--width", type=int)
    p.add_argument("--height", type=int)
    p.add_argument("--max-depth", type=int, default=8)
    p.add_argument("--rr-depth", type=int, default=5)
    p.add_argument("--variants", default="scalar_rgb,llvm_ad_rgb")
    p.add_argument("--vs", metavar="COMMAND")
    p.add_argument("--worker", help=argparse.SUPPRESS)
    a = p.parse_args()
    if a.worker:
        return worker(a)
    names = [v for v in a.variants.split(",") if v]
    options = ["--spp", str(a.spp), "--max-depth", str(a.max_depth), "--rr-depth", str(a.rr_depth)]
    options += [x for k in ("width", "height") if getattr(a, k) for x in (f"--{k}", str(getattr(a, k)))]
    procs = {v: Renderer(v, a.scene, options) for v in names}
    size = next(iter(procs.values())).size
    samples = size["width"] * size["height"] * a.spp
    times = {v: [] for v in names}
    other = []
    command = shlex.split(a.vs.replace("{spp}", str(a.spp)).replace("{width}", str(size["width"])).replace("{height}", str(size["height"]))) if a.vs else None
    for _ in range(a.rounds):
        for v in names:
            times[v].append(procs[v].render())
        if command:
            done = subprocess.run(command, stdout=subprocess.PIPE, text=True)
            if done.returncode:
                sys.exit(f"{command[0]} ended with {done.returncode}")
            try:
                other.append({"cpu_seconds": float(json.loads(done.stdout)["cpu_seconds"])})
            except (ValueError, KeyError, TypeError) as e:
                sys.exit(f"{command[0]} printed no JSON document with cpu_seconds: {e!r}")
    for renderer in procs.values():
        renderer.close()
    out = {"scene": a.scene, **size, "spp": a.spp, "max_depth": a.max_depth, "rr_depth": a.rr_depth, "threads": 1, "rounds": a.rounds,
           "variants": {v: {**summary(times[v], samples), "image_mean": times[v][-1]["mean"]} for v in names}}
    if command:
        out["vs"] = {"command": a.vs, **summary(other, samples), "ratio": {}}
        for v in names:
            r = [m["cpu_seconds"] / o["cpu_seconds"] for m, o in zip(times[v], other)]
            out["vs"]["ratio"][v] = {"median": round(statistics.median(r), 4), "lowest": round(min(r), 4), "highest": round(max(r), 4)}
    print(json.dumps(out, indent=1))


if __name__ == "__main__":
    main()
