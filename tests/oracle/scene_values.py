#!/usr/bin/env python3
"""Values of Mitsuba's cameras, emitters, textures and shapes, as gold data.

Writes camera_values.json, emitter_values.json, texture_values.json and shape_values.json beside this file, and the small
images they use into data/ (paths in the XML are relative to this folder). Every entry carries its XML.

camera: `film` is [x, y] in pixels of the full film (pixel i spans [i, i+1)), also for crops; `o` lies on the near plane,
        `d` is normalised, `aperture` the pair that places the ray on a lens.
emitter: `shade` entries: from the point `p` (with normal `n`) the random pair `u` gave direction `d`, distance `dist`,
        density `pdf` (solid angle; 0 with `delta`), `weight` = radiance / pdf (for delta lights the incident
        irradiance at normal incidence). `toward` entries: radiance `value` seen along `d` from `p`, and the density
        `pdf` with which the emitter would have chosen that direction. `falloff` (spots): intensity at an angle (degrees) off the axis. `emit` entries: a light ray from the pairs
        `u2`, `u3` with `weight` = power carried by one such ray.
texture: `value` (RGB) and `scalar` (what a mask's opacity or a blend's weight sees) at `uv`.
shape: rays `o`, `d` (the direction's length is kept as 1) with the first hit: `t`, `p`, geometric `n`, shading `sh_n`, `uv`,
        `dp_du`, `dp_dv`; `area` is the shape's.
"""
import json
import math
import os

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))


def num(x):
    """The shortest decimal that reads back as the same 32-bit float."""
    return float(str(np.float32(x)))


def vec(v):
    return [num(x) for x in np.array(v).ravel()]


def write(name, doc):
    path = os.path.join(HERE, name)
    text = json.dumps(doc, separators=(",", ":"))
    for key in ("name", "film", "p", "uv", "o", "u2"):
        text = text.replace('{"%s"' % key, '\n{"%s"' % key)
    with open(path, "w") as fh:
        fh.write(text + "\n")
    print(name, os.path.getsize(path), "bytes")


def write_exr(path, rgb):
    import OpenEXR
    ch = {c: np.ascontiguousarray(rgb[..., i], dtype=np.float32) for i, c in enumerate("RGB")}
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, ch) as f:
        f.write(path)


def images():
    from PIL import Image
    os.makedirs(os.path.join(HERE, "data"), exist_ok=True)
    rng = np.random.default_rng(11)
    env = rng.uniform(0.1, 2.0, (8, 16, 3))
    write_exr(os.path.join(HERE, "data/env.exr"), env)
    tex = rng.integers(0, 256, (3, 4, 3), dtype=np.uint8)
    Image.fromarray(tex).save(os.path.join(HERE, "data/texture.png"))
    Image.fromarray(tex[..., 0]).save(os.path.join(HERE, "data/grey.png"))
    alpha = np.concatenate([tex, rng.integers(0, 256, (3, 4, 1), dtype=np.uint8)], -1)
    Image.fromarray(alpha).save(os.path.join(HERE, "data/alpha.png"))
    write_exr(os.path.join(HERE, "data/texture.exr"), rng.uniform(0, 1, (3, 4, 3)))


SCENE = '<scene version="3.0.0">{}</scene>'
LOOK = '<transform name="to_world"><lookat origin="1, 2, 5" target="0.2, 0.1, 0" up="0, 1, 0"/></transform>'


def fl(name, value):
    return f'<float name="{name}" value="{value}"/>'


def st(name, value):
    return f'<string name="{name}" value="{value}"/>'


def film(w, h, crop=None):
    body = f'<integer name="width" value="{w}"/><integer name="height" value="{h}"/>'
    if crop:
        for k, v in zip(("crop_offset_x", "crop_offset_y", "crop_width", "crop_height"), crop):
            body += f'<integer name="{k}" value="{v}"/>'
    return f'<film type="hdrfilm">{body}<rfilter type="box"/></film>'


def sensor(kind, *body):
    return f'<sensor type="{kind}">{"".join(body)}</sensor>'


