#!/usr/bin/env python3
"""Writes the feature scenes of this folder: one small scene per loader or material feature, their assets, manifest.json.

Each is 48 x 48 pixels. The references beside them come from `tests/oracle/reference.py --manifest tests/scenes/manifest.json`.
"""
import json
import math
import os
import xml.etree.ElementTree as ET

import numpy as np
from PIL import Image

HERE = os.path.dirname(os.path.abspath(__file__))
SCENES = []


# --- pieces of XML -----------------------------------------------------------------------------------------------

def prop(kind):
    return lambda name, value: f'<{kind} name="{name}" value="{value}"/>'


fl, st, it, rgb, spectrum = prop("float"), prop("string"), prop("integer"), prop("rgb"), prop("spectrum")


def flag(name, value=True):
    return prop("boolean")(name, str(value).lower())


def bsdf(kind, *body, id=None, name=None):
    attr = (f' id="{id}"' if id else "") + (f' name="{name}"' if name else "")
    return f'<bsdf type="{kind}"{attr}>{"".join(body)}</bsdf>'


def diffuse(value=0.5):
    return bsdf("diffuse", rgb("reflectance", value))


def to_world(*steps, name="to_world"):
    return f'<transform name="{name}">{"".join(steps)}</transform>'


def scale(*v):
    return f'<scale value="{v[0]}"/>' if len(v) == 1 else '<scale x="{}" y="{}" z="{}"/>'.format(*v)


def rotate(axis, angle):
    return f'<rotate {axis}="1" angle="{angle}"/>'


def move(x, y, z):
    return f'<translate x="{x}" y="{y}" z="{z}"/>'


def shape(kind, *body):
    return f'<shape type="{kind}">{"".join(body)}</shape>'


def rect(steps, *body):
    return shape("rectangle", to_world(*steps), *body)


def sphere(x, y, z, r, *body):
    return shape("sphere", f'<point name="center" x="{x}" y="{y}" z="{z}"/>', fl("radius", r), *body)


def area(value):
    return f'<emitter type="area">{rgb("radiance", value)}</emitter>'


def bitmap(file, *body, name):
    return f'<texture type="bitmap" name="{name}">{st("filename", file)}{"".join(body)}</texture>'


def checker(*body, name):
    return f'<texture type="checkerboard" name="{name}">{"".join(body)}</texture>'


def camera(origin="0, 1.2, 5", target="0, 0.7, 0", fov=36, width=48, height=48, film="", extra="", kind="perspective"):
    lens = fl("fov", fov) if fov else ""
    return (f'<sensor type="{kind}">{lens}{extra}' + to_world(f'<lookat origin="{origin}" target="{target}" up="0, 1, 0"/>') +
            f'<sampler type="independent">{it("sample_count", 64)}</sampler>'
            f'<film type="hdrfilm">{it("width", width)}{it("height", height)}{film}{st("pixel_format", "rgb")}'
            f'{st("component_format", "float32")}<rfilter type="box"/></film></sensor>')


def stage(floor=None, wall=None, light=True):
    """A floor at y = 0, a wall behind at z = -1.5, a lamp above."""
    s = rect([scale(3), rotate("x", -90)], floor or diffuse("0.6 0.6 0.6"))
    s += rect([scale(3), move(0, 0, -1.5)], wall or diffuse("0.5 0.55 0.6"))
    if light:
        s += rect([scale(0.8), rotate("x", 90), move(0.4, 3.2, 0.8)], diffuse("0 0 0"), area("8 7 6"))
    return s


def add(name, *body, depth=5, spp=256, integrator="", sensor=None, files=(), extra_files=(), reference_defines=(), note="", **cam):
    SCENES.append(dict(name=name, depth=depth, spp=spp, body="".join(body), integrator=integrator, sensor=sensor or camera(**cam),
                       files=list(files), extra=dict(extra_files), reference_defines=list(reference_defines), note=note))


# --- assets ------------------------------------------------------------------------------------------------------

def uv_sphere(rows, cols):
    p, t, f = [], [], []
    for i in range(rows + 1):
        for j in range(cols + 1):
            th, ph = math.pi * i / rows, 2 * math.pi * j / cols
            p.append((math.sin(th) * math.cos(ph), math.cos(th), math.sin(th) * math.sin(ph)))
            t.append((j / cols, 1 - i / rows))
    for i in range(rows):
        for j in range(cols):
            a, b, c, d = (i * (cols + 1) + j, i * (cols + 1) + j + 1, (i + 1) * (cols + 1) + j, (i + 1) * (cols + 1) + j + 1)
            if i > 0:
                f.append((a, b, d))
            if i < rows - 1:
                f.append((a, d, c))
    return np.array(p), np.array(t), f


