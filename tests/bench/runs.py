"""Renders of a program and what its images say: shared by the scripts that measure photon samplers. Needs numpy and OpenEXR.

Errors are those of `isophote compare`: x the image, r the reference, means over pixels and channels, linear values; pixels that are not finite in
either image count nowhere, and their number is kept with each run.

  relmse     mean (x-r)^2 / (r^2 + 0.01)
  rmse       sqrt(mean (x-r)^2)
  floor      mean v / (r^2 + 0.01), v the variance of the reference's mean: what relMSE would be for a perfect image
  cv         over tiles of 16 x 16 pixels from the top left corner (those at the right and bottom border are smaller): the relative error of a tile
             is e = sqrt(mean (x-r)^2 / (mean r^2 + 0.01)), means over the tile's pixels and channels; cv is the standard deviation of e over tiles,
             all alike, divided by its mean
  nsd        standard deviation over seeds / mean over seeds, mean over pixels and channels; values of mean and deviation 0 count as 0
  noise      mean of (variance over seeds) / (r^2 + 0.01): the part of relMSE that is noise
"""
import hashlib
import json
import os
import subprocess
import sys

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.normpath(os.path.join(HERE, "..", ".."))
sys.path.insert(0, os.path.join(HERE, "..", "oracle"))
import exr  # noqa: E402

EPSILON = 0.01
TILE = 16


def plan(path=os.path.join(HERE, "samplers.toml")):
    import tomllib
    with open(path, "rb") as f:
        return tomllib.load(f)


def from_root(path):
    return os.path.normpath(os.path.join(ROOT, path))


class Program:
    def __init__(self, path):
        if not os.path.exists(path):
            raise SystemExit(f"{path} is not there: build it (cargo build --release), or name another with --program or ISOPHOTE")
        self.path = path
        with open(path, "rb") as f:
            self.hash = hashlib.sha256(f.read()).hexdigest()

    def command(self, scene, options, seed, iterations, output, threads=1, method="sppm"):
        return [self.path, "render", method, scene, "--threads", str(threads), "--iterations", str(iterations), "--seed", str(seed), "-q", "--json",
                "-o", output, *options]

    def render(self, *arguments, **named):
        """One render: the document of --json."""
        command = self.command(*arguments, **named)
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True)
        if done.returncode:
            raise SystemExit(f"{' '.join(command)}\nended with {done.returncode}")
        return json.loads(done.stdout)


def normalisations(document):
    """b by rung, of the run's last draw; empty without a ladder."""
    rungs = ((document.get("diagnostics") or {}).get("sampler") or {}).get("rungs") or []
    return {r["name"]: r["normalisation"] for r in rungs}


class Reference:
    def __init__(self, mean, variance=None):
        """`variance` defaults to NAME.var.exr beside NAME.mean.exr; without it the floor is unknown (None)."""
        self.mean = exr.read(mean)[0]
        beside = mean.removesuffix(".mean.exr") + ".var.exr"
        variance = variance or (beside if mean.endswith(".mean.exr") and os.path.exists(beside) else None)
        self.variance = exr.read(variance)[0] if variance else None
        self.weight = 1 / (self.mean ** 2 + EPSILON)
        self.good = np.isfinite(self.mean).all(axis=2)

    @property
    def size(self):
        return f"{self.mean.shape[1]}x{self.mean.shape[0]}"

    def floor(self):
        return None if self.variance is None else float((self.variance * self.weight)[self.good].mean())

    def errors(self, image):
        if image.shape != self.mean.shape:
            raise SystemExit(f"the reference has {self.size} pixels, the image {image.shape[1]}x{image.shape[0]}: set the resolution")
        good = self.good & np.isfinite(image).all(axis=2)
        square = np.where(good[..., None], image - self.mean, 0) ** 2
        return {"relmse": float((square * self.weight)[good].mean()), "rmse": float(np.sqrt(square[good].mean())),
                "cv": self.tile_cv(square, good), "masked": int((~good).sum())}

    def tile_cv(self, square, good):
        def sums(values):
            rows, columns = (np.arange(0, n, TILE) for n in values.shape)
            return np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)
        count = 3 * sums(good.astype(float))
        used = count > 0
        mean = lambda values: sums(np.where(good, values.sum(axis=2), 0.0))[used] / count[used]
        relative = np.sqrt(mean(square) / (mean(self.mean ** 2) + EPSILON))
        return float(relative.std() / relative.mean()) if relative.mean() > 0 else None


