#!/usr/bin/env python3
"""Noise for CPU time, and light paths a CPU second, beside the papers' own code, whose numbers stand in samplers.toml under [peers].

  peers.py [--samplers uniform,spatial,image] [--only SCENE,...] [--seeds N] -o FOLDER

Our CPU seconds are brought to their machine's by Mitsuba 3's scalar_rgb `path` on mi.cornell_box(), measured here before and after every scene
(mitsuba_speed.py): seconds there = seconds here * samples a CPU second here / samples a CPU second there. The budget is theirs, so each
sampler gets as many iterations as take theirs' 15 seconds; what mismatch is left is corrected by (seconds / 15)^(alpha/2), as a
deviation falls.

Noise is theirs: the standard deviation over seeds divided by the mean, averaged over pixels, here over channels as well (`mean` is that of the
channels' average, which is lower). A root of an unbiased variance is too small for few seeds: it is divided by c4(seeds), and the quotient with its
jackknife interval decides. Paths, start-up and burn-in included, a CPU second of their machine over the scenes: lowest and highest beside their
lowest and highest, which come from five scenes, three of them these.

Exit status 1 if a mark is missed or undecided. A scene that is not there is left out, and said.
"""
import argparse
import json
import os
import subprocess
import sys

import numpy as np
from scipy import special

import paired
import runs


def say(text):
    print(text, file=sys.stderr, flush=True)


def mitsuba_speed(spp, rounds):
    """Samples a CPU second of scalar_rgb `path` on the Cornell box of mi.cornell_box()."""
    box = os.path.join(runs.HERE, "cornell-box", "scene.xml")
    command = [sys.executable, os.path.join(runs.HERE, "mitsuba_speed.py"), box, "--width", "256", "--height", "256", "--spp", str(spp), "--rounds", str(rounds), "--variants", "scalar_rgb"]
    document = json.loads(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout)
    return document["variants"]["scalar_rgb"]["samples_per_cpu_second"]


def c4(seeds):
    """Mean of the root of the unbiased variance of normal numbers, over their standard deviation."""
    return float(np.sqrt(2 / (seeds - 1)) * np.exp(special.gammaln(seeds / 2) - special.gammaln((seeds - 1) / 2)))


def kept(file):
    if not os.path.exists(file):
        return None
    with open(file) as f:
        return json.load(f)


def measure(name, scene, peers, a, program):
    """One scene: rounds to their end, Mitsuba before and after."""
    folder = os.path.join(a.output, name)
    os.makedirs(folder, exist_ok=True)
    file = os.path.join(folder, "mitsuba.json")
    speeds = kept(file) or [mitsuba_speed(a.spp, a.rounds)]
    with open(file, "w") as f:
        json.dump(speeds, f)
    there = peers["mitsuba_samples_per_cpu_second"]
    seconds = a.cpu_seconds or peers["cpu_seconds"]
    plan = runs.plan()
    variants = {s: [*peers["options"].split(), *plan["variants"][s].split()] for s in a.samplers.split(",")}
    say(f"{name}: Mitsuba makes {speeds[0] / 1e6:.3f} Msamples a CPU second; calibrating")
    rounds = runs.Rounds(program, scene, variants, folder, budget=seconds * there / speeds[0], say=say)
    new = len(rounds.rounds) < a.seeds
    while len(rounds.rounds) < a.seeds:
        rounds.add()
    if new:
        speeds.append(mitsuba_speed(a.spp, a.rounds))
        with open(file, "w") as f:
            json.dump(speeds, f)
    factor = float(np.mean(speeds)) / there
    told = ", ".join(f"{s / 1e6:.3f}" for s in speeds)
    print(f"\n{name}: {len(rounds.rounds)} seeds; Mitsuba {told} Msamples a CPU second: a second here is {factor:.2f} there")
    if max(speeds) > 1.15 * min(speeds):
        print("  note: Mitsuba's speed moved by more than 15 %: measure again on a quieter machine")
    return [row(name, sampler, rounds, factor, seconds, peers) for sampler in variants]


