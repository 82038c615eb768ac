#!/usr/bin/env python3
"""Makes the meshes and textures of `textured-room` and the meshes of `box` and `glass-box` (deterministic)."""
import math
import os

import numpy as np
from PIL import Image

HERE = os.path.dirname(os.path.abspath(__file__))


def path(*parts):
    p = os.path.join(HERE, *parts)
    os.makedirs(os.path.dirname(p), exist_ok=True)
    return p


def block(file, cx, cz, half, height, degrees):
    """An open-bottomed block: four sides and a top, quads with outward winding, no normals."""
    a = math.radians(degrees)
    corners = [(x * math.cos(a) + z * math.sin(a) + cx, -x * math.sin(a) + z * math.cos(a) + cz)
               for x, z in ((-half, half), (half, half), (half, -half), (-half, -half))]
    with open(file, "w") as f:
        for y in (0, height):
            for x, z in corners:
                f.write("v %.6f %.6f %.6f\n" % (x, y, z))
        for i in range(4):
            j = (i + 1) % 4
            f.write(f"f {i + 1} {j + 1} {j + 5} {i + 5}\n")
        f.write("f 5 6 7 8\n")


def torus(file, major, minor, n, m):
    """A ring in the xz plane with vertex normals and texture coordinates."""
    with open(file, "w") as f:
        for i in range(n + 1):
            for j in range(m + 1):
                u, v = 2 * math.pi * i / n, 2 * math.pi * j / m
                r = major + minor * math.cos(v)
                f.write("v %.6f %.6f %.6f\n" % (r * math.cos(u), minor * math.sin(v), r * math.sin(u)))
                f.write("vt %.6f %.6f\n" % (i / n, j / m))
                f.write("vn %.6f %.6f %.6f\n" % (math.cos(v) * math.cos(u), math.sin(v), math.cos(v) * math.sin(u)))
        for i in range(n):
            for j in range(m):
                a = i * (m + 1) + j + 1
                q = (a, a + 1, a + m + 2, a + m + 1)
                f.write("f " + " ".join(f"{k}/{k}/{k}" for k in q) + "\n")


def smooth_noise(rng, size, cells, octaves=3):
    """Periodic value noise in [0, 1]."""
    out, weight = np.zeros((size, size)), 0.0
    for o in range(octaves):
        c = cells << o
        g = rng.random((c, c))
        x = np.arange(size) * c / size
        i, t = x.astype(int), x % 1
        t = t * t * (3 - 2 * t)
        j = (i + 1) % c
        rows = g[i] * (1 - t)[:, None] + g[j] * t[:, None]
        out += (rows[:, i] * (1 - t) + rows[:, j] * t) / 2 ** o
        weight += 1 / 2 ** o
    return out / weight


def save(file, a):
    Image.fromarray(np.clip(np.round(a), 0, 255).astype(np.uint8)).save(file, optimize=True)


def textures():
    rng = np.random.default_rng(2024)
    y, x = np.mgrid[0:64, 0:64] / 64
    # planks: four boards of different tone, with grain along them
    grain = smooth_noise(rng, 64, 4)
    board = (x * 4).astype(int)
    tone = np.array([0.85, 1.0, 0.75, 0.92])[board] * (0.8 + 0.3 * np.roll(grain, 7, 0))
    tone[(x * 4) % 1 < 0.06] *= 0.45
    save(path("textured-room/textures/planks.png"), tone[..., None] * np.array([190, 135, 90]))
    # plaster: a smooth pattern
    n = smooth_noise(rng, 64, 4)
    save(path("textured-room/textures/plaster.png"), np.stack([150 + 60 * n, 165 + 45 * n, 170 + 25 * n], -1))
    # a poster of flat pixels, for nearest filtering
    p = np.zeros((12, 16, 3)) + np.array([225, 220, 200])
    p[2:10, 2:6] = (200, 60, 40)
    p[3:9, 7:9] = (40, 90, 170)
    p[3:9, 10:14] = (60, 150, 80)
    p[5:7, 11:13] = (240, 200, 60)
    p[0, :] = p[-1, :] = p[:, 0] = p[:, -1] = (60, 50, 45)
    save(path("textured-room/textures/poster.png"), p)
    # a lattice to cut out: opacity with soft edges
    d = np.minimum(np.abs((x * 4) % 1 - 0.5), np.abs((y * 4) % 1 - 0.5))
    save(path("textured-room/textures/lattice.png"), 255 * np.clip((0.2 - d) / 0.05, 0, 1))
    # wear of the table: how much of the second material shows
    save(path("textured-room/textures/wear.png"), 255 * np.clip((smooth_noise(rng, 64, 3) - 0.35) / 0.3, 0, 1))


def sky():
    """64 x 32: blue above, warm ground, and a wide lobe of sunlight (half width about 15 degrees: no fireflies)."""
    import OpenEXR
    h, w = 32, 64
    v, u = np.mgrid[0:h, 0:w]
    v, u = v / (h - 1), (u + 0.5) / w
    d = np.stack([np.sin(np.pi * v) * np.sin(2 * np.pi * u), np.cos(np.pi * v), -np.sin(np.pi * v) * np.cos(2 * np.pi * u)], -1)
    sun = np.array([-0.62, 0.62, 0.48])
    sun /= np.linalg.norm(sun)
    lobe = np.exp(20 * (d @ sun - 1))[..., None]
    up = np.clip(d[..., 1:2] * 1.5 + 0.3, 0, 1)
    img = up * (np.array([0.5, 0.75, 1.2]) + 0.4 * (1 - np.abs(d[..., 1:2]))) + (1 - up) * np.array([0.35, 0.3, 0.22]) + lobe * np.array([60, 50, 36])
    ch = {c: np.ascontiguousarray(img[..., i], dtype=np.float32) for i, c in enumerate("RGB")}
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, ch) as f:
        f.write(path("textured-room/textures/sky.exr"))


if __name__ == "__main__":
    block(path("box/meshes/tall.obj"), -0.34, -0.3, 0.3, 1.2, 18)
    block(path("box/meshes/short.obj"), 0.36, 0.32, 0.3, 0.6, -17)
    torus(path("textured-room/meshes/ring.obj"), 0.2, 0.07, 32, 16)
    textures()
    sky()
