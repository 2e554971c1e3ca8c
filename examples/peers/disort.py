"""Compares 2 cm of snow with discrete ordinates (PythonicDISORT) for the same grain events.

PythonicDISORT solves transport between points. Its inputs are the single-scattering
albedo and the Legendre moments of our mean grain event, and an optical thickness. This is
the thickness divided by, first, the mean free distance between grains, and, second, the
effective free path: that of points which spread light as far as the grains do
(docs/methods.md).
"""

import argparse
import warnings

import numpy as np
from common import COLOURS, plt, save, table, write
from PythonicDISORT.pydisort import pydisort

# The albedo is close to 1 because snow hardly absorbs blue light.
warnings.filterwarnings("ignore", message="Some delta-scaled single-scattering albedos")

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", default="out/peers", help="directory of the picture")
args = parser.parse_args()

STREAMS = 16
kernel, constants = table("kernel")
snow, _ = table("thin")
nm = np.array(kernel["wavelength_nm"])
assert snow["wavelength_nm"] == list(nm)
moments = [name for name in kernel if name[0] == "p"]
thickness_m = 0.02


def fluxes(i, free_path_m):
    """Reflectance and transmittance at wavelength number ``i`` for parallel light at normal
    incidence."""
    legendre = np.array([1.0] + [kernel[name][i] for name in moments])
    depth = thickness_m / free_path_m
    # PythonicDISORT is singular at an albedo of 1.
    albedo = min(kernel["albedo"][i], 1 - 1e-9)
    _, up, down, *_ = pydisort(
        depth, albedo, STREAMS, legendre[None, :STREAMS], 1.0, 1.0, 0.0, only_flux=True
    )
    diffuse, direct = down(depth)
    return float(up(0.0)), float(diffuse + direct)


free = constants["mean_free_distance_m"]
curves = {
    "SPLITSnow": (np.array(snow["reflectance"]), np.array(snow["transmittance"])),
    "points, distance of grains": np.array([fluxes(i, free) for i in range(len(nm))]).T,
    "points, effective free path": np.array(
        [fluxes(i, path) for i, path in enumerate(kernel["effective_free_path_m"])]
    ).T,
}
shown = [400, 600, 800, 900, 1040, 1240, 1400]
print(f"optical thickness {thickness_m / free:.2f}; {thickness_m / kernel['effective_free_path_m'][0]:.2f} at {nm[0]:.0f} nm")
print("g", *(f"{kernel['p1'][list(nm).index(x)]:.4f}" for x in shown), sep="\t")
figure, axes = plt.subplots(1, 2, figsize=(9.4, 3.8))
for axis, j, quantity in zip(axes, (0, 1), ("reflectance", "transmittance")):
    print(quantity, *shown, sep="\t")
    for i, (name, values) in enumerate(curves.items()):
        style = dict(color=COLOURS[i], marker="osD"[i], markevery=(3 * i, 9), markersize=5)
        axis.plot(nm, values[j], label=name, **style)
        print(name, *(f"{values[j][list(nm).index(x)]:.4f}" for x in shown), sep="\t")
    axis.set(xlabel="wavelength, nm", ylabel=f"{quantity} of 2 cm", xlim=(nm[0], nm[-1]))
    axis.set_ylim(bottom=0)
axes[1].legend(loc="upper right")
save(figure, "disort", args.out)
written = {"wavelength_nm": nm}
for j, quantity in enumerate("RT"):
    for name, values in list(curves.items())[1:]:
        written[f"{quantity}: {name}"] = values[j]
write("disort", args.out, written)
