"""Writes the spectral responses and solar spectra of crates/spectra/data.

    pip install -r examples/sensors/requirements.txt
    pip download --no-deps --no-binary :all: pyrsr==0.8.0 && tar xzf pyrsr-0.8.0.tar.gz
    python examples/sensors/make.py pyrsr-0.8.0

pyrsr holds the tables of the agencies as text; it need not be installed.
"""

import sys
from pathlib import Path

import numpy as np
from pvlib import spectrum
from scipy.interpolate import CubicSpline

DATA = Path(__file__).parents[2] / "crates/spectra/data"
# responses below this share of the largest are left out at the ends of a band
CUT = 0.01
# the range of the model, nm, and the half width of a Gaussian in standard deviations
RANGE_NM = (350, 2500)
GAUSSIAN_SD = 3


def write(path, comments, header, rows):
    lines = [f"# {comment}" for comment in comments] + [header]
    lines += [",".join(str(cell) for cell in row) for row in rows]
    (DATA / path).write_text("\n".join(lines) + "\n")


def number(value, digits):
    return f"{value:.{digits}f}".rstrip("0").rstrip(".")


def table(sensor, folder, bands, unit_nm, source):
    rows = []
    for band in bands:
        nm, response = np.loadtxt(folder / f"band_{band.lstrip('B')}", skiprows=1, unpack=True)
        nm, response = nm * unit_nm, np.maximum(response / response.max(), 0)
        used = np.flatnonzero(response >= CUT)
        used = slice(used[0], used[-1] + 1)
        rows += [
            (band, number(a, 1), number(b, 4)) for a, b in zip(nm[used], response[used])
        ]
    comments = [
        f"{source}, as in PyPI pyrsr 0.8.0 (Apache-2.0)",
        "relative to the largest; without the ends of the bands, where it is below 1 %",
        "written by examples/sensors/make.py",
    ]
    write(f"sensors/{sensor}.csv", comments, "band,wavelength_nm,response", rows)


def rectangles(sensor, bands, source):
    comments = [source, "response 1 within the limits; written by examples/sensors/make.py"]
    write(f"sensors/{sensor}.csv", comments, "band,from_nm,to_nm", bands)


def gaussians(sensor, centres, widths, source):
    half = GAUSSIAN_SD * widths / 2.3548
    within = (centres - half >= RANGE_NM[0]) & (centres + half <= RANGE_NM[1])
    rows = [
        (f"{sensor[0].upper()}{k + 1}", number(centres[k], 2), number(widths[k], 2))
        for k in np.flatnonzero(within)
    ]
    comments = [
        source,
        f"without the bands that reach beyond {RANGE_NM[0]}-{RANGE_NM[1]} nm",
        "written by examples/sensors/make.py",
    ]
    write(f"sensors/{sensor}.csv", comments, "band,centre_nm,fwhm_nm", rows)


