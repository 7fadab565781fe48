"""The table of schemes: every class is whole, and mass laws are those of the sources."""

import math

import numpy as np
import pytest

from abi_operator.microphysics import SCHEMES, size_distribution
from abi_operator.microphysics.gamma import mean_mass

EVERY = [(scheme, name) for scheme, classes in SCHEMES.items() for name in classes]


@pytest.mark.parametrize(("scheme", "name"), EVERY)
def test_limits_and_laws_are_physical(scheme, name):
    distribution = size_distribution(scheme, name)
    assert 0 < distribution.smallest_mass < distribution.largest_mass < 0.01
    assert 1.5 < distribution.law.power <= 3
    assert distribution.nu >= 0
    if distribution.law.power == 3:
        assert 50 < distribution.law.coefficient * 6 / math.pi <= 1001


def test_classes_are_those_of_the_schemes():
    classes = {scheme: set(table) for scheme, table in SCHEMES.items()}
    assert classes["kessler"] == {"cloud", "rain"}
    assert classes["wsm3"] == classes["wsm5"] == {"cloud", "rain", "ice", "snow"}
    assert classes["wsm6"] == classes["wsm5"] | {"graupel"} == classes["thompson"]
    assert classes["morrison"] == classes["wsm6"] | {"hail"}
    frozen = {"pristine", "snow", "aggregates", "graupel", "hail"}
    assert classes["rams"] == {"cloud", "drizzle", "rain"} | frozen


def test_mass_laws_by_hand():
    # A crystal of WSM with D = 11.9 m^(1/2) and 1e-10 kg is 119 um long.
    law = size_distribution("wsm6", "ice").law
    np.testing.assert_allclose(law.coefficient * 119e-6**law.power, 1e-10, rtol=1e-12)
    # Snow of Thompson, 0.069 D^2: 1 mm weighs 6.9e-8 kg.
    law = size_distribution("thompson", "snow").law
    np.testing.assert_allclose(law.coefficient * 1e-3**law.power, 6.9e-8, rtol=1e-12)
    # RAMS: an aggregate of 1 mm weighs 0.496 (1e-3)^2.4 = 3.129e-8 kg.
    law = size_distribution("rams", "aggregates").law
    np.testing.assert_allclose(law.coefficient * 1e-3**law.power, 3.129e-8, rtol=1e-3)


def test_limits_by_hand():
    """Rain of WSM has Lam of 8e4 m-1 at most: a mean mass of pi 1000 / Lam^3 = 6.136e-12 kg."""
    rain = size_distribution("wsm6", "rain")
    np.testing.assert_allclose(rain.smallest_mass, 6.136e-12, rtol=1e-4)
    np.testing.assert_allclose(mean_mass(1 / 8e4, rain.law, 0.0), rain.smallest_mass, rtol=1e-12)
    # Pristine ice of RAMS of 125 um weighs 110.8 (125e-6)^2.91 = 4.859e-10 kg.
    pristine = size_distribution("rams", "pristine")
    np.testing.assert_allclose(pristine.largest_mass, 110.8 * 125e-6**2.91, rtol=1e-12)
