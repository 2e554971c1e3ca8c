"""The scenes of examples/mitsuba at small size: brightness and hue."""

import importlib
import sys

import mitsuba as mi
import numpy as np
import pytest
from conftest import ROOT

import splitsnow
import splitsnow.mitsuba

LUMINANCE = [0.2126, 0.7152, 0.0722]


@pytest.fixture
def example(monkeypatch, tmp_path):
    """Runs a script of examples/mitsuba and returns its module, EXR and PNG."""
    monkeypatch.syspath_prepend(str(ROOT / "examples/mitsuba"))

    def example(name, size, spp, variant="llvm_ad_spectral"):
        module = importlib.import_module(name)
        out = tmp_path / name
        arguments = [name, "--size", size, "--spp", spp, "--variant", variant, "--out", out]
        monkeypatch.setattr(sys, "argv", list(map(str, arguments)))
        module.stage.main(*module.PICTURE)
        image, shown = (np.array(mi.Bitmap(f"{out}{end}")) for end in (".exr", ".png"))
        assert image.shape == shown.shape and image.shape[1] == size
        assert np.isfinite(image).all()
        return module, image, shown

    return example


def blueness(colour):
    """Fraction of blue; colours out of gamut are clipped."""
    colour = np.maximum(colour, 0)
    return colour[..., 2] / colour.sum(-1)


def test_sculpture(example):
    """Brightness follows grain size and density; thin fins are white, cores are blue."""
    sculpture, image, shown = example("sculpture", 350, 32)
    vertices, faces = sculpture.body()
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (corners[:, 0] * normals).sum() / 6 > 0.03  # normals point outwards
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), 1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()  # closed
    bodies = [image[:, 50 * i : 50 * (i + 1)] for i in range(7)]
    seen = [body[body.sum(-1) > 0] for body in bodies]
    lights = [body.mean(0) @ LUMINANCE for body in seen]
    base, small, large, light, dense, fine_light, coarse_dense = lights
    assert small < 0.7 * base and base < large
    assert 1.1 * dense < base < 0.9 * light
    assert small < fine_light < coarse_dense < large
    for body in bodies:
        core, fin = (body[32:36, x : x + 3].mean((0, 1)) for x in (26, 15))
        assert core @ LUMINANCE < 0.3 * (fin @ LUMINANCE)
        # with small grains even the fins are blue
        assert blueness(core) > max(0.5, blueness(fin) + 0.05)
    assert shown.max() == 255 and (shown[:, :4] == 0).all()


def test_igloo(example):
    """The igloo is blue; at the seams it is brighter and whiter."""
    igloo, image, shown = example("igloo", 120, 64)
    sensor = mi.load_dict(igloo.scene(120, 1)["sensor"])
    rows, columns = np.mgrid[:60, :120]  # the wall, not the floor
    positions = (np.stack([columns, rows]).reshape(2, -1) + 0.5) / np.array([[120], [90]])
    ray, _ = sensor.sample_ray(0, 0.5, mi.Point2f(positions), mi.Point2f(0.5))
    origin, direction = np.array(ray.o), np.array(ray.d)
    along = (origin * direction).sum(0)
    distance = -along + np.sqrt(along**2 + igloo.RADIUS**2 - (origin**2).sum(0))
    x, y, z = origin + distance * direction
    seam = igloo.seams(np.arctan2(z, np.hypot(x, y)), np.arctan2(y, x))
    wall = image[:60].reshape(-1, 3)
    between, seams = wall[seam < 0.1].mean(0), wall[seam > 0.8].mean(0)
    assert seams @ LUMINANCE > 1.1 * (between @ LUMINANCE) and seams[0] > 1.5 * between[0]
    assert blueness(between) > blueness(seams) + 0.05
    assert between[0] < 0.7 * between[2] and (between > 0).all()
    # a wall of snow 15 cm thick under a sky of radiance 1 / pi; reflections add to it
    nm = np.arange(360, 831, 5)
    database = splitsnow.Database.open(igloo.FILE)
    straight = database.transmittance(0.3, 300, 300, 15, 0, wavelengths_nm=nm)
    straight = splitsnow.srgb(straight, nm, "D65", linear=True, clip=False) / np.pi
    assert (0.2 * straight[1:] < between[1:]).all() and (between < 2 * straight.max()).all()
    assert shown[:60].mean() > 60