def write_obj(path, p, f, t=None, n=None):
    with open(path, "w") as out:
        for v in p:
            out.write("v %.6f %.6f %.6f\n" % tuple(v))
        for v in t if t is not None else []:
            out.write("vt %.6f %.6f\n" % tuple(v))
        for v in n if n is not None else []:
            out.write("vn %.6f %.6f %.6f\n" % tuple(v))
        for face in f:
            corner = {(False, False): "{0}", (True, False): "{0}/{0}", (False, True): "{0}//{0}", (True, True): "{0}/{0}/{0}"}[t is not None, n is not None]
            out.write("f " + " ".join(corner.format(i + 1) for i in face) + "\n")


def obj_sphere(file, rows=8, cols=14, normals=True, uv=True):
    def make(path):
        p, t, f = uv_sphere(rows, cols)
        write_obj(path, p, f, t if uv else None, p if normals else None)
    return file, make


def obj_gem(file):
    """A lumpy octahedron of polygons without normals or uv, one of them a quad (fanned by the reader)."""
    def make(path):
        p = np.array([[1, 0, 0], [-0.9, 0.1, 0], [0, 0.9, 0.1], [0.1, -1, 0], [0, 0.05, 0.9], [0, 0, -1]])
        write_obj(path, p, [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)])
    return file, make


def png(file, kind):
    def make(path):
        rng = np.random.default_rng(len(file))
        if kind == "colour":
            a = rng.integers(40, 256, (5, 6, 3))
        elif kind == "grey":
            a = rng.integers(0, 256, (6, 6))
        elif kind == "alpha":
            a = np.concatenate([rng.integers(40, 256, (5, 6, 3)), rng.integers(0, 256, (5, 6, 1))], -1)
        else:  # smooth, for a lossy format
            y, x = np.mgrid[0:32, 0:32] / 31
            a = np.stack([60 + 180 * x, 60 + 180 * y, 200 - 100 * x * y], -1)
        Image.fromarray(a.astype(np.uint8)).save(path, **({"quality": 95, "subsampling": 0} if path.endswith("jpg") else {}))
    return file, make


def exr_image(file, kind):
    def make(path):
        import OpenEXR
        if kind == "env":
            h, w = 16, 32
            v, u = np.mgrid[0:h, 0:w]
            v, u = v / (h - 1), (u + 0.5) / w
            d = np.stack([np.sin(np.pi * v) * np.sin(2 * np.pi * u), np.cos(np.pi * v), -np.sin(np.pi * v) * np.cos(2 * np.pi * u)], -1)
            sun = np.exp(6 * (d @ np.array([0.6, 0.64, 0.48]) - 1))[..., None]
            a = np.array([0.25, 0.35, 0.5]) * (0.6 + 0.4 * d[..., 1:2]) + sun * np.array([5, 4, 2.5]) + 0.3 * (d[..., :1] > 0.3)
        else:
            a = np.random.default_rng(9).uniform(0.05, 3 if kind == "lamp" else 1, (4, 5, 3))
        ch = {c: np.ascontiguousarray(a[..., i], dtype=np.float32) for i, c in enumerate("RGB")}
        with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, ch) as f:
            f.write(path)
    return file, make


# --- the scenes --------------------------------------------------------------------------------------------------

def still_life():
    return (sphere(-0.9, 0.5, 0.2, 0.5, diffuse("0.8 0.3 0.2")) + sphere(1.1, 0.35, 0.6, 0.35, diffuse("0.2 0.6 0.3")) +
            shape("cube", to_world(scale(0.35), rotate("y", 30), move(0.2, 0.35, -0.4)), diffuse("0.3 0.3 0.8")))


