"""From one state to the columns that the solver is given: one for each exponential term of a band.

Functions read as of one state; a batch of states has its axes behind those of every array.
"""

import dataclasses
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .atmosphere import State
from .bands import AnyName, SomeBand, by_band, entry, several_bands
from .geometry import is_up
from .lambertian import Lambertian
from .machine.algebra import trailing
from .optics import mixture, num_terms
from .planck import in_band_radiance
from .solver import cos_scattering_angle
from .sun_path import sun_secant
from .surface import surface_emission

HARMLESS_ZENITH = 1.0
"""Where a sun or a satellite at or below the horizon stands while columns are solved; what comes of
it is not used. [rad]"""


class BandColumns(eqx.Module):
    """Solver's columns of one state in bands that have the same kind of ground and of light.

    First come columns of the first exponential term of every band, then those of the second term of
    the bands that have one, and so on.

    Parameters
    ----------
    arguments
        Those of `solver.toa_brf` or, of bands that emit, of `solver.toa_radiance` by name, with an
        axis of columns first and those of the batch last.
    weight
        Weight of each column. [-]
    bands
        Names of the bands.
    places
        Of each column, the place of its band among the names.
    emit
        Whether the bands emit.
    """

    arguments: dict[str, Any]
    weight: Float[Array, " column"]
    bands: tuple[str, ...] = eqx.field(static=True)
    places: tuple[int, ...] = eqx.field(static=True)
    emit: bool = eqx.field(static=True)

    def summed(self, terms: Float[Array, "column *batch"]) -> dict[str, Float[Array, "*batch"]]:
        """What the solver gives of each column, weighted and summed, by band."""
        weighted = jnp.unstack(trailing(self.weight, terms.ndim) * terms)
        found: dict[str, Array] = {}
        for place, x in zip(self.places, weighted, strict=True):
            name = self.bands[place]
            found[name] = found[name] + x if name in found else x
        return found


def columns_of_bands(
    state: State,
    bands: tuple[str, ...],
    gases: tuple[str, ...],
    num_moments: int,
    *,
    per_band: Any = False,
    emitting: Collection[str] = (),
    solar_irradiance: Mapping[str, Array] | None = None,
    satellite: str = "GOES-16",
) -> tuple[BandColumns, ...]:
    """Columns of one state in several bands, by one program for all of them.

    What differs from band to band is a batch. An array of which each band has its own copy has one
    more axis, leading, with the copies in the order of `bands`: slopes by the copies are those of
    each band. What is not copied is shared, and what follows from shared arrays and from no number
    of a band is computed once for all bands.

    Parameters
    ----------
    state
        What the column holds; the sun and the satellite may be anywhere, see `above_horizon`.
    bands, gases
        Which bands, and which gases absorb.
    num_moments
        Legendre moments that the solver reads.
    per_band
        Which arrays of the pair of `state` and `solar_irradiance` are copied: a bool for all, or a
        tree of bools of which every one is for all arrays of a branch.
    emitting
        Those of the bands that emit.
    solar_irradiance
        Of the bands that emit. [W m-2 um-1]
    satellite
        In whose responses they emit.

    Returns
    -------
    One for each kind of ground and of light.
    """
    inputs = state, dict(solar_irradiance or {})
    copied = jax.tree.map(lambda flag, x: jax.tree.map(lambda _: flag, x), per_band, inputs)
    inputs, copied = ((with_plain_grounds(x), rest) for x, rest in (inputs, copied))
    state = inputs[0]
    groups: dict[Any, list[int]] = {}
    for k, name in enumerate(bands):
        kind = name in emitting, jax.tree.structure(ground_of(state, name))
        groups.setdefault(kind, []).append(k)
    absorbing = gases if state.atmosphere.gases is not None else ()
    counts = [num_terms(name, absorbing) for name in bands]

    def layers(inputs: Any, band: SomeBand) -> Any:
        return _layers(inputs[0], band, gases, num_moments)

    def ground(inputs: Any, band: SomeBand) -> Any:
        return ground_of(inputs[0], band.name)

    def emission(inputs: Any, band: SomeBand) -> Any:
        return _emission(inputs[0], inputs[1], band, satellite)

    inputs, copied = by_band(inputs, copied, bands)
    by_term, by_layer = _mapped(layers, inputs, copied, bands)
    by_term = {name: jnp.swapaxes(x, 0, 1) for name, x in by_term.items()}
    found = []
    for (emits, _), rows in groups.items():
        names = tuple(bands[k] for k in rows)
        every = tuple(rows)
        part = jax.tree.map(lambda x, c, every=every: _rows(x, every) if c else x, inputs, copied)
        own = by_band(part, copied, names)
        of_group = {"albedo": _mapped(ground, *own, names)}
        if emits:
            of_group |= _mapped(emission, *own, names)
        each = [counts[k] for k in rows]
        places = [(t, k) for t in range(max(each)) for k, n in enumerate(each) if n > t]
        shared = tuple(rows[k] for _, k in places)
        of_terms = tuple(t * len(bands) + rows[k] for t, k in places)
        own_rows = tuple(k for _, k in places)
        arguments = {x: _rows(y, shared) for x, y in by_layer.items()}
        arguments |= {
            name: _rows(x.reshape(-1, *x.shape[2:]), of_terms) for name, x in by_term.items()
        }
        weight = arguments.pop("weight")
        arguments |= jax.tree.map(lambda x, rows=own_rows: _rows(x, rows), of_group)
        found.append(BandColumns(arguments, weight, names, own_rows, emits))
    return tuple(found)


