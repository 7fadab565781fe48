"""Values that are no weather are refused with their place; what advection leaves is counted."""

import netCDF4
import numpy as np
import pytest

from abi_operator.files import InputError, read_wrf, wrf_coordinates
from abi_operator.files.plausible import PLAUSIBLE, without_traces
from abi_operator.nomenclature import MODEL

LAYERS = ("Time", "bottom_top", "south_north", "west_east")
SURFACE = ("Time", "south_north", "west_east")
# NC_FILL_FLOAT of netcdf.h, as in chunks that no one wrote.
FILL = np.float32(9.9692099683868690e36)

GROUND = {
    "TSK": (SURFACE, np.full((2, 3, 2), 300, np.float32)),
    "EMISS": (SURFACE, np.full((2, 3, 2), 0.95, np.float32)),
    "LANDMASK": (SURFACE, np.ones((2, 3, 2), np.float32)),
    "XLAND": (SURFACE, np.ones((2, 3, 2), np.float32)),
    "RE_CLOUD": (LAYERS, np.full((2, 4, 3, 2), 1e-5, np.float32)),
    "QNICE": (LAYERS, np.full((2, 4, 3, 2), 1e4, np.float32)),
}
PLACE = r"at Time=1, bottom_top=2, south_north=1, west_east=0 \(1 of the 24 values read\)"
GROUND_PLACE = r"at Time=1, south_north=1, west_east=0 \(1 of the 6 values read\)"


@pytest.fixture
def spoiled(write_wrf_twin):
    """A function that writes a WRF twin with one value of one variable changed."""

    def write(name, value):
        path = write_wrf_twin(extra=GROUND)
        with netCDF4.Dataset(path, "a") as file:
            file[name][(1, 2, 1, 0) if file[name].ndim == 4 else (1, 1, 0)] = value
        return path

    return write


def test_every_variable_of_a_model_has_a_range():
    derived = {name for name in MODEL if name.endswith("_bounds")}
    assert set(MODEL) - derived <= set(PLAUSIBLE)


def test_rounding_is_no_fault(spoiled):
    read_wrf(spoiled("EMISS", np.nextafter(np.float32(1), np.float32(2))), 1)
    with pytest.raises(InputError, match="EMISS in .* is 1.001"):
        read_wrf(spoiled("EMISS", 1.001), 1)


@pytest.mark.parametrize(
    ("name", "lowest", "highest"),
    [  # of what has been observed or is usual in models
        ("layer_pressure", 100, 107_000),  # 1 hPa; the shore of the Dead Sea
        ("surface_pressure", 33_000, 107_000),  # Mount Everest
        ("layer_temperature", 162, 340),  # cloud tops; desert air
        ("surface_temperature", 175, 1400),  # Antarctica; lava
        ("height", -430, 80_000),
        ("vapour_mixing_ratio", 0, 0.037),
        ("cloud_mixing_ratio", 0, 0.01),
        ("rain_mixing_ratio", 0, 0.02),
        ("hail_mixing_ratio", 0, 0.03),
        ("cloud_number_mixing_ratio", 0, 2e10),
        ("ice_number_mixing_ratio", 0, 2e10),
        ("snow_effective_radius", 0, 1e-3),
    ],
)
def test_all_weather_is_plausible(name, lowest, highest):
    assert PLAUSIBLE[name].lowest <= lowest < highest <= PLAUSIBLE[name].highest


@pytest.mark.parametrize("name", ["P", "PB", "T", "QVAPOR", "QCLOUD", "RE_CLOUD", "QNICE"])
def test_what_was_never_written_is_called_so(spoiled, name):
    path = spoiled(name, FILL)
    message = (
        rf"^{name} in \S* was never written \(it is NetCDF's own fill .* 9.9692e\+36\) {PLACE}"
    )
    with pytest.raises(InputError, match=message):
        read_wrf(path, 1)
    read_wrf(path, 0)


@pytest.mark.parametrize("name", ["PSFC", "TSK", "EMISS", "LANDMASK", "XLAT", "XLONG"])
def test_so_is_the_ground(spoiled, name):
    with pytest.raises(InputError, match=f"{name} in .* was never written .* {GROUND_PLACE}"):
        read_wrf(spoiled(name, FILL), 1)


