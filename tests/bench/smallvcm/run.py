#!/usr/bin/env python3
"""Processor time an iteration of `vcm` takes in boxes like those of SmallVCM, beside SmallVCM's own figures.

  run.py [--program target/release/isophote] [--against OTHER] [--rounds 15] [--iterations 1 4] [--scenes point background] [-- OPTION ...]

Needs numpy, scipy and Mitsuba 3. The settings are SmallVCM's: 512x512, depth 10, one camera and one light path a pixel, one thread. An
iteration's time is the difference of two renders of different lengths, so that start-up, the look at the first vertices and writing the image
drop out; user and system time.

SmallVCM's figures are of another hour, in which the machine was as fast as Mitsuba 3's `path` (scalar_rgb, one thread) says on its own Cornell box:
MITSUBA samples a second. In every round Mitsuba renders that box before and after the programs, which take turns between; a round's ratio is
SmallVCM's time, at the speed of these two, over ours. Printed is the geometric mean of the rounds' ratios with its 95 % interval, and the
verdict on 2, what is asked.

Prints JSON.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, ".."))
import paired  # noqa: E402
from mitsuba_speed import Renderer  # noqa: E402

PIXELS = 512 * 512
# SmallVCM (g++ -O3 -march=native), its built-in scenes 2 and 3: seconds an iteration, one thread, measured for this project on a machine with other
# work on it. Ours have the same walls, balls, lights, view and glossy floor, but for rounding and the floor's lobe.
SMALLVCM = {"point": 2.22, "background": 1.46}
# Mitsuba 3's mi.cornell_box(), `path`, scalar_rgb, in the same hour: samples a second of processor time.
MITSUBA = 0.55e6
MITSUBA_SPP = 8
ASKED = 2.0


def cpu(program, scene, iterations, options, output):
    before = os.times()
    subprocess.run([program, "render", "vcm", scene, "--iterations", str(iterations), "--threads", "1", "-q", "-o", output, *options],
                   stdout=subprocess.DEVNULL, check=True)
    after = os.times()
    return after.children_user - before.children_user + after.children_system - before.children_system


def summary(name, ours, theirs, others):
    """Of all rounds: our seconds, SmallVCM's at the machine's speed in each, those of another program if there is one."""
    ratio = paired.ratio(theirs, ours)
    # At least so much is at most so much of the inverse.
    inverse = paired.ratio(ours, theirs)
    ours_median, theirs_median = statistics.median(ours), statistics.median(theirs)
    out = {"seconds": [round(s, 3) for s in ours], "median": round(ours_median, 3),
           "million_paths_per_second": round(2 * PIXELS / ours_median / 1e6, 3),
           "smallvcm": {"seconds": round(theirs_median, 3), "million_paths_per_second": round(2 * PIXELS / theirs_median / 1e6, 3)},
           "ratio": paired.show(ratio), "asked": ASKED, "verdict": paired.verdict(inverse, 1 / ASKED)}
    if others:
        out["against"] = {"median": round(statistics.median(others), 3), "ours_over_it": paired.show(paired.ratio(ours, others))}
    return {name: out}


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--program", default=os.path.join(HERE, "..", "..", "..", "target", "release", "isophote"))
    p.add_argument("--against", help="another program that takes turns")
    p.add_argument("--rounds", type=int, default=15)
    p.add_argument("--iterations", type=int, nargs=2, default=[1, 4], metavar=("FEW", "MANY"))
    p.add_argument("--scenes", nargs="+", default=sorted(SMALLVCM), choices=sorted(SMALLVCM))
    p.add_argument("options", nargs="*", help="further options of `isophote render vcm`")
    a = p.parse_args()
    few, many = a.iterations
    if not 0 < few < many:
        p.error("--iterations wants two numbers, the smaller first")
    programs = [a.program] + ([a.against] if a.against else [])
    mitsuba = Renderer("scalar_rgb", os.path.join(HERE, "..", "cornell-box", "scene.xml"), ["--spp", str(MITSUBA_SPP)])
    samples = mitsuba.size["width"] * mitsuba.size["height"] * MITSUBA_SPP
    speeds = []
    times = {name: [[] for _ in programs] for name in a.scenes}
    theirs = {name: [] for name in a.scenes}
    with tempfile.TemporaryDirectory() as folder:
        image = os.path.join(folder, "image.exr")
        for turn in range(a.rounds):
            for name in a.scenes:
                scene = os.path.join(HERE, name + ".xml")
                around = [mitsuba.render()["cpu_seconds"]]
                numbers = range(len(programs))
                for k in (numbers if turn % 2 == 0 else reversed(numbers)):
                    took = [cpu(programs[k], scene, n, a.options, image) for n in (few, many)]
                    times[name][k].append((took[1] - took[0]) / (many - few))
                around.append(mitsuba.render()["cpu_seconds"])
                speeds.append(samples / statistics.mean(around))
                theirs[name].append(SMALLVCM[name] * MITSUBA / speeds[-1])
    mitsuba.close()
    out = {"options": a.options, "rounds": a.rounds, "mitsuba_samples_per_second": round(statistics.median(speeds)), "scenes": {}}
    for name in a.scenes:
        out["scenes"].update(summary(name, times[name][0], theirs[name], times[name][1] if a.against else None))
    print(json.dumps(out, indent=1))


if __name__ == "__main__":
    main()
