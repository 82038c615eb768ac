#!/usr/bin/env python3
"""Variants of a method at equal CPU time, one thread, round by round over seeds, with 95 % intervals of paired ratios.

  equal_time.py --section equal_time [--only hall,villa] [--plan samplers.toml] -o FOLDER          what the plan says
  equal_time.py SCENE.xml [--method sppm] --reference NAME.mean.exr (--budget S | --iterations N) [--pair 'A/B<=BOUND']... -o FOLDER 'NAME=OPTIONS'...
  equal_time.py --self-test                                                                        the statistics, on known ratios

Time is the processor time of rendering as `--json` tells it (start-up, burn-in and updates of targets included; loading not). `--time` of the
program is wall time, so iterations are calibrated once for each variant instead, on seed 0, which measures nothing else (some two rounds and a half).
What mismatch is left is corrected run by run: an error is multiplied by (CPU seconds / budget)^alpha, alpha the radius schedule's, since that is how
noise falls (in `vcm` that of merges; all else falls as one over time, 1 % more for a mismatch of 4 %); with --iterations the budget is one second,
so that errors are errors times time. The table shows CPU seconds as they were, and a note
tells of more than 10 %.

relMSE, NSD, cv, noise and floor: see runs.py. Nothing is subtracted from what is called relMSE. `bias` is the mean relMSE as rendered less noise and
less the reference's floor, `floor` that floor's share. `cv` is the median over runs, `cv all` that of errors averaged over seeds; `spread b` the
relative standard deviation over seeds of the last rung's normalisation (in the run's last draw).

A pair of relMSE is decided twice, on relMSE as it is and with the floor subtracted: a verdict stands where both agree and the floor is less than half
of relMSE, otherwise the reference is too noisy to tell ("floor"). A pair of `nsd` is decided by the jackknife over seeds, and adds none. `cost` is CPU
seconds a light path traced; `cost_kept` CPU seconds a path asked for by --photons, so that start-up and burn-in cost and do not count; `cost_deposit` CPU
seconds a photon deposited at a measurement point. Seeds are added
until every pair's interval is narrow (paired.py) or there are --most-seeds. `means` is the ratio of the means over seeds, by bootstrap: far from the
ratio, it tells of rare bad seeds. A pair without a bound (A/B~MARGIN) is told and decides nothing.

A plan is for `sppm` unless `method`, among its defaults or in a section, names another.

A scene that is not there is left out, and said. Exit status 1 if a pair is missed or undecided.
"""
import argparse
import json
import os
import sys

import numpy as np

import paired
import runs

PER_SEED = ("relmse", "rmse", "cv", "cost", "cost_kept", "cost_deposit")


def say(text):
    print(text, file=sys.stderr, flush=True)


class Measured:
    """What the rounds so far say of one scene."""

    def __init__(self, rounds, reference):
        self.rounds, self.reference, self.cache = rounds, reference, {}
        self.floor = reference.floor()
        self.seeds = len(rounds.rounds)
        self.stacks = {name: rounds.stack(name) for name in rounds.variants}
        self.errors = {name: [reference.errors(image) for image in stack] for name, stack in self.stacks.items()}

    def mismatch(self, name):
        """(CPU seconds / budget)^alpha of each run."""
        return (self.rounds.column(name, "cpu_seconds") / (self.rounds.budget or 1)) ** self.rounds.column(name, "alpha")

    def values(self, metric, name, floor=0.0):
        if metric == "cost":
            return self.rounds.column(name, "cpu_seconds") / self.rounds.column(name, "light_paths")
        if metric == "cost_kept":
            return self.rounds.column(name, "cpu_seconds") / (self.rounds.column(name, "photons") * self.rounds.column(name, "iterations"))
        if metric == "cost_deposit":
            return self.rounds.column(name, "cpu_seconds") / self.rounds.column(name, "deposits")
        found = np.array([e[metric] for e in self.errors[name]], dtype=float)
        if metric == "relmse":
            return (found - floor) * self.mismatch(name)
        return found * np.sqrt(self.mismatch(name)) if metric == "rmse" else found

    def nsd(self, name, keep=slice(None)):
        return runs.nsd(self.stacks[name][keep]) * np.sqrt(np.mean(self.mismatch(name)[keep]))

    def decide(self, pair):
        if pair.metric == "nsd":
            interval = paired.jackknife(lambda keep: self.nsd(pair.a, keep) / self.nsd(pair.b, keep), self.seeds)
            return {"pair": str(pair), "interval": interval, "verdict": paired.verdict(interval, pair.bound)}
        a, b = self.values(pair.metric, pair.a), self.values(pair.metric, pair.b)
        interval = paired.ratio(a, b)
        found = {"pair": str(pair), "interval": interval, "means": paired.ratio_of_means(a, b), "verdict": paired.verdict(interval, pair.bound),
                 "narrow": pair.narrow(interval)}
        if pair.metric == "relmse" and self.floor is not None:
            less = paired.ratio(self.values("relmse", pair.a, self.floor), self.values("relmse", pair.b, self.floor))
            found["less_floor"] = less
            # The floor is an expectation: where it is most of the error, what is left after it is chance, shared by all seeds.
            drowned = any(self.floor > 0.5 * np.mean([e["relmse"] for e in self.errors[name]]) for name in (pair.a, pair.b))
            if drowned or paired.verdict(less, pair.bound) != found["verdict"]:
                found["verdict"] = "told (floor)" if pair.bound is None else "undecided (floor)"
            found["narrow"] = found["narrow"] and pair.narrow(less)
        return found

    def row(self, name):
        relmse, cpu = self.values("relmse", name), self.rounds.column(name, "cpu_seconds")
        b = [list(r[name]["b"].values()) for r in self.rounds.rounds]
        last = np.array([x[-1] for x in b]) if all(b) else None
        many = self.seeds > 1
        noise = runs.noise(self.stacks[name], self.reference) if many else None
        raw = np.mean([e["relmse"] for e in self.errors[name]])
        return {"iterations": self.rounds.iterations[name], "cpu_seconds": float(np.median(cpu)), "relmse": float(np.median(relmse)),
                "relmse_as_rendered": float(raw), "noise": float(noise * np.mean(self.mismatch(name))) if many else None, "floor": self.floor,
                "bias": float(raw - noise - (self.floor or 0)) if many else None, "rmse": float(np.median(self.values("rmse", name))),
                "nsd": float(self.nsd(name)) if many else None, "cv": float(np.median(self.values("cv", name))),
                "cv_pooled": runs.pooled_cv(self.stacks[name], self.reference),
                "paths_per_cpu_second": float(np.median(self.rounds.column(name, "light_paths") / cpu)),
                "mean": float(self.stacks[name].mean()),
                "b": {r: float(np.mean([x[name]["b"][r] for x in self.rounds.rounds])) for r in (self.rounds.rounds[0][name]["b"])},
                "b_spread": float(last.std(ddof=1) / last.mean()) if last is not None and many and last.mean() > 0 else None,
                "masked": int(max(e["masked"] for e in self.errors[name]))}


