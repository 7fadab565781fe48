"""Settings are written once, and every function that takes them shows and knows them by name."""

import inspect
from typing import NamedTuple, TypedDict, Unpack, get_type_hints

import pytest

import abi_operator
from abi_operator import brf, brightness_temperature, radiance, reflectance_factor, solver
from abi_operator._keywords import with_keywords
from abi_operator.settings import ByName
from abi_operator.solver import surface_coupling, toa_albedo, toa_brf, toa_radiance
from abi_operator.solver.settings import OfFluxes, OfReflectances, OfViews

OPERATOR = abi_operator.Settings, ByName
ALL, VIEWS, FLUXES = ((solver.Settings, x) for x in (OfReflectances, OfViews, OfFluxes))
DOORS = {
    brf: OPERATOR,
    reflectance_factor: OPERATOR,
    radiance: OPERATOR,
    brightness_temperature: OPERATOR,
    toa_brf: ALL,
    toa_radiance: VIEWS,
    surface_coupling: VIEWS,
    toa_albedo: FLUXES,
}


class Settings(NamedTuple):
    size: int = 3
    name: str = "x"


class ByKeyword(TypedDict, total=False):
    size: int


@with_keywords(ByKeyword, Settings())
def double(x: float, *, more: float = 0.0, **given: Unpack[ByKeyword]) -> float:
    """Twice as much."""
    return 2 * x + more + Settings(**given).size


def test_a_function_shows_and_knows_its_keywords():
    assert (
        str(inspect.signature(double)) == "(x: float, *, more: float = 0.0, size: int = 3) -> float"
    )
    assert double.__doc__ == "Twice as much."
    assert double(1.0, more=0.5, size=4) == 6.5
    message = r"double\(\) got an unexpected keyword argument 'name'; it takes size\."
    with pytest.raises(TypeError, match=message):
        double(1.0, name="y")  # pyright: ignore[reportCallIssue]


@pytest.mark.parametrize("door", DOORS)
def test_doors_take_the_fields_of_their_settings(door):
    settings, by_name = DOORS[door]
    parameters = inspect.signature(door).parameters
    defaults = settings()._asdict()
    names = get_type_hints(by_name)
    assert set(names) <= set(defaults)
    for name in names:
        assert parameters[name].kind is inspect.Parameter.KEYWORD_ONLY
        assert parameters[name].default == defaults[name]
    with pytest.raises(
        TypeError, match=rf"{door.__name__}\(\) .* 'num_stream'; it takes .*streams"
    ):
        door(num_stream=4)


@pytest.mark.parametrize(("settings", "by_name"), [OPERATOR, ALL])
def test_every_setting_is_described_and_can_be_given(settings, by_name):
    assert set(settings._fields) == set(get_type_hints(by_name))
    entries = inspect.getdoc(settings).partition("----------\n")[2]
    described = [line for line in entries.splitlines() if line and not line.startswith(" ")]
    assert ", ".join(described).split(", ") == list(settings._fields)


def test_a_flux_has_no_views():
    with pytest.raises(TypeError, match="unexpected keyword argument 'multiple_views'"):
        toa_albedo(1.0, 1.0, 1.0, 0.1, 0.5, multiple_views=True)
