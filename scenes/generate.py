#!/usr/bin/env python3
"""Makes the meshes, the textures and the sky of the scenes in this folder (deterministic)."""
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


def boxes(file, *extents):
    """Closed boxes along the axes, (x0, x1, y0, y1, z0, z1) each: outward quads, no normals."""
    sides = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    with open(file, "w") as f:
        for x0, x1, y0, y1, z0, z1 in extents:
            for i in range(8):
                f.write("v %.6g %.6g %.6g\n" % ((x0, x1)[i & 1], (y0, y1)[i >> 1 & 1], (z0, z1)[i >> 2]))
        for k in range(len(extents)):
            for side in sides:
                f.write("f " + " ".join(str(8 * k + i + 1) for i in side) + "\n")


def panels(file, *centres, half_x, half_z):
    """Horizontal rectangles that face down."""
    with open(file, "w") as f:
        for x, y, z in centres:
            for dx, dz in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                f.write("v %.6g %.6g %.6g\n" % (x + dx * half_x, y, z + dz * half_z))
        for k in range(len(centres)):
            f.write("f " + " ".join(str(4 * k + i) for i in (1, 2, 3, 4)) + "\n")


def chair(x, z, facing):
    """Boxes of a chair: a seat, four legs, and a back on the side away from `facing` (+1 or -1 along z)."""
    back = z - facing * 0.2
    legs = [(x + a - 0.02, x + a + 0.02, 0, 0.45, z + b - 0.02, z + b + 0.02) for a in (-0.18, 0.18) for b in (-0.18, 0.18)]
    return legs + [(x - 0.21, x + 0.21, 0.45, 0.49, z - 0.21, z + 0.21), (x - 0.21, x + 0.21, 0.49, 0.98, back - 0.015, back + 0.015)]


def hall():
    # The dining room: x in [-2.4, 2.4], y in [0, 2.6], z in [0, 5.2]. The hall: x in [-30, 30], y in [0, 4.5], z in [-8.6, -0.6].
    # A passage of 1.9 m x 2.35 m, 0.6 m long, joins them.
    boxes(path("hall/meshes/room.obj"),
          (-2.7, -0.1, 0, 2.9, -0.6, 0), (1.8, 2.7, 0, 2.9, -0.6, 0), (-0.1, 1.8, 2.35, 2.9, -0.6, 0),
          (-2.7, -2.4, 0, 2.9, 0, 5.5), (2.4, 2.7, 0, 2.9, 0, 5.5), (-2.4, 2.4, 0, 2.9, 5.2, 5.5), (-2.4, 2.4, 2.6, 2.9, 0, 5.2))
    boxes(path("hall/meshes/hall.obj"),
          (-30.3, 30.3, 0, 4.8, -8.9, -8.6), (-30.3, -30, 0, 4.8, -8.6, -0.3), (30, 30.3, 0, 4.8, -8.6, -0.3),
          (-30, -2.7, 0, 4.8, -0.6, -0.3), (2.7, 30, 0, 4.8, -0.6, -0.3), (-2.7, 2.7, 2.9, 4.8, -0.6, -0.3), (-30.3, 30.3, 4.5, 4.8, -8.6, -0.6),
          (-30.3, 30.3, -0.3, 0, -8.9, -0.6))
    boxes(path("hall/meshes/floor.obj"), (-2.7, 2.7, -0.3, 0, -0.6, 5.5))
    boxes(path("hall/meshes/bench.obj"), (4.6, 6.6, 0.38, 0.46, -8.5, -8.0), (4.8, 4.95, 0, 0.38, -8.4, -8.1), (6.25, 6.4, 0, 0.38, -8.4, -8.1))
    panels(path("hall/meshes/far-lamps.obj"), *((s * x, 4.49, -4.6) for x in (17, 20, 23, 26) for s in (-1, 1)), half_x=0.5, half_z=0.5)
    legs = [(x - 0.035, x + 0.035, 0, 0.7, z - 0.035, z + 0.035) for x in (-1.35, 0.15) for z in (1.55, 2.35)]
    boxes(path("hall/meshes/table.obj"), (-1.45, 0.25, 0.7, 0.75, 1.45, 2.45), *legs)
    boxes(path("hall/meshes/chairs.obj"), *(b for x in (-1.0, -0.2) for b in chair(x, 1.25, 1)), *chair(0.95, 2.9, -1))
    boxes(path("hall/meshes/sideboard.obj"), (1.9, 2.4, 0.1, 0.85, 0.5, 2.1), (1.95, 2.4, 0, 0.1, 0.55, 2.05))


