#!/usr/bin/env python3
"""equal_time.py from end to end on a made-up program, whose noise for time is known: is the ratio found, is the floor seen, do faults show?

Method `a` has twice `b`'s variance an iteration and a quarter of its time, so that at equal time its error is half of b's. Both start up for a
while, the machine's speed wanders between rounds and jumps between runs, and the reference is noisy.
"""
import contextlib
import io
import math
import os
import sys
import tempfile

import numpy as np

import equal_time
import paired
import runs

SHAPE = (48, 64, 3)
EACH = {"a": 0.01, "b": 0.04}
VARIANCE = {"a": 0.2, "b": 0.1}
START = 0.02


class MadeUp:
    hash = "made up"

    def __init__(self, truth):
        self.truth, self.generator, self.speed, self.methods = truth, np.random.default_rng(3), 1.0, set()

    def render(self, scene, options, seed, iterations, output, method):
        name = options[-1]
        self.methods.add(method)
        self.speed *= math.exp(self.generator.normal(0, 0.05))
        cpu = (START + EACH[name] * iterations) * self.speed * math.exp(self.generator.normal(0, 0.05))
        deviation = self.truth * math.sqrt(VARIANCE[name] / iterations) * math.exp(self.generator.normal(0, 0.03))
        runs.exr.write(output, self.truth + deviation * self.generator.normal(size=SHAPE))
        return {"cpu_seconds": cpu, "light_paths": 1000 * iterations, "rejected": {}, "non_finite_pixels": 0, "settings": {"alpha": 1.0, "photons": 1000},
                "diagnostics": {"deposits": 500 * iterations}}


def measured(folder, truth, floor, **budget):
    """A finished measurement of 16 seeds, and its verdict on a/b <= 0.7; `floor` is the reference's relative variance."""
    noise = np.random.default_rng(4).normal(size=SHAPE)
    mean, variance = os.path.join(folder, "reference.mean.exr"), os.path.join(folder, "reference.var.exr")
    runs.exr.write(mean, truth * (1 + math.sqrt(floor) * noise))
    runs.exr.write(variance, floor * truth ** 2)
    scene = os.path.join(folder, "scene.xml")
    with open(scene, "w") as f:
        f.write("<scene/>")
    entry = {"name": "made up", "scene": scene, "reference": mean, "variants": {"a": "a", "b": "b"},
             "pairs": ["a/b<=0.7", "nsd:a/b<=0.9", "cost:a/b<=0.5", "a/b<=0.95", "a/b<=0.57", "cost_deposit:a/b<=0.5", "a/b~1.2"], **budget}
    program = MadeUp(truth)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        document = equal_time.measure(entry, program, os.path.join(folder, f"runs {floor} {budget}"), 16, 16)
    return document | {"methods": program.methods}


def plans():
    """Every entry of both plans, with its file, its method and what is wrong with it."""
    for file, method in (("samplers.toml", "sppm"), ("vcm.toml", "vcm")):
        plan = runs.plan(os.path.join(runs.HERE, file))
        for section in (s for s, entries in plan.items() if isinstance(entries, list)):
            for entry in plan[section]:
                entry = plan["defaults"] | entry
                pairs = [paired.Pair.parse(p) for p in entry["pairs"]]
                wrong = [v for v in entry["variants"] if v not in plan["variants"]] + [x for p in pairs for x in (p.a, p.b) if x not in entry["variants"]]
                wrong += [p.metric for p in pairs if p.metric not in (*equal_time.PER_SEED, "nsd")]
                yield f"{file} {section} {entry['name']}", wrong, entry.get("method", "sppm") == method


