"""Scenes that a satellite does not see."""

import numpy as np
import pytest
import xarray as xr

from abi_operator.files import InputError
from abi_operator.scene import check_sight
from abi_operator.scene.angles import find_angles, view_zenith


def scene(latitude, longitude):
    fields = {"latitude": latitude, "longitude": longitude}
    return xr.Dataset({name: ("x", np.array(values)) for name, values in fields.items()})


@pytest.mark.parametrize(
    ("place", "satellite", "advice"),
    [
        # Tibet is behind the Earth for all of them, and Hawaii's west for two.
        (scene([28.0, 36.0], [84.0, 92.0]), "GOES-16", "; give --satellite-longitude 88, from"),
        (
            scene([19.0, 28.0], [-178.0, -168.0]),
            "GOES-19",
            "; give --satellite GOES-17 or GOES-18, or --satellite-longitude -173, from",
        ),
        (scene([-18.0, -17.0], [178.0, -178.0]), "GOES-16", "or --satellite-longitude 180, from"),
        (scene([85.0, 88.0], [-75.0, -70.0]), "GOES-16", "sees latitudes beyond 81.3 degrees."),
    ],
)
def test_a_scene_that_is_out_of_sight_is_told_who_sees_it(place, satellite, advice):
    with pytest.raises(InputError, match="the whole scene .* is out of sight of GOES") as error:
        check_sight(place, satellite)
    assert advice in str(error.value)


def test_what_is_advised_helps():
    check_sight(scene([28.0, 36.0], [84.0, 92.0]), "GOES-16", 88.0)
    check_sight(scene([19.0, 28.0], [-178.0, -168.0]), "GOES-18")


def test_a_scene_that_is_seen_in_part_is_simulated():
    check_sight(scene([0.0, 0.0], [-150.0, 100.0]), "GOES-16")


def test_the_view_does_not_depend_on_the_time():
    latitude, longitude = np.array([10.0, 50.0]), np.array([-60.0, -120.0])
    time = np.datetime64("2019-06-01T03:00")
    there = find_angles(time, latitude, longitude, -75.2).view_zenith
    np.testing.assert_allclose(view_zenith(latitude, longitude, -75.2), there, atol=1e-9)


def test_latitudes_beyond_the_last_are_never_seen():
    assert view_zenith(np.array([81.35]), np.array([-75.2]), -75.2) > 90
    assert view_zenith(np.array([81.2]), np.array([-75.2]), -75.2) < 90
