# SPDX-License-Identifier: MIT OR Apache-2.0
"""Reads compact files and looks up spectra, with numpy alone.

The format is described in docs/formats.md ("Compact file"), the look-up in docs/methods.md
("Look-up"): y = -ln T, or -ln(1 - R), is interpolated along the thickness by a monotone
cubic curve and along the other axes linearly, in coordinates in which snow is smooth.
Answers agree with those of the program within 1e-5 (tests/python/test_blender.py).
"""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path

import numpy as np

CORE = ("facetness", "grain_size_um", "density_kg_m3", "thickness_cm", "angle_deg")
# Optional axes that describe the snow, in the order of storage.
CONDITIONS = (
    "black_carbon_ng_g",
    "absorber_ug_g",
    "water_saturation",
    "temperature_c",
    "sphericity",
    "substrate_reflectance",
)
# Coordinate of each axis, in which y is nearly linear.
PLACES = {
    "black_carbon_ng_g": lambda x: np.sqrt(x + 20),
    "absorber_ug_g": lambda x: np.sqrt(x + 10),
    "water_saturation": lambda x: -np.log(1 - x),
    "temperature_c": lambda x: np.asarray(x, float),
    "sphericity": np.log,
    "substrate_reflectance": lambda x: -np.log(1 - 0.95 * x),
    "facetness": lambda x: -np.exp(-x / 0.18),
    "grain_size_um": np.log,
    "density_kg_m3": np.log,
    "thickness_cm": lambda x: np.log(1 + x / 0.5),
    "angle_deg": lambda x: 0.4 * np.exp(-_cosine(x) / 0.02) - _cosine(x),
}
# Extra nodes below the first thickness, as fractions of it.
THIN = np.array([0, 1 / 64, 1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2])
# Largest y taken from the spectra of a file with a linear basis.
DARKEST = 16.0
TYPES = {"U8": "u1", "U16": "<u2", "F16": "<f2", "F32": "<f4", "F64": "<f8"}
MOST_HEADER = 16 << 20
MOST_NUMBER = 1e9


class FileError(ValueError):
    """A file that is not a compact file, or one that this reader does not know."""


class OutsideError(ValueError):
    """A value outside the axes of a file."""


def _cosine(degrees):
    return np.cos(np.radians(degrees))