HEAD = ["", "iters", "CPU s", "relMSE", "noise", "bias", "floor", "RMSE", "NSD", "cv", "cv all", "kpaths/s", "spread b"]


def table(measured):
    def cell(value, form):
        return "-" if value is None else format(value, form)
    lines = []
    for name in measured.rounds.variants:
        r = measured.row(name)
        share = None if measured.floor is None else measured.floor / r["relmse_as_rendered"]
        lines.append([name, str(r["iterations"]), cell(r["cpu_seconds"], ".2f"), cell(r["relmse"], ".3g"), cell(r["noise"], ".3g"),
                      cell(r["bias"], ".2g"), cell(share, ".1%"), cell(r["rmse"], ".3g"), cell(r["nsd"], ".3f"), cell(r["cv"], ".3f"), cell(r["cv_pooled"], ".3f"),
                      cell(r["paths_per_cpu_second"] / 1e3, ".0f"), cell(r["b_spread"], ".1%")])
    width = [max(len(line[i]) for line in [HEAD, *lines]) for i in range(len(HEAD))]
    return "\n".join("  ".join(x.rjust(w) if i else x.ljust(w) for i, (x, w) in enumerate(zip(line, width))) for line in [HEAD, *lines])


def warnings(measured):
    budget = measured.rounds.budget
    for name in measured.rounds.variants:
        r = measured.row(name)
        if budget and abs(r["cpu_seconds"] / budget - 1) > 0.1:
            yield f"{name} took {r['cpu_seconds'] / budget:.2f} of the budget: its error is corrected by more than it should be"
        if measured.floor is None:
            yield "the reference has no variance: its floor is unknown and nothing guards against it"
        elif measured.floor > 0.1 * r["relmse_as_rendered"]:
            yield f"{name}: the reference's noise is {measured.floor / r['relmse_as_rendered']:.0%} of relMSE"
        if r["bias"] is not None and r["bias"] > 0.2 * r["relmse_as_rendered"]:
            yield f"{name}: bias is {r['bias'] / r['relmse_as_rendered']:.0%} of relMSE; where methods share it, it draws ratios to 1"
        if r["masked"]:
            yield f"{name}: up to {r['masked']} pixels not finite, left out"


