"""Directions of sun and satellite against values of two other programs."""

import numpy as np
import pytest
from pyorbital.orbital import get_observer_look

from abi_operator.constants import SATELLITE_HEIGHT
from abi_operator.nomenclature import QUALITY_FLAGS
from abi_operator.scene.angles import Angles, _look, angle_flags, find_angles

# The last printed digit of the values below.
PRINTED = 0.051


def angles(time, latitude, longitude, satellite_longitude=-75.0):
    """Angles at one place."""
    place = np.array([[latitude]]), np.array([[longitude]])
    return find_angles(np.datetime64(time, "ns"), *place, satellite_longitude)


@pytest.mark.parametrize(
    ("time", "latitude", "longitude", "zenith"),
    [
        ("2007-10-23T15:00", 33.0, -117.0, 78.5),
        ("2007-10-23T18:00", 33.0, -117.0, 49.6),
        ("2007-10-23T18:25", 33.0, -117.0, 47.3),
        ("2005-06-27T18:00", 43.0, -105.0, 23.6),
        ("2005-06-27T21:00", 43.0, -105.0, 31.1),
        ("2005-06-28T00:00", 43.0, -105.0, 63.1),
    ],
)
def test_solar_zenith_angle(time, latitude, longitude, zenith):
    """Values on which pyorbital and pvlib agree."""
    np.testing.assert_allclose(angles(time, latitude, longitude).solar_zenith, zenith, atol=PRINTED)


@pytest.mark.parametrize(
    ("satellite_longitude", "zenith"), [(-75.0, 58.9), (-89.5, 48.4), (-137.0, 44.0)]
)
def test_view_zenith_angle(satellite_longitude, zenith):
    """Values by spherical trigonometry."""
    view = angles("2007-10-23T18:00", 33.0, -117.0, satellite_longitude).view_zenith
    np.testing.assert_allclose(view, zenith, atol=PRINTED)


def test_the_satellite_stands_where_pyorbital_sees_it():
    rng, time = np.random.default_rng(3), np.datetime64("2007-10-23T18:00", "ns")
    latitude, longitude = rng.uniform(-60, 60, 500), rng.uniform(-130, -20, 500)
    azimuth, elevation = get_observer_look(
        -75.2, 0.0, SATELLITE_HEIGHT / 1e3, time, longitude, latitude, np.zeros(500)
    )
    zenith, own = _look(time, latitude, longitude, -75.2)
    # A direction from its sine, to 1e-16 over the cosine of 88 degrees.
    np.testing.assert_allclose(zenith, 90 - elevation, rtol=0, atol=1e-9)
    np.testing.assert_allclose((own - azimuth + 180) % 360, 180, rtol=0, atol=1e-9)


def test_relative_azimuth_is_folded_and_zero_on_the_same_side():
    """At noon the sun is in the south, as is the satellite over the same meridian."""
    noon = angles("2007-10-23T12:00", 40.0, -3.9, -3.9)
    assert noon.relative_azimuth < 1.0
    opposite = angles(
        "2007-06-21T12:00", 10.0, 0.4, 0.4
    )  # sun in the north, satellite in the south
    assert 179.0 < opposite.relative_azimuth <= 180.0
    morning = angles("2007-10-23T16:00", 33.0, -117.0, -137.0).relative_azimuth
    assert 0 < morning < 180


def test_longitude_may_be_counted_either_way():
    west, east = (angles("2007-10-23T18:00", 33.0, lon) for lon in (-117.0, 243.0))
    np.testing.assert_allclose(west, east, atol=1e-6)


def test_flags_by_angle():
    zenith = np.array([[10.0, 80.0, 80.1, 89.9, 90.0, 120.0]])
    other = np.full_like(zenith, 10.0)
    grazing, night = QUALITY_FLAGS["grazing_sun"], QUALITY_FLAGS["night"]
    flags = angle_flags(Angles(zenith, other, other))
    assert flags.dtype == np.uint8
    assert flags.tolist() == [[0, 0, grazing, grazing, night, night]]
    grazing, unseen = QUALITY_FLAGS["grazing_view"], QUALITY_FLAGS["out_of_sight"]
    flags = angle_flags(Angles(other, zenith, other))
    assert flags.tolist() == [[0, 0, grazing, grazing, unseen, unseen]]
