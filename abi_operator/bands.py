"""The bands of the Advanced Baseline Imager that the operator simulates.

A band is named by the string that ABI files use, ``"C01"``. Inputs that differ from band to band
(surface albedo, single-scattering albedo of a plume) are dictionaries with these names as keys, so
that a state holds just the bands it was specified for and a Jacobian says by name which is which.

Optics of several bands differ in numbers alone, and to compile them once takes one program for all:
`jax.vmap` over `several_bands`. What is mapped over is a `SomeBand`, which stands wherever a `Band`
does. Its name, a `OneOf`, cannot be looked up in a dictionary, as nobody knows which it is while
the program is made; `constants` and `entry` look things up by either kind of name.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

T = TypeVar("T")


class Band(NamedTuple):
    """One band: its name in ABI files and the centroid of its response. [um]

    Centroids are those of GOES-16's spectral response [1]_; those of GOES-17 to -19 differ by 1.4
    nm or less, but by 6 nm in C04 and by 14 nm in C07.

    References
    ----------
    .. [1] NOAA GOES-R Calibration Working Group, ABI spectral response functions (PFM), 2016.
    """

    name: str
    wavelength_um: float


# "green" is the band that the imager lacks, monochromatic light of 0.555 um.
BANDS: dict[str, Band] = {
    band.name: band
    for band in (
        Band("C01", 0.4711),
        Band("green", 0.555),
        Band("C02", 0.6396),
        Band("C03", 0.8644),
        Band("C04", 1.3732),
        Band("C05", 1.6095),
        Band("C06", 2.2427),
        Band("C07", 3.8934),
    )
}

GRASSO2013 = ("C01", "C02", "C03", "C06")
"""The reflective bands of Grasso et al. (2013): those simulated where nothing else is asked for."""


class OneOf(eqx.Module):
    """Name of one of several bands.

    Parameters
    ----------
    names
        Those of all of them.
    place
        Which of them it is: a number that only `jax.vmap` knows. None where there is one.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    place: Int[Array, ""] | None = None


class SomeBand(NamedTuple):
    """One of several bands, in place of a `Band`."""

    name: OneOf
    wavelength_um: Float[Array, ""]


AnyBand = Band | SomeBand
AnyName = str | OneOf


class ByBand(eqx.Module):
    """What one of several bands finds in a mapping by band, in place of the mapping.

    Parameters
    ----------
    own
        Entry of the band, whichever it is.
    names
        Those of all of the bands.
    """

    own: Any
    names: tuple[str, ...] = eqx.field(static=True)

    def __contains__(self, name: object) -> bool:
        return name in self.names


def several_bands(names: Sequence[str], dtype: Any) -> SomeBand:
    """Bands to map over with `jax.vmap`, whose numbers are of one floating type."""
    place = jnp.arange(len(names), dtype=jnp.int32)
    wavelength_um = jnp.asarray([BANDS[name].wavelength_um for name in names], dtype)
    return SomeBand(OneOf(tuple(names), place), wavelength_um)


def names_of(name: AnyName) -> tuple[str, ...]:
    """Name of the band, or of all those of which it is one."""
    return (name,) if isinstance(name, str) else name.names


def one_of(name: AnyName) -> OneOf:
    """The same name, as one of the only one if it is a string."""
    return OneOf((name,)) if isinstance(name, str) else name


def first_missing(name: AnyName, table: Collection[str] | ByBand) -> str | None:
    """First band that it may be and that a table lacks, or None."""
    return next((x for x in names_of(name) if x not in table), None)


def constants(of_name: Callable[[str], T], name: AnyName, dtype: Any) -> T:
    """Numbers that are listed by band, of the band with a name.

    Parameters
    ----------
    of_name
        What belongs to a name: a number, an array of NumPy or a tree of them, of the same structure
        for all names.
    name
        Name of the band. Of a string it is just what belongs to it.
    dtype
        Floating type of those of `OneOf` several.
    """
    found = [of_name(x) for x in names_of(name)]
    place = None if isinstance(name, str) else name.place
    if place is None:
        return found[0]

    def one(*numbers: Any) -> Array:
        table = np.stack([np.asarray(x, float) for x in numbers])
        if np.all(table == table[0]):
            return jnp.asarray(table[0], dtype)
        return jnp.asarray(table, dtype).at[place].get(mode="promise_in_bounds")

    return jax.tree.map(one, *found)


def entry(mapping: Mapping[str, T] | ByBand, name: AnyName) -> T:
    """Entry of the band with a name; that it is there is checked by `first_missing`.

    Raises
    ------
    ValueError
        Where the band is one of several whose entries differ in kind, see `by_band`.
    """
    if isinstance(mapping, ByBand):
        return mapping.own
    first, *others = names_of(name)
    if others:
        raise ValueError(f"entries of bands {names_of(name)} must be of one kind to be one batch.")
    return mapping[first]


def by_band(tree: Any, copied: Any, names: Sequence[str]) -> tuple[Any, Any]:
    """Tree in which every mapping by band is what each band finds there, along a leading axis.

    A mapping by band is any dictionary of which all keys are names of bands. One that lacks a band,
    or of which entries differ in kind, is left as it is.

    Parameters
    ----------
    tree
        Arrays, of which some have one copy for each band along a leading axis.
    copied
        Which have: a tree of the same structure with a bool for each array.
    names
        Names of the bands.

    Returns
    -------
    The tree, and which of its arrays have a leading axis of bands now.
    """

    def stacks(x: Any) -> bool:
        if not _is_mapping(x) or not set(names) <= x.keys():
            return False
        return len({jax.tree.structure(x[name]) for name in names}) == 1

    def own(x: Any, is_copied: Any) -> Any:
        if not stacks(x):
            return x
        found = [
            jax.tree.map(lambda leaf, c, k=k: leaf[k] if c else leaf, x[name], is_copied[name])
            for k, name in enumerate(names)
        ]
        return ByBand(jax.tree.map(lambda *leaves: jnp.stack(leaves), *found), tuple(names))

    def flags(x: Any, is_copied: Any) -> Any:
        if not stacks(x):
            return is_copied
        return ByBand(jax.tree.map(lambda _: True, x[names[0]]), tuple(names))

    mapped = [jax.tree.map(f, tree, copied, is_leaf=_is_mapping) for f in (own, flags)]
    return mapped[0], mapped[1]


def _is_mapping(x: Any) -> bool:
    return isinstance(x, dict) and bool(x) and x.keys() <= BANDS.keys()


def check_bands(bands: Sequence[str], known: Collection[str] = BANDS) -> tuple[str, ...]:
    """Return `bands` as a tuple, or raise `ValueError` naming the ones that are not `known`.

    A string is refused, though it is a sequence: of letters.
    """
    if isinstance(bands, str):
        raise ValueError(
            f"bands are a sequence of names, such as ({bands!r},); got the string {bands!r}."
        )
    unknown = [name for name in bands if name not in known]
    if unknown or not bands:
        raise ValueError(f"bands {unknown or '()'} are not simulated; choose from {list(known)}.")
    if len(set(bands)) != len(bands):
        raise ValueError(f"each band can be asked for once; got {tuple(bands)}.")
    return tuple(bands)