def measure(entry, program, folder, least, most):
    """One scene until its pairs are narrow; prints the table and returns the document."""
    reference = runs.Reference(entry["reference"], entry.get("reference_var"))
    variants = {name: ["--resolution", entry.get("resolution", reference.size), *options.split()] for name, options in entry["variants"].items()}
    pairs = [paired.Pair.parse(p) for p in entry.get("pairs", [])]
    for pair in pairs:
        if missing := [x for x in (pair.a, pair.b) if x not in variants]:
            raise SystemExit(f"{pair}: no variant is called {missing[0]!r}; there are {', '.join(variants)}")
        if pair.metric not in (*PER_SEED, "nsd"):
            raise SystemExit(f"{pair}: the metrics are {', '.join(PER_SEED)} and nsd")
    if ("budget" in entry) == ("iterations" in entry):
        raise SystemExit(f"{entry['name']}: give a budget or a number of iterations, one of them")
    say(f"{entry['name']}: {'calibrating' if 'budget' in entry else 'rendering'}")
    rounds = runs.Rounds(program, entry["scene"], variants, folder, entry.get("budget"), entry.get("iterations"), say=say,
                         method=entry.get("method", "sppm"))
    while True:
        while len(rounds.rounds) < least:
            rounds.add()
        measured = Measured(rounds, reference)
        decided = [measured.decide(p) for p in pairs]
        if measured.seeds >= most or all(d.get("narrow", True) for d in decided):
            break
        rounds.add()
    print(f"\n{entry['name']}: {measured.seeds} seeds, " + (f"{rounds.budget:g} CPU seconds" if rounds.budget else "errors times CPU seconds^alpha"))
    print(table(measured))
    for d in decided:
        extra = "".join(f"; {key.replace('_', ' ')} {paired.show(d[key])}" for key in ("less_floor", "means") if key in d)
        print(f"  {d['verdict']:9s} {d['pair']}: {paired.show(d['interval'])}{extra}{'' if d.get('narrow', True) else '; not as narrow as asked'}")
    told = list(dict.fromkeys(warnings(measured)))
    for text in told:
        print(f"  note: {text}")
    sys.stdout.flush()
    for d in decided:
        d |= {key: vars(d[key]) for key in ("interval", "means", "less_floor") if d.get(key)}
    return {"name": entry["name"], "scene": entry["scene"], "method": rounds.method, "budget": rounds.budget, "seeds": measured.seeds, "variants": variants,
            "rows": {name: measured.row(name) for name in variants}, "pairs": decided, "notes": told,
            "runs": {name: [e | r[name] for e, r in zip(measured.errors[name], rounds.rounds)] for name in variants}}


def planned(a):
    """The entries of a section of the plan, names of variants resolved, scenes that are not there left out."""
    plan = runs.plan(a.plan) if a.plan else runs.plan()
    if a.section not in plan:
        raise SystemExit(f"the plan has no section {a.section!r}")
    only = a.only.split(",") if a.only else None
    for entry in plan[a.section]:
        if only and entry["name"] not in only:
            continue
        entry = plan["defaults"] | entry
        entry["variants"] = {v: f"{entry['common']} {plan['variants'][v]}" for v in entry["variants"]}
        for key in ("scene", "reference"):
            entry[key] = runs.from_root(entry[key])
        if not os.path.exists(entry["scene"]) or not os.path.exists(entry["reference"]):
            print(f"{entry['name']}: LEFT OUT, {entry['scene']} or its reference is not there")
            continue
        yield entry


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("scene", nargs="?")
    p.add_argument("variants", nargs="*", metavar="NAME=OPTIONS")
    p.add_argument("--program", default=os.environ.get("ISOPHOTE", "target/release/isophote"))
    p.add_argument("--section")
    p.add_argument("--only")
    p.add_argument("--plan")
    p.add_argument("--method")
    p.add_argument("--reference")
    p.add_argument("--reference-var")
    p.add_argument("--budget", type=float)
    p.add_argument("--iterations", type=int)
    p.add_argument("--pair", action="append", default=[])
    p.add_argument("--least-seeds", type=int)
    p.add_argument("--most-seeds", type=int)
    p.add_argument("--self-test", action="store_true")
    p.add_argument("-o", "--output", metavar="FOLDER")
    a = p.parse_intermixed_args()
    if a.self_test:
        import test_equal_time
        return paired.self_test() + test_equal_time.test()
    if not a.output:
        p.error("-o names the folder of images and results")
    if a.section:
        if a.method:
            p.error("a section's method is the plan's")
        entries = list(planned(a))
    elif a.scene and a.reference and a.variants:
        entries = [{"name": os.path.basename(os.path.dirname(os.path.abspath(a.scene))), "scene": a.scene,
                    "reference": a.reference, "reference_var": a.reference_var,
                    "variants": dict(v.split("=", 1) for v in a.variants), "pairs": a.pair,
                    **{k: v for k, v in (("budget", a.budget), ("iterations", a.iterations), ("method", a.method)) if v}}]
    else:
        p.error("name a section of the plan, or a scene, its reference and variants")
    program = runs.Program(a.program)
    documents = []
    for entry in entries:
        least = a.least_seeds or entry.get("least_seeds", 6)
        most = max(least, a.most_seeds or entry.get("most_seeds", 24))
        documents.append(measure(entry, program, os.path.join(a.output, entry["name"]), least, most))
        # Written after every scene: a long series that is stopped keeps what it has.
        with open(os.path.join(a.output, f"{a.section or 'equal_time'}.json"), "w") as f:
            json.dump({"program_sha256": program.hash, "scenes": documents}, f, indent=1)
    return any(d["verdict"] != "met" and not d["verdict"].startswith("told") for document in documents for d in document["pairs"])


if __name__ == "__main__":
    sys.exit(main())