@pytest.mark.parametrize(("value", "words"), [(np.nan, "is missing"), (np.inf, "is infinite")])
def test_what_is_not_finite_is_called_so(spoiled, value, words):
    with pytest.raises(
        InputError, match=f"QVAPOR in .* {words} .*{PLACE}; repair it, or leave it out"
    ):
        read_wrf(spoiled("QVAPOR", value), 1)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("QCLOUD", 5, "QCLOUD in .* is 5 kg kg-1 .*; plausible is 0 to 0.03 kg kg-1: check its un"),
        ("QCLOUD", 1e20, "QCLOUD in .* is 1e.20 kg kg-1"),
        ("QCLOUD", -1e-3, "is -0.001 kg kg-1 .* 0 to 0.03 kg kg-1, or -1e-05 as advection leaves"),
        ("QVAPOR", -1e-2, "QVAPOR in .* is -0.01 kg kg-1"),
        ("QNICE", -1e6, "QNICE in .* is -1e.06 kg-1"),
        ("RE_CLOUD", 10, "RE_CLOUD in .* is 10 m"),  # in micrometres
        ("RE_CLOUD", -1e-5, "RE_CLOUD in .* is -1e-05 m .* 0 to 0.001 m: check"),
        ("P", 1e6, r"P \+ PB in .* is 1.05e\+06 Pa .*; plausible is 1 to 110000 Pa"),
        ("P", -1e6, r"P \+ PB in .* is -950000 Pa"),
        ("T", 500, "the temperature by T, P and PB in .* K .*; plausible is 130 to 500 K"),
        ("T", -999, "the temperature by T, P and PB in .* is -"),
    ],
)
def test_what_is_no_weather_is_refused(spoiled, name, value, words):
    path = spoiled(name, value)
    with pytest.raises(InputError, match=words) as raised:
        read_wrf(path, 1)
    assert raised.match(PLACE)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("TSK", 26.85, "TSK in .* is 26.85 K .*; plausible is 150 to 1500 K"),  # in Celsius
        ("EMISS", 95, "EMISS in .* is 95 at .*; plausible is 0 to 1: check"),
        ("PSFC", 1000, "PSFC in .* is 1000 Pa .* 30000 to 110000 Pa"),  # in hPa
        ("XLAT", -999, "XLAT in .* is -999 degrees_north .* -90 to 90"),
        ("XLONG", 1000, "XLONG in .* is 1000 degrees_east"),
        ("LANDMASK", 2, "LANDMASK in .* is 2 at .* 0 to 1"),
    ],
)
def test_so_is_a_ground_that_is_none(spoiled, name, value, words):
    path = spoiled(name, value)
    with pytest.raises(InputError, match=words) as raised:
        read_wrf(path, 1)
    assert raised.match(GROUND_PLACE)
    if name in ("XLAT", "XLONG", "LANDMASK"):
        with pytest.raises(InputError, match=words):
            wrf_coordinates(path, 1)


def test_a_land_mask_that_counts_from_one_has_its_own_range(spoiled, write_wrf_twin):
    path = spoiled("XLAND", 0)
    read_wrf(path, 1)  # LANDMASK is there, and is taken
    path = write_wrf_twin(extra={"XLAND": (SURFACE, np.zeros((2, 3, 2), np.float32))})
    with pytest.raises(InputError, match="XLAND in .* is 0 at .* plausible is 1 to 2"):
        read_wrf(path, 1)


def test_rows_are_counted_in_the_file(spoiled):
    with pytest.raises(InputError, match="south_north=1, west_east=0 .1 of the 8 values"):
        read_wrf(spoiled("QCLOUD", 5), 1, slice(1, 2))


def test_a_file_in_grams_per_kilogram_is_refused(write_wrf_twin):
    path = write_wrf_twin()
    with netCDF4.Dataset(path, "a") as file:
        for name in ("QVAPOR", "QCLOUD"):
            file[name][:] *= 1000
    with pytest.raises(InputError, match="QVAPOR in .* kg kg-1 .* check its units"):
        read_wrf(path, 0)


@pytest.mark.parametrize(
    ("name", "units"),
    [
        ("QVAPOR", "g kg-1"),
        ("QCLOUD", "g/kg"),
        ("P", "hPa"),
        ("PSFC", "mb"),
        ("T", "degC"),
        ("PH", "m"),
        ("TSK", "C"),
        ("QNICE", "cm-3"),
        ("RE_CLOUD", "micron"),
        ("XLAT", "radian"),
        ("EMISS", "%"),
    ],
)
def test_other_units_than_expected_are_refused(write_wrf_twin, name, units):
    path = write_wrf_twin(extra=GROUND)
    with netCDF4.Dataset(path, "a") as file:
        file[name].units = units
    with pytest.raises(InputError, match=rf"^{name} in \S* has the units '{units}' where '"):
        read_wrf(path, 0)


@pytest.mark.parametrize(
    ("name", "spellings"),
    [
        (
            "QVAPOR",
            (
                "kg kg-1",
                "kg/kg",
                "kg kg**-1",
                "kg kg^-1",
                "kg kg^{-1}",
                "kg/kg dry air",
                "1",
                "",
                " ",
            ),
        ),
        ("QNICE", ("  kg-1", "  kg(-1)", "# kg(-1)", "#/kg", "1/kg", "kg-1", "number kg-1")),
        ("PH", ("m2 s-2", "m2/s2", "m**2 s**-2", "m^2 s^-2")),
        ("XLAT", ("degree_north", "degrees_north", "degrees", "deg", "degrees north", "degrees_N")),
        ("P", ("Pa", "pascal")),
        ("T", ("K", "Kelvin")),
        ("EMISS", ("", "-", "1", "fraction", "dimensionless")),
        ("LANDMASK", ("", "flag", "1")),
    ],
)
def test_units_are_known_in_many_spellings(write_wrf_twin, name, spellings):
    for units in spellings:
        path = write_wrf_twin(extra=GROUND)
        with netCDF4.Dataset(path, "a") as file:
            file[name].units = units
        read_wrf(path, 0)


def test_what_advection_leaves_is_zero_counted_and_told(write_wrf_twin):
    values = np.full((2, 4, 3, 2), 1e-3, np.float32)
    values[0, :2, 0, 0] = -1e-12, -5e-6
    path = write_wrf_twin(extra={"QRAIN": (LAYERS, values)})
    rain = read_wrf(path, 0)["rain_mixing_ratio"]
    assert rain.attrs["num_negative_set_to_zero"] == 2
    assert rain.attrs["smallest_negative"] == np.float32(-5e-6)
    np.testing.assert_array_equal(rain, np.maximum(values[0, ::-1], 0))
    assert "smallest_negative" not in read_wrf(path, 1)["rain_mixing_ratio"].attrs


def test_nothing_else_is_changed():
    values = np.array([0.0, 1e-9, 0.01])
    kept, attributes = without_traces(values, PLAUSIBLE["rain_mixing_ratio"])
    assert kept is values and attributes == {"num_negative_set_to_zero": 0}
