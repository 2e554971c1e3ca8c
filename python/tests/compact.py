"""Compact files made of arrays, as docs/formats.md describes them."""

import json

import numpy as np

LIGHTS = {False: "collimated", True: "diffuse: isotropic radiance"}


def write_compact(path, axes, wavelengths_nm, curves, diffuse=False):
    """Writes curves without compression.

    `axes` are nodes by name, slowest first; `curves` are arrays by quantity, one axis for
    each of `axes` and one for the wavelengths.
    """
    l = len(wavelengths_nm)
    tensors = {name: np.asarray(nodes, "<f8") for name, nodes in axes.items()}
    tensors["wavelength_nm"] = np.asarray(wavelengths_nm, "<f8")
    metadata = {
        "format": "splitsnow-compact",
        "format_version": "2",
        "substrate": "black",
        "basis": "linear",
        "quantities": ",".join(q for q in ("transmittance", "reflectance") if q in curves),
        "axis_order": ",".join(axes),
        "illumination": LIGHTS[diffuse],
    }
    if "view_deg" in axes:
        metadata["content"] = "anisotropy_factor"
    for quantity, values in curves.items():
        assert values.shape == (*map(len, axes.values()), l)
        tensors[f"{quantity}.coefficients"] = np.asarray(values, "<f4").reshape(-1, l)
        tensors[f"{quantity}.basis"] = np.eye(l, dtype="<f4")
        metadata[f"{quantity}.components"] = str(l)
    header, data = {"__metadata__": metadata}, b""
    for name in sorted(tensors, key=lambda name: (-tensors[name].itemsize, name)):
        tensor, begin = tensors[name], len(data)
        data += tensor.tobytes()
        header[name] = {
            "dtype": f"F{8 * tensor.itemsize}",
            "shape": tensor.shape,
            "data_offsets": [begin, len(data)],
        }
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(len(text).to_bytes(8, "little") + text + data)