def test_soot(example):
    """The upper part shows reflected light, the lower part transmitted light, each as in
    the database; in transmission soot absorbs blue first."""
    soot, image, shown = example("soot", 120, 256)
    nm = np.arange(360, 831, 5)
    database = splitsnow.Database.open(soot.FILE)

    def colours(lookup, angle_deg):
        spectra = [
            lookup(0.3, 300, 275, 10, angle_deg, wavelengths_nm=nm, black_carbon_ng_g=soot_ng_g)
            for soot_ng_g in soot.SOOT_NG_G
        ]
        return splitsnow.srgb(np.array(spectra), nm, "D65", linear=True, clip=False) / np.pi

    through = colours(database.transmittance, 0)
    both = through + soot.FRONT * np.sqrt(0.5) * colours(database.reflectance, 45)
    columns = [(12, 31), (39, 58), (66, 85), (93, 112)]
    above, below = (
        np.array([image[rows, start:stop].mean((0, 1)) for start, stop in columns])
        for rows in (slice(10, 20), slice(25, 34))
    )
    assert np.allclose(below, through, rtol=0.05, atol=1e-5)
    assert np.allclose(above, both, rtol=0.05)
    assert (np.diff(below, axis=0) < 0).all() and (np.diff(above, axis=0) < 0).all()
    assert (np.diff(below[:, 2] / below[:, 0]) < 0).all()
    assert below[0, 2] > below[0, 0] and below[3, 2] < below[3, 0]
    assert shown[25:34, 93:112].max() < 60 < 100 < shown[25:34, 12:31].min()


def test_reference(monkeypatch):
    """Compared with a volumetric path tracer: similar brightness and hue in the middle of a
    block, less light towards its sides."""
    monkeypatch.syspath_prepend(str(ROOT / "examples/mitsuba"))
    reference = importlib.import_module("reference")
    mi.set_variant("llvm_ad_spectral")
    splitsnow.mitsuba.register()
    width = reference.WIDTH
    straight = reference.render(reference.ours, width, width / 3, 24, 256)[0].mean((0, 1))
    wide = reference.render(reference.volume, 3.0, width / 3, 24, 96)[0].mean((0, 1))
    block = reference.render(reference.volume, width, width, 24, 96)[0] @ LUMINANCE
    inner, whole = block[6:-6, 6:-6].mean(), block.mean()
    rim = (block.sum() - block[2:-2, 2:-2].sum()) / (24**2 - 20**2)
    assert rim < 0.6 * inner and whole < 0.9 * inner
    nm = np.arange(360, 831, 5)
    database = splitsnow.Database.open(reference.FILE)
    expected = database.transmittance(0.3, 300, 275, 10, 0, wavelengths_nm=nm)
    expected = splitsnow.srgb(expected, nm, "D65", linear=True, clip=False) / np.pi
    assert np.allclose(straight, expected, rtol=0.03)
    assert 0.85 < (wide @ LUMINANCE) / (straight @ LUMINANCE) < 1.4
    assert abs(blueness(wide) - blueness(straight)) < 0.04
    one, other = np.array([0.2, 0.2, 0.2]), np.array([0.1, 0.1, 0.1])
    assert reference.delta_e(one, one, 1.0) == 0
    # greys differ in lightness only
    lightness = [116 * np.cbrt(np.pi * grey) - 16 for grey in (0.2, 0.1)]
    assert reference.delta_e(one, other, 1.0) == pytest.approx(lightness[0] - lightness[1])
