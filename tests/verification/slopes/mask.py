#!/usr/bin/env python3
"""Writes mask.txt: which pixels of scene.xml lie farther than the first radius from every edge, shadow boundary and silhouette.

A pixel is `#` if its whole square, as seen on the plane z = 0, is at least RADIUS from the shadow of the block, the convex hull of its
base and of its top as the light throws it (the plane's edges are far outside the view). `~` if the shadow's boundary passes within
RADIUS of the pixel's centre, which is lit: there the disk crosses an edge. `.` for the rest (mostly the shadow itself). The camera
looks down the light's axis: +x is to the right of the film, +y up.
"""
import math
import os

WIDTH, FOV, EYE, LIGHT, RADIUS = 32, 27.0, 5.0, 1.0, 0.3
LOW, HIGH, TOP = (0.6, 0.5), (0.8, 0.7), 0.2


def hull(points):
    points = sorted(set(points))

    def half(points):
        chain = []
        for p in points:
            while len(chain) > 1 and ((chain[-1][0] - chain[-2][0]) * (p[1] - chain[-2][1])
                                      - (chain[-1][1] - chain[-2][1]) * (p[0] - chain[-2][0])) <= 0:
                chain.pop()
            chain.append(p)
        return chain[:-1]

    return half(points) + half(points[::-1])


def distance(p, a, b):
    d = (b[0] - a[0], b[1] - a[1])
    t = ((p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1]) / (d[0] ** 2 + d[1] ** 2)
    t = min(max(t, 0.0), 1.0)
    return math.hypot(p[0] - a[0] - t * d[0], p[1] - a[1] - t * d[1])


def main():
    base = [(x, y) for x in (LOW[0], HIGH[0]) for y in (LOW[1], HIGH[1])]
    stretch = LIGHT / (LIGHT - TOP)
    shadow = hull(base + [(x * stretch, y * stretch) for x, y in base])
    edges = list(zip(shadow, shadow[1:] + shadow[:1]))
    half_view = EYE * math.tan(math.radians(FOV / 2))
    pixel = 2 * half_view / WIDTH

    def inside(p):
        return all((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) >= 0 for a, b in edges)

    rows = []
    for y in range(WIDTH):
        row = ""
        for x in range(WIDTH):
            centre = ((x + 0.5) * pixel - half_view, half_view - (y + 0.5) * pixel)
            nearest = min(distance(centre, a, b) for a, b in edges)
            row += "." if inside(centre) else "#" if nearest >= RADIUS + pixel * math.sqrt(0.5) else "~" if nearest < RADIUS else "."
        rows.append(row)
    with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "mask.txt"), "w") as f:
        f.write("\n".join(rows) + "\n")
    print("\n".join(rows))


if __name__ == "__main__":
    main()