def sensors(pyrsr):
    data = pyrsr / "pyrsr/data"
    table(
        "sentinel2a",
        data / "Sentinel-2A/MSI",
        [f"B{k}" for k in (*range(1, 9), "8A", *range(9, 13))],
        1,
        "Sentinel-2A MSI: ESA, S2-SRF_COPE-GSEG-EOPG-TN-15-0007 3.0, 2017-12-19",
    )
    table(
        "landsat8",
        data / "Landsat-8/OLI_TIRS",
        [f"B{k}" for k in range(1, 10)],
        1000,
        "Landsat 8 OLI: NASA, Ball_BA_RSR.v1.2, 2014-09",
    )
    table(
        "modis",
        data / "Terra/MODIS",
        [f"B{k}" for k in range(1, 17)],
        1,
        "Terra MODIS, bands 1 to 16: NASA, HMODIST_RSRs",
    )

    olci = [
        (400, 15), (412.5, 10), (442.5, 10), (490, 10), (510, 10), (560, 10), (620, 10),
        (665, 10), (673.75, 7.5), (681.25, 7.5), (708.75, 10), (753.75, 7.5), (761.25, 2.5),
        (764.375, 3.75), (767.5, 2.5), (778.75, 15), (865, 20), (885, 10), (900, 10),
        (940, 20), (1020, 40),
    ]  # fmt: skip
    rectangles(
        "sentinel3_olci",
        [
            (f"Oa{k + 1:02}", number(nm - width / 2, 4), number(nm + width / 2, 4))
            for k, (nm, width) in enumerate(olci)
        ],
        "Sentinel-3 OLCI: nominal centres and widths, ESA, Sentinel-3 OLCI User Guide",
    )
    viirs = [
        ("M1", 402, 422), ("M2", 436, 454), ("M3", 478, 498), ("M4", 545, 565),
        ("M5", 662, 682), ("M6", 739, 754), ("M7", 846, 885), ("M8", 1230, 1250),
        ("M9", 1371, 1386), ("M10", 1580, 1640), ("M11", 2225, 2275), ("I1", 600, 680),
        ("I2", 846, 885), ("I3", 1580, 1640),
    ]  # fmt: skip
    rectangles(
        "viirs",
        viirs,
        "VIIRS, reflective bands: nominal limits, NASA, VIIRS Level-1B Product User Guide, 2018",
    )

    # every 20th channel of EMIT_Wavelengths_20220817.txt (github.com/emit-sds/emit-sds-l1b,
    # Apache-2.0), and the last: a cubic spline gives the others to 0.02 nm
    channel = np.array([*range(20, 301, 20), 304])
    nm = np.array([
        2492.9239, 2345.1217, 2197.0969, 2048.8649, 1900.4390, 1751.8415, 1603.0886, 1454.1888,
        1305.1603, 1156.0304, 1006.8344, 857.5937, 708.3835, 559.3142, 410.6380, 381.0056,
    ])  # fmt: skip
    all_channels = np.arange(304, 19, -1)
    gaussians(
        "emit",
        CubicSpline(channel, nm)(all_channels),
        np.maximum(8.809 - 0.0014022 * (all_channels - 20), 8.415),
        "EMIT: Gaussians; centres and widths of the calibration of 2022-08-17, "
        "NASA JPL, emit-sds-l1b (Apache-2.0)",
    )
    prisma = np.array([
        406.99, 415.84, 423.78, 431.33, 438.66, 446.01, 453.39, 460.73, 468.10, 475.32, 482.55,
        489.79, 497.06, 504.51, 512.05, 519.54, 527.31, 535.05, 542.89, 550.91, 559.02, 567.21,
        575.49, 583.84, 592.34, 601.01, 609.96, 618.72, 627.78, 636.68, 645.96, 655.42, 664.89,
        674.46, 684.14, 694.13, 703.74, 713.73, 723.88, 733.96, 744.15, 754.47, 764.86, 775.27,
        785.66, 796.13, 806.71, 817.31, 827.92, 838.53, 849.21, 859.97, 870.74, 881.46, 892.08,
        902.80, 913.45, 923.95, 934.11, 944.63, 956.27, 967.03, 977.37, 979.22, 988.92, 998.91,
        1008.64, 1018.54, 1029.34, 1037.99, 1047.68, 1057.57, 1067.79, 1078.22, 1088.76, 1099.28,
        1109.89, 1120.68, 1131.30, 1142.07, 1152.65, 1163.68, 1174.71, 1185.59, 1196.34, 1207.27,
        1217.86, 1229.19, 1240.21, 1250.98, 1262.53, 1273.50, 1284.49, 1295.42, 1306.22, 1317.26,
        1328.30, 1339.13, 1349.79, 1361.05, 1372.91, 1383.28, 1394.75, 1405.63, 1416.54, 1427.37,
        1438.47, 1449.19, 1459.32, 1469.93, 1480.84, 1491.43, 1502.02, 1512.63, 1523.22, 1533.78,
        1544.23, 1554.82, 1565.37, 1575.63, 1585.86, 1596.25, 1606.49, 1616.83, 1627.02, 1637.09,
        1647.23, 1656.93, 1667.19, 1677.32, 1687.43, 1697.29, 1707.09, 1716.86, 1726.65, 1736.49,
        1746.22, 1755.83, 1765.51, 1775.12, 1784.72, 1793.95, 1803.59, 1813.05, 1822.44, 1832.03,
        1841.33, 1850.55, 1859.56, 1868.17, 1878.74, 1887.08, 1896.09, 1904.93, 1914.30, 1923.39,
        1932.26, 1941.11, 1949.90, 1958.62, 1967.34, 1976.01, 1984.85, 1993.55, 2002.11, 2010.66,
        2019.32, 2027.73, 2036.26, 2044.68, 2053.01, 2061.38, 2069.80, 2077.99, 2086.38, 2094.63,
        2102.82, 2111.04, 2119.23, 2127.34, 2135.51, 2143.47, 2151.39, 2159.56, 2167.48, 2175.34,
        2183.42, 2191.10, 2199.14, 2206.84, 2214.63, 2222.43, 2230.01, 2237.90, 2245.45, 2253.11,
        2260.87, 2268.29, 2276.05, 2283.49, 2290.83, 2298.61, 2305.72, 2313.20, 2320.90, 2327.82,
        2335.53, 2342.82, 2349.79, 2357.29, 2364.59, 2371.55, 2378.77, 2386.06, 2393.04, 2400.04,
        2407.60, 2414.36, 2421.24, 2428.67, 2435.54, 2442.40, 2449.14, 2456.59, 2463.03, 2469.63,
        2477.06, 2483.79, 2490.22, 2497.12,
    ])  # fmt: skip
    gaussians(
        "prisma",
        prisma,
        np.full(len(prisma), 12.0),
        "PRISMA: Gaussians; centres as products of ASI list them (each scene lists its own), "
        "all widths 12 nm, the bound in Cogliati et al. 2021 (doi:10.1016/j.rse.2021.112499)",
    )


