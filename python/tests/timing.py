"""Times look-ups of a million points scattered over the box of a compact file.

python timing.py FILE...
"""

import sys
import time

import numpy as np

import splitsnow

COUNT = 1_000_000
REPEATS = 7


def timed(call):
    """Median time of a call, s."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return sorted(times)[REPEATS // 2]


for path in sys.argv[1:]:
    snow = splitsnow.Database.open(path)
    random = np.random.default_rng(1)
    axes = list(snow.axes.values())
    points = [random.uniform(nodes[0], nodes[-1], COUNT) for nodes in axes[-5:]]
    points = [np.clip(p, nodes[0], nodes[-1]) for p, nodes in zip(points, axes[-5:])]
    first = [float(p[0]) for p in points]
    print(snow, snow.basis)
    for quantity in snow.quantities:
        look_up = getattr(snow, quantity)
        look_up(*first)  # prepares
        print(f"  {quantity}: {COUNT} spectra {timed(lambda: look_up(*points)):.3f} s")
    of = {"quantity": snow.quantities[0]}
    print(f"  srgb: {COUNT} colours {timed(lambda: snow.srgb(*points, **of)):.3f} s")
    single = timed(lambda: [snow.srgb(*first, **of) for _ in range(1000)])
    print(f"  srgb: one colour in a call {single * 1e3:.1f} us")