class CompactFile:
    """A compact file in memory."""

    def __init__(self, path):
        path = Path(path)
        if path.is_dir():
            path = path / "snow.safetensors"
        try:
            data = path.read_bytes()
        except OSError as error:
            raise FileError(f"{path} cannot be read: {error.strerror or error}") from error
        self.path = path
        try:
            self._read(data)
        except FileError as error:
            raise FileError(f"{path} cannot be used as a file of snow: {error}") from None

    def _read(self, data):
        header, tensors = _header(data)
        self._tensors, meta = tensors, header
        _expect(meta, "format", ["splitsnow-compact"])
        version = _expect(meta, "format_version", ["2", "1"])
        if "content" in meta:
            raise FileError(
                "it holds anisotropy factors toward views; choose the file of reflectance and "
                "transmittance, snow.safetensors"
            )
        order = tuple(filter(None, meta.get("axis_order", "").split(",")))
        conditions = order[: -len(CORE)]
        known = tuple(name for name in CONDITIONS if name in conditions)
        if order[-len(CORE) :] != CORE or conditions != known:
            raise FileError(f"its axes are {', '.join(order) or 'missing'}; this reader knows others")
        self.basis = _expect(meta, "basis", ["linear", "log"])
        precision = _expect(meta, "precision", ["f32", "f16", "quantised"], "f32")
        both = "transmittance,reflectance"
        quantities = _expect(meta, "quantities", [both, "transmittance", "reflectance"], both)
        self.quantities = tuple(quantities.split(","))
        if version == "1":
            self.black_substrate = meta.get("bottom_boundary", "black").startswith("black")
        else:
            kinds = ["black", "reflecting", "layers"]
            self.black_substrate = _expect(meta, "substrate", kinds) == "black"
        self.diffuse = meta.get("illumination", "").startswith("diffuse")
        self.wavelengths_nm = self._coordinate("wavelength_nm")
        self.axes = {name: self._coordinate(name) for name in order}
        shape = tuple(len(nodes) for nodes in self.axes.values())
        used = {"wavelength_nm", *order}
        self.absent = np.zeros(len(self.axes["grain_size_um"]), int)
        if "absent" in tensors:
            used.add("absent")
            self.absent = self._tensor("absent", ["U16"], self.absent.shape).astype(int)
        self._factors = {}
        for quantity in self.quantities:
            parts = self._quantity(meta, quantity, precision, math.prod(shape), used)
            self._factors[quantity] = (parts[0].reshape(*shape, -1), parts[1])
        unknown = sorted(set(tensors) - used)
        if unknown:
            raise FileError(f"it has the tensor {unknown[0]}, which this reader does not know")
        del self._tensors

    def _tensor(self, name, types, shape):
        if name not in self._tensors:
            raise FileError(f"it has no tensor {name}")
        kind, found, data = self._tensors[name]
        if kind not in types or (shape is not None and found != tuple(shape)):
            wanted = f"{' or '.join(types)} {'[n]' if shape is None else list(shape)}"
            raise FileError(f"its tensor {name} is {kind} {list(found)}, expected {wanted}")
        return np.frombuffer(data, TYPES[kind]).reshape(found)

    def _coordinate(self, name):
        values = self._tensor(name, ["F64", "F32"], None)
        if values.dtype == np.float32:
            # the shortest decimals that round to these numbers
            values = np.array([float(str(value)) for value in values])
        if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
            raise FileError(f"its tensor {name} must be a list of finite numbers")
        if (np.diff(values) <= 0).any():
            raise FileError(f"its tensor {name} must increase strictly")
        return values

    def _quantity(self, meta, quantity, precision, curves, used):
        wavelengths = len(self.wavelengths_nm)
        text = meta.get(f"{quantity}.components", "missing")
        if not (text.isdecimal() and 1 <= int(text) <= wavelengths):
            raise FileError(
                f"its metadata {quantity}.components is {text}, expected 1 to {wavelengths}"
            )
        count, names = int(text), [f"{quantity}.basis"]
        basis = self._tensor(names[0], ["F32"], (wavelengths, count)).astype(float)
        if precision == "quantised":
            names.append(f"{quantity}.quantisation")
            scales = self._tensor(names[1], ["F32"], (count, 2)).astype(float)
            columns = []
            for k, (offset, step) in enumerate(scales):
                names.append(f"{quantity}.coefficients.{k}")
                integers = self._tensor(names[-1], ["U8", "U16"], (curves,))
                columns.append((offset + step * integers).astype(np.float32))
            coefficients = np.stack(columns, -1).astype(float)
        else:
            names.append(f"{quantity}.coefficients")
            kind = {"f32": "F32", "f16": "F16"}[precision]
            coefficients = self._tensor(names[1], [kind], (curves, count)).astype(float)
        for values in (coefficients, basis):
            # written so that NaN is refused too
            if not (np.abs(values) <= MOST_NUMBER).all():
                raise FileError(f"its {quantity} has a number beyond {MOST_NUMBER:g}")
        used.update(names)
        return coefficients, basis

    @property
    def conditions(self):
        """Names of the optional axes of the file."""
        return tuple(self.axes)[: -len(CORE)]

    def snow(self, quantity, values):
        """The quantity of one snow, for look-ups at any thickness and angle.

        ``values`` has the snow's value on each axis but thickness and angle, by name. An
        axis with a single node needs none.
        """
        if quantity not in self._factors:
            raise FileError(
                f"{self.path} has no {quantity}; make the file with "
                'quantities = ["transmittance", "reflectance"]'
            )
        unknown = sorted(set(values) - set(self.axes))
        if unknown:
            raise OutsideError(f"{self.path.name} has no axis {unknown[0]}")
        corners = []
        for name in (*self.conditions, *CORE[:3]):
            corners.append(_bracket(name, self.axes[name], values.get(name), self.path.name))
        size = self.axes["grain_size_um"]
        requested = values.get("grain_size_um", size[0])
        return Snow(self, quantity, corners, requested)