def villa():
    # The room: x in [-3, 3], y in [0, 2.8], z in [-3.5, 2.5]; a window of 2.8 m x 1.6 m in the wall at z = -3.5.
    boxes(path("villa/meshes/walls.obj"),
          (-3.3, -0.8, 0, 3.1, -3.8, -3.5), (2, 3.3, 0, 3.1, -3.8, -3.5), (-0.8, 2, 0, 0.7, -3.8, -3.5), (-0.8, 2, 2.3, 3.1, -3.8, -3.5),
          (-3.3, -3, 0, 3.1, -3.5, 2.8), (3, 3.3, 0, 3.1, -3.5, 2.8), (-3, 3, 0, 3.1, 2.5, 2.8), (-3, 3, 2.8, 3.1, -3.5, 2.5))
    boxes(path("villa/meshes/frame.obj"),
          (0.575, 0.625, 0.74, 2.26, -3.68, -3.62), (-0.8, -0.75, 0.7, 2.3, -3.68, -3.62), (1.95, 2, 0.7, 2.3, -3.68, -3.62),
          (-0.75, 1.95, 0.7, 0.74, -3.68, -3.62), (-0.75, 1.95, 2.26, 2.3, -3.68, -3.62), (-0.9, 2.1, 0.66, 0.7, -3.5, -3.38))
    boxes(path("villa/meshes/floor.obj"), (-3.3, 3.3, -0.3, 0, -3.8, 2.8))
    boxes(path("villa/meshes/sofa.obj"),
          (-2.95, -2.05, 0.12, 0.42, -2.6, 0.0), (-2.95, -2.65, 0.42, 0.9, -2.6, 0.0), (-2.65, -2.05, 0.42, 0.62, -2.6, -2.35), (-2.65, -2.05, 0.42, 0.62, -0.25, 0.0))
    legs = [(x - 0.03, x + 0.03, 0, 0.36, z - 0.03, z + 0.03) for x in (-1.2, -0.3) for z in (-1.85, -0.95)]
    boxes(path("villa/meshes/table.obj"), (-1.3, -0.2, 0.36, 0.41, -1.95, -0.85), *legs)
    shelf = [(2.65, 3, y, y + 0.03, -2.6, -0.9) for y in (0.03, 0.5, 0.97, 1.44, 1.91)]
    boxes(path("villa/meshes/shelf.obj"), (2.65, 3, 0, 1.94, -2.63, -2.6), (2.65, 3, 0, 1.94, -0.9, -0.87), *shelf)
    rng = np.random.default_rng(7)
    books = {"red": [], "blue": [], "cream": []}
    for y in (0.53, 1.0, 1.47):
        z = -2.55
        while z < -1.05:
            w, h = 0.03 + 0.04 * rng.random(), 0.24 + 0.12 * rng.random()
            colour = ("red", "blue", "cream")[rng.integers(3)]
            if rng.random() < 0.85:
                books[colour].append((2.72 + 0.03 * rng.random(), 2.98, y, y + h, z, z + w))
            z += w + 0.004
    for colour, b in books.items():
        boxes(path(f"villa/meshes/books-{colour}.obj"), *b)
    boxes(path("villa/meshes/garden-wall.obj"), (-14, 14, -0.3, 1.5, -13.3, -13))
    boxes(path("villa/meshes/terrace.obj"), (-5, 5, -0.3, -0.25, -8, -3.8))


