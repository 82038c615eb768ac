#!/usr/bin/env python3
"""Two threads of one process against two processes of one thread side by side, round by round.

  scaling.py [--program target/release/isophote] [--rounds 5] [--iterations 64] [--whole] -- path SCENE.xml [OPTION ...]

Each round renders N iterations on two threads, and, at once, N/2 iterations in each of two processes on one thread each: the same
work. With --whole each of the two processes renders all N, with a seed of its own, and two threads render both, one after the other: for
methods that cannot begin in the middle, such as `sppm` with a Metropolis sampler, whose start-up and updates are then in both. Compared is
the render time alone (`seconds` of --json), without loading. Since the two alternate, drifts of the machine cancel.

Prints JSON: the seconds of every round and `ratio` = what two threads reach of what two processes reach (median of the rounds'
ratios, and their range): 1 says that nothing is lost between threads.
"""
import argparse
import json
import os
import statistics
import subprocess
import tempfile


def start(program, render, threads, first, last, seed, output):
    command = [program, "render", *render, "--iterations", f"{first}:{last}", "--seed", str(seed), "--threads", str(threads), "--json", "-q", "-o", output]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def seconds(process):
    text = process.communicate()[0]
    if process.returncode:
        raise SystemExit(f"the renderer ended with {process.returncode}")
    return json.loads(text)["seconds"]


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--program", default="target/release/isophote")
    p.add_argument("--rounds", type=int, default=5)
    p.add_argument("--iterations", type=int, default=64)
    p.add_argument("--whole", action="store_true", help="each process renders all iterations")
    p.add_argument("render", nargs="+", help="what follows `isophote render`")
    a = p.parse_args()
    half = a.iterations // 2
    threads, processes = [], []
    with tempfile.TemporaryDirectory() as folder:
        out = [os.path.join(folder, f"{k}.exr") for k in range(2)]
        for r in range(a.rounds):
            if a.whole:
                threads.append(sum(seconds(start(a.program, a.render, 2, 0, 2 * half, 2 * r + k, out[0])) for k in range(2)))
                pair = [start(a.program, a.render, 1, 0, 2 * half, 2 * r + k, out[k]) for k in range(2)]
            else:
                threads.append(seconds(start(a.program, a.render, 2, 0, 2 * half, 0, out[0])))
                pair = [start(a.program, a.render, 1, k * half, (k + 1) * half, 0, out[k]) for k in range(2)]
            # Rate of the pair: the mean of the two rates, as each has half of the work.
            processes.append(statistics.harmonic_mean([seconds(x) for x in pair]))
    ratios = [b / t for t, b in zip(threads, processes)]
    print(json.dumps({"render": a.render, "iterations": 2 * half, "whole": a.whole, "rounds": a.rounds, "two_threads": threads, "two_processes": processes,
                      "ratio": {"median": round(statistics.median(ratios), 4), "lowest": round(min(ratios), 4),
                                "highest": round(max(ratios), 4)}}, indent=1))


if __name__ == "__main__":
    main()