def cameras():
    for axis in ("x", "y", "smaller", "larger", "diagonal"):
        yield f"fov_axis-{axis}", sensor("perspective", fl("fov", 40), st("fov_axis", axis), LOOK, film(60, 40)), None
    yield "fov_axis-smaller-portrait", sensor("perspective", fl("fov", 40), st("fov_axis", "smaller"), LOOK, film(40, 60)), None
    yield "fov_axis-larger-portrait", sensor("perspective", fl("fov", 40), st("fov_axis", "larger"), LOOK, film(40, 60)), None
    yield "default", sensor("perspective", film(60, 40)), None
    yield "default-square", sensor("perspective", film(48, 48)), None
    yield "focal_length", sensor("perspective", st("focal_length", "35mm"), LOOK, film(60, 40)), None
    yield "principal-point", sensor("perspective", fl("fov", 40), fl("principal_point_offset_x", 0.25),
                                    fl("principal_point_offset_y", -0.1), LOOK, film(60, 40)), None
    yield "crop", sensor("perspective", fl("fov", 40), LOOK, film(60, 40, (10, 5, 24, 20))), (10, 5, 24, 20)
    yield "crop-offset-principal", sensor("perspective", fl("fov", 40), fl("principal_point_offset_x", 0.25), LOOK,
                                          film(60, 40, (10, 5, 24, 20))), (10, 5, 24, 20)
    yield "clip", sensor("perspective", fl("fov", 40), fl("near_clip", 0.5), fl("far_clip", 50), LOOK, film(60, 40)), None
    matrix = '<transform name="to_world"><rotate x="1" angle="20"/><rotate y="1" angle="30"/><translate x="1" y="2" z="3"/></transform>'
    yield "rotate-translate", sensor("perspective", fl("fov", 40), matrix, film(60, 40)), None
    flip = '<transform name="to_world"><matrix value="-1 0 0 1  0 1 0 2  0 0 1 3  0 0 0 1"/></transform>'
    yield "mirrored-matrix", sensor("perspective", fl("fov", 40), flip, film(60, 40)), None
    yield "thinlens", sensor("thinlens", fl("fov", 40), fl("aperture_radius", 0.2), fl("focus_distance", 3), LOOK, film(60, 40)), None
    yield "thinlens-crop", sensor("thinlens", fl("fov", 40), fl("aperture_radius", 0.2), fl("focus_distance", 3), LOOK,
                                  film(60, 40, (10, 5, 24, 20))), (10, 5, 24, 20)


FLOOR = '<shape type="rectangle"><transform name="to_world"><scale value="3"/></transform></shape>'
ROT = '<transform name="to_world"><rotate x="0.6" y="0.8" z="0" angle="50"/></transform>'
AREA = '<emitter type="area"><rgb name="radiance" value="1 2 3"/></emitter>'
AREA_TEX = '<emitter type="area"><texture type="bitmap" name="radiance"><string name="filename" value="data/texture.exr"/><boolean name="raw" value="true"/></texture></emitter>'
PLACE = '<transform name="to_world"><scale value="0.5"/><rotate x="1" angle="150"/><translate x="0.3" y="0.2" z="3"/></transform>'
INTENSITY = '<rgb name="intensity" value="1 2 3"/>'


def emitters():
    yield "point", '<emitter type="point">' + INTENSITY + '<point name="position" x="0.5" y="-0.3" z="2"/></emitter>'
    yield "point-to_world", '<emitter type="point">' + INTENSITY + '<transform name="to_world"><translate x="0.5" y="-0.3" z="2"/></transform></emitter>'
    spot = '<transform name="to_world"><lookat origin="0.5, 0.2, 2" target="0, 0, 0" up="0, 1, 0"/></transform>'
    yield "spot-default", f'<emitter type="spot">{INTENSITY}{spot}</emitter>'
    yield "spot", f'<emitter type="spot">{INTENSITY}{fl("cutoff_angle", 50)}{fl("beam_width", 20)}{spot}</emitter>'
    yield "directional", '<emitter type="directional"><rgb name="irradiance" value="1 2 3"/><vector name="direction" x="0.3" y="-0.2" z="-2"/></emitter>'
    yield "directional-to_world", f'<emitter type="directional"><rgb name="irradiance" value="1 2 3"/>{ROT}</emitter>'
    yield "constant", '<emitter type="constant"><rgb name="radiance" value="1 2 3"/></emitter>'
    env = '<string name="filename" value="data/env.exr"/>'
    yield "envmap", f'<emitter type="envmap">{env}</emitter>'
    yield "envmap-rotated-scaled", f'<emitter type="envmap">{env}{fl("scale", 2.5)}{ROT}</emitter>'
    yield "area-rectangle", f'<shape type="rectangle">{PLACE}{AREA}</shape>'
    yield "area-rectangle-textured", f'<shape type="rectangle">{PLACE}{AREA_TEX}</shape>'
    yield "area-rectangle-flipped", f'<shape type="rectangle">{PLACE}<boolean name="flip_normals" value="true"/>{AREA}</shape>'
    neg = PLACE.replace('<scale value="0.5"/>', '<scale x="-0.5" y="0.5" z="0.5"/>')
    yield "area-rectangle-negative", f'<shape type="rectangle">{neg}{AREA}</shape>'
    yield "area-disk", f'<shape type="disk">{PLACE}{AREA}</shape>'
    yield "area-sphere", f'<shape type="sphere">{PLACE}{AREA}</shape>'
    yield "area-cylinder", f'<shape type="cylinder">{PLACE}{AREA}</shape>'
    yield "area-cube", f'<shape type="cube">{PLACE}{AREA}</shape>'
    yield "spectrum-radiance", f'<shape type="rectangle">{PLACE}<emitter type="area"><spectrum name="radiance" value="2"/></emitter></shape>'