def canyon():
    """A winding canyon that widens with the distance -z from the camera: a strip of cross-sections with leaning walls, closed at both ends."""
    rng = np.random.default_rng(31)
    depths = -1.6 + np.concatenate([np.linspace(0, 4, 12), np.geomspace(4.6, 345, 66)])
    across = np.concatenate([np.linspace(-1, -0.62, 12), np.linspace(-0.5, 0.5, 7), np.linspace(0.62, 1, 12)])
    noise = rng.standard_normal((len(depths), len(across), 3))
    noise = (noise + 0.5 * (np.roll(noise, 1, 0) + np.roll(noise, 1, 1))) / 1.5
    points = np.zeros((len(depths), len(across), 3))
    for i, d in enumerate(depths):
        half = 2 + 0.045 * max(d, 0)
        middle = 0.55 * half * math.sin(2.2 * math.log(1 + max(d, 0) / 2.5)) - 0.1
        for j, t in enumerate(across):
            a, s = abs(t), math.copysign(1, t)
            if a <= 0.5:
                x, y = 1.7 * t, 0.0
            else:
                climb = (a - 0.56) / 0.44
                ledge = 0.13 * math.sin(9 * climb + 1.3 * s + 1.1 * math.log(1 + max(d, 0)))
                x, y = s * (0.95 + 0.35 * math.sin(2.6 * climb) + ledge - 0.8 * climb ** 2), 3.1 * max(climb, 0)
            rough = (0.035, 0.02, 0.0) if a <= 0.5 else (0.085, 0.05, 0.0)
            points[i, j] = (middle + half * (x + rough[0] * noise[i, j, 0]), half * (y + rough[1] * noise[i, j, 1]), -d)
    # both ends narrow to almost nothing
    ends = [np.array([[e[:, 0].mean(), e[:, 1].max() / 3, e[0, 2]]]) for e in (points[0], points[-1])]
    points = np.stack([ends[0] + 0.02 * (points[0] - ends[0]), *points, ends[1] + 0.02 * (points[-1] - ends[1])])
    n, m = points.shape[:2]
    with open(path("canyon/meshes/canyon.obj"), "w") as f:
        for p in points.reshape(-1, 3):
            f.write("v %.3f %.3f %.3f\n" % tuple(p))
        for i in range(n - 1):
            for j in range(m - 1):
                a = i * m + j + 1
                f.write(f"f {a} {a + 1} {a + m + 1} {a + m}\n")
    # stones on the ground, from the camera's feet to the far end
    with open(path("canyon/meshes/stones.obj"), "w") as f:
        count = 0
        for k in range(27):
            d = 1.2 * (260 / 1.2) ** (k / 25)
            half = 2 + 0.045 * d
            x = 0.55 * half * math.sin(2.2 * math.log(1 + d / 2.5)) - 0.1 + half * rng.uniform(-0.75, 0.75)
            r = min(half * rng.uniform(0.08, 0.2), 0.17 * d)
            if k == 26:  # the nearest one
                x, r, d = -0.42, 0.2, 0.62
            grid = []
            for i in range(7):
                for j in range(9):
                    theta, phi = math.pi * i / 6, 2 * math.pi * j / 9
                    q = r * (1 + (0.16 * rng.standard_normal() if 0 < i < 6 else 0))
                    grid.append((x + 1.25 * q * math.sin(theta) * math.cos(phi), 0.35 * r + q * 0.8 * math.cos(theta), -d + q * math.sin(theta) * math.sin(phi)))
            for p in grid:
                f.write("v %.3f %.3f %.3f\n" % p)
            for i in range(6):
                for j in range(9):
                    a, b = count + 9 * i + j + 1, count + 9 * i + (j + 1) % 9 + 1
                    if i == 0:
                        f.write(f"f {a} {b + 9} {a + 9}\n")
                    elif i == 5:
                        f.write(f"f {a} {b} {a + 9}\n")
                    else:
                        f.write(f"f {a} {b} {b + 9} {a + 9}\n")
            count += len(grid)