def row(name, sampler, rounds, factor, seconds, peers):
    stack = rounds.stack(sampler)
    cpu = rounds.column(sampler, "cpu_seconds") * factor
    alpha = float(rounds.column(sampler, "alpha")[0])
    correction = lambda keep: np.mean((cpu[keep] / seconds) ** alpha) ** 0.5 / c4(len(stack[keep]))
    everything = np.arange(len(stack))
    theirs = peers["noise"][name].get(sampler)
    interval = paired.jackknife(lambda keep: runs.nsd(stack[keep]) * correction(keep) / theirs, len(stack))
    mark = peers["marks"].get(sampler)
    found = {"scene": name, "sampler": sampler, "seeds": len(stack), "iterations": rounds.iterations[sampler],
             "cpu_seconds": float(np.median(cpu / factor)), "scaled_cpu_seconds": float(np.median(cpu)), "factor": factor, "nsd_as_rendered": runs.nsd(stack),
             "nsd": float(runs.nsd(stack) * correction(everything)),
             "nsd_of_channels_mean": float(runs.nsd(stack.mean(axis=3, keepdims=True)) * correction(everything)),
             "theirs": theirs, "ratio": vars(interval) if interval else None, "mark": mark, "verdict": paired.verdict(interval, mark) if mark else "-",
             "paths_per_scaled_cpu_second": float(np.median(rounds.column(sampler, "light_paths") / cpu))}
    print(f"  {sampler:10s} {found['scaled_cpu_seconds']:6.2f} s there ({found['cpu_seconds']:.2f} here, {found['iterations']} iterations), noise {found['nsd']:.4f} "
          f"(mean {found['nsd_of_channels_mean']:.4f}), theirs {theirs}: {paired.show(interval)}, mark {mark or '-'}: {found['verdict']}; "
          f"{found['paths_per_scaled_cpu_second'] / 1e3:.0f} kpaths/s", flush=True)
    if abs(found["scaled_cpu_seconds"] / seconds - 1) > 0.1:
        print(f"  note: {sampler} took {found['scaled_cpu_seconds'] / seconds:.2f} of the budget: its noise is corrected by more than it should be")
    return found


def paths(rows, peers):
    """Lowest and highest number of paths a second over the scenes, beside theirs."""
    found = []
    print("\nthousand light paths a CPU second of their machine")
    for sampler in dict.fromkeys(r["sampler"] for r in rows):
        ours = [r["paths_per_scaled_cpu_second"] / 1e3 for r in rows if r["sampler"] == sampler]
        low, high = peers["paths"][sampler]
        ratios = min(ours) / low, max(ours) / high
        verdict = "met" if min(ratios) >= peers["paths_mark"] else "missed"
        print(f"  {sampler:10s} {min(ours):.0f} to {max(ours):.0f}, theirs {low} to {high}: {ratios[0]:.2f} and {ratios[1]:.2f} times, "
              f"mark {peers['paths_mark']:g}: {verdict}")
        found.append({"sampler": sampler, "lowest": min(ours), "highest": max(ours), "theirs": [low, high], "ratios": ratios, "verdict": verdict})
    return found


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--program", default=os.environ.get("ISOPHOTE", "target/release/isophote"))
    p.add_argument("--samplers", default="uniform,spatial,image")
    p.add_argument("--only")
    p.add_argument("--seeds", type=int)
    p.add_argument("--cpu-seconds", type=float, help="another budget than theirs, to try the script; its numbers say nothing")
    p.add_argument("--spp", type=int, default=32, help="of Mitsuba's renders")
    p.add_argument("--rounds", type=int, default=3, help="of Mitsuba's renders")
    p.add_argument("-o", "--output", metavar="FOLDER", required=True)
    a = p.parse_args()
    peers = runs.plan()["peers"]
    a.seeds = a.seeds or peers["seeds"]
    program, rows = runs.Program(a.program), []
    for name, scene in peers["scenes"].items():
        scene = runs.from_root(scene)
        if a.only and name not in a.only.split(","):
            continue
        if not os.path.exists(scene):
            print(f"{name}: LEFT OUT, {scene} is not there")
            continue
        rows += measure(name, scene, peers, a, program)
    if not rows:
        return 2
    speed = paths(rows, peers)
    with open(os.path.join(a.output, "peers.json"), "w") as f:
        json.dump({"program_sha256": program.hash, "noise": rows, "paths": speed}, f, indent=1)
    return any(x["verdict"] not in ("met", "-") for x in rows + speed)


if __name__ == "__main__":
    sys.exit(main())