class Snow:
    """One quantity of one snow: a table over thickness and angle."""

    def __init__(self, file, quantity, corners, grain_size_um):
        self.file, self.quantity, self.grain_size_um = file, quantity, grain_size_um
        self.angles = PLACES["angle_deg"](file.axes["angle_deg"])
        self.nodes_cm = file.axes["thickness_cm"]
        has_thin = file.black_substrate or len(self.nodes_cm) == 1
        self.thin = len(THIN) if has_thin else 0
        extra = THIN[: self.thin] * self.nodes_cm[0]
        self.rows_cm = np.concatenate([extra, self.nodes_cm])
        self.x = PLACES["thickness_cm"](self.rows_cm)
        coefficients, basis = file._factors[quantity]
        self.vectors = basis if file.basis == "log" else None
        count = len(file.conditions)
        self.first = 0  # index of the first thickness that exists
        total = None
        for places in itertools.product(*corners[count:]):
            weight = math.prod(share for _, share in places)
            f, s, d = (index for index, _ in places)
            parts = []
            for blocks in itertools.product(*corners[:count]):
                share = math.prod(share for _, share in blocks)
                index = tuple(index for index, _ in blocks)
                parts.append((share, coefficients[(*index, f, s, d)]))
            absent = int(file.absent[s])
            self.first = max(self.first, absent)
            column = self._column(self._mixed(parts, basis), absent)
            scaled = [weight * values for values in column]
            total = scaled if total is None else [a + b for a, b in zip(total, scaled)]
        self.y, self.slopes = total  # (rows, angles, components)

    def _mixed(self, parts, basis):
        """Coefficients of y, or y itself, ``(thicknesses, angles, components)``."""
        if self.file.basis == "log":
            return sum(share * coefficients for share, coefficients in parts)
        curves = [(share, (rows @ basis.T).astype(np.float32).astype(float)) for share, rows in parts]
        if len(curves) > 1:
            # least values of the library before it takes the logarithm
            least = 1e-30 if self.quantity == "transmittance" else 1e-9
            y = sum(
                share * np.minimum(-np.log(np.maximum(self._transparent(c), least)), DARKEST)
                for share, c in curves
            )
            y = np.maximum(y, 0)
            curves = [(1, np.exp(-y) if self.quantity == "transmittance" else -np.expm1(-y))]
        transparent = np.clip(self._transparent(curves[0][1]), math.exp(-DARKEST), 1)
        return -np.log(transparent)

    def _transparent(self, values):
        return values if self.quantity == "transmittance" else 1 - values

    def _spectral(self, y):
        return y if self.vectors is None else y @ self.vectors.T

    def _column(self, nodes, absent):
        """y and its slopes at all rows of thickness."""
        y = np.zeros((len(self.x), *nodes.shape[1:]))
        y[self.thin :] = nodes
        y[self.thin : self.thin + absent] = 0
        if self.vectors is None and self.thin:
            # noise must not make a slab transmit more than a thinner one
            begin = self.thin + absent
            y[begin:] = np.maximum.accumulate(y[begin:], 0)
        if self.thin and not absent:
            y[: self.thin] = self._thin(nodes if self.vectors is not None else y[self.thin :])
        begin = self.thin + absent if absent else 0
        slopes = np.zeros_like(y)
        if len(y) - begin >= 2:
            x, values = self.x[begin:], y[begin:]
            raw = _slopes(x, values)
            if self.vectors is None:
                slopes[begin:] = raw * _shares(x, values, raw)
            else:
                # what the limit takes from the wavelengths, as nearly as the basis has it; the
                # overshoot of dark ones is invisible
                spectra, steep = self._spectral(values), self._spectral(raw)
                excess = (_shares(x, spectra, steep) - 1) * steep
                slopes[begin:] = raw + np.where(spectra < DARKEST, excess, 0) @ self.vectors
        return y, slopes

    def _thin(self, nodes):
        """y at the rows thinner than the first node."""
        x, first_cm = self.x[self.thin :][:3], self.nodes_cm[0]
        spectra = self._spectral(nodes[:3])
        if len(spectra) > 1:
            slope = np.maximum(_slopes(x, spectra)[0], 0)
        else:
            slope = spectra[0] / max(x[0], 1e-38)
        slope = slope / (0.5 + first_cm)
        found = _thinner(spectra[0], slope, first_cm)
        return found if self.vectors is None else found @ self.vectors

    def check(self, thickness_cm):
        """Raises ``OutsideError`` if the file does not cover one of these thicknesses."""
        least, most = float(np.min(thickness_cm)), float(np.max(thickness_cm))
        low, high = self.range_cm
        if not (low * (1 - 1e-6) <= least and most <= high * (1 + 1e-6)):
            raise OutsideError(
                f"a thickness of {least if least < low else most:g} cm is outside "
                f"{self.file.path.name}, which covers {low:g} to {high:g} cm at grains of "
                f"{self.grain_size_um:g} um"
            )

    @property
    def range_cm(self):
        """Thinnest and thickest snow that can be looked up, cm."""
        if len(self.nodes_cm) == 1:
            return self.nodes_cm[0], self.nodes_cm[0]
        if self.first >= len(self.nodes_cm):
            return math.inf, math.inf
        if self.first or not self.thin:
            return self.nodes_cm[self.first], math.inf
        return 0.0, math.inf

    def spectra(self, thickness_cm, angle_deg):
        """Spectra at all pairs, ``(thicknesses, angles, wavelengths)``."""
        thickness_cm = np.atleast_1d(np.asarray(thickness_cm, float))
        angle_deg = np.atleast_1d(np.asarray(angle_deg, float))
        self.check(thickness_cm)
        ends = self.file.axes["angle_deg"][[0, -1]]
        scale = 1e-6 * np.maximum(np.abs(ends), 1)
        if not ((angle_deg >= ends[0] - scale[0]) & (angle_deg <= ends[1] + scale[1])).all():
            raise OutsideError(
                f"an angle is outside {self.file.path.name}, which covers {ends[0]:g} to "
                f"{ends[1]:g} degrees"
            )
        cell, share = _cells(self.angles, PLACES["angle_deg"](np.clip(angle_deg, *ends)))
        share = share[:, None]

        def along_angles(rows):
            if len(self.angles) == 1:
                return np.repeat(rows, len(angle_deg), 1)
            return rows[:, cell] * (1 - share) + rows[:, cell + 1] * share

        last_cm = self.rows_cm[-1]
        y = np.empty((len(thickness_cm), len(angle_deg), self._spectral(self.y[:1]).shape[-1]))
        beyond = PLACES["thickness_cm"](thickness_cm) > self.x[-1]
        inner = thickness_cm[~beyond]
        if len(inner):
            # within the nodes, and no thinner than the first that exists
            place = np.clip(PLACES["thickness_cm"](inner), self.x[0], self.x[-1])
            row, t = _cells(self.x, place)
            step, t = (self.x[row + 1] - self.x[row])[:, None, None], t[:, None, None]
            left = 1 - t
            curve = (
                (1 + 2 * t) * left**2 * self.y[row]
                + t * left**2 * step * self.slopes[row]
                + t**2 * (3 - 2 * t) * self.y[row + 1]
                - t**2 * left * step * self.slopes[row + 1]
            )
            y[~beyond] = self._spectral(along_angles(curve))
        if beyond.any():
            before, last = self._spectral(along_angles(self.y[-2:]))
            (slope,) = self._spectral(along_angles(self.slopes[-1:]))
            if self.quantity == "reflectance":
                y[beyond] = last
            else:
                step_cm = last_cm - self.rows_cm[-2]
                deeper_cm = (thickness_cm[beyond] - last_cm)[:, None, None]
                y[beyond] = _deeper(last, slope / (0.5 + last_cm), before, step_cm, deeper_cm)
        # numbers of a damaged file may overflow
        y = np.maximum(np.nan_to_num(y, nan=0, posinf=np.inf), 0)
        return np.exp(-y) if self.quantity == "transmittance" else -np.expm1(-y)


