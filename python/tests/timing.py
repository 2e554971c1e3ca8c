"""Times look-ups of a million random points within the axes of compact files.

Usage: python timing.py FILE...
"""

import sys
import time

import numpy as np

import splitsnow

COUNT = 1_000_000
REPEATS = 7


def median_time(call):
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
        look_up(*first)  # prepares the look-up
        print(f"  {quantity}: {COUNT} spectra {median_time(lambda: look_up(*points)):.3f} s")
    options = {"quantity": snow.quantities[0]}
    print(f"  srgb: {COUNT} colours {median_time(lambda: snow.srgb(*points, **options)):.3f} s")
    single = median_time(lambda: [snow.srgb(*first, **options) for _ in range(1000)])
    print(f"  srgb: one colour per call {single * 1e3:.1f} us")
