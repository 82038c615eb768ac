#!/usr/bin/env python3
"""Values of Mitsuba's BSDFs, as gold data: writes bsdf_values.json (beside this file, or -o FILE).

Each entry holds the BSDF as XML, so that a test exercises its own loader as well. All directions are local
(z is the shading normal, x is dp_du), both pointing away from the surface; uv is the surface position.
`value` is f(wi, wo) * |cos(wo)| as RGB, `pdf` the solid-angle density of sampling wo from wi. Delta lobes
contribute to `samples` only: there `weight` is value / pdf, `discrete` says that `pdf` is a probability,
`eta` is the relative index along the sampled direction, `u` the lobe-choosing number, `uv2` the pair that
places the direction.
`mode` is `radiance` (paths from the camera) or `importance` (paths from a light).
"""
import argparse
import json
import math
import os

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
AL = '<rgb name="eta" value="1.6575 0.880405 0.521244"/><rgb name="k" value="9.22381 6.2695 4.837"/>'
AU = '<rgb name="eta" value="0.143036 0.375307 1.44205"/><rgb name="k" value="3.983 2.38556 1.60336"/>'


def f(name, value):
    return f'<float name="{name}" value="{value}"/>'


def rgb(name, value):
    return f'<rgb name="{name}" value="{value}"/>'


def b(kind, *body, name=None):
    attr = f' name="{name}"' if name else ""
    return f'<bsdf type="{kind}"{attr}>{"".join(body)}</bsdf>'


def s(name, value):
    return f'<string name="{name}" value="{value}"/>'


def flag(name, value):
    return f'<boolean name="{name}" value="{str(value).lower()}"/>'


CHECKER = '<texture type="checkerboard" name="{}"/>'
RED = rgb("diffuse_reflectance", "0.8 0.5 0.2")


def entries():
    """(name, XML, sides): sides is `front` (upper hemisphere mostly) or `both`."""
    yield "diffuse", b("diffuse", rgb("reflectance", "0.1 0.5 0.9")), "front"
    yield "diffuse-default", b("diffuse"), "front"
    yield "diffuse-spectrum", b("diffuse", '<spectrum name="reflectance" value="0.3"/>'), "front"
    yield "diffuse-checkerboard", b("diffuse", CHECKER.format("reflectance")), "front"
    yield "twosided-diffuse", b("twosided", b("diffuse", rgb("reflectance", "0.1 0.5 0.9"))), "both"
    yield "twosided-pair", b("twosided", b("diffuse", rgb("reflectance", "0.1 0.5 0.9")),
                             b("diffuse", rgb("reflectance", "0.7 0.2 0.3"))), "both"
    for distr in ("beckmann", "ggx"):
        for visible in (True, False):
            tag = f"{distr}-{'visible' if visible else 'all'}"
            common = (s("distribution", distr), flag("sample_visible", visible))
            yield f"roughconductor-{tag}", b("roughconductor", *common, f("alpha", 0.3), AL), "front"
            yield f"roughconductor-aniso-{tag}", b("roughconductor", *common, f("alpha_u", 0.1), f("alpha_v", 0.4), AU,
                                                    rgb("specular_reflectance", "0.9 0.8 0.7")), "front"
            yield f"roughdielectric-{tag}", b("roughdielectric", *common, f("alpha", 0.3), f("int_ior", 1.5), f("ext_ior", 1.0)), "both"
            yield f"roughplastic-{tag}", b("roughplastic", *common, f("alpha", 0.2), RED), "front"
        yield f"roughconductor-{distr}-smooth", b("roughconductor", s("distribution", distr), f("alpha", 0.02), AL), "front"
        yield f"roughdielectric-aniso-{distr}", b("roughdielectric", s("distribution", distr), f("alpha_u", 0.15), f("alpha_v", 0.5),
                                                   f("int_ior", 1.33), f("ext_ior", 1.0),
                                                   rgb("specular_reflectance", "0.9 0.8 0.7"),
                                                   rgb("specular_transmittance", "0.5 0.6 0.7")), "both"
        for alpha in (0.05, 0.1, 0.5):
            for nonlinear in (False, True):
                yield (f"roughplastic-{distr}-{alpha}-{'nonlinear' if nonlinear else 'linear'}",
                       b("roughplastic", s("distribution", distr), f("alpha", alpha), flag("nonlinear", nonlinear), RED,
                         f("int_ior", 1.5), f("ext_ior", 1.0)), "front")
    yield "roughconductor-default", b("roughconductor"), "front"
    yield "roughconductor-named", b("roughconductor", s("material", "Cu"), f("alpha", 0.2)), "front"
    yield "roughdielectric-default", b("roughdielectric"), "both"
    yield "roughdielectric-named", b("roughdielectric", s("int_ior", "diamond"), s("ext_ior", "water"), f("alpha", 0.2)), "both"
    yield "roughdielectric-dense-outside", b("roughdielectric", f("int_ior", 1.0), f("ext_ior", 1.5), f("alpha", 0.2)), "both"
    yield "roughplastic-default", b("roughplastic"), "front"
    yield "roughplastic-specular", b("roughplastic", f("alpha", 0.15), RED, rgb("specular_reflectance", "0.4 0.5 0.6")), "front"
    yield "plastic-default", b("plastic"), "front"
    yield "plastic-linear", b("plastic", RED, f("int_ior", 1.5), f("ext_ior", 1.0)), "front"
    yield "plastic-nonlinear", b("plastic", RED, f("int_ior", 1.5), f("ext_ior", 1.0), flag("nonlinear", True)), "front"
    yield "plastic-specular", b("plastic", RED, rgb("specular_reflectance", "0.4 0.5 0.6")), "front"
    yield "dielectric-default", b("dielectric"), "both"
    yield "dielectric-1.5", b("dielectric", f("int_ior", 1.5), f("ext_ior", 1.0)), "both"
    yield "dielectric-tinted", b("dielectric", f("int_ior", 1.33), f("ext_ior", 1.0), rgb("specular_reflectance", "0.9 0.8 0.7"),
                                  rgb("specular_transmittance", "0.5 0.6 0.7")), "both"
    yield "thindielectric", b("thindielectric", f("int_ior", 1.5), f("ext_ior", 1.0)), "both"
    yield "thindielectric-default", b("thindielectric"), "both"
    yield "conductor-default", b("conductor"), "front"
    yield "conductor-gold", b("conductor", AU), "front"
    yield "conductor-named", b("conductor", s("material", "Al"), rgb("specular_reflectance", "0.9 0.8 0.7")), "front"
    yield "twosided-conductor", b("twosided", b("conductor", AU)), "both"
    blend = (b("diffuse", rgb("reflectance", "0.9 0.1 0.1")), b("diffuse", rgb("reflectance", "0.1 0.1 0.9")))
    yield "blendbsdf-0.25", b("blendbsdf", f("weight", 0.25), *blend), "front"
    yield "blendbsdf-rough", b("blendbsdf", f("weight", 0.7), blend[0], b("roughconductor", f("alpha", 0.3), AL)), "front"
    yield "blendbsdf-delta", b("blendbsdf", f("weight", 0.3), blend[0], b("conductor")), "front"
    yield "blendbsdf-checkerboard", b("blendbsdf", CHECKER.format("weight"), *blend), "front"
    yield "mask-0.25", b("mask", f("opacity", 0.25), blend[0]), "both"
    yield "mask-checkerboard", b("mask", CHECKER.format("opacity"), blend[0]), "both"
    yield "twosided-roughplastic", b("twosided", b("roughplastic", f("alpha", 0.2), RED)), "both"
    yield "mask-twosided", b("mask", f("opacity", 0.6), b("twosided", blend[0])), "both"


