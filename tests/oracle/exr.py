"""Reading and writing of linear RGB EXR images."""
import numpy as np


def write(path, rgb, **attributes):
    import OpenEXR
    rgb = np.asarray(rgb, dtype=np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **attributes}
    with OpenEXR.File(header, {c: np.ascontiguousarray(rgb[..., i]) for i, c in enumerate("RGB")}) as f:
        f.write(path)


def read(path):
    """(height, width, 3) as float64, and the header."""
    import OpenEXR
    with OpenEXR.File(path, separate_channels=True) as f:
        ch = f.channels()
        header = dict(f.header())
        missing = [c for c in "RGB" if c not in ch]
        if missing:
            raise ValueError(f"{path}: no channel {missing[0]} (found {', '.join(ch)})")
        rgb = np.stack([np.asarray(ch[c].pixels, dtype=np.float64) for c in "RGB"], -1)
    return rgb, header


def attribute(header, key):
    v = header.get(key)
    return None if v is None else np.atleast_1d(getattr(v, "value", v))[0]
