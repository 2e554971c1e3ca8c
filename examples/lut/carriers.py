"""How far other carriers of colour are from a table of `splitsnow export --format lut`.

    python examples/lut/carriers.py snow.json

Light straight through 1 to 60 cm of snow. Delta-E*ab (CIE 1976) without exposure, and exposed so that
the colour of the table has half the luminance of white. Exponentials are fitted to the exposed
colours. Needs numpy and scipy.
"""

import sys

import numpy as np
from scipy.optimize import minimize

from table import Table

table = Table(sys.argv[1])
WHITE = np.array([0.3127 / 0.329, 1, 0.3583 / 0.329])
FROM_XYZ = np.array(table.about["primaries"]["from_xyz_d65"])
thickness_cm = np.geomspace(1, 60, 200)
exact = table.transmittance(thickness_cm, np.ones(200))


def lab(colours):
    t = np.linalg.solve(FROM_XYZ, colours.T).T / WHITE
    f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], -1)


bright = 0.5 / (np.linalg.solve(FROM_XYZ, exact.T).T / WHITE)[:, 1:2]


def errors(found, exposure):
    return np.linalg.norm(lab(found * exposure) - lab(exact * exposure), axis=-1)


def report(name, found):
    plain, exposed = errors(found, 1), errors(found, bright)
    print(f"{name}: mean {plain.mean():.1f}, largest {plain.max():.0f}; exposed: {exposed.mean():.1f}, {exposed.max():.0f}")


def fitted(model, start):
    best = minimize(lambda p: errors(model(p), bright).mean(), start, method="Nelder-Mead",
                    options={"maxiter": 20000, "maxfev": 20000, "xatol": 1e-6, "fatol": 1e-6})
    return model(best.x)


def attenuation(p):
    """glTF's KHR_materials_volume and other absorbing media: white without thickness."""
    return np.exp(-np.exp(p[:3]) * thickness_cm[:, None])


def tinted(p):
    """The same behind a colour of the surface."""
    return np.exp(p[3:6]) * attenuation(p)


def sampled(cm, colours):
    return np.stack([np.interp(thickness_cm, cm, c) for c in colours.T], -1)


even = np.linspace(0, 60, 33)
report("attenuation colour, best fit", fitted(attenuation, np.log([0.2, 0.15, 0.12])))
report("attenuation and colour of the surface, best fit", fitted(tinted, np.log([0.2, 0.15, 0.12, 0.1, 0.1, 0.1])))
report("33 even steps of thickness, as in a .cube", sampled(even, table.transmittance(even, np.ones(33))))
encoded = np.where(exact <= 0.0031308, 12.92 * exact, 1.055 * np.abs(exact) ** (1 / 2.4) - 0.055)
levels = np.round(255 * encoded) / 255
report("8 bits a channel, sRGB curve", np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4))
