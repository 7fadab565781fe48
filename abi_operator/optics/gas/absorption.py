r"""Absorption by gases in one band, as a sum of exponentials."""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...atmosphere import Atmosphere
from ...bands import AnyBand, constants, first_missing, names_of
from ...optical_properties import OpticalProperties
from .amounts import Amount, amounts_of
from .tables import TABLES, Absorber

ALL_GASES = ("O3", "H2O", "CO2", "CH4", "N2O", "O2", "N2")
"""Gases that absorb in some band; of oxygen and nitrogen air has the same everywhere."""


def gas_absorption(
    atmosphere: Atmosphere, band: AnyBand, gases: Sequence[str] = ALL_GASES
) -> OpticalProperties:
    r"""Absorption by the gases of one column, by the sum of exponentials of the band.

    .. math:: T(m) = \sum_t w_t \exp\Bigl(-m \sum_k \tau_{tk}\Bigr), \qquad
       \tau_{tk} = \sum_g c_{tg}\, u_{gk}

    with additive amounts u of each gas g in the layers k. The sums of several gases in a band are
    fitted as one, in which each gas alone and all together have the transmittance that was
    published (`tables` states the errors). Where the gases asked for are grey, there is one term.
    One of several bands has as many terms as any of them: those beyond its own (`num_terms`) have
    no weight.

    Parameters
    ----------
    atmosphere
        One column; without `Gases` nothing absorbs. Temperature is read for vapour
        in C04, C06 and C07.
    band
        One of `BANDS`.
    gases
        Gases that are to absorb, of `ALL_GASES`.

    Raises
    ------
    ValueError
        Where a band or a gas is not known, or the column lacks a temperature that is needed.
    """
    if missing := first_missing(band.name, TABLES):
        raise ValueError(f"no gas absorption for band {missing!r}; have {list(TABLES)}.")
    unknown = [gas for gas in gases if gas not in ALL_GASES]
    if unknown:
        raise ValueError(f"gases {unknown} are not known; choose from {ALL_GASES}.")
    dtype = atmosphere.pressure.dtype
    names = names_of(band.name)
    kinds = {_kind(a.amount): a.amount for name in names for a in _absorbers(name, gases)}
    if atmosphere.gases is None or not kinds:
        levels, *batch = atmosphere.pressure.shape
        nothing = jnp.zeros((1, levels - 1, *batch), dtype)
        return OpticalProperties(nothing, jnp.ones(1, dtype), ())
    terms = max(num_terms(name, gases) for name in names)

    def listed(name: str) -> tuple[np.ndarray, list[Any], np.ndarray]:
        numbers = [_numbers(_amount(name, gases, x)) for x in kinds.values()]
        coefficients = [_coefficients(name, gases, kind, terms) for kind in kinds]
        return _weight(name, gases, terms), numbers, np.stack(coefficients, axis=1)

    present = np.any([listed(name)[2] != 0 for name in names], axis=0)
    weight, numbers, coefficients = constants(listed, band.name, dtype)
    coefficients = jnp.asarray(coefficients, dtype)
    wanted = [_with(x, n) for x, n in zip(kinds.values(), numbers, strict=True)]
    amounts = amounts_of(atmosphere, wanted)
    # Written out: several times faster than a product with a matrix that is mostly empty.
    extinction = [jnp.zeros_like(amounts[0])] * terms
    for t in range(terms):
        for k in np.flatnonzero(present[t]):
            extinction[t] = extinction[t] + coefficients[t, k] * amounts[k]
    return OpticalProperties(jnp.stack(extinction), jnp.asarray(weight, dtype), ())


def num_terms(name: str, gases: Sequence[str]) -> int:
    """Exponential terms of a band where some gases absorb: 1 where they are grey."""
    absorbers = _absorbers(name, gases)
    if all(len(set(a.coefficients)) == 1 for a in absorbers):
        return 1
    return len(TABLES[name].weight)


def _absorbers(name: str, gases: Sequence[str]) -> list[Absorber]:
    return [a for a in TABLES[name].absorbers if a.gas in gases]


def _weight(name: str, gases: Sequence[str], terms: int) -> np.ndarray:
    """Weight of each term of a band, and 0 of those that it lacks."""
    own = TABLES[name].weight if num_terms(name, gases) > 1 else (1.0,)
    return np.pad(own, (0, terms - len(own)))


def _coefficients(name: str, gases: Sequence[str], kind: Any, terms: int) -> np.ndarray:
    """Of one kind of amount in each term of a band, and 0 in those that it lacks."""
    found = [a.coefficients for a in _absorbers(name, gases) if _kind(a.amount) == kind]
    own = np.sum(found, axis=0)[: num_terms(name, gases)] if found else np.zeros(0)
    return np.pad(own, (0, terms - len(own)))


def _amount(name: str, gases: Sequence[str], like: Amount) -> Amount:
    """The amount of a kind that a band has, or one that stands for it."""
    own = [a.amount for a in _absorbers(name, gases) if _kind(a.amount) == _kind(like)]
    return own[0] if own else like


def _kind(amount: Amount) -> Any:
    """What amounts share that differ in numbers alone."""
    if not isinstance(amount, tuple):
        return amount
    return type(amount), *(x for x in amount if not isinstance(x, float))


def _numbers(amount: Amount) -> dict[str, float]:
    """Numbers of an amount by name; a function has none."""
    fields: dict[str, Any] = getattr(amount, "_asdict", dict)()
    return {name: x for name, x in fields.items() if isinstance(x, float)}


def _with(amount: Any, numbers: dict[str, Any]) -> Amount:
    """An amount with other numbers."""
    return amount._replace(**numbers) if numbers else amount


def transmittance(
    optics: OpticalProperties, air_mass: Float[Array, "*path"]
) -> Float[Array, "*path"]:
    r"""Direct transmittance of a column, :math:`\sum_t w_t \exp(-m \sum_k \tau_{tk})`. [-]

    Parameters
    ----------
    optics
        What attenuates, by absorption and by scattering.
    air_mass
        Length of the path relative to the vertical: :math:`1 / \mu` one way, or
        :math:`1 / \mu_0 + 1 / \mu` to the ground and back. [-]
    """
    depth = jnp.sum(optics.extinction, axis=1)
    return jnp.sum(optics.weight * jnp.exp(-air_mass[..., None] * depth), axis=-1)
