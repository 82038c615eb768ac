#!/usr/bin/env python3
"""Writes Mitsuba's built-in `mi.cornell_box()` as a scene file, and checks that both render alike.

  cornell_box.py [-o tests/bench/cornell-box/scene.xml] [--check]

The dictionary is walked as it is: nothing is typed in by hand, and unknown kinds of values stop the program. The film gets
a box filter and float32 components, which change no mean.
"""
import argparse
import os
import sys
import xml.etree.ElementTree as ET

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
TAGS = {"diffuse": "bsdf", "twosided": "bsdf", "dielectric": "bsdf", "conductor": "bsdf", "rectangle": "shape", "cube": "shape",
        "sphere": "shape", "obj": "shape", "area": "emitter", "path": "integrator", "perspective": "sensor", "independent": "sampler",
        "hdrfilm": "film", "box": "rfilter", "gaussian": "rfilter", "tent": "rfilter"}


def number(x):
    return repr(float(str(np.float32(x)))).removesuffix(".0")


def element(parent, name, value, mi, top):
    if isinstance(value, dict):
        kind = value["type"]
        if kind in ("rgb", "spectrum"):
            v = value["value"]
            v = [v] if isinstance(v, (int, float)) else v
            ET.SubElement(parent, kind, name=name, value=", ".join(number(x) for x in v))
            return
        if kind == "ref":
            ET.SubElement(parent, "ref", id=value["id"], **({} if name in ("bsdf", "emitter") else {"name": name}))
            return
        if kind not in TAGS:
            sys.exit(f"no element known for {kind}")
        e = ET.SubElement(parent, TAGS[kind], type=kind, **({"id": name} if top else {}))
        for k, v in value.items():
            if k != "type":
                element(e, k, v, mi, False)
    elif isinstance(value, bool):
        ET.SubElement(parent, "boolean", name=name, value=str(value).lower())
    elif isinstance(value, int):
        ET.SubElement(parent, "integer", name=name, value=str(value))
    elif isinstance(value, float):
        ET.SubElement(parent, "float", name=name, value=number(value))
    elif isinstance(value, str):
        ET.SubElement(parent, "string", name=name, value=value)
    elif hasattr(value, "matrix"):
        t = ET.SubElement(parent, "transform", name=name)
        m = np.array(value.matrix, dtype=np.float64).reshape(4, 4)
        ET.SubElement(t, "matrix", value=" ".join(number(x) for x in m.ravel()))
    else:
        sys.exit(f"{name}: cannot write {value!r}")


def scene_xml(mi):
    d = mi.cornell_box()
    film = d["sensor"]["film"]
    film["rfilter"] = {"type": "box"}
    d["sensor"].pop("focus_distance", None)  # perspective takes it and makes no use of it
    film.update(pixel_format="rgb", component_format="float32")
    d["sensor"]["sampler"]["type"] = "independent"
    root = ET.Element("scene", version="3.0.0")
    root.append(ET.Comment(" Mitsuba 3's mi.cornell_box(), written by tests/oracle/cornell_box.py. "))
    for k, v in d.items():
        if k != "type":
            element(root, k, v, mi, True)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n", d


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("-o", "--out", default=os.path.join(HERE, "..", "bench", "cornell-box", "scene.xml"))
    p.add_argument("--check", action="store_true", help="render both, 64 x 64, 16 runs, and compare")
    p.add_argument("--spp", type=int, default=64)
    a = p.parse_args()
    import mitsuba as mi
    mi.set_variant("scalar_rgb" if not a.check else "llvm_ad_rgb")
    text, d = scene_xml(mi)
    os.makedirs(os.path.dirname(os.path.abspath(a.out)), exist_ok=True)
    with open(a.out, "w") as f:
        f.write(text)
    if not a.check:
        return
    import ztest
    d["sensor"]["film"].update(width=64, height=64)
    own = mi.load_string(text.replace('name="width" value="256"', 'name="width" value="64"').replace('name="height" value="256"', 'name="height" value="64"'))
    built_in = mi.load_dict(d)
    images = []
    for k, scene in enumerate((built_in, own)):
        images.append(np.stack([np.array(mi.render(scene, spp=a.spp, seed=100 * k + i), dtype=np.float64)[..., :3] for i in range(16)]))
    # the same random numbers on both: equal up to rounding
    same = [np.array(mi.render(s, spp=4, seed=9), dtype=np.float64) for s in (built_in, own)]
    print("same seed: largest difference", float(np.abs(same[0] - same[1]).max()), "means", *(float(s.mean()) for s in same))
    out, _, _ = ztest.compare(images[0].mean(0), images[0].var(0, ddof=1) / 16, 16, runs=images[1])
    print("PASS" if out["pass"] else "FAIL", "ratio", out["mean"]["ratio_all"], out["mean"]["interval_95_all"])
    sys.exit(0 if out["pass"] else 1)


if __name__ == "__main__":
    main()