def nsd(stack):
    """Of images (K, H, W, 3); each value's standard deviation is the root of the unbiased variance."""
    deviation, mean = stack.std(axis=0, ddof=1), stack.mean(axis=0)
    if not np.all((mean > 0) | (deviation == 0)):
        return float("nan")
    return float(np.where(mean > 0, deviation / np.where(mean > 0, mean, 1), 0).mean())


def noise(stack, reference):
    return float((stack.var(axis=0, ddof=1) * reference.weight)[reference.good].mean())


def pooled_cv(stack, reference):
    """cv of the squared errors' mean over seeds: less of it is the chance of one run."""
    return reference.tile_cv(((stack - reference.mean) ** 2).mean(axis=0), reference.good)


def calibrated(renders, budget):
    """Iterations by name that take `budget` CPU seconds; `renders[name](n)` returns the CPU seconds of n iterations. A start-up, and early
    iterations that cost more, are told from the rest by a short and a longer render; then come two rounds of full length, names in turn, so that a
    change of the machine's speed meets all alike, and their mean corrects the number."""
    iterations = {}
    for name, render in renders.items():
        short = render(2)
        n = max(6, round(0.3 * budget / (short / 2)))
        long = render(n)
        each = (long - short) / (n - 2) if long > short else long / n
        iterations[name] = max(1, round(n + (budget - long) / each))
    rounds = [{name: render(iterations[name]) for name, render in renders.items()} for _ in range(2)]
    for name in renders:
        mean = (rounds[0][name] + rounds[1][name]) / 2
        iterations[name] = max(1, round(iterations[name] + (budget - mean) * iterations[name] / mean))
    return iterations


class Rounds:
    """Runs of named variants on one scene, round by round (a seed each), in an order that changes with the seed. `folder` keeps images and
    `runs.json`; a folder of the same program, scene, method and settings is gone on with, another is refused."""

    def __init__(self, program, scene, variants, folder, budget=None, iterations=None, first_seed=1, say=lambda text: None, method="sppm"):
        self.program, self.scene, self.variants, self.folder, self.say, self.first_seed = program, scene, variants, folder, say, first_seed
        self.method = method
        self.budget = budget
        self.rounds = []
        self.iterations = {name: iterations for name in variants} if iterations else None
        with open(scene, "rb") as f:
            content = hashlib.sha256(f.read()).hexdigest()
        self.about = {"program": program.hash, "scene": content, "variants": variants, "budget": budget, "iterations": iterations, "first_seed": first_seed,
                      "method": method}
        os.makedirs(folder, exist_ok=True)
        self.file = os.path.join(folder, "runs.json")
        if os.path.exists(self.file):
            with open(self.file) as f:
                kept = json.load(f)
            if {"method": "sppm"} | kept["about"] != self.about:
                raise SystemExit(f"{folder} holds runs of another program, scene, method or settings: give another folder")
            self.rounds, self.iterations = kept["rounds"], kept["iterations"]
        if self.iterations is None:
            # Seed 0 is the calibration's alone.
            self.iterations = calibrated({name: lambda n, name=name: self.one(name, 0, n)["cpu_seconds"] for name in variants}, budget)
            self.save()

    def image(self, name, seed):
        return os.path.join(self.folder, f"{name}.{seed}.exr")

    def one(self, name, seed, iterations):
        return self.program.render(self.scene, self.variants[name], seed, iterations, self.image(name, seed), method=self.method)

    def save(self):
        with open(self.file + ".new", "w") as f:
            json.dump({"about": self.about, "iterations": self.iterations, "rounds": self.rounds}, f)
        os.replace(self.file + ".new", self.file)

    def add(self):
        """One more round."""
        k = len(self.rounds)
        names = list(self.variants)
        names = names[k // 2 % len(names):] + names[:k // 2 % len(names)]
        found = {}
        for name in names[::-1] if k % 2 else names:
            document = self.one(name, self.first_seed + k, self.iterations[name])
            found[name] = {key: document[key] for key in ("cpu_seconds", "light_paths", "rejected", "non_finite_pixels")}
            found[name]["iterations"] = self.iterations[name]
            # A method without merges has no radius to shrink: its noise falls as one over time.
            found[name] |= {"alpha": document["settings"].get("alpha", 1.0), "photons": document["settings"].get("photons"), "b": normalisations(document),
                            "deposits": (document.get("diagnostics") or {}).get("deposits")}
        self.rounds.append(found)
        self.save()
        self.say(f"round {k + 1}: " + ", ".join(f"{name} {found[name]['cpu_seconds']:.2f} s" for name in self.variants))

    def column(self, name, key):
        return np.array([r[name][key] for r in self.rounds], dtype=float)

    def stack(self, name):
        return np.array([exr.read(self.image(name, self.first_seed + k))[0] for k in range(len(self.rounds))])
