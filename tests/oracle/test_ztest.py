#!/usr/bin/env python3
"""Calibration of ztest.py on made-up images: false alarms at the level, and the power to see a planted bias."""
import numpy as np

import ztest

SHAPE = (48, 48, 3)


def draw(rng, runs, scale=1.0, heavy=False):
    noise = rng.lognormal(-0.5, 1.0, (runs,) + SHAPE) if heavy else rng.gamma(4, 0.25, (runs,) + SHAPE)
    ramp = np.linspace(0.2, 2, SHAPE[1])[None, None, :, None]
    return noise * ramp * scale


def failures(trials, scale, heavy=False, level=0.01, ref_runs=16, runs=16):
    bad = 0
    for seed in range(trials):
        rng = np.random.default_rng(seed)
        r = draw(rng, ref_runs, heavy=heavy)
        c = draw(rng, runs, scale, heavy)
        out, _, _ = ztest.compare(r.mean(0), r.var(0, ddof=1) / ref_runs, ref_runs, runs=c, level=level)
        bad += not out["pass"]
    return bad


def test_level():
    assert failures(300, 1.0) <= 9  # 3 expected; P(>9) < .2 %
    assert failures(300, 1.0, heavy=True) <= 12


def test_power():
    assert failures(20, 1.03) == 20


def test_tile_bias():
    rng = np.random.default_rng(1)
    r, c = draw(rng, 16), draw(rng, 16)
    c[:, 16:32, 0:16] *= 1.05
    out, p, _ = ztest.compare(r.mean(0), r.var(0, ddof=1) / 16, 16, runs=c)
    assert not out["pass"] and (out["worst"]["tile_row"], out["worst"]["tile_column"]) == (1, 0)


def test_cut():
    rng = np.random.default_rng(2)
    r, c = draw(rng, 16), draw(rng, 16)
    r[:, 5, 5] += 100
    out, _, _ = ztest.compare(r.mean(0), r.var(0, ddof=1) / 16, 16, runs=c)
    assert not out["pass"]
    out, _, _ = ztest.compare(r.mean(0), r.var(0, ddof=1) / 16, 16, runs=c, cut=0.001)
    assert out["pass"]


def test_constant():
    one = np.ones(SHAPE)
    assert ztest.compare(one, 0 * one, 16, runs=np.stack([one * (1 + 1e-6)] * 4))[0]["pass"]
    assert not ztest.compare(one, 0 * one, 16, runs=np.stack([one * 1.001] * 4))[0]["pass"]


if __name__ == "__main__":
    for name, f in sorted(globals().items()):
        if name.startswith("test_"):
            f()
            print("ok", name)
