#!/usr/bin/env python3
"""Named conductors (RGB eta and k, as the *_rgb variants use them) and named indices of refraction of Mitsuba 3.

Writes materials.json beside this file.
"""
import glob
import json
import os

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
IORS = ["vacuum", "helium", "hydrogen", "air", "carbon dioxide", "water", "acetone", "ethanol", "carbon tetrachloride", "glycerol",
        "benzene", "silicone oil", "bromine", "water ice", "fused quartz", "pyrex", "acrylic glass", "polypropylene", "bk7",
        "sodium chloride", "amber", "pet", "diamond"]


def num(x):
    return float(str(np.float32(x)))


def main():
    import mitsuba as mi
    mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    folder = os.path.join(os.path.dirname(mi.__file__), "data", "ior")
    conductors = {}
    for name in sorted(os.path.basename(f)[:-8] for f in glob.glob(folder + "/*.eta.spd")) + ["none"]:
        p = mi.traverse(mi.load_dict({"type": "conductor", "material": name}))
        eta, k = (np.array(p[key]).ravel() * np.ones(3) for key in ("eta.value", "k.value"))
        conductors[name] = {"eta": [num(x) for x in eta], "k": [num(x) for x in k]}
    # relative to vacuum: the index of a dielectric whose outside is 1
    iors = {name: num(mi.traverse(mi.load_dict({"type": "dielectric", "int_ior": name, "ext_ior": 1.0}))["eta"]) for name in IORS}
    with open(os.path.join(HERE, "materials.json"), "w") as fh:
        text = json.dumps({"mitsuba": mi.__version__, "iors": iors, "conductors": conductors}, separators=(",", ":"))
        fh.write(text.replace('},"', '},\n"').replace(':{"', ':\n{"', 2) + "\n")
    print(len(conductors), "conductors,", len(iors), "indices")


if __name__ == "__main__":
    main()