def direction(rng, sides):
    z = rng.uniform(0.02, 0.999)
    if sides == "both" and rng.random() < 0.5:
        z = -z
    phi = rng.uniform(0, 2 * math.pi)
    r = math.sqrt(1 - z * z)
    return [r * math.cos(phi), r * math.sin(phi), z]


def num(x):
    """The shortest decimal that reads back as the same 32-bit float."""
    return float(str(np.float32(x)))


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("-o", "--out", default=os.path.join(HERE, "bsdf_values.json"))
    p.add_argument("--pairs", type=int, default=24)
    a = p.parse_args()
    import drjit as dr
    import mitsuba as mi
    mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)

    def vec(v):
        return [num(x) for x in np.array(v).ravel()]

    def single(v):
        return [num(x) for x in v]

    def surface(wi, uv):
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.t = 1.0
        si.p = [0, 0, 0]
        si.n = [0, 0, 1]
        si.sh_frame = mi.Frame3f([1, 0, 0], [0, 1, 0], [0, 0, 1])
        si.dp_du, si.dp_dv = [1, 0, 0], [0, 1, 0]
        si.uv = uv
        si.wi = wi
        return si

    out = []
    for name, xml, sides in entries():
        rng = np.random.default_rng(sum(ord(c) * (i + 1) for i, c in enumerate(name)))
        bsdf = mi.load_string(xml.replace("<bsdf", '<bsdf version="3.0.0"', 1))
        rough = bool(mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth))
        modes = ["radiance"] + (["importance"] if "dielectric" in name else [])
        entry = {"name": name, "xml": xml, "evals": [], "samples": []}
        for mode in modes:
            ctx = mi.BSDFContext(getattr(mi.TransportMode, mode.capitalize()))
            n = a.pairs if mode == "radiance" else a.pairs // 2
            for i in range(n if rough else 0):
                uv = single(rng.random(2))
                wi = single(direction(rng, sides))
                si = surface(wi, uv)
                if i % 3 == 0:  # one in three near a lobe: a sampled direction
                    bs, w = bsdf.sample(ctx, si, rng.random(), rng.random(2))
                    wo = vec(bs.wo) if bs.pdf > 0 else direction(rng, sides)
                else:
                    wo = direction(rng, "both" if i % 8 == 1 else sides)
                wo = single(wo)
                entry["evals"].append({"mode": mode, "uv": uv, "wi": wi, "wo": wo,
                                       "value": vec(bsdf.eval(ctx, si, wo)), "pdf": num(bsdf.pdf(ctx, si, wo))})
            # samples: angles from normal to grazing, both sides where that means anything
            angles = [0, 40, 75] if rough else [0, 20, 45, 60, 75, 85, 89]
            for deg in angles + ([180 - x for x in angles] if sides == "both" else [120]):
                th = math.radians(deg)
                wi = single([math.sin(th) * math.cos(0.3), math.sin(th) * math.sin(0.3), math.cos(th)])
                for u in (0.01, 0.3, 0.99):
                    uv, uv2 = single(rng.random(2)), single(rng.random(2))
                    si = surface(wi, uv)
                    bs, w = bsdf.sample(ctx, si, u, uv2)
                    valid = bs.pdf > 0 and any(x != 0 for x in vec(w))
                    e = {"mode": mode, "uv": uv, "wi": wi, "u": u, "uv2": uv2, "valid": bool(valid)}
                    if valid:
                        kind = int(bs.sampled_type)
                        e.update(wo=vec(bs.wo), pdf=num(bs.pdf), weight=vec(w), eta=num(bs.eta),
                                 discrete=bool(mi.has_flag(kind, mi.BSDFFlags.Delta)),
                                 null=bool(mi.has_flag(kind, mi.BSDFFlags.Null)))
                    entry["samples"].append(e)
        out.append(entry)

    ms = np.linspace(0.0, 1.0, 21)
    fres = [{"eta": eta, "cos": [num(m) for m in ms], "f": [num(mi.fresnel(float(np.float32(m)), eta)[0]) for m in ms]}
            for eta in (1.5, 1 / 1.5, 1.33, 2.419)]
    diffuse = [{"eta": e, "value": num(mi.fresnel_diffuse_reflectance(e))}
               for e in (1.0, 1.1, 1.33, 1.49 / 1.000277, 1.5, 2.0, 1 / 1.33, 1.000277 / 1.49, 1 / 1.5, 0.5)]

    # The tables of roughplastic: the transmittance into it on 64 equidistant cosines (the first is 1e-6 in the
    # plug-in), read back from the plug-in's own values, and the mean reflectance from inside.
    ctx = mi.BSDFContext()
    tables = []
    for distr in ("Beckmann", "GGX"):
        for alpha in (0.05, 0.1, 0.2, 0.3, 0.5):
            for eta in (1.5, 1.49 / 1.000277):
                mi.set_variant("scalar_rgb")
                bsdf = mi.load_dict({"type": "roughplastic", "distribution": distr.lower(), "alpha": alpha, "int_ior": eta, "ext_ior": 1.0,
                                     "diffuse_reflectance": {"type": "rgb", "value": 0.8}, "specular_reflectance": {"type": "rgb", "value": 0.0}})

                def value(c):
                    si = surface([math.sqrt(1 - c * c), 0, c], [0, 0])
                    return float(bsdf.eval(ctx, si, [math.sqrt(1 - c * c), 0, c])[0]) / c

                mi.set_variant("llvm_ad_rgb")
                mu = np.maximum(np.linspace(0, 1, 64), 1e-6).astype(np.float32)
                wi = mi.Vector3f(mi.Float(np.sqrt(1 - mu.astype(np.float64) ** 2).astype(np.float32)), dr.zeros(mi.Float, 64), mi.Float(mu))
                inner = np.array(mi.eval_reflectance(getattr(mi.MicrofacetType, distr), alpha, alpha, wi, 1 / eta))
                mi.set_variant("scalar_rgb")
                r = float(2 * np.mean(inner * mu))
                unit = math.sqrt(0.8 / (1 - r) / (math.pi * eta * eta))
                t = [math.sqrt(value(k / 63)) / unit for k in range(1, 64)]
                t.insert(0, 2 * math.sqrt(value(0.5 / 63)) / unit - t[0])
                tables.append({"distribution": distr.lower(), "alpha": alpha, "eta": eta,
                               "external_transmittance": [round(x, 6) for x in t], "internal_reflectance": num(r)})
    mi.set_variant("scalar_rgb")
    doc = {"mitsuba": mi.__version__, "variant": "scalar_rgb", "about": " ".join(__doc__.split("\n\n", 1)[1].split()),
           "bsdfs": out, "fresnel": fres, "fresnel_diffuse_reflectance": diffuse, "rough_tables": tables}
    with open(a.out, "w") as fh:
        # one line per evaluation keeps diffs readable
        text = json.dumps(doc, indent=None, separators=(",", ":"))
        fh.write(text.replace('{"name"', '\n{"name"').replace('{"mode"', '\n {"mode"').replace('{"eta"', '\n{"eta"')
                 .replace('{"distribution"', '\n{"distribution"') + "\n")
    print(a.out, os.path.getsize(a.out), "bytes,", len(out), "BSDFs")


if __name__ == "__main__":
    main()
