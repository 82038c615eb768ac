#!/usr/bin/env python3
"""Ratios of two methods over seeds: intervals, the rule that adds seeds, verdicts. The unit is the seed; A[i] and B[i] share one.

The ratio is the geometric mean of A[i]/B[i]; its interval is Student's t on the logarithms. Beside it stands the ratio of the arithmetic means with
a bootstrap interval over seeds, since a rare bad seed moves a mean and hardly a logarithm. Where a logarithm has no answer (a value that
is zero, negative or not finite; fewer than two seeds) there is no interval, and nothing is left out to get one.

`python3 paired.py` tests all of it on numbers whose ratio is known.
"""
import dataclasses
import math
import re
import sys

import numpy as np
from scipy import stats

LEVEL = 0.95


@dataclasses.dataclass
class Interval:
    ratio: float
    low: float
    high: float
    seeds: int

    @property
    def half_width(self):
        """Of the logarithm."""
        return math.log(self.high / self.low) / 2


def of_logs(logs, level=LEVEL):
    """exp of the mean of logarithms, with Student's interval."""
    n = len(logs)
    if n < 2 or not np.all(np.isfinite(logs)):
        return None
    half = stats.t.ppf((1 + level) / 2, n - 1) * np.std(logs, ddof=1) / math.sqrt(n)
    return Interval(*(float(np.exp(np.mean(logs) + d)) for d in (0, -half, half)), n)


def ratio(a, b, level=LEVEL):
    """Geometric mean of a[i]/b[i] over seeds i, with its interval; None if there is none."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    if a.shape != b.shape:
        raise ValueError("a ratio pairs as many values of A as of B, seed by seed")
    if not (np.all(np.isfinite(a)) and np.all(np.isfinite(b)) and np.all(a > 0) and np.all(b > 0)):
        return None
    return of_logs(np.log(a / b), level)


def ratio_of_means(a, b, level=LEVEL, resamples=2000):
    """mean(a)/mean(b), whole seeds drawn again; percentiles taken farther out by sqrt(n/(n-1)) as in docs/statistics.md."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    n = len(a)
    if n < 2 or not (np.all(np.isfinite(a)) and np.all(np.isfinite(b)) and np.all(a > 0) and np.all(b > 0)):
        return None
    drawn = np.random.default_rng(n).integers(0, n, (resamples, n))
    found = np.sort(np.log(a[drawn].mean(axis=1) / b[drawn].mean(axis=1)))
    tail = stats.norm.sf(stats.norm.ppf((1 + level) / 2) * math.sqrt(n / (n - 1)))
    low, high = np.exp(np.quantile(found, [tail, 1 - tail]))
    return Interval(float(a.mean() / b.mean()), float(low), float(high), n)


def jackknife(statistic, runs, level=LEVEL):
    """Interval of a positive statistic of all seeds together (NSD, a ratio of two), each seed left out once; `statistic` takes indices."""
    everything = np.arange(runs)
    if runs < 3:
        return None
    whole = statistic(everything)
    left = np.array([statistic(np.delete(everything, k)) for k in everything])
    if not (whole > 0 and np.all(np.isfinite(left)) and np.all(left > 0)):
        return None
    logs = np.log(left)
    half = stats.t.ppf((1 + level) / 2, runs - 1) * math.sqrt((runs - 1) / runs * np.sum((logs - logs.mean()) ** 2))
    return Interval(float(whole), float(whole * math.exp(-half)), float(whole * math.exp(half)), runs)


def verdict(interval, bound):
    """Is the ratio at most `bound`? Without a bound it is told and no more."""
    if bound is None:
        return "told"
    if interval is None:
        return "undecided"
    return "met" if interval.high <= bound else "missed" if interval.low > bound else "undecided"


