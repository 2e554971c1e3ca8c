"""The scenes of examples/mitsuba, small: brightness, hue and their order."""

import importlib
import sys

import mitsuba as mi
import numpy as np
import pytest
from conftest import ROOT

import splitsnow

LUMINANCE = [0.2126, 0.7152, 0.0722]


@pytest.fixture
def example(monkeypatch, tmp_path):
    """Runs a script of examples/mitsuba: its module, EXR and PNG."""
    monkeypatch.syspath_prepend(str(ROOT / "examples/mitsuba"))

    def example(name, size, spp, variant="llvm_ad_spectral"):
        module = importlib.import_module(name)
        out = tmp_path / name
        words = [name, "--size", size, "--spp", spp, "--variant", variant, "--out", out]
        monkeypatch.setattr(sys, "argv", list(map(str, words)))
        module.stage.main(*module.PICTURE)
        image, shown = (np.array(mi.Bitmap(f"{out}{end}")) for end in (".exr", ".png"))
        assert image.shape == shown.shape and image.shape[1] == size
        assert np.isfinite(image).all()
        return module, image, shown

    return example


def blueness(colour):
    """Share of blue; what is out of gamut is cut off."""
    colour = np.maximum(colour, 0)
    return colour[..., 2] / colour.sum(-1)


def test_sculpture(example):
    """Each snow as bright as its grains and density say; thin fins white, cores blue."""
    sculpture, image, shown = example("sculpture", 350, 32)
    vertices, faces = sculpture.body()
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (corners[:, 0] * normals).sum() / 6 > 0.03  # outwards
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), 1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()  # closed
    bodies = [image[:, 50 * i : 50 * (i + 1)] for i in range(7)]
    seen = [body[body.sum(-1) > 0] for body in bodies]
    base, small, large, round_, faceted, light, dense = [body.mean(0) @ LUMINANCE for body in seen]
    assert small < 0.7 * base and base < large
    assert 1.1 * dense < base < 0.9 * light
    database = splitsnow.Database.open(sculpture.FILE)
    through = [
        database.transmittance(*snow.values(), 20, 0, wavelengths_nm=[550])
        for snow in sculpture.SNOWS[3:5]
    ]
    assert (round_ > faceted) == (through[0] > through[1])
    for body in bodies:
        core, fin = (body[32:36, x : x + 3].mean((0, 1)) for x in (26, 15))
        assert core @ LUMINANCE < 0.3 * (fin @ LUMINANCE)
        assert blueness(core) > max(0.5, blueness(fin) + 0.1)
    assert shown.max() == 255 and (shown[:, :4] == 0).all()