def water(file, half_x, half_z, n, m):
    """A height field about y = 0 with the normals of its formula: a sum of seven sine waves."""
    rng = np.random.default_rng(12)
    waves = []
    for length in (1.5, 1.15, 0.9, 0.75, 0.6, 0.5, 0.42):
        k, a = 2 * math.pi / length, rng.uniform(-math.pi, math.pi)
        waves.append((k * math.cos(a), k * math.sin(a), 0.016 * length, rng.uniform(0, 2 * math.pi)))
    with open(file, "w") as f:
        for i in range(m + 1):
            for j in range(n + 1):
                x, z = half_x * (2 * j / n - 1), half_z * (2 * i / m - 1)
                y = sum(h * math.sin(p * x + q * z + o) for p, q, h, o in waves)
                dx = sum(h * p * math.cos(p * x + q * z + o) for p, q, h, o in waves)
                dz = sum(h * q * math.cos(p * x + q * z + o) for p, q, h, o in waves)
                s = math.sqrt(1 + dx * dx + dz * dz)
                f.write("v %.4f %.4f %.4f\nvn %.4f %.4f %.4f\n" % (x, y, z, -dx / s, 1 / s, -dz / s))
        for i in range(m):
            for j in range(n):
                a = i * (n + 1) + j + 1
                f.write("f " + " ".join(f"{k}//{k}" for k in (a, a + n + 1, a + n + 2, a + 1)) + "\n")


def pool():
    # The basin: x in [-2.2, 2.2], z in [-1.6, 1.6], its floor at y = -1.2, the water's rest at 0, the rim at 0.2.
    water(path("pool/meshes/water.obj"), 2.25, 1.65, 56, 42)
    boxes(path("pool/meshes/rim.obj"), (-6, -2.2, 0.1, 0.2, -5, 5), (2.2, 6, 0.1, 0.2, -5, 5), (-2.2, 2.2, 0.1, 0.2, -5, -1.6), (-2.2, 2.2, 0.1, 0.2, 1.6, 5))
    boxes(path("pool/meshes/basin.obj"), (-2.5, -2.2, -1.5, 0.1, -1.9, 1.9), (2.2, 2.5, -1.5, 0.1, -1.9, 1.9), (-2.2, 2.2, -1.5, 0.1, -1.9, -1.6), (-2.2, 2.2, -1.5, 0.1, 1.6, 1.9))
    boxes(path("pool/meshes/steps.obj"), (-2.2, -1.8, -1.2, -0.25, -1.6, -0.4), (-1.8, -1.45, -1.2, -0.55, -1.6, -0.4), (-1.45, -1.1, -1.2, -0.85, -1.6, -0.4))


def tube(file, radius, length, facets):
    """An open prism along +z from z = 0: quads that face outwards, no normals."""
    with open(file, "w") as f:
        for z in (0, length):
            for i in range(facets):
                a = 2 * math.pi * i / facets
                f.write("v %.6f %.6f %.6f\n" % (radius * math.cos(a), radius * math.sin(a), z))
        for i in range(facets):
            j = (i + 1) % facets
            f.write(f"f {i + 1} {j + 1} {j + facets + 1} {i + facets + 1}\n")


if __name__ == "__main__":
    block(path("box/meshes/tall.obj"), -0.34, -0.3, 0.3, 1.2, 18)
    block(path("box/meshes/short.obj"), 0.36, 0.32, 0.3, 0.6, -17)
    torus(path("textured-room/meshes/ring.obj"), 0.2, 0.07, 32, 16)
    textures()
    sky()
    hall()
    villa()
    canyon()
    pool()
    tube(path("spheres/meshes/tube.obj"), 0.11, 0.3, 12)