def textures():
    uv = '<transform name="to_uv"><scale x="2" y="3"/><rotate z="1" angle="30"/><translate x="0.3" y="0.1"/></transform>'
    for file in ("texture.png", "texture.exr", "grey.png", "alpha.png"):
        yield f"bitmap-{file}", f'<texture type="bitmap"><string name="filename" value="data/{file}"/></texture>'
    for filt in ("bilinear", "nearest"):
        for wrap in ("repeat", "mirror", "clamp"):
            yield (f"bitmap-{filt}-{wrap}", f'<texture type="bitmap"><string name="filename" value="data/texture.png"/>'
                   f'{st("filter_type", filt)}{st("wrap_mode", wrap)}</texture>')
    yield "bitmap-raw", '<texture type="bitmap"><string name="filename" value="data/texture.png"/><boolean name="raw" value="true"/></texture>'
    yield "bitmap-to_uv", f'<texture type="bitmap"><string name="filename" value="data/texture.png"/>{uv}</texture>'
    yield "checkerboard", '<texture type="checkerboard"/>'
    yield "checkerboard-colours", '<texture type="checkerboard"><rgb name="color0" value="0.1 0.2 0.3"/><rgb name="color1" value="0.7 0.8 0.9"/></texture>'
    yield "checkerboard-to_uv", f'<texture type="checkerboard">{uv}</texture>'


def shapes():
    turn = '<transform name="to_world"><scale value="0.7"/><rotate x="0.48" y="-0.6" z="0.64" angle="40"/><translate x="0.2" y="-0.1" z="0.3"/></transform>'
    uneven = '<transform name="to_world"><scale x="0.5" y="0.8" z="1.2"/><rotate y="1" angle="40"/></transform>'
    mirror = '<transform name="to_world"><scale x="-1" y="1" z="1"/></transform>'
    flip = '<boolean name="flip_normals" value="true"/>'
    for kind in ("rectangle", "cube", "sphere", "disk", "cylinder"):
        yield kind, f'<shape type="{kind}"/>'
        yield f"{kind}-turned", f'<shape type="{kind}">{turn}</shape>'
        yield f"{kind}-flip_normals", f'<shape type="{kind}">{turn}{flip}</shape>'
        yield f"{kind}-mirrored", f'<shape type="{kind}">{mirror}</shape>'
        if kind not in ("sphere", "cylinder"):  # Mitsuba warns there, and takes one axis for the radius
            yield f"{kind}-uneven", f'<shape type="{kind}">{uneven}</shape>'
    yield "sphere-centre", '<shape type="sphere"><point name="center" x="0.2" y="-0.3" z="0.1"/><float name="radius" value="0.6"/></shape>'
    yield "sphere-centre-turned", f'<shape type="sphere"><point name="center" x="0.2" y="-0.3" z="0.1"/><float name="radius" value="0.6"/>{turn}</shape>'
    yield "cylinder-points", '<shape type="cylinder"><point name="p0" x="0.2" y="-0.5" z="0.1"/><point name="p1" x="-0.3" y="0.4" z="0.6"/><float name="radius" value="0.3"/></shape>'
    for tag, body in (("", ""), ("-face_normals", '<boolean name="face_normals" value="true"/>'), ("-flip_normals", flip),
                      ("-no_flip_tex_coords", '<boolean name="flip_tex_coords" value="false"/>'), ("-mirrored", mirror), ("-uneven", uneven)):
        for file in ("blob_vn", "blob_plain"):
            yield f"obj-{file}{tag}", f'<shape type="obj"><string name="filename" value="data/{file}.obj"/>{body}</shape>'


