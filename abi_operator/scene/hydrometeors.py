"""Mass and number of every class of condensate in the layers of a model.

The number of particles is found layer by layer, from the first of these that is there: the model's
own effective radius, the model's own number, an assumption. What is assumed is what the
microphysics scheme of the model implies (`abi_operator.microphysics`); of droplets it can be
chosen, and is a general number where the scheme has none (`assumed_droplets`).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..files import InputError
from ..microphysics import SCHEMES, Predicted, number_path
from ..nomenclature import HYDROMETEORS
from ..optics import from_effective_radius
from .column_air import dry_air_path
from .condensate import Condensate, check_classes, classes_present, mixing_ratios, scheme_of, weigh
from .droplet_number import AssumedDroplets, DropletNumber, assumed_droplets


class Paths(NamedTuple):
    """Particles of one class in the layers (layer, y, x).

    Parameters
    ----------
    mass, number
        Mass and number per horizontal area. [kg m-2], [m-2]
    num_assumed
        Layers in which the number is assumed and not the model's. [-]
    """

    mass: np.ndarray
    number: np.ndarray
    num_assumed: int


class Hydrometeors(NamedTuple):
    """Condensate of a model as it is simulated.

    Parameters
    ----------
    paths
        By class, ``"cloud"`` among them.
    condensate
        What of the model's is simulated.
    scheme
        Microphysics scheme that numbers are assumed after.
    droplets
        Numbers of droplets that are assumed where the model has none.
    """

    paths: dict[str, Paths]
    condensate: Condensate
    scheme: str
    droplets: AssumedDroplets


def hydrometeor_paths(
    model: xr.Dataset,
    droplet_number: DropletNumber | None = None,
    *,
    classes: tuple[str, ...] | None = None,
    microphysics: str | None = None,
) -> Hydrometeors:
    """Mass and number of condensate in the layers of a model.

    Mass that a model which predicts numbers has left without one, as advection does to traces, is
    not simulated; `Hydrometeors.condensate` tells how much.

    Parameters
    ----------
    model
        A model Dataset.
    droplet_number
        Number of droplets where the model has none; None for that of the scheme, or general ones.
    classes
        Classes to simulate beside cloud water; None for those that have any mass.
    microphysics
        Scheme in `microphysics.SCHEMES` by which the model is understood; None for its own.

    Raises
    ------
    InputError
        Where a number has to be assumed and the scheme is unknown, or predicts that number.
    """
    check_microphysics(microphysics)
    if classes is None:
        classes = classes_present(model, microphysics)
    scheme = scheme_of(model, microphysics)
    droplets = assumed_droplets(droplet_number, scheme)
    air = dry_air_path(model)
    masses = {n: air * ratio for n, ratio in mixing_ratios(model, microphysics).items()}
    thickness = -np.diff(model["height"].values, axis=0)
    paths = {}
    for name in ("cloud", *check_classes(classes)):
        mass = masses.get(name, np.zeros_like(air))
        number = _number_of_model(model, name, mass, air)
        without = (mass > 0) & ~(number > 0)
        if name == "cloud":
            number = np.where(without, droplets.number.over(model) * thickness, number)
        elif without.any() and (_closes(scheme, name) or not _has_number(model, name)):
            number = np.where(without, _assumed(model, name, mass, thickness, scheme), number)
        paths[name] = Paths(
            np.where(number > 0, mass, 0), number, int((without & (number > 0)).sum())
        )
    simulated = {name: path.mass for name, path in paths.items()}
    return Hydrometeors(paths, weigh(masses, simulated), scheme, droplets)


def check_microphysics(microphysics: str | None) -> None:
    """Raise `InputError` for a scheme of which nothing is known."""
    if microphysics is not None and microphysics not in SCHEMES:
        raise InputError(
            f"nothing is known of microphysics {microphysics!r}; choose from {', '.join(SCHEMES)}."
        )


def _number_of_model(model: xr.Dataset, name: str, mass: np.ndarray, air: np.ndarray) -> np.ndarray:
    """Number of particles (layer, y, x), 0 where the model has neither number nor radius. [m-2]"""
    number = np.zeros_like(mass)
    if f"{name}_number_mixing_ratio" in model:
        number = air * model[f"{name}_number_mixing_ratio"].values
    if f"{name}_effective_radius" in model:
        radius = model[f"{name}_effective_radius"].values
        with jax.enable_x64(True):
            particles = from_effective_radius(jnp.asarray(mass), jnp.asarray(radius), name)
            by_radius = np.asarray(particles.number_path)
        number = np.where((radius > 0) & (mass > 0), by_radius, number)
    return number


def _has_number(model: xr.Dataset, name: str) -> bool:
    return any(f"{name}_{x}" in model for x in ("number_mixing_ratio", "effective_radius"))


def _closes(scheme: str, name: str) -> bool:
    """Whether a scheme implies the number of a class."""
    classes = SCHEMES.get(scheme, {})
    return name in classes and not isinstance(classes[name].closure, Predicted)


def _assumed(
    model: xr.Dataset, name: str, mass: np.ndarray, thickness: np.ndarray, scheme: str
) -> np.ndarray:
    """Number of particles by the assumptions of a scheme (layer, y, x). [m-2]"""
    if not _closes(scheme, name):
        if name in SCHEMES.get(scheme, {}):
            why = f"which its microphysics {scheme!r} predicts"
        elif scheme in SCHEMES:
            why = f"of which its microphysics {scheme!r} has none"
        else:
            why = f"and nothing is known of its microphysics {scheme!r}"
        raise InputError(
            f"the model's output has no number of particles of {HYDROMETEORS[name]}, {why}; name "
            f"a microphysics to assume ({', '.join(SCHEMES)}), or leave {name!r} out of the "
            "hydrometeors."
        )
    temperature = model["layer_temperature"].values
    with jax.enable_x64(True):
        arrays = map(jnp.asarray, (mass, thickness, temperature))
        return np.asarray(number_path(scheme, name, *arrays))