def build():
    # Cameras.
    for axis, w, h in (("y", 48, 32), ("diagonal", 48, 32), ("smaller", 32, 48), ("larger", 32, 48)):
        add(f"fov-axis-{axis}", stage(), still_life(), width=w, height=h, fov=40, extra=st("fov_axis", axis), spp=192)
    add("focal-length", stage(), still_life(), fov=None, extra=st("focal_length", "35mm"), spp=192)
    add("principal-point", stage(), still_life(), width=48, height=40,
        extra=fl("principal_point_offset_x", 0.2) + fl("principal_point_offset_y", -0.15), spp=192)
    add("crop", stage(), still_life(), width=96, height=80, spp=192,
        film=it("crop_offset_x", 30) + it("crop_offset_y", 20) + it("crop_width", 48) + it("crop_height", 40))
    add("thinlens", stage(), still_life(), kind="thinlens", extra=fl("aperture_radius", 0.25) + fl("focus_distance", 4), spp=256)

    # Emitters.
    add("point-light", stage(light=False), still_life(),
        f'<emitter type="point">{rgb("intensity", "6 5 4")}<point name="position" x="1" y="2.2" z="1.5"/></emitter>', spp=96)
    add("spot-light", stage(light=False), still_life(),
        f'<emitter type="spot">{rgb("intensity", "14 12 10")}{fl("cutoff_angle", 35)}{fl("beam_width", 12)}' +
        to_world('<lookat origin="1.5, 3, 2" target="0, 0.3, 0" up="0, 1, 0"/>') + '</emitter>'
        f'<emitter type="spot">{rgb("intensity", "2 4 10")}' + to_world('<lookat origin="-2, 2, 1.5" target="-0.9, 0.3, 0" up="0, 1, 0"/>') +
        '</emitter>', spp=160)
    add("directional-light", stage(light=False), still_life(),
        f'<emitter type="directional">{rgb("irradiance", "2 1.8 1.6")}<vector name="direction" x="-0.6" y="-1" z="-0.5"/></emitter>'
        f'<emitter type="directional">{rgb("irradiance", "0.2 0.4 0.8")}{to_world(rotate("x", 120))}</emitter>', spp=96)
    add("constant-light", stage(light=False), still_life(), f'<emitter type="constant">{rgb("radiance", "0.6 0.8 1")}</emitter>')
    turn = to_world(rotate("y", 70), rotate("x", 25))
    add("envmap-rotated", rect([scale(1.6), rotate("x", -90)], diffuse("0.6 0.6 0.6")), still_life(),
        f'<emitter type="envmap">{st("filename", "env.exr")}{fl("scale", 1.5)}{turn}</emitter>', files=[exr_image("env.exr", "env")],
        fov=60)
    add("hidden-emitters", rect([scale(1.6), rotate("x", -90)], diffuse("0.6 0.6 0.6")), still_life(),
        sphere(0.3, 1.7, 0, 0.3, area("5 5 4")), f'<emitter type="envmap">{st("filename", "env.exr")}</emitter>',
        files=[exr_image("env.exr", "env")], integrator=flag("hide_emitters"), fov=50)
    add("many-lights", stage(light=False), still_life(), sphere(-1.5, 1.8, 0.5, 0.2, area("6 3 1")), sphere(1.6, 1.5, 0, 0.1, area("8 20 40")),
        f'<emitter type="point">{rgb("intensity", "1 1 1")}<point name="position" x="0" y="2.5" z="2"/></emitter>'
        f'<emitter type="constant">{rgb("radiance", "0.1 0.1 0.1")}</emitter>', spp=384)
    add("emitter-shapes", stage(light=False), still_life(),
        shape("disk", to_world(scale(0.4), rotate("x", 120), move(-1, 1.8, 0)), area("9 5 3")),
        shape("cylinder", '<point name="p0" x="0.2" y="1.4" z="-0.6"/><point name="p1" x="1.4" y="1.7" z="-0.2"/>', fl("radius", 0.1), area("3 6 3")),
        shape("cube", to_world(scale(0.15), rotate("y", 30), move(1.4, 1.0, 0.4)), area("2 3 6")), spp=384)
    add("emitter-twosided", stage(light=False), still_life(),
        rect([scale(0.7), rotate("x", 60), move(0, 1.6, 0.6)], bsdf("twosided", diffuse("0.7 0.7 0.3")), area("4 4 4")), spp=256)
    add("emitter-negative-scale", stage(light=False),
        rect([scale(-0.4, 0.4, 0.4), rotate("x", 100), move(-1.1, 1.6, 0)], area("9 5 3")),
        shape("sphere", to_world(scale(-0.4, 0.4, 0.4), move(0.9, 0.7, 0.3)), diffuse("0.6 0.6 0.6"), area("0.5 1 0.5")),
        shape("cube", to_world(scale(0.2, 0.2, -0.2), rotate("y", 30), move(0, 0.5, 0.6)), area("2 3 6")),
        shape("disk", to_world(scale(0.4, 0.4, -0.4), rotate("x", 90), move(0.3, 2.2, 0.5)), area("5 5 5")),
        shape("obj", st("filename", "ball.obj"), to_world(scale(-0.3, 0.3, 0.3), move(-0.9, 0.4, 0.4)), area("1 1 3")),
        shape("obj", st("filename", "plain.obj"), to_world(scale(-0.25, 0.25, 0.25), move(1.5, 1.5, 0)), area("4 2 2")),
        files=[obj_sphere("ball.obj"), obj_sphere("plain.obj", normals=False)], spp=768)
    add("emitter-textured", stage(light=False), still_life(),
        rect([scale(0.9), rotate("x", 20), move(0, 1.7, -0.6)],
             f'<emitter type="area">{bitmap("lamp.exr", flag("raw"), name="radiance")}</emitter>'),
        rect([scale(0.5), rotate("y", 50), move(-1.6, 0.9, 0.4)],
             f'<emitter type="area">{bitmap("colour.png", st("filter_type", "nearest"), name="radiance")}</emitter>'),
        files=[exr_image("lamp.exr", "lamp"), png("colour.png", "colour")], spp=256)
    add("emitter-spectrum", stage(light=False), still_life(),
        rect([scale(0.8), rotate("x", 90), move(0.4, 3.2, 0.8)], f'<emitter type="area">{spectrum("radiance", 8)}</emitter>'), spp=192)

    # Shapes and meshes.
    add("disk-cylinder", stage(),
        shape("disk", to_world(scale(0.5), rotate("x", -60), move(-0.9, 0.6, 0.3)), bsdf("twosided", diffuse("0.8 0.4 0.2"))),
        shape("cylinder", to_world(scale(0.4), rotate("x", -70), move(0.3, 0.3, 0)), bsdf("twosided", diffuse("0.3 0.6 0.8"))),
        shape("cylinder", '<point name="p0" x="0.9" y="0.1" z="0.8"/><point name="p1" x="1.4" y="1.4" z="0.1"/>', fl("radius", 0.2),
              flag("flip_normals"), diffuse("0.7 0.7 0.3")))
    add("turned-shapes", stage(),
        shape("cube", to_world(scale(0.3, 0.5, 0.4), rotate("z", 20), rotate("y", 40), move(-0.9, 0.6, 0)), diffuse("0.8 0.4 0.2")),
        shape("sphere", to_world(rotate("x", 30), scale(0.45), move(0.3, 0.5, 0.4)), diffuse("0.3 0.6 0.8")),
        rect([scale(0.5, 0.3, 1), '<rotate x="0.6" y="0.8" z="0" angle="50"/>', move(1.2, 0.8, 0)], bsdf("twosided", diffuse("0.4 0.7 0.3"))),
        shape("rectangle", to_world('<matrix value="0.3 0.1 0 -0.2  0 0.3 0 1.5  0.1 0 1 0.2  0 0 0 1"/>'), bsdf("twosided", diffuse("0.7 0.7 0.7"))))
    add("sphere-inside", sphere(0, 1, 0, 3, flag("flip_normals"), diffuse("0.5 0.6 0.7")),
        shape("sphere", to_world(scale(0.4), move(0.6, 1.9, 0)), area("6 5 4")), sphere(-0.6, 0.6, 0.5, 0.5, diffuse("0.8 0.3 0.3")),
        origin="0, 1.2, 2.6", fov=60, depth=6)
    add("uv-shapes", stage(),
        *(shape(kind, to_world(scale(r), rotate("x", -65), rotate("y", 20), move(x, y, z)), bsdf("twosided", bsdf("diffuse", bitmap("colour.png",
          st("filter_type", "nearest"), name="reflectance"))))
          for kind, r, x, y, z in (("sphere", 0.45, -1.2, 0.5, 0.3), ("cylinder", 0.4, -0.35, 0.2, 0.4), ("disk", 0.45, 0.4, 0.45, 0.7),
                                   ("cube", 0.3, 1.2, 0.4, 0.5), ("rectangle", 0.45, -0.5, 1.6, -0.2))),
        shape("obj", st("filename", "ball.obj"), to_world(scale(0.45), rotate("y", 100), move(0.6, 1.5, -0.2)),
              bsdf("diffuse", bitmap("colour.png", name="reflectance"))),
        files=[png("colour.png", "colour"), obj_sphere("ball.obj")], spp=192)
    add("obj-normals", stage(),
        shape("obj", st("filename", "ball.obj"), to_world(scale(0.45), move(-1.1, 0.5, 0.3)), diffuse("0.8 0.5 0.4")),
        shape("obj", st("filename", "plain.obj"), to_world(scale(0.45), move(0, 0.5, 0.3)), diffuse("0.4 0.8 0.5")),
        shape("obj", st("filename", "ball.obj"), flag("face_normals"), to_world(scale(0.45), move(1.1, 0.5, 0.3)), diffuse("0.4 0.5 0.8")),
        shape("obj", st("filename", "gem.obj"), to_world(scale(0.4), rotate("y", 20), move(-0.5, 1.6, -0.3)), diffuse("0.7 0.7 0.5")),
        shape("obj", st("filename", "gem.obj"), flag("face_normals"), to_world(scale(0.4), rotate("y", 20), move(0.6, 1.6, -0.3)), diffuse("0.7 0.5 0.7")),
        files=[obj_sphere("ball.obj", 6, 8), obj_sphere("plain.obj", 6, 8, normals=False), obj_gem("gem.obj")], spp=256)
    add("obj-flip-normals", stage(),
        shape("obj", st("filename", "ball.obj"), flag("flip_normals"), to_world(scale(0.45), move(-1.1, 0.5, 0.3)),
              bsdf("twosided", diffuse("0.8 0.5 0.4"), diffuse("0.1 0.3 0.9"))),
        shape("obj", st("filename", "ball.obj"), to_world(scale(0.3, 0.6, 0.4), rotate("z", 30), move(0, 0.6, 0.3)), diffuse("0.4 0.8 0.5")),
        shape("obj", st("filename", "plain.obj"), flag("flip_normals"), flag("face_normals"), to_world(scale(0.45), move(1.1, 0.5, 0.3)),
              bsdf("twosided", diffuse("0.4 0.5 0.8"), diffuse("0.9 0.7 0.1"))),
        shape("obj", st("filename", "ball.obj"), flag("flip_tex_coords", False), to_world(scale(0.4), move(0, 1.6, -0.3)),
              bsdf("diffuse", bitmap("colour.png", name="reflectance"))),
        files=[obj_sphere("ball.obj"), obj_sphere("plain.obj", normals=False), png("colour.png", "colour")])
    add("coarse-smooth-spheres", stage(),
        shape("obj", st("filename", "ball.obj"), to_world(scale(0.6), move(-0.8, 0.6, 0.2)), diffuse("0.8 0.8 0.8")),
        shape("obj", st("filename", "ball.obj"), to_world(scale(0.5), rotate("x", 40), move(0.8, 0.6, 0.4)), diffuse("0.7 0.4 0.3")),
        files=[obj_sphere("ball.obj", 6, 9)], depth=6, spp=384, note="light-side methods need the adjoint shading-normal factor here")
    add("far-from-origin",
        '<default name="x" value="2000"/><default name="z" value="-1500"/>',
        rect([scale(3), rotate("x", -90), move("$x", 0, "$z")], diffuse("0.6 0.6 0.6")),
        shape("sphere", to_world(scale(0.6), move(-0.7, 0.6, 0.2), move("$x", 0, "$z")), diffuse("0.8 0.4 0.3")),
        shape("sphere", to_world(scale(0.4), move(0.8, 0.4, 0.4), move("$x", 0, "$z")), bsdf("dielectric", fl("int_ior", 1.5), fl("ext_ior", 1))),
        rect([scale(1), rotate("x", 90), move(0.4, 3.2, 0.8), move("$x", 0, "$z")], area("8 7 6")),
        sensor=camera().replace("</transform><sampler", '<translate x="$x" z="$z"/></transform><sampler'),
        reference_defines=["x=0", "z=0"], depth=6, spp=512,
        note="the reference is rendered at the origin (x=0, z=0), where single precision does no harm")

    # Materials.
    def balls(*materials, y=0.5):
        n = len(materials)
        r = min(0.5, 1.5 / n)
        return "".join(sphere(round((i - (n - 1) / 2) * 2.2 * r, 3), r if y is None else y, 0.3, round(r, 3), m) for i, m in enumerate(materials))

    striped = checker(to_world(scale(6), name="to_uv"), rgb("color0", "0.7 0.6 0.2"), rgb("color1", "0.2 0.3 0.6"), name="reflectance")
    wall = bsdf("diffuse", striped)
    ior = fl("int_ior", 1.5) + fl("ext_ior", 1)
    for d in ("ggx", "beckmann"):
        add(f"roughdielectric-{d}", stage(wall=wall), balls(bsdf("roughdielectric", st("distribution", d), fl("alpha", 0.25), ior),
            bsdf("roughdielectric", st("distribution", d), fl("alpha", 0.6), fl("int_ior", 1.33), fl("ext_ior", 1))),
            rect([scale(0.5), rotate("y", 15), move(-1.2, 1.7, 0)], bsdf("roughdielectric", st("distribution", d), fl("alpha", 0.15), ior)),
            depth=8, spp=1024)
        add(f"roughconductor-{d}", stage(wall=wall), balls(
            bsdf("roughconductor", st("distribution", d), st("material", "Cu"), fl("alpha", 0.3)),
            bsdf("roughconductor", st("distribution", d), rgb("eta", "1.6575 0.880405 0.521244"), rgb("k", "9.22381 6.2695 4.837"),
                 fl("alpha_u", 0.15), fl("alpha_v", 0.5)),
            bsdf("roughconductor", st("distribution", d), fl("alpha", 0.2), rgb("specular_reflectance", "0.9 0.7 0.5"))),
            shape("cylinder", to_world(scale(0.3), rotate("y", 60), move(-0.6, 1.6, -0.3)),
                  bsdf("twosided", bsdf("roughconductor", st("distribution", d), st("material", "Au"), fl("alpha_u", 0.1), fl("alpha_v", 0.4)))),
            shape("obj", st("filename", "ball.obj"), to_world(scale(0.4), move(0.8, 1.6, -0.2)),
                  bsdf("roughconductor", st("distribution", d), st("material", "Ag"), fl("alpha_u", 0.4), fl("alpha_v", 0.1))),
            files=[obj_sphere("ball.obj", 10, 16)], spp=512)
    red = rgb("diffuse_reflectance", "0.8 0.3 0.2")
    add("roughplastic", stage(), balls(bsdf("roughplastic", red, fl("alpha", 0.1)),
        bsdf("roughplastic", red, fl("alpha", 0.3), flag("nonlinear"), ior),
        bsdf("roughplastic", red, fl("alpha", 0.3), st("distribution", "ggx"), ior),
        bsdf("roughplastic", red, fl("alpha", 0.5), st("distribution", "ggx"), flag("nonlinear"), rgb("specular_reflectance", "0.5 0.6 0.7"))),
        rect([scale(0.6), rotate("x", -10), move(0, 1.6, -0.4)],
             bsdf("roughplastic", fl("alpha", 0.15), bitmap("colour.png", name="diffuse_reflectance"))), files=[png("colour.png", "colour")], spp=512)
    add("plastic", stage(), balls(bsdf("plastic", red), bsdf("plastic", red, flag("nonlinear")), bsdf("plastic", red, ior, rgb("specular_reflectance", "0.4 0.5 0.6"))),
        rect([scale(0.6), rotate("x", -10), move(0, 1.6, -0.4)],
             bsdf("plastic", flag("nonlinear"), bitmap("colour.png", name="diffuse_reflectance"))), files=[png("colour.png", "colour")], spp=512)
    add("conductor", stage(wall=wall), balls(bsdf("conductor", st("material", "Cu")), bsdf("conductor"),
        bsdf("twosided", bsdf("conductor", st("material", "Au"), rgb("specular_reflectance", "0.5 0.8 0.9"))),
        bsdf("conductor", rgb("eta", "1.5 1 0.5"), rgb("k", "3 2 4"))), spp=512)
    add("dielectric", stage(wall=wall), balls(bsdf("dielectric"), bsdf("dielectric", st("int_ior", "water"), st("ext_ior", "air"),
        rgb("specular_transmittance", "0.5 0.8 0.9")), bsdf("dielectric", fl("int_ior", 1), fl("ext_ior", 1.4))), depth=10, spp=1024)
    add("dielectric-furnace", shape("sphere", fl("radius", 3), flag("flip_normals"), diffuse(0.5), area("0.5 0.5 0.5")),
        sphere(0, 0.7, 0, 0.6, bsdf("dielectric", ior)), shape("cube", to_world(scale(0.3), rotate("y", 30), move(0.9, 0.5, 0.4)), bsdf("dielectric", st("int_ior", "diamond"))),
        origin="0, 1.0, 2.6", fov=60, depth=-1, spp=64, note="radiance 1 everywhere: a dielectric in an isotropic field is invisible")
    add("light-in-glass", stage(light=False), shape("cube", to_world(scale(0.6), rotate("y", 25), move(0, 0.61, 0)), bsdf("dielectric", ior)),
        sphere(0, 0.61, 0, 0.4, area("4 4 3")), f'<emitter type="constant">{rgb("radiance", "0.3 0.3 0.4")}</emitter>', depth=8, spp=1536)
    add("thindielectric", stage(wall=wall), balls(bsdf("thindielectric"), bsdf("thindielectric", ior, rgb("specular_transmittance", "0.5 0.8 0.9"))),
        rect([scale(0.6), rotate("y", 40), move(0.9, 1.5, 0)], bsdf("thindielectric", fl("int_ior", 2.2), fl("ext_ior", 1))), depth=8, spp=1024)
    two = (diffuse("0.9 0.2 0.1"), diffuse("0.1 0.2 0.9"))
    add("blendbsdf", stage(), balls(bsdf("blendbsdf", fl("weight", 0.25), *two), bsdf("blendbsdf", fl("weight", 0.6), two[0], bsdf("roughconductor", fl("alpha", 0.3)))),
        rect([scale(0.6), rotate("y", 20), move(-0.9, 1.6, -0.2)], bsdf("blendbsdf", bitmap("grey.png", flag("raw"), name="weight"), *two)),
        rect([scale(0.6), rotate("y", -20), move(0.9, 1.6, -0.2)], bsdf("blendbsdf", checker(to_world(scale(2), name="to_uv"), name="weight"), *two)),
        files=[png("grey.png", "grey")], spp=256)
    add("mask", stage(), rect([scale(0.6), rotate("y", 20), move(-0.8, 0.6, 0.4)], bsdf("mask", bitmap("grey.png", flag("raw"), name="opacity"), bsdf("twosided", two[0]))),
        rect([scale(0.6), rotate("y", -20), move(0.8, 0.6, 0.4)], bsdf("mask", checker(fl("color0", 0.9), fl("color1", 0), to_world(scale(3), name="to_uv"), name="opacity"),
                                                                        bsdf("twosided", two[1]))),
        sphere(0, 1.5, 0, 0.4, bsdf("mask", fl("opacity", 0.4), two[1])), files=[png("grey.png", "grey")], depth=8, spp=512)
    add("twosided", stage(), *(rect([scale(0.5), rotate("y", a), move(x, y, 0.3)], m) for a, x, y, m in (
        (20, -1.1, 0.6, bsdf("twosided", two[0])), (200, 0, 0.6, bsdf("twosided", two[0])), (200, 1.1, 0.6, bsdf("twosided", *two)),
        (200, -0.6, 1.7, two[0]), (20, 0.6, 1.7, bsdf("twosided", bsdf("roughplastic", red), two[1])))))

    # Textures and parameters.
    for filt in ("bilinear", "nearest"):
        tile = to_world(scale(2.5, 2.5, 1), '<translate x="-0.6" y="-0.7"/>', name="to_uv")
        add(f"bitmap-wrap-{filt}", stage(), *(rect([scale(0.55), move(x, y, -0.2)], bsdf("diffuse", bitmap("colour.png", st("wrap_mode", mode), st("filter_type", filt),
            flag("raw", raw), tile, name="reflectance"))) for x, y, mode, raw in ((-1.15, 0.6, "repeat", False), (0, 0.6, "mirror", False), (1.15, 0.6, "clamp", False),
                                                                                (-0.6, 1.75, "repeat", True), (0.6, 1.75, "mirror", True))),
            files=[png("colour.png", "colour")], spp=128)
    turned = to_world(scale(3, 2, 1), rotate("z", 30), '<translate x="0.3" y="0.1"/>', name="to_uv")
    add("checkerboard-to-uv", stage(floor=bsdf("diffuse", checker(to_world(scale(4, 3, 1), name="to_uv"), name="reflectance"))),
        rect([scale(0.7), move(-0.9, 0.9, 0)], bsdf("diffuse", checker(rgb("color0", "0.9 0.2 0.1"), rgb("color1", "0.1 0.3 0.8"), turned, name="reflectance"))),
        rect([scale(0.7), move(0.9, 0.9, 0)], bsdf("diffuse", checker(bitmap("colour.png", name="color0"), rgb("color1", "0.05 0.05 0.05"),
                                                                    to_world(rotate("z", 45), scale(2), name="to_uv"), name="reflectance"))),
        files=[png("colour.png", "colour")], spp=128)
    add("bitmap-formats", stage(), *(rect([scale(0.5), move(x, y, -0.2)], bsdf("diffuse", bitmap(f, *more, name="reflectance"))) for x, y, f, more in (
        (-1.1, 0.55, "smooth.jpg", ()), (0, 0.55, "alpha.png", ()), (1.1, 0.55, "grey.png", ()), (-0.6, 1.7, "grey.png", (flag("raw"),)), (0.6, 1.7, "low.exr", ()))),
        files=[png("smooth.jpg", "smooth"), png("alpha.png", "alpha"), png("grey.png", "grey"), exr_image("low.exr", "reflectance")], spp=128)
    add("single-values", stage(), balls(bsdf("diffuse", spectrum("reflectance", 0.3)), bsdf("diffuse", rgb("reflectance", 0.7)), bsdf("diffuse", rgb("reflectance", "0.75,0.5,0.25")),
        bsdf("diffuse"), bsdf("roughplastic", spectrum("diffuse_reflectance", 0.2))), spp=192)
    inc = f'<scene version="3.0.0">{bsdf("diffuse", rgb("reflectance", "0.2 0.6 0.8"), id="blue")}' + \
        '<default name="size" value="0.3"/>' + shape("cube", to_world(scale("$size"), move(0.9, "$size", 0.4)), '<ref id="blue"/>') + "</scene>"
    add("include-default-ref", '<default name="size" value="0.5"/><default name="light" value="8, 7, 6"/>', stage(light=False), '<include filename="part.xml"/>',
        bsdf("twosided", diffuse("0.8 0.3 0.3"), id="red"), '<texture type="checkerboard" id="squares"/>',
        sphere(-0.9, "$size", 0.2, "$size", '<ref id="red"/>'),
        rect([scale(0.5), move(0, 1.4, -0.5)], bsdf("diffuse", '<ref id="squares" name="reflectance"/>')),
        rect([scale(0.8), rotate("x", 90), move(0.4, 3.2, 0.8)], '<ref id="blue"/>', f'<emitter type="area"><rgb name="radiance" value="$light"/></emitter>'),
        extra_files={"part.xml": inc}, spp=192)