def blob():
    """A lumpy octahedron with uv, with and without vertex normals that are not the faces'."""
    pts = np.array([[1, 0, 0], [-0.9, 0.1, 0], [0, 1.1, 0], [0.1, -1, 0], [0, 0.05, 0.8], [0, 0, -1.2]])
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for name, normals in (("blob_vn", True), ("blob_plain", False)):
        with open(os.path.join(HERE, f"data/{name}.obj"), "w") as f:
            for p in pts:
                f.write("v %g %g %g\n" % tuple(p))
            for p in pts:
                f.write("vt %g %g\n" % (round(0.5 + p[0] / 3, 3), round(0.5 + p[1] / 4 + p[2] / 5, 3)))
            if normals:
                for p in pts:
                    n = p / np.linalg.norm(p)
                    f.write("vn %.6f %.6f %.6f\n" % tuple(n))
            for face in faces:
                f.write("f " + " ".join(f"{i+1}/{i+1}/{i+1}" if normals else f"{i+1}/{i+1}" for i in face) + "\n")


def main():
    os.chdir(HERE)
    images()
    blob()
    import drjit as dr
    import mitsuba as mi
    mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    head = {"mitsuba": mi.__version__, "variant": "scalar_rgb", "about": " ".join(__doc__.split())}

    def load(xml):
        return mi.load_string(SCENE.format(xml))

    def plugin(xml):
        return mi.load_string(xml.replace(">", ' version="3.0.0">', 1) if not xml.endswith("/>") or xml.count("<") > 1
                              else xml.replace("/>", ' version="3.0.0"/>'))

    out = []
    for name, xml, crop in cameras():
        s = load(xml).sensors()[0]
        size = [int(x) for x in s.film().size()]
        off, dim = (crop[:2], crop[2:]) if crop else ((0, 0), size)
        lens = "thinlens" in name
        rays = []
        for fx, fy in ((0, 0), (1, 0), (0, 1), (1, 1), (0.5, 0.5), (0.25, 0.5), (0.5, 0.25), (0.8125, 0.34375)):
            for ap in ((0.5, 0.5), (0.1, 0.3), (0.9, 0.6), (0.7, 0.05)) if lens else ((0.5, 0.5),):
                ray, w = s.sample_ray(0.0, 0.5, [fx, fy], list(ap))
                e = {"film": [off[0] + fx * dim[0], off[1] + fy * dim[1]], "o": vec(ray.o), "d": vec(ray.d), "maxt": num(ray.maxt)}
                if lens:
                    e["aperture"] = list(ap)
                rays.append(e)
        out.append({"name": name, "xml": xml, "film_size": size, "output_size": list(dim), "rays": rays})
    write("camera_values.json", {**head, "cameras": out})

    out = []
    for name, xml in emitters():
        rng = np.random.default_rng(5)
        scene = load(xml + FLOOR)
        e = scene.emitters()[0]
        shade, toward, emit = [], [], []
        pts = [([0.1, 0.2, 0], [0, 0, 1]), ([-0.8, 0.5, 0], [0, 0, 1]), ([0.3, 0.2, 2.5], [0, 0, 1]), ([2.5, -2.8, 0], [0, 0, 1])]
        for p, n in pts:
            it = dr.zeros(mi.SurfaceInteraction3f)
            it.p, it.n = p, n
            for _ in range(6):
                u = [num(x) for x in rng.random(2)]
                ds, w = e.sample_direction(it, u)
                shade.append({"p": p, "n": n, "u": u, "d": vec(ds.d), "dist": num(ds.dist), "pdf": num(ds.pdf), "delta": bool(ds.delta),
                              "weight": vec(w), "emitter_n": vec(ds.n)})
            if name.startswith(("area", "spectrum", "constant", "envmap")):
                axes = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
                for k in range(18):
                    d = rng.normal(size=3) if k < 12 or p != pts[2][0] or not name.startswith(("constant", "envmap")) else np.array(axes[k - 12])
                    if name.startswith(("area", "spectrum")):
                        d = np.array([0.3, 0.2, 3]) - p + 0.3 * d
                    d = [num(x) for x in d / np.linalg.norm(d)]
                    si = scene.ray_intersect(mi.Ray3f(mi.Point3f(p), mi.Vector3f(d)))
                    if si.emitter(scene) is None:
                        continue
                    ds = mi.DirectionSample3f(scene, si, it)
                    toward.append({"p": p, "d": d, "value": vec(si.emitter(scene).eval(si)), "pdf": num(e.pdf_direction(it, ds)),
                                   "dist": num(si.t) if math.isfinite(si.t) else None})
        for _ in range(6):
            u2, u3 = [num(x) for x in rng.random(2)], [num(x) for x in rng.random(2)]
            ray, w = e.sample_ray(0.0, 0.5, u2, u3)
            emit.append({"u2": u2, "u3": u3, "o": vec(ray.o), "d": vec(ray.d), "weight": vec(w)})
        falloff = []
        if name.startswith("spot"):
            o, to = np.array([0.5, 0.2, 2.0]), np.array([-0.5, -0.2, -2.0])
            to /= np.linalg.norm(to)
            side = np.cross(to, [0, 1, 0])
            side /= np.linalg.norm(side)
            for deg in (0, 5, 10, 14, 16, 18, 19.5, 22, 30, 40, 45, 49.5, 51, 90, 120):
                a = math.radians(deg)
                it = dr.zeros(mi.SurfaceInteraction3f)
                it.p = [float(x) for x in o + 2 * (math.cos(a) * to + math.sin(a) * side)]
                w = np.array(e.sample_direction(it, [0.5, 0.5])[1]) * 4
                falloff.append({"angle": deg, "intensity": vec(w)})
        bs = scene.bbox().bounding_sphere()
        out.append({"name": name, "xml": xml, "floor": FLOOR, "bounding_sphere": vec(bs.center) + [num(bs.radius)], "shade": shade,
                    "toward": toward, "emit": emit, **({"falloff": falloff} if falloff else {})})
    write("emitter_values.json", {**head, "emitters": out})

    out = []
    for name, xml in textures():
        t = plugin(xml)
        rng = np.random.default_rng(3)
        pts = [[i / 8, j / 6] for i in range(-2, 11, 3) for j in range(-1, 8, 2)] + [[0.125, 1 / 6], [0.2, 0.2], [0.7, 0.2], [0.2, 0.7], [0.7, 0.7]]
        pts += [list(x) for x in rng.uniform(-2, 3, (24, 2))]
        vals = []
        for p in pts:
            p = [num(x) for x in p]
            si = dr.zeros(mi.SurfaceInteraction3f)
            si.uv = p
            vals.append({"uv": p, "value": vec(t.eval(si)), "scalar": num(t.eval_1(si)) if "colours" not in name else None})
        out.append({"name": name, "xml": xml, "mean": num(t.mean()), "values": vals})
    write("texture_values.json", {**head, "textures": out})

    out, refused = [], []
    for name, xml in shapes():
        try:
            scene = load(xml)
        except Exception as ex:
            refused.append({"name": name, "xml": xml, "message": str(ex).strip().split("\n")[-1][:200]})
            continue
        rng = np.random.default_rng(7)
        sh = scene.shapes()[0]
        hits = []
        for k in range(24):
            o = rng.normal(size=3)
            o = 3 * o / np.linalg.norm(o)
            if k % 6 == 5:
                o = o * 0.05  # from the inside
            d = rng.uniform(-0.5, 0.5, 3) - o if k % 6 != 5 else rng.normal(size=3)
            o, d = [num(x) for x in o], [num(x) for x in d / np.linalg.norm(d)]
            si = scene.ray_intersect(mi.Ray3f(mi.Point3f(o), mi.Vector3f(d)))
            e = {"o": o, "d": d, "hit": bool(si.is_valid())}
            if si.is_valid():
                e.update(t=num(si.t), p=vec(si.p), n=vec(si.n), sh_n=vec(si.sh_frame.n), uv=vec(si.uv), dp_du=vec(si.dp_du), dp_dv=vec(si.dp_dv),
                         frame_s=vec(si.sh_frame.s))
            hits.append(e)
        out.append({"name": name, "xml": xml, "area": num(sh.surface_area()), "rays": hits})
    write("shape_values.json", {**head, "shapes": out, "refused": refused})


if __name__ == "__main__":
    main()
