"""What becomes of the derived green where the near infrared of a plume changes."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from ..products import GREEN_RECIPES, derived_green
from .green_table import green_table
from .plume_band import PlumeBand
from .ssa_root import FALLS_SHORT, NOT_CONVERGED, REACHED, SsaRoot

TABLE = "table"
"""Name, among the recipes, of the green that is looked up in the scene's own pixels."""

_CODES = {REACHED: "reached", FALLS_SHORT: "falls_short", NOT_CONVERGED: "not_converged"}


class NearInfrared(NamedTuple):
    """C03 of a scene as it is and as it becomes.

    Parameters
    ----------
    inside
        Where the plume is (y, x).
    base
        Bidirectional reflectance factor as it is (y, x). [-]
    changed, first_order
        As it becomes, and what it would be by its slope (change, y, x). [-]
    ssa, ssa_changed
        Single-scattering albedo of the plume as it is (y, x) and becomes (change, y, x), NaN
        outside. [-]
    code
        Of `ssa_root` (change, y, x), 0 outside.
    """

    inside: np.ndarray
    base: np.ndarray
    changed: np.ndarray
    first_order: np.ndarray
    ssa: np.ndarray
    ssa_changed: np.ndarray
    code: np.ndarray

    @classmethod
    def of(
        cls, plume: PlumeBand, stored: np.ndarray, inside: np.ndarray, roots: Sequence[SsaRoot]
    ) -> Self:
        """Put the columns of a plume back on the map.

        In the plume what it is is computed anew, too, so that an error that the simulation was
        allowed is in no difference; elsewhere all is what is stored, which gives differences of 0.

        Parameters
        ----------
        plume
            Columns inside the plume.
        stored
            What the result has (y, x). [-]
        inside
            Where the columns are (y, x).
        roots
            Of each change.
        """

        def on_map(values: np.ndarray, elsewhere: Any) -> np.ndarray:
            field = np.array(np.broadcast_to(elsewhere, inside.shape), values.dtype)
            field[inside] = values
            return field

        ssa = np.asarray(plume.ssa)
        base, slope = np.asarray(plume.brf(ssa)), plume.slope()
        return cls(
            inside,
            on_map(base, stored),
            np.stack([on_map(root.brf, stored) for root in roots]),
            np.stack([on_map(base + slope * (root.ssa - ssa), stored) for root in roots]),
            on_map(ssa, np.nan),
            np.stack([on_map(root.ssa, np.nan) for root in roots]),
            np.stack([on_map(root.code, 0) for root in roots]),
        )

    def fields(self) -> dict[str, Any]:
        """Variables of a Dataset."""
        along = ("change", "y", "x")
        brf = "bidirectional reflectance factor in C03"
        ssa = "single-scattering albedo of the plume in C03"
        codes = {
            "long_name": "whether the single-scattering albedo makes the near infrared as asked",
            "flag_values": np.array(list(_CODES), np.int8),
            "flag_meanings": " ".join(_CODES.values()),
        }
        slope = f"{brf}, changed as its slope says"
        return {
            "near_infrared": (("y", "x"), self.base, _attributes(brf)),
            "near_infrared_changed": (along, self.changed, _attributes(f"{brf}, changed")),
            "near_infrared_first_order": (along, self.first_order, _attributes(slope)),
            "ssa": (("y", "x"), self.ssa, _attributes(ssa)),
            "ssa_changed": (along, self.ssa_changed, _attributes(f"{ssa}, changed")),
            "ssa_code": (along, self.code, codes),
        }


def green_fields(
    brf: dict[str, np.ndarray], near: NearInfrared
) -> tuple[list[str], dict[str, Any]]:
    """Names of the recipes, and variables of green by each and of its changes.

    Parameters
    ----------
    brf
        Bidirectional reflectance factor (y, x) in C01, C02 and C03; where there is ``green`` as
        well a table is made of it and looked up beside the recipes. [-]
    near
        C03 as it is and becomes.
    """
    red, blue = brf["C02"], brf["C01"]
    recipes: dict[str, Any] = {
        name: lambda n, name=name: derived_green(red, blue, n, recipe=name)
        for name in GREEN_RECIPES
    }
    if "green" in brf:
        table = green_table(red, blue, brf["C03"], brf["green"])
        usable = np.isfinite([red, blue, brf["C03"]]).all(axis=0)

        def look_up(near_infrared: np.ndarray) -> np.ndarray:
            found = np.full(usable.shape, np.nan)
            found[usable] = table(red[usable], blue[usable], near_infrared[usable])
            return found

        recipes[TABLE] = look_up
    green = np.stack([recipe(near.base) for recipe in recipes.values()])
    changed, first = (
        np.stack([[recipe(x) for x in three] for recipe in recipes.values()])
        for three in (near.changed, near.first_order)
    )
    along = ("recipe", "change", "y", "x")
    g = green[:, None]
    fields = {
        "green": (("recipe", "y", "x"), green, "reflectance derived for 0.555 um"),
        "green_changed": (along, changed, "the same with the near infrared changed"),
        "green_first_order": (along, first, "the same with the near infrared changed by slope"),
        "green_change": (along, (changed - g) / changed, "change of green over changed green"),
        "green_change_first_order": (along, (first - g) / first, "the same by slope"),
        "green_change_of_base": (along, (changed - g) / g, "change of green over green as it is"),
    }
    return list(recipes), {
        name: (dims, values, _attributes(words)) for name, (dims, values, words) in fields.items()
    }


def _attributes(long_name: str) -> dict[str, str]:
    return {"units": "1", "long_name": long_name}