@dataclasses.dataclass
class Pair:
    """`[metric:]A/B<=BOUND[~MARGIN]`: the ratio asked for. Seeds are added until the interval's half-width is under half the margin, both as
    logarithms. The margin is what lies between the bound and no difference, |log BOUND|, or the factor after the tilde. `A/B~MARGIN` asks for
    no bound."""
    metric: str
    a: str
    b: str
    bound: float | None
    margin: float

    @classmethod
    def parse(cls, text):
        found = re.fullmatch(r"(?:(\w+):)?([^/:]+)/([^/<~]+)(?:<=([0-9.]+))?(?:~([0-9.]+))?", text.replace(" ", ""))
        if not found or not (found[4] or found[5]):
            raise SystemExit(f"{text!r} is no pair: write A/B<=BOUND, metric:A/B<=BOUND~MARGIN, or A/B~MARGIN where no bound is asked")
        metric, a, b, bound, margin = found.groups()
        factor = float(margin or bound)
        bound = float(bound) if bound else None
        if bound is not None and bound <= 0 or factor <= 0 or factor == 1:
            raise SystemExit(f"{text!r} needs a positive bound and, where the bound is 1, a margin other than 1: {a}/{b}<=1~1.15")
        return cls(metric or "relmse", a, b, bound, abs(math.log(factor)))

    def narrow(self, interval):
        return interval is not None and interval.half_width < self.margin / 2

    def __str__(self):
        return f"{self.metric} {self.a}/{self.b}" + ("" if self.bound is None else f" <= {self.bound:g}")


def show(interval):
    return "no interval" if interval is None else f"{interval.ratio:.3g} [{interval.low:.3g}, {interval.high:.3g}]"


# What follows tests the above on numbers whose ratio is known.

def experiment(generator, pair, truth, spread, common, least, most):
    """Seeds until the interval is narrow; `common` is the spread of a factor that both methods of a seed share."""
    def draw(n):
        shared = generator.normal(0, common, n)
        return [np.exp(shared + generator.normal(0, spread, n) + shift) for shift in (math.log(truth), 0.0)]
    a, b = draw(least)
    while not pair.narrow(ratio(a, b)) and len(a) < most:
        more = draw(1)
        a, b = np.append(a, more[0]), np.append(b, more[1])
    return a, b


def unpaired(a, b, level=LEVEL):
    """Two independent lists: the mistake that pairing avoids."""
    x, y = np.log(a), np.log(b)
    u, v = x.var(ddof=1) / len(x), y.var(ddof=1) / len(y)
    half = stats.t.ppf((1 + level) / 2, len(x) + len(y) - 2) * math.sqrt(u + v)
    middle = x.mean() - y.mean()
    return Interval(*(float(math.exp(middle + d)) for d in (0, -half, half)), len(x))


def coverage(make, estimate, truth, repetitions):
    found = [estimate(*make()) for _ in range(repetitions)]
    held = sum(i.low <= truth <= i.high for i in found) / repetitions
    return held, float(np.mean([math.log(i.ratio) for i in found])), float(np.mean([i.half_width for i in found])), found


