"""How the operator simulates: what each of its functions is told by name."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypedDict

from .optics import ALL_GASES

NUM_STREAMS = 10
"""Streams of the solver where nothing is said: so many are within 0.5 % of 64 in 99 of 100 columns
of all kinds that scenes hold; 8 are within 0.8 % (`benchmarks/truth.py`)."""


def streams_of_attributes(attributes: Mapping[str, Any]) -> int:
    """Streams with which a result was made, by its attributes; those of one that does not say."""
    return int(attributes.get("num_streams", NUM_STREAMS))


class Settings(NamedTuple):
    """How to simulate; `brf` and its neighbours take the fields of this as keyword arguments.

    Parameters
    ----------
    satellite
        Whose solar irradiance and response. Optics are those of GOES-16 for all; GOES-19 is refused
        in the band in which its gas absorption is another (C04).
    gases
        Which of the atmosphere's gases absorb; ``()`` leaves them all out.
    num_streams, num_modes, num_doublings
        Accuracy and cost of the solver; see `solver.Settings`. With `num_doublings` None every
        layer is exact, but for derivatives inside `jax.jit` and loops, where optical depths cannot
        be read: columns with a layer thicker than 1000 that is not opaque are NaN there.
    error_budget
        Relative error of the reflectance that may be made for speed on top of what the streams
        leave, such as 1e-3; see `solver.Settings`. None solves everything.
    plume_edges
        Whether columns are solved on levels that go with the edges of their plumes
        (`with_plume_edges`), so that slopes in base and top of a plume are smooth. Else, with None
        as well, a plume is spread over all of the layers that its edges lie in: such slopes then
        change in steps from layer to layer.
    """

    satellite: str = "GOES-16"
    gases: tuple[str, ...] = ALL_GASES
    num_streams: int = NUM_STREAMS
    num_modes: int | None = None
    num_doublings: int | None = None
    error_budget: float | None = None
    plume_edges: bool | None = None


class ByName(TypedDict, total=False):
    """The same as keyword arguments, gases in any sequence."""

    satellite: str
    gases: Sequence[str]
    num_streams: int
    num_modes: int | None
    num_doublings: int | None
    error_budget: float | None
    plume_edges: bool | None


def settings_of(given: ByName) -> Settings:
    """Settings of keyword arguments, or `ValueError` where gases are not a sequence of names."""
    gases = given.get("gases", ALL_GASES)
    if isinstance(gases, str):
        raise ValueError(
            f"gases are a sequence of names, such as ({gases!r},); got the string {gases!r}."
        )
    return Settings(**{**given, "gases": tuple(gases)})