def suns():
    astm = spectrum.get_reference_spectra()
    rows = [(f"{nm:g}", *(f"{value:.5g}" for value in row)) for nm, row in zip(
        astm.index, astm[["extraterrestrial", "global", "direct"]].to_numpy()
    )]  # fmt: skip
    write(
        "suns/astm_g173.csv",
        [
            "ASTM G173-03, W m-2 nm-1: extraterrestrial; global on a plane tilted by 37 degrees,",
            "and direct with the circumsolar light, both at air mass 1.5; "
            "from PyPI pvlib 0.16.1 (BSD-3-Clause)",
            "written by examples/sensors/make.py",
        ],
        "wavelength_nm,extraterrestrial,global,direct",
        rows,
    )
    zenith = 75
    inputs = {
        "apparent_zenith": zenith,
        "aoi": zenith,
        "surface_tilt": 0,
        "ground_albedo": 0.8,
        "surface_pressure": 101300,
        # Kasten and Young 1989
        "relative_airmass": 1
        / (np.cos(np.radians(zenith)) + 0.50572 * (96.07995 - zenith) ** -1.6364),
        "precipitable_water": 0.42,
        "ozone": 0.38,
        "aerosol_turbidity_500nm": 0.05,
        "dayofyear": 51,
    }
    winter = spectrum.spectrl2(**inputs)
    listed = ", ".join(f"{key} = {value:.4g}" for key, value in inputs.items())
    write(
        "suns/subarctic_winter.csv",
        [
            "Global irradiance on a horizontal plane, W m-2 nm-1, in a clear subarctic winter:",
            "the model of Bird and Riordan (1986), PyPI pvlib 0.16.1 (BSD-3-Clause), spectrl2 with",
            listed,
            "written by examples/sensors/make.py",
        ],
        "wavelength_nm,power",
        [
            (f"{nm:g}", f"{value:.4g}")
            for nm, value in zip(winter["wavelength"], winter["poa_global"].ravel())
        ],
    )


if __name__ == "__main__":
    sensors(Path(sys.argv[1]))
    suns()