def self_test(repetitions=2000):
    generator = np.random.default_rng(1)
    allowed = 4 * math.sqrt(0.95 * 0.05 / repetitions)
    failures = []

    def check(what, good, note=""):
        print(f"{'ok  ' if good else 'FAIL'} {what} {note}")
        if not good:
            failures.append(what)

    for truth, bound in [(0.3, "0.5"), (1.05, "1.15"), (0.5, "0.5")]:
        pair = Pair.parse(f"a/b<={bound}")
        for least, most in [(6, 6), (16, 16), (6, 200)]:
            def make():
                return experiment(generator, pair, truth, 0.15, 0.5, least, most)
            held, middle, width, found = coverage(make, ratio, truth, repetitions)
            name = f"ratio {truth}, {f'{least} seeds' if least == most else 'seeds added'}"
            # Stopping by the width takes a little of the level: narrow intervals are those of luckily small spreads.
            check(f"{name}: intervals hold the truth", abs(held - 0.95) < allowed + (0.015 if least != most else 0), f"{held:.3f}")
            check(f"{name}: the ratio is recovered", abs(middle - math.log(truth)) < 0.02, f"{math.exp(middle):.4f}")
            wrong = sum(verdict(i, float(bound)) == ("missed" if truth <= float(bound) else "met") for i in found) / repetitions
            check(f"{name}: verdicts against <= {bound} are seldom wrong", wrong < 0.025 + allowed, f"{wrong:.4f} wrong")
            if least != most:
                check(f"{name}: the rule ends narrow", all(pair.narrow(i) for i in found), f"{np.mean([i.seeds for i in found]):.1f} seeds")
    pair = Pair.parse("a/b<=0.5")

    def sixteen():
        return experiment(generator, pair, 0.4, 0.15, 0.5, 16, 16)
    held, middle, width, _ = coverage(sixteen, ratio_of_means, 0.4, repetitions)
    check("bootstrap of the means: intervals hold the truth", abs(held - 0.95) < 0.03, f"{held:.3f}")
    paired_width = coverage(sixteen, ratio, 0.4, repetitions)[2]
    held, _, width, _ = coverage(sixteen, unpaired, 0.4, repetitions)
    check("unpaired intervals are seen to be wrong (far too wide)", held > 0.95 + allowed and width > 2 * paired_width,
          f"{held:.3f}, {width / paired_width:.1f} times as wide")
    held, _, _, _ = coverage(sixteen, lambda a, b: ratio(a, np.roll(b, 1)), 0.4, repetitions)
    check("pairs of different seeds are seen to be wrong (too wide)", held > 0.95 + allowed, f"{held:.3f}")
    held, _, _, _ = coverage(sixteen, lambda a, b: ratio(b, a), 0.4, repetitions)
    check("a ratio upside down is seen to be wrong", held < 0.05, f"{held:.3f}")
    held, _, _, _ = coverage(sixteen, lambda a, b: ratio(a + 0.3, b + 0.3), 0.4, repetitions)
    check("a floor left in both is seen to be wrong", held < 0.5, f"{held:.3f}")

    def narrowed(a, b):
        i = ratio(a, b)
        return Interval(i.ratio, i.ratio * (i.low / i.ratio) ** 0.8, i.ratio * (i.high / i.ratio) ** 0.8, i.seeds)
    held, _, _, _ = coverage(sixteen, narrowed, 0.4, repetitions)
    check("an interval a fifth too narrow is seen to be wrong", held < 0.95 - allowed, f"{held:.3f}")

    def deviations():
        x = generator.normal(0, 0.35, (12, 40)), generator.normal(0, 0.5, (12, 40))
        return (lambda keep: x[0][keep].std(axis=0, ddof=1).mean() / x[1][keep].std(axis=0, ddof=1).mean()), 12
    held, middle, _, _ = coverage(deviations, jackknife, 0.7, repetitions // 4)
    check("jackknife of NSD: intervals hold the truth", abs(held - 0.95) < 2 * allowed + 0.01, f"{held:.3f}, {math.exp(middle):.4f} for 0.7")
    for bad in ([1, 0, 2], [1, -1, 2], [1, math.nan, 2], [1, math.inf, 2]):
        check(f"no interval of {bad}", ratio(bad, [1, 1, 1]) is None and ratio_of_means(bad, [1, 1, 1]) is None)
    check("no interval, no verdict", verdict(None, 1) == "undecided" and not pair.narrow(None))
    told = Pair.parse("cost:a/b~1.1")
    check("a pair without a bound is told and has its margin", (told.bound, told.b, verdict(ratio([1, 2, 3], [3, 1, 2]), told.bound)) == (None, "b", "told")
          and told.margin == math.log(1.1) and str(told) == "cost a/b")
    for text in ("a/b<=1", "a<=2", "a/b<=0", "a/b<=x", "a/b", "a/b~1", "a/b~"):
        try:
            Pair.parse(text)
            check(f"{text} is refused", False)
        except SystemExit:
            check(f"{text} is refused", True)
    print(f"{len(failures)} failed" if failures else "all hold")
    return len(failures)


if __name__ == "__main__":
    sys.exit(1 if self_test() else 0)