def pretty(text):
    root = ET.fromstring(text)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def main():
    build()
    manifest = []
    for s in SCENES:
        folder = os.path.join(HERE, s["name"])
        os.makedirs(folder, exist_ok=True)
        text = f'<scene version="3.0.0"><integrator type="path">{it("max_depth", s["depth"])}{s["integrator"]}</integrator>'
        defaults = ""
        body = s["body"]
        while body.startswith("<default"):  # defaults come before what uses them
            end = body.index("/>") + 2
            defaults, body = defaults + body[:end], body[end:]
        text += defaults + s["sensor"] + body + "</scene>"
        with open(os.path.join(folder, "scene.xml"), "w") as f:
            f.write(pretty(text))
        for file, content in s["extra"].items():
            with open(os.path.join(folder, file), "w") as f:
                f.write(pretty(content))
        for file, make in s["files"]:
            make(os.path.join(folder, file))
        entry = {"name": s["name"], "scene": f"{s['name']}/scene.xml", "reference": f"{s['name']}/reference", "max_depth": s["depth"], "rr_depth": 5,
                 "runs": 16, "spp": s["spp"], "seed": 1}
        if s["reference_defines"]:
            entry["defines"] = s["reference_defines"]
        if s["note"]:
            entry["note"] = s["note"]
        manifest.append(entry)
    with open(os.path.join(HERE, "manifest.json"), "w") as f:
        f.write('{"scenes": [\n' + ",\n".join(json.dumps(e) for e in manifest) + "\n]}\n")
    print(len(manifest), "scenes")


if __name__ == "__main__":
    main()