def _mapped(
    function: Callable[[Any, SomeBand], Any], inputs: Any, copied: Any, bands: tuple[str, ...]
) -> Any:
    """`function` of what each band has of the inputs, and of the band: of all bands at once."""
    leaves, structure = jax.tree.flatten(inputs)
    axes = [0 if x else None for x in jax.tree.leaves(copied)]

    def of_leaves(leaves: list[Array], band: SomeBand) -> Any:
        return function(jax.tree.unflatten(structure, leaves), band)

    return jax.vmap(of_leaves, in_axes=(axes, 0))(leaves, several_bands(bands, leaves[0].dtype))


def _rows(x: Float[Array, "row *own"], chosen: Sequence[int]) -> Float[Array, "chosen *own"]:
    """Rows of an array, in any order and number."""
    function = _sliced if len(set(chosen)) == len(chosen) else _repeated
    return function(x, tuple(chosen))


def _sliced(x: Array, chosen: tuple[int, ...]) -> Array:
    starts = [k for k in range(len(chosen)) if k == 0 or chosen[k] != chosen[k - 1] + 1]
    ends = [*starts[1:], len(chosen)]
    runs = [x[chosen[i] : chosen[j - 1] + 1] for i, j in zip(starts, ends, strict=True)]
    return jnp.concatenate(runs)


_repeated = jax.custom_jvp(_sliced, nondiff_argnums=(1,))


@_repeated.defjvp
def _(chosen: tuple[int, ...], primals: Any, tangents: Any) -> tuple[Array, Array]:
    # Backwards this is one sum for each row; slices would be filled up with zeros, one by one.
    rows = jnp.unstack(tangents[0])
    return _sliced(primals[0], chosen), jnp.stack([rows[k] for k in chosen])


def _layers(state: State, band: SomeBand, gases: tuple[str, ...], num_moments: int) -> Any:
    """Extinction, single-scattering albedo and weight of all terms (and the sun's secants, where
    they are not 1 / mu0), and what terms share.
    """
    geometry = state.geometry
    mu0 = jnp.cos(above_horizon(geometry.solar_zenith))
    mu = jnp.cos(above_horizon(geometry.view_zenith))
    angles = mu0, mu, geometry.relative_azimuth
    angle = cos_scattering_angle(*angles)
    optics = mixture(state.atmosphere, band, gases, num_moments, angle)
    by_term = {"tau": optics.tau, "ssa": optics.ssa, "weight": optics.weight}
    if geometry.spherical:
        height = state.atmosphere.height
        by_term["secant"] = sun_secant(height, above_horizon(geometry.solar_zenith), optics.tau)
    shared = {
        "moments": optics.moments,
        "phase_function": optics.phase_function,
        "mu0": mu0,
        "mu": mu,
        "relative_azimuth": geometry.relative_azimuth,
    }
    return by_term, shared


def ground_of(state: State, band: AnyName) -> Any:
    """Albedo of a Lambertian ground, given as one or as a surface, or any other surface."""
    return _plain(entry(state.albedo, band))


def with_plain_grounds(state: State) -> State:
    """The same state, where a Lambertian surface is its albedo: one kind of ground, not two."""
    grounds = {name: _plain(ground) for name, ground in state.albedo.items()}
    return dataclasses.replace(state, albedo=grounds)


def _plain(ground: Any) -> Any:
    return ground.albedo if isinstance(ground, Lambertian) else ground


def above_horizon(zenith: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Zenith angle, or a harmless constant where it is at or below the horizon. [rad]"""
    return jnp.where(is_up(zenith), zenith, zenith.dtype.type(HARMLESS_ZENITH))


def _emission(state: State, irradiance: Any, band: SomeBand, satellite: str) -> dict[str, Array]:
    """Sunlight, Planck function of the levels, and what leaves the ground."""
    at_levels, at_ground = state.atmosphere.temperature, state.surface_temperature
    assert at_levels is not None and at_ground is not None  # refused at the door
    fire = {}
    if state.fire is not None:
        hot = in_band_radiance(state.fire.temperature, band.name, satellite)
        fire = {"fire": hot, "fraction": state.fire.fraction}
    ground = ground_of(state, band.name)
    albedo = ground if isinstance(ground, jax.Array) else ground.white_sky_albedo()
    background = in_band_radiance(at_ground, band.name, satellite)
    return {
        "solar_irradiance": entry(irradiance, band.name),
        "planck_levels": in_band_radiance(at_levels, band.name, satellite),
        "surface_emission": surface_emission(albedo, background, **fire),
    }
