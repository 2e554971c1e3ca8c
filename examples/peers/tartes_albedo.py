"""Compares deep snow with TARTES 2 (Libois et al. 2013) at the same specific surface area.

TARTES describes snow by the specific surface area (SSA) of its grains, their asymmetry
parameter and their absorption enhancement B. All three follow from our grains:
SSA = 4 K1 K2 / D_ice (Varsa 2025, appendix B). The asymmetry parameter is (1 + g) / 2,
where g is the mean cosine of a grain event; this includes diffraction, which does not
change the direction. B = l SSA D_ice / 4, where l is the mean path in ice, since
4 / (SSA D_ice) is the mean chord of convex grains.
"""

import argparse

import numpy as np
import tartes
from common import COLOURS, plt, save, table, write

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", default="out/peers", help="directory of the picture")
args = parser.parse_args()

kernel, constants = table("kernel")
nm = np.array(kernel["wavelength_nm"])
ssa = constants["specific_surface_area_m2_kg"]
g = (1 + np.array(kernel["p1"])) / 2
b = np.array(kernel["mean_path_m"]) * ssa * constants["ice_density_kg_m3"] / 4


class Soot(tartes.impurities.Impurities):
    """Black carbon as in SPLITSnow: 16.619 m2/g at 880 nm, exponent 1."""

    @classmethod
    def MAE(cls, wavelength):
        return 16.619e3 * 880e-9 / wavelength


def albedo(ng_g, shapes=None):
    """Albedo of 1 m of snow per wavelength for parallel light at normal incidence; `shapes`
    are g and B."""
    values = []
    for i, x in enumerate(nm):
        shape = {}
        if shapes:
            shape = {"shape_parameterization": "constant", "g0": shapes[0][i], "B0": shapes[1][i]}
        value = tartes.albedo(
            x * 1e-9,
            ssa,
            density=constants["density_kg_m3"],
            thickness=1.0,
            impurities=ng_g * 1e-9,
            impurities_type=Soot,
            refrac_index="w2008",
            dir_frac=1.0,
            sza=0.0,
            **shape,
        )
        values.append(float(np.squeeze(value)))
    return np.array(values)


panels = {
    "clean": (0, ["clean"]),
    "100 ng/g of black carbon": (100, ["soot_in_pores", "soot_in_ice"]),
}
names = {"clean": "SPLITSnow", "soot_in_pores": "SPLITSnow, in pores", "soot_in_ice": "SPLITSnow, in ice"}
written = {"wavelength_nm": nm}
shown = [400, 600, 800, 900, 1040, 1240, 1400]
print(f"SSA {ssa:.2f} m2/kg; g {g[0]:.3f} to {g[-1]:.3f} with diffraction; B {b[0]:.2f} to {b[-1]:.2f}")
figure, axes = plt.subplots(1, 2, figsize=(9.4, 3.8), sharey=True)
for axis, (title, (ng_g, ours)) in zip(axes, panels.items()):
    curves = {
        "TARTES, its own g and B": albedo(ng_g),
        "TARTES, our g and B": albedo(ng_g, (g, b)),
    }
    for name, values in curves.items():
        written[f"{title}: {name}"] = values
    for name in ours:
        columns, _ = table(name)
        assert columns["wavelength_nm"] == list(nm)
        curves[names[name]] = np.array(columns["reflectance"])
    print(title, *shown, sep="\t")
    for i, (name, values) in enumerate(curves.items()):
        style = dict(color=COLOURS[i], marker="so^D"[i], markevery=(3 * i, 9), markersize=5)
        axis.plot(nm, values, label=name, **style)
        print(name, *(f"{values[list(nm).index(x)]:.4f}" for x in shown), sep="\t")
    axis.set(title=title, xlabel="wavelength, nm", xlim=(nm[0], nm[-1]), ylim=(0, 1))
    axis.legend(loc="lower left")
axes[0].set_ylabel("albedo of 1 m of snow")
save(figure, "tartes", args.out)
write("tartes", args.out, written)
