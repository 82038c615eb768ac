"""Image metrics of two synthetic pictures, written without a look at the Rust code; stored in metrics.json.

Run: python3 tests/oracle/metrics.py > tests/oracle/metrics.json
"""

import json

import numpy as np

PIXELS = 2000


def number(i, salt):
    """Integers 0..65535 from a multiplicative hash; exact in float32."""
    return ((i * 2654435761 + salt * 40503) % 4294967296) // 65536


def pictures():
    i = np.arange(3 * PIXELS, dtype=np.int64)
    zero = np.float32(0)
    r = np.where(i % 17 == 0, zero, number(i, 1).astype(np.float32) / np.float32(16384))
    x = r + (number(i, 2).astype(np.float32) - np.float32(32768)) / np.float32(65536)
    out = x.copy()
    out[i % 34 == 0] = 0
    out[i % 1009 == 0] = np.float32(100) * x[i % 1009 == 0]
    out[i % 101 == 0] = -x[i % 101 == 0]
    return r.astype(np.float64), out.astype(np.float64)


def metrics(r, x, e):
    d = x - r
    rel = np.sort(d**2 / (r**2 + e))
    keep = len(rel) - int(np.floor(0.001 * 3 * PIXELS))
    s = x + r
    relative = np.where(s > 0, d / np.where(s > 0, s / 2, 1), 0) ** 2
    usable = (s > 0) | (x == r)
    values = {
        "mse": np.mean(d**2),
        "rmse": np.sqrt(np.mean(d**2)),
        "relmse": np.mean(rel),
        "relmse_trimmed": np.mean(rel[:keep]),
        "mape": np.mean(np.abs(d) / (np.abs(r) + e)),
        "smape": np.mean(2 * np.abs(d) / (np.abs(x) + np.abs(r) + 2 * e)),
        "srrmse": np.sqrt(np.mean(relative[usable])),
    }
    return {k: float(v) for k, v in values.items()}, int(np.sum(~usable))


if __name__ == "__main__":
    r, x = pictures()
    half, left_out = metrics(r, x, 0.5)
    default, _ = metrics(r, x, 0.01)
    print(json.dumps({"0.01": default, "0.5": half, "srrmse_left_out": left_out}, indent=2))
