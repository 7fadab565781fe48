"""Columns that scenes hold, as the plain NumPy arrays that `toa_brf` and `toa_radiance` take.

`columns(workload, count, seed)` makes one of four workloads, by the operator's own optics of the
images of `pareto_states`, so that moments and phase functions are those of mixtures:

W1  smoke at 0 to 4 km or ash at 6 to 12 km, optical depth 0.05 to 4 and much of it weak, a fourth
    of the pixels clear; 20 to 40 layers; C01 C02 C03 C06 without gases, as in the paper.
W2  clouds as a mesoscale model gives them, with liquid, ice, snow and rain; 27 to 50 layers; the
    same bands, without gases too.
W3  clear and fire pixels in C05 C06 C07 with gases; C07 emits; 27 to 50 layers.
W4  W1 in C01 C02 C03, of which `iterate` gives the state of a retrieval after so many steps: the
    plume's optical depth and single-scattering albedo change, and nothing else does.

The number of layers follows from the seed, and all columns of a call share it. Columns are the
images of the bands one after the other (of W3, those of each exponential term of a band), with
pixels in row order, so that neighbouring columns are alike as they are in scenes; `shuffled` takes
them in random order. Float64: `jax_enable_x64` must be on.
"""

from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import jax
import numpy as np
from pareto_states import make_state

from abi_operator import Geometry
from abi_operator.band_columns import columns_of_bands
from abi_operator.optics import ALL_GASES
from abi_operator.satellites import solar_irradiance

PAPER = ("C01", "C02", "C03", "C06")
ITERATES = 10  # of W4
BATCH = 256  # pixels whose optics are computed together


@dataclass(frozen=True)
class Workload:
    """What a workload's images hold."""

    bands: tuple[str, ...]
    layers: tuple[int, int]  # fewest and most
    holds: dict[str, bool]
    gases: tuple[str, ...] = ()
    emitting: tuple[str, ...] = ()


WORKLOADS = {
    "W1": Workload(PAPER, (20, 40), {"plumes": True}),
    "W2": Workload(PAPER, (27, 50), {"clouds": True}),
    "W3": Workload(("C05", "C06", "C07"), (27, 50), {"hot": True}, ALL_GASES, ("C07",)),
    "W4": Workload(PAPER[:3], (20, 40), {"plumes": True}),
}


def _of_one(state, given: Workload, num_moments):
    """The solver's columns of one state."""
    sunlight = {band: np.float64(solar_irradiance(band)) for band in given.emitting}
    return columns_of_bands(
        state,
        given.bands,
        given.gases,
        num_moments,
        emitting=given.emitting,
        solar_irradiance=sunlight,
    )


@partial(jax.jit, static_argnames=("name", "num_moments", "only"))
def _groups(state, name, num_moments, only=None):
    """Arguments of the solver of a batch of states, group by group: (pixel, column, ...)."""

    def arguments(state):
        groups = _of_one(state, WORKLOADS[name], num_moments)
        found = [x.arguments | {"weight": x.weight} for x in groups]
        return found if only is None else [x[only] for x in found]

    return jax.vmap(arguments)(state)


@dataclass(frozen=True)
class Source:
    """States of all pixels, and what their columns are, in order: group, place in it, band."""

    state: Any
    workload: str
    kinds: tuple[tuple[int, int, str], ...]

    def batch(self, pixels, num_moments, only=None):
        """Groups of these pixels, at most `BATCH` of them."""
        filled = np.concatenate([pixels, np.repeat(pixels[-1:], BATCH - len(pixels))])
        chosen = jax.tree.map(lambda x: np.asarray(x)[filled], self.state)
        found = _groups(chosen, self.workload, num_moments, only)
        return jax.tree.map(lambda x: np.asarray(x)[: len(pixels)], found)