def test():
    failures = []

    def check(what, good, note=""):
        print(f"{'ok  ' if good else 'FAIL'} {what} {note}")
        if not good:
            failures.append(what)

    truth = np.full(SHAPE, 2.0)
    truth[:, 32:] = 0.5
    with tempfile.TemporaryDirectory() as folder:
        for budget in ({"budget": 2.0}, {"iterations": 100}):
            d = measured(folder, truth, 1e-6, **budget)
            pair = d["pairs"][0]
            # With the start-up: a has 198 iterations in two seconds, b 49.5; at 100 iterations 1.02 and 4.02 seconds.
            known = 2 * 49.5 / 198 if "budget" in budget else 2 * 1.02 / 4.02
            check(f"{budget}: the interval holds the known ratio", pair["interval"]["low"] < known < pair["interval"]["high"],
                  f"{pair['interval']['ratio']:.3f} for {known:.3f}")
            check(f"{budget}: met, for relMSE and NSD", pair["verdict"] == "met" and d["pairs"][1]["verdict"] == "met")
            deposit = d["pairs"][5]
            check(f"{budget}: cost of a photon deposited", deposit["verdict"] == "met", f"{deposit['interval']['ratio']:.3f}")
            check(f"{budget}: cost of a path", d["pairs"][2]["verdict"] == "met", f"{d['pairs'][2]['interval']['ratio']:.3f}")
            check(f"{budget}: a pair without a bound is told", d["pairs"][6]["verdict"] == "told" and d["pairs"][6]["interval"] == pair["interval"])
            check(f"{budget}: the method is sppm if none is named", d["methods"] == {"sppm"})
            for name, row in d["rows"].items():
                check(f"{budget}: {name} has no bias", abs(row["bias"]) < 0.05 * row["relmse_as_rendered"], f"{row['bias'] / row['relmse_as_rendered']:.4f}")
            if "budget" in budget:
                off = max(abs(row["cpu_seconds"] / 2 - 1) for row in d["rows"].values())
                check("calibration meets the budget as far as the machine is steady", off < 0.4, f"{off:.2f}")
            else:
                plain = paired.ratio(*([r["relmse"] for r in d["runs"][name]] for name in "ab"))
                check("without the correction for time the ratio is seen to be wrong", plain.low > 1.5, paired.show(plain))
        d = measured(folder, truth, 0.003, budget=2.0)
        pair = d["pairs"][3]
        check("nor is a ratio told without saying so", d["pairs"][6]["verdict"] == "told (floor)")
        check("no verdict where the reference's noise is most of the error", pair["interval"]["high"] < 0.95 and pair["verdict"] == "undecided (floor)",
              f"{pair['interval']['high']:.3f}")
        d = measured(folder, truth, 0.0008, budget=2.0)
        pair = d["pairs"][4]
        check("a noisy reference draws the ratio to 1 and is found out", pair["verdict"] == "undecided (floor)" and pair["interval"]["low"] > 0.57,
              f"{pair['interval']['ratio']:.3f}, {pair['verdict']}")
        check("and the table says so", sum("reference's noise" in note for note in d["notes"]) == 2)
        check("less the floor the known ratio is back", abs(pair["less_floor"]["ratio"] / 0.5 - 1) < 0.25, f"{pair['less_floor']['ratio']:.3f}")

    with tempfile.TemporaryDirectory() as folder:
        d = measured(folder, truth, 1e-6, iterations=20, method="vcm")
        check("the method named is the one rendered and recorded", d["methods"] == {"vcm"} and d["method"] == "vcm")
        program = runs.Program(__file__)
        command = program.command("scene.xml", [], 1, 2, "out.exr", method="vcm")
        check("and the one on the program's command line", command[1:4] == ["render", "vcm", "scene.xml"], " ".join(command[1:4]))
    for name, wrong, method in plans():
        check(f"{name}: the plan names what there is", not wrong and method, " ".join(wrong))

    # Errors by tiles: half of the tiles with a relative error of 0.3, half of 0.1, but for the epsilon.
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "r.mean.exr")
        runs.exr.write(path, np.full(SHAPE, 100.0))
        reference = runs.Reference(path)
        image = np.full(SHAPE, 130.0)
        image[:, 32:] = 110.0
        e = reference.errors(image)
        check("cv of errors 0.3 and 0.1", abs(e["cv"] - 0.5) < 1e-5, f"{e['cv']:.6f}")
        check("relMSE and RMSE of them", abs(e["relmse"] - 0.05) < 1e-5 and abs(e["rmse"] - math.sqrt(500)) < 1e-4)
        image[3, 5, 1] = math.nan
        e = reference.errors(image)
        check("a pixel that is not finite counts nowhere, and is counted", e["masked"] == 1 and abs(e["cv"] - 0.5) < 1e-5)
        check("no floor without a variance", reference.floor() is None)
        check("NSD of two images", abs(runs.nsd(np.stack([np.full(SHAPE, 1.0), np.full(SHAPE, 3.0)])) - math.sqrt(0.5)) < 1e-12)
    print(f"{len(failures)} failed" if failures else "all hold")
    return len(failures)


if __name__ == "__main__":
    sys.exit(1 if test() else 0)