def _header(data):
    """Metadata, and the type, shape and bytes of each tensor."""
    length = int.from_bytes(data[:8], "little")
    if len(data) < 8 or not 2 <= length <= MOST_HEADER:
        raise FileError("it is not a safetensors file")
    if 8 + length > len(data):
        raise FileError("it is truncated")
    try:
        header = json.loads(data[8 : 8 + length])
        meta = header.pop("__metadata__", {})
        entries = [
            (*map(int, entry["data_offsets"]), name, entry["dtype"], tuple(entry["shape"]))
            for name, entry in header.items()
        ]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise FileError(f"its header is damaged ({error})") from None
    body, end, tensors = data[8 + length :], 0, {}
    for first, last, name, kind, shape in sorted(entries):
        if kind not in TYPES:
            raise FileError(f"its tensor {name} has the type {kind}, which this reader does not know")
        size = math.prod(shape) * np.dtype(TYPES[kind]).itemsize
        if first != end or last - first != size or min(shape, default=0) < 0:
            raise FileError(f"its tensor {name} does not match its data")
        tensors[name] = (kind, shape, body[first:last])
        end = last
    if end != len(body):
        raise FileError("it is truncated" if end > len(body) else "something was appended to it")
    return meta, tensors


def _expect(meta, key, allowed, default=None):
    value = meta.get(key, default)
    if value not in allowed:
        raise FileError(f"its metadata {key} is {value}, expected {' or '.join(allowed)}")
    return value