@dataclass(frozen=True)
class Columns:
    """One solver column each: layers top first, one sun and view a column, its band by name.

    `weight` is that of its exponential term. Columns of bands that emit have `planck_levels`,
    `surface_emission` and `solar_irradiance` [W m-2 sr-1 um-1, W m-2 um-1], which are 0, 0 and 1 of
    others in the same workload and None in workloads without emission.
    """

    tau: np.ndarray
    ssa: np.ndarray
    phase_function: np.ndarray
    albedo: np.ndarray
    mu0: np.ndarray
    mu: np.ndarray
    relative_azimuth: np.ndarray
    band: np.ndarray
    weight: np.ndarray
    emits: np.ndarray
    planck_levels: np.ndarray | None
    surface_emission: np.ndarray | None
    solar_irradiance: np.ndarray | None
    pixel: np.ndarray
    kind: np.ndarray
    source: Source

    @property
    def count(self):
        return len(self.mu0)

    def rows(self, chosen):
        """Some of the columns, by index, slice or mask."""
        own = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "source"}
        return replace(self, **{k: None if x is None else x[chosen] for k, x in own.items()})

    def first(self, count):
        return self.rows(slice(count))

    def moments(self, num_moments):
        """Legendre moments (count, layer, moment) without 2l + 1, computed when asked for."""
        return self._computed("moments", num_moments, (num_moments,))

    def with_geometry(self, mu0, mu, relative_azimuth):
        """The same columns, all under one sun and one view."""
        same = {"mu0": mu0, "mu": mu, "relative_azimuth": relative_azimuth}
        same = {name: np.full(self.count, x) for name, x in same.items()}
        geometry = self.source.state.geometry
        angles = (np.full(geometry.mu0.shape, x) for x in (np.arccos(mu0), np.arccos(mu)))
        azimuth = np.full(geometry.mu0.shape, relative_azimuth)
        state = replace(self.source.state, geometry=Geometry(*angles, azimuth))
        moved = replace(self, source=replace(self.source, state=state), **same)
        return replace(moved, phase_function=moved._computed("phase_function", 2))

    def _computed(self, name, num_moments, axes=()):
        """An argument of the solver that has an axis of layers, from the states."""
        found = np.empty((*self.tau.shape, *axes))
        pixels, of_pixel = np.unique(self.pixel, return_inverse=True)
        for start in range(0, len(pixels), BATCH):
            groups = self.source.batch(pixels[start : start + BATCH], num_moments, name)
            inside = (of_pixel >= start) & (of_pixel < start + BATCH)
            for kind, (group, place, _) in enumerate(self.source.kinds):
                here = np.flatnonzero(inside & (self.kind == kind))
                found[here] = groups[group][of_pixel[here] - start, place]
        return found

    def arguments(self, num_streams, emits=False):
        """What `toa_brf` takes by name, or `toa_radiance` of columns that emit."""
        names = ["tau", "ssa", "albedo", "mu0", "mu", "relative_azimuth", "phase_function"]
        if emits:
            names += ["planck_levels", "surface_emission", "solar_irradiance"]
        found = {name: np.ascontiguousarray(getattr(self, name)) for name in names}
        return found | {"moments": self.moments(num_streams + 1)}


def columns(workload, count, seed, *, shuffled=False, iterate=0, num_layers=None):
    """`count` columns of a workload; see the head of this file. `num_layers` may be set."""
    given = WORKLOADS[workload]
    rng = np.random.default_rng([seed, list(WORKLOADS).index(workload)])
    drawn = int(rng.integers(given.layers[0], given.layers[1], endpoint=True))
    num_layers = num_layers or drawn
    probe = make_state(1, 2, given.bands, np.random.default_rng(0), **given.holds)
    kinds = _kinds(probe, given)
    num_pixels = -(-count // len(kinds))
    state = make_state(num_pixels, num_layers, given.bands, rng, **given.holds)
    if workload == "W4":
        state = _iterate(state, iterate, rng)
    source = Source(state, workload, kinds)
    order = rng.permutation(num_pixels * len(kinds)) if shuffled else np.arange(count)
    return _made(source, num_pixels).rows(order[:count])


def _kinds(state, given: Workload):
    """Group, place and band of every column of a state: term by term, each in all bands."""
    one = jax.tree.map(lambda x: np.asarray(x)[0], state)
    groups = jax.eval_shape(partial(_of_one, given=given, num_moments=2), one)
    return tuple(
        (g, place, x.bands[of_band])
        for g, x in enumerate(groups)
        for place, of_band in enumerate(x.places)
    )


def _made(source: Source, num_pixels):
    """All columns of all pixels, in order of kind and pixel."""
    batches = [
        source.batch(np.arange(start, min(start + BATCH, num_pixels)), 2)
        for start in range(0, num_pixels, BATCH)
    ]
    groups = [
        {k: np.concatenate([x[g][k] for x in batches]) for k in batches[0][g]}
        for g in range(len(batches[0]))
    ]

    def ordered(name, other=None):
        parts = [
            groups[g][name][:, place]
            if name in groups[g]
            else np.full((num_pixels, *groups[-1][name].shape[2:]), other)
            for g, place, _ in source.kinds
        ]
        return np.concatenate(parts)

    emitting = WORKLOADS[source.workload].emitting
    kind = np.repeat(np.arange(len(source.kinds)), num_pixels)
    band = np.array([x for _, _, x in source.kinds])[kind]
    names = ["tau", "ssa", "phase_function", "albedo", "mu0", "mu", "relative_azimuth", "weight"]
    dark = {"planck_levels": 0.0, "surface_emission": 0.0, "solar_irradiance": 1.0}
    return Columns(
        **{name: ordered(name) for name in names},
        **{name: ordered(name, x) if emitting else None for name, x in dark.items()},
        band=band,
        emits=np.isin(band, emitting),
        pixel=np.tile(np.arange(num_pixels), len(source.kinds)),
        kind=kind,
        source=source,
    )


def _iterate(state, number, rng):
    """The state of a retrieval after some steps: half of what was wrong is left by each."""
    left = 0.5**number
    plumes = {}
    for name, plume in state.atmosphere.plumes.items():
        shape = plume.extinction_550.shape
        wrong, absorbing = rng.uniform(-1, 1, shape), rng.uniform(-0.5, 0.5, shape)
        extinction = plume.extinction_550 * np.exp(left * wrong)
        ssa = {band: 1 - (1 - x) * np.exp(left * absorbing) for band, x in plume.ssa.items()}
        plumes[name] = replace(plume, extinction_550=extinction, ssa=ssa)
    return replace(state, atmosphere=replace(state.atmosphere, plumes=plumes))
