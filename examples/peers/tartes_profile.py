"""Compares light inside 30 cm of snow with TARTES 2 (Libois et al. 2013), for the same specific
surface area, density, asymmetry parameter and absorption enhancement (see tartes_albedo.py)."""

import argparse

import numpy as np
import tartes
from common import COLOURS, plt, save, table, write

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", default="out/peers", help="directory of the picture")
args = parser.parse_args()

kernel, constants = table("kernel")
ssa = constants["specific_surface_area_m2_kg"]


class Soot(tartes.impurities.Impurities):
    """Black carbon as in SPLITSnow: 16.619 m2/g at 880 nm, exponent 1."""

    @classmethod
    def MAE(cls, wavelength):
        return 16.619e3 * 880e-9 / wavelength


def tartes_profile(nm, depth_m, ng_g):
    """Downwelling, upwelling and actinic flux at `depth_m` per incident flux."""
    row = kernel["wavelength_nm"].index(nm)
    settings = dict(
        density=constants["density_kg_m3"],
        thickness=0.3,
        impurities=ng_g * 1e-9,
        impurities_type=Soot,
        refrac_index="w2008",
        shape_parameterization="constant",
        g0=(1 + kernel["p1"][row]) / 2,
        B0=kernel["mean_path_m"][row] * ssa * constants["ice_density_kg_m3"] / 4,
        dir_frac=1.0,
        sza=0.0,
    )
    down, up = tartes.irradiance_profiles(nm * 1e-9, depth_m, ssa, **settings)
    actinic = tartes.actinic_profile(nm * 1e-9, depth_m, ssa, **settings)
    return [np.squeeze(values) for values in (down, up, actinic)]


figure, axes = plt.subplots(1, 3, figsize=(9.4, 4.2), sharey=True)
written = {}
print("sample", "nm", "depth_cm", "down", "TARTES", "up", "TARTES", "actinic", "TARTES", sep="\t")
for sample, ng_g, line in [("profile_clean", 0, "-"), ("profile_soot", 100, "--")]:
    ours, _ = table(sample)
    for i, nm in enumerate(sorted(set(ours["wavelength_nm"]))):
        rows = [k for k, other in enumerate(ours["wavelength_nm"]) if other == nm]
        depth_cm = np.array(ours["depth_cm"])[rows]
        theirs = tartes_profile(nm, depth_cm / 100, ng_g)
        columns = [np.array(ours[name])[rows] for name in ("downwelling", "upwelling", "actinic")]
        written["depth_cm"] = depth_cm
        for axis, name, a, b in zip(axes, ("down", "up", "actinic"), columns, theirs):
            label = f"{nm:.0f} nm" if line == "-" else None
            axis.plot(a, depth_cm, line, color=COLOURS[i], label=label)
            if line == "-":
                axis.plot(b[::3], depth_cm[::3], ".", color=COLOURS[i], markersize=4)
            written[f"{sample} {nm:.0f} nm {name}"] = a
            written[f"{sample} {nm:.0f} nm {name}, TARTES"] = b
        for shown in (0, 0.1, 0.2, 1, 5, 20):
            k = int(np.argmin(abs(depth_cm - shown)))
            values = [f"{x[k]:.4g}" for pair in zip(columns, theirs) for x in pair]
            print(sample, f"{nm:.0f}", f"{depth_cm[k]:g}", *values, sep="\t")
titles = ("downwelling flux", "upwelling flux", "actinic flux")
for axis, title in zip(axes, titles):
    axis.set(title=title, xlabel="per incident flux", xscale="log", xlim=(1e-5, 8), ylim=(30, -0.5))
axes[0].set_ylabel("depth, cm")
axes[1].legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=4)
save(figure, "tartes_profile", args.out)
write("tartes_profile", args.out, written)
