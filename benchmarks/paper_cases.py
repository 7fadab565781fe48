"""Directions and levels of the paper's cases, for `paper_figures.py` and `paper_fires.py`."""

import jax
import jax.numpy as jnp
import numpy as np

from abi_operator import Geometry
from abi_operator.scene.angles import find_angles

# Levels on the edges of the plumes. [m]
HEIGHT = 1e3 * np.array(
    [60, 40, 30, 25, 20, 16, 14, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2.5, 2, 1.5, 1, 0.5, 0]
)
# The paper's cases: time, latitude and longitude. [degree]
CASES = {
    "case 1": (np.datetime64("2007-10-23T18:00"), 33.0, -117.0),
    "case 2": (np.datetime64("2005-06-27T18:00"), 43.0, -105.0),
}
SATELLITES = {"75 W": -75.0, "137 W": -137.0}
SUN_DISTANCE = 0.9949  # in case 1 [AU]
CASE1_GASES = {"precipitable_water": 10.0, "ozone_column": 280.0}  # [kg m-2], [DU]


def table(head, rows):
    print(f"| {' | '.join(head)} |\n|{' --- |' * len(head)}")
    for row in rows:
        print(f"| {' | '.join(map(str, row))} |")
    print(flush=True)


def directions(case, satellite):
    """Geometry of a case seen from a satellite."""
    time, latitude, longitude = CASES[case]
    angles = find_angles(time, np.array([latitude]), np.array([longitude]), SATELLITES[satellite])
    return Geometry(*(jnp.asarray(np.radians(x[0])) for x in angles))


def columns(states):
    """Many states as one batch."""
    return jax.tree.map(lambda *x: jnp.stack([jnp.asarray(y, float) for y in x]), *states)


def angles_of(geometry):
    sun, view, azimuth = (np.degrees(np.asarray(x)) for x in jax.tree.leaves(geometry))
    return f"zenith angles {sun:.1f} and {view:.1f}, azimuth {azimuth:.1f} degrees"
