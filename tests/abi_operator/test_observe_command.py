"""What the command that observes a result says of itself."""

from typing import get_type_hints

from abi_operator.instrument import NOISE
from abi_operator.observe_command import observe
from abi_operator.radiance import THERMAL


def test_an_error_of_the_calibration_is_of_the_bands_that_have_one():
    (option,) = get_type_hints(observe, include_extras=True)["calibration"].__metadata__
    bands = sorted(NOISE.calibration)
    assert f"one for each of {bands[0]} to {bands[-1]}; of {THERMAL[0]} none" in option.help
    assert not set(THERMAL) & set(bands)