def _bracket(name, nodes, value, file):
    """Indices of the nodes around ``value`` and their weights; only those above 0."""
    if value is None:
        if len(nodes) > 1:
            raise OutsideError(f"{name} is needed: {file} covers {nodes[0]:g} to {nodes[-1]:g}")
        return [(0, 1.0)]
    near = np.abs(nodes - value) <= 1e-6 * np.where(nodes == 0, 1, np.abs(nodes))
    if near.any():
        return [(int(np.argmin(np.abs(nodes - value))), 1.0)]
    if not nodes[0] < value < nodes[-1]:
        covers = f"{nodes[0]:g} to {nodes[-1]:g}" if len(nodes) > 1 else f"{nodes[0]:g} only"
        raise OutsideError(f"{name} = {value:g} is outside {file}, which covers {covers}")
    below = int(np.searchsorted(nodes, value)) - 1
    low, here, high = (float(PLACES[name](x)) for x in (nodes[below], value, nodes[below + 1]))
    share = (here - low) / (high - low)
    return [(below, 1 - share), (below + 1, share)]


def _cells(nodes, places):
    """Node below each place, at most the last but one, and the way to the next, 0 to 1."""
    if len(nodes) == 1:
        return np.zeros(len(places), int), np.zeros(len(places))
    cell = np.clip(np.searchsorted(nodes, places, "right") - 1, 0, len(nodes) - 2)
    return cell, np.clip((places - nodes[cell]) / (nodes[cell + 1] - nodes[cell]), 0, 1)


def _secants(x, values):
    return np.diff(values, axis=0) / np.diff(x).reshape(-1, *[1] * (values.ndim - 1))


def _slopes(x, values):
    """Slopes at the nodes of the parabolas through each node and its two neighbours."""
    lines = _secants(x, values)
    if len(x) == 2:
        return np.repeat(lines, 2, 0)
    steps = np.diff(x).reshape(-1, *[1] * (values.ndim - 1))
    middle = (lines[:-1] * steps[1:] + lines[1:] * steps[:-1]) / (steps[:-1] + steps[1:])
    first, last = 2 * lines[:1] - middle[:1], 2 * lines[-1:] - middle[-1:]
    return np.concatenate([first, middle, last])


def _shares(x, values, slopes):
    """Fractions of the slopes that keep the curves monotone (Fritsch and Carlson 1980)."""
    lines = _secants(x, values)
    left, right = np.concatenate([lines[:1], lines]), np.concatenate([lines, lines[-1:]])
    upward = np.where(np.maximum(left, right) < 0, -1, 1)
    most, slopes = 3 * np.minimum(upward * left, upward * right), upward * slopes
    with np.errstate(divide="ignore", invalid="ignore"):
        limited = np.where(most > 0, most / slopes, 0)
    return np.where(slopes <= most, np.where(slopes >= 0, 1.0, 0.0), limited)


def _growth(slope, k, h_cm):
    """ln(cosh kh + s/k sinh kh), the growth of 1/T over ``h_cm`` where light diffuses."""
    along = k * np.abs(h_cm)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        straight = np.log1p(np.maximum(slope * h_cm, -1))
        rising, falling = 0.5 * (1 + slope / k), 0.5 * (1 - slope / k)
        decay = np.exp(-2 * along)
        total = np.where(h_cm > 0, rising + falling * decay, rising * decay + falling)
        curved = along + np.where(total > 0, np.log(np.maximum(total, 1e-300)), -np.inf)
    return np.where(along < 1e-6, straight, curved)


def _decay(y, slope, before, step_cm):
    """The decay constant k with which the curve passes through the thinner node."""
    ratio = np.exp(-np.maximum(y - before, 0))
    low, high = np.zeros_like(slope), np.maximum(slope, 0)
    for _ in range(24):
        k = 0.5 * (low + high)
        decay = np.exp(-k * step_cm)
        with np.errstate(divide="ignore", invalid="ignore"):
            part = slope / k
            found = 0.5 * ((1 + part) * decay * decay + (1 - part))
            straight = k * step_cm < 1e-6
            too_large = np.where(straight, 1 - slope * step_cm > ratio, found > ratio * decay)
        high, low = np.where(too_large, k, high), np.where(too_large, low, k)
    return high


def _deeper(y, slope, before, step_cm, h_cm):
    growth = _growth(slope, _decay(y, slope, before, step_cm), h_cm)
    return y + np.maximum(growth, 0)


def _thinner(y, slope, first_cm):
    """y at the parts ``THIN`` of the first thickness; 0 at 0 cm."""
    k = _decay(y, slope, np.zeros_like(y), first_cm)
    whole = _growth(slope, k, -first_cm)
    leads = whole < 0
    parts = THIN.reshape(-1, *[1] * y.ndim)
    with np.errstate(divide="ignore", invalid="ignore"):
        curved = y - y / np.where(leads, whole, 1) * _growth(slope, k, (parts - 1) * first_cm)
    return np.where(leads, curved, y * parts)
