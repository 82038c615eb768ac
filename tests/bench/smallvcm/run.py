#!/usr/bin/env python3
"""Seconds of processor time an iteration of `vcm` takes in boxes like those of SmallVCM, beside SmallVCM's own figures.

  run.py [--program target/release/isophote] [--against OTHER] [--rounds 5] [--iterations 1 5] [--mitsuba 1e6 | --python PYTHON] [-- OPTION ...]

The settings are SmallVCM's: 512x512, depth 10, one camera and one light path a pixel, one thread. An iteration's time is the difference of two
renders of different lengths, so that start-up, the look at the first vertices and writing the image drop out; user and system time. Programs take
turns, and a ratio comes from one round.

SmallVCM's figures are of another hour, in which the machine was as fast as Mitsuba 3's `path` (scalar_rgb, one thread) says on its own Cornell box:
MITSUBA samples a second. How fast it is now is measured with --python, an interpreter that has Mitsuba, or given with --mitsuba, in samples a
second (tests/bench/mitsuba_speed.py prints it). `ratio` is SmallVCM's time at today's speed over ours. Asked is 2. Without either the
machine is taken to be as fast as then.

Prints JSON.
"""
import argparse
import json
import os
import statistics
import subprocess
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
PIXELS = 512 * 512
# SmallVCM (g++ -O3 -march=native), its built-in scenes 2 and 3: seconds an iteration, one thread, measured for this project on a machine with other
# work on it. Ours have the same walls, balls, lights, view and glossy floor, but for rounding and the floor's lobe.
SMALLVCM = {"point": 2.22, "background": 1.46}
# Mitsuba 3's mi.cornell_box(), `path`, scalar_rgb, in the same hour: samples a second of processor time.
MITSUBA = 0.55e6


def cpu(program, scene, iterations, options, output):
    before = os.times()
    subprocess.run([program, "render", "vcm", scene, "--iterations", str(iterations), "--threads", "1", "-q", "-o", output, *options],
                   stdout=subprocess.DEVNULL, check=True)
    after = os.times()
    return after.children_user - before.children_user + after.children_system - before.children_system


def mitsuba_speed(python):
    scene = os.path.join(HERE, "..", "cornell-box", "scene.xml")
    command = [python, os.path.join(HERE, "..", "mitsuba_speed.py"), scene, "--variants", "scalar_rgb", "--rounds", "3", "--spp", "16"]
    document = json.loads(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout)
    return document["variants"]["scalar_rgb"]["samples_per_cpu_second"]


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--program", default=os.path.join(HERE, "..", "..", "..", "target", "release", "isophote"))
    p.add_argument("--against", help="another program that takes turns")
    p.add_argument("--rounds", type=int, default=5)
    p.add_argument("--iterations", type=int, nargs=2, default=[1, 5], metavar=("FEW", "MANY"))
    p.add_argument("--scenes", nargs="+", default=sorted(SMALLVCM), choices=sorted(SMALLVCM))
    speed = p.add_mutually_exclusive_group()
    speed.add_argument("--mitsuba", type=float, help="samples a second of Mitsuba's `path` now")
    speed.add_argument("--python", help="an interpreter that has Mitsuba, to measure it")
    p.add_argument("options", nargs="*", help="further options of `isophote render vcm`")
    a = p.parse_args()
    few, many = a.iterations
    if not 0 < few < many:
        p.error("--iterations wants two numbers, the smaller first")
    now = mitsuba_speed(a.python) if a.python else a.mitsuba or MITSUBA
    programs = [a.program] + ([a.against] if a.against else [])
    out = {"options": a.options, "mitsuba_samples_per_second": now, "scenes": {}}
    with tempfile.TemporaryDirectory() as folder:
        image = os.path.join(folder, "image.exr")
        for name in a.scenes:
            scene = os.path.join(HERE, name + ".xml")
            rounds = [[(cpu(x, scene, many, a.options, image) - cpu(x, scene, few, a.options, image)) / (many - few) for x in programs]
                      for _ in range(a.rounds)]
            ours = statistics.median(r[0] for r in rounds)
            theirs = SMALLVCM[name] * MITSUBA / now
            result = {"seconds": [round(r[0], 3) for r in rounds], "median": round(ours, 3), "million_paths_per_second": round(2 * PIXELS / ours / 1e6, 3),
                      "smallvcm": round(theirs, 3), "smallvcm_million_paths_per_second": round(2 * PIXELS / theirs / 1e6, 3),
                      "ratio": round(theirs / ours, 2)}
            if a.against:
                result["against"] = {"seconds": [round(r[1], 3) for r in rounds], "median": round(statistics.median(r[1] for r in rounds), 3),
                                     "ours_over_it": round(statistics.median(r[0] / r[1] for r in rounds), 3)}
            out["scenes"][name] = result
    print(json.dumps(out, indent=1))


if __name__ == "__main__":
    main()
