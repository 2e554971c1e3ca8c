"""`splitsnow.retrieve` finds known snows again."""

import time

import numpy as np
import pytest
import xarray

import splitsnow
from conftest import ROOT

FIX = {"facetness": 0.2, "density_kg_m3": 200, "thickness_cm": 34}


@pytest.fixture(scope="module")
def natural(run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("natural")
    run("build", ROOT / "configs/vermont.toml", "--out", folder)
    return splitsnow.Database.open(folder)


def spectra_of(natural, sizes, carbons):
    curves = [
        natural.reflectance(0.2, size, 200, 34, 0, black_carbon_ng_g=carbon)
        for size, carbon in zip(sizes, carbons)
    ]
    return np.array(curves, dtype=float)


def test_known_snow_is_found(natural):
    sizes, carbons = np.array([150.0, 300.0, 700.0]), np.array([5.0, 60.0, 200.0])
    spectra = spectra_of(natural, sizes, carbons)
    found = splitsnow.retrieve(spectra.reshape(3, 1, -1), natural, fix=FIX, jacobian=True)
    assert found.names == ("ssa_m2_kg", "optical_radius_um", "grain_size_um", "black_carbon_ng_g")
    assert found.unknowns == found.names[2:]
    assert found.converged.all() and found.best.shape == (3, 1, 4)
    np.testing.assert_allclose(found["grain_size_um"][:, 0], sizes, rtol=2e-3)
    np.testing.assert_allclose(found["black_carbon_ng_g"][:, 0], carbons, rtol=0.02, atol=0.5)
    np.testing.assert_allclose(found.fitted[:, 0], spectra, atol=1e-3)
    assert (found.p95[..., 0] < found.p68[..., 0]).all()
    sizes_found, ends = found["grain_size_um"], found.p68[..., 2, :]
    assert (ends[..., 0] < sizes_found).all() and (sizes_found < ends[..., 1]).all()
    with pytest.raises(KeyError, match="there is no density"):
        found["density"]
    # derivatives are those of the look-up
    step = np.array([-1.0, 1.0])
    high_low = spectra_of(natural, 300 + step, [60, 60])
    slope = (high_low[1] - high_low[0]) / 2
    np.testing.assert_allclose(found.jacobian[1, 0, :, 0], slope, rtol=0.05, atol=2e-6)


def test_wavelengths_need_not_be_those_of_the_file(natural):
    spectrum = spectra_of(natural, [300], [60])[0]
    nm = np.arange(400, 1651, 10.0)
    fine = np.interp(nm, natural.wavelengths_nm, spectrum)
    found = splitsnow.retrieve(fine, natural, wavelengths_nm=nm, fix=FIX)
    assert found["grain_size_um"].shape == ()
    np.testing.assert_allclose(found["grain_size_um"], 300, rtol=2e-3)
    few = splitsnow.retrieve(fine[nm < 1200], natural, wavelengths_nm=nm[nm < 1200], fix=FIX)
    assert few.wavelengths_nm.tolist() == [400, 600, 800, 1030, 1100]
    with pytest.raises(ValueError, match="at least 2 are needed"):
        splitsnow.retrieve(fine[::20], natural, wavelengths_nm=nm[::20] + 5, fix=FIX)


def test_dimensions_and_coordinates_of_xarray_are_kept(natural):
    spectra = spectra_of(natural, [200, 400], [10, 90])
    array = xarray.DataArray(
        spectra.T,
        dims=("wavelength_nm", "site"),
        coords={"wavelength_nm": natural.wavelengths_nm, "site": ["a", "b"]},
    )
    table = splitsnow.retrieve(array, natural, fix=FIX).to_xarray()
    assert dict(table.sizes) == {"site": 2, "wavelength_nm": 7}
    assert table.site.values.tolist() == ["a", "b"]
    assert table.ssa_m2_kg.attrs["units"] == "m2 kg-1"
    assert (table.ssa_m2_kg_low < table.ssa_m2_kg).all()
    np.testing.assert_allclose(table.grain_size_um, [200, 400], rtol=2e-3)


def test_values_for_each_spectrum_and_priors(natural):
    thin = natural.reflectance(0.2, 300, 200, 5, 0, black_carbon_ng_g=60)
    deep = natural.reflectance(0.2, 300, 200, 34, 0, black_carbon_ng_g=60)
    fix = {"facetness": 0.2, "density_kg_m3": 200, "thickness_cm": [5, 34]}
    found = splitsnow.retrieve([thin, deep], natural, fix=fix)
    np.testing.assert_allclose(found["grain_size_um"], 300, rtol=5e-3)
    # a narrow prior wins
    free = {"grain_size_um": "250+-0.1", "black_carbon_ng_g": (0, 100)}
    held = splitsnow.retrieve(deep, natural, free=free, fix=FIX)
    np.testing.assert_allclose(held["grain_size_um"], 250, rtol=1e-3)
    # a smaller error gives a narrower interval
    both = [splitsnow.retrieve(deep, natural, fix=FIX, sigma=s, correlated=0) for s in (0.002, 0.02)]
    widths = [np.ptp(found.p68[0]) for found in both]
    assert widths[0] < 0.5 * widths[1]
    exact = splitsnow.retrieve(deep, natural, fix=FIX, intervals="grid")
    plain = splitsnow.retrieve(deep, natural, fix=FIX)
    np.testing.assert_allclose(exact.p68[2], plain.p68[2], rtol=0.05)


def test_bands_of_a_sensor(run, tmp_path):
    """In the order of the sensor, whatever their wavelengths."""
    config = tmp_path / "narrow.toml"
    config.write_text(
        """\
version = 1
[axes]
facetness = [0.2]
grain_size_um = [100, 200, 400, 800]
density_kg_m3 = [200]
thickness_cm = ["inf"]
incidence_angle_deg = [30]
[wavelengths]
start_nm = 520
stop_nm = 900
step_nm = 10
[run]
rays = 2000
"""
    )
    run("build", config, "--out", tmp_path / "narrow")
    snow = splitsnow.Database.open(tmp_path / "narrow")
    sensor = "sentinel2a:B8A,B3,B5"
    bands = splitsnow.bands(sensor, snow.wavelengths_nm)
    sizes = np.array([130.0, 300.0, 600.0])
    values = bands.average(snow.reflectance(0.2, sizes, 200, np.inf, 30))
    deep = {"thickness_cm": np.full(3, np.inf)}
    found = splitsnow.retrieve(values, snow, bands=sensor, fix=deep, jacobian=True)
    np.testing.assert_allclose(found["grain_size_um"], sizes, rtol=2e-3)
    np.testing.assert_allclose(found.fitted, values, atol=1e-4)
    assert found.wavelengths_nm.tolist() == bands.centre_nm.tolist()
    assert (np.abs(found.jacobian[..., 0]).argmax(-1) == 0).all()  # B8A shows the size
    stated = splitsnow.retrieve(values, snow, bands=sensor, sigma=[0.001, 0.5, 0.5], level=0)
    assert (np.ptp(stated.p68[:, 0], axis=-1) < np.ptp(found.p68[:, 0], axis=-1)).all()
    with pytest.raises(ValueError, match=r"shape \(3, 2\); expected \(\.\.\., 3\), one value per band"):
        splitsnow.retrieve(values[:, :2], snow, bands=sensor)
    with pytest.raises(ValueError, match="give bands or wavelengths_nm, not both"):
        splitsnow.retrieve(values, snow, bands=sensor, wavelengths_nm=[560, 700, 865])
    with pytest.raises(ValueError, match="B11"):
        splitsnow.retrieve(values, snow, bands="sentinel2a:B11")


def test_missing_values_and_wrong_requests(natural):
    spectra = spectra_of(natural, [200, 400], [10, 90])
    spectra[0, 3] = np.nan
    found = splitsnow.retrieve(spectra, natural, fix=FIX)
    assert np.isnan(found.best[0]).all() and not found.converged[0]
    np.testing.assert_allclose(found["grain_size_um"][1], 400, rtol=2e-3)
    for wrong, message in (
        ({"fix": {"facetness": 2}}, "facetness = 2 is outside"),
        ({"fix": {"snow": 2}}, "no parameter snow"),
        ({"free": {"facetness": "x"}}, "for a range"),
        ({"noise": -1}, "noise = -1"),
        ({"sigma": 0}, "sigma must be above 0"),
        ({"intervals": "x"}, "no intervals 'x'"),
        ({"wavelengths_nm": [1, 2]}, "expected"),
        ({"quantity": "brf"}, "no quantity"),
    ):
        with pytest.raises(ValueError, match=message):
            splitsnow.retrieve(spectra[1:], natural, **wrong)


def test_a_cube_takes_seconds(natural):
    """At least 2,000 spectra per second on two cores for three unknowns; a third of it here,
    because other tests may run beside this one."""
    random = np.random.default_rng(1)
    count = 4000
    shape = dict(fix={"density_kg_m3": 200, "thickness_cm": 34})
    base = spectra_of(natural, [150, 250, 400, 700], [5, 60, 100, 200])
    spectra = base[np.arange(count) % 4] + random.normal(0, 0.005, (count, base.shape[1]))
    begin = time.perf_counter()
    found = splitsnow.retrieve(spectra, natural, **shape)
    seconds = time.perf_counter() - begin
    print(f"{count / seconds:.0f} spectra per second")
    assert len(found.unknowns) == 3 and found.converged.mean() > 0.99
    assert count / seconds > 700
