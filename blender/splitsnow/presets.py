# SPDX-License-Identifier: MIT OR Apache-2.0
"""The snows to choose from. Their files are made by blender/presets/make."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

FOLDER = Path(__file__).parent / "presets"


@dataclass(frozen=True)
class Preset:
    """A file of snow, and a place on its axes."""

    label: str
    description: str
    file: str
    values: dict = field(default_factory=dict)

    @property
    def path(self):
        return FOLDER / self.file


PRESETS = {
    "new": Preset(
        "New Snow",
        "Small grains, light: 150 um, 120 kg/m3",
        "dry.safetensors",
        {"grain_size_um": 150, "density_kg_m3": 120},
    ),
    "settled": Preset(
        "Settled Snow",
        "A few days old: 250 um, 250 kg/m3",
        "dry.safetensors",
        {"grain_size_um": 250, "density_kg_m3": 250},
    ),
    "packed": Preset(
        "Packed Snow",
        "By wind or by hand, as in an igloo: 200 um, 400 kg/m3",
        "dry.safetensors",
        {"grain_size_um": 200, "density_kg_m3": 400},
    ),
    "old": Preset(
        "Old Snow",
        "Coarse grains: 800 um, 350 kg/m3",
        "dry.safetensors",
        {"grain_size_um": 800, "density_kg_m3": 350},
    ),
    "melting": Preset(
        "Melting Snow",
        "Coarse round grains with water in a tenth of the pores: 700 um, 400 kg/m3",
        "wet.safetensors",
        {"grain_size_um": 700, "water_saturation": 0.1},
    ),
    "town": Preset(
        "Town Snow",
        "Soot in the ice, 50 ng/g: 300 um, 300 kg/m3",
        "sooty.safetensors",
        {"black_carbon_ng_g": 50},
    ),
}
