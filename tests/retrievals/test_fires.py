"""Fires found and retrieved in the image of a scene, by day and by night."""

import jax.numpy as jnp
import numpy as np
import pytest
import typer
import xarray as xr
from typer.testing import CliRunner

from abi_operator import Fire, radiance
from abi_operator.files import InputError, ResultWriter
from abi_operator.instrument import IMAGER
from abi_operator.nomenclature import QUALITY_FLAGS, SCENARIO
from abi_operator.scene import column_states, simulate
from abi_operator.scene.angles import sun_distance
from retrievals import ResultCode, retrieve_fires
from retrievals.commands import retrieve
from retrievals.declarations import fire
from retrievals.fire_detection import DETECTED, surroundings
from retrievals.fires import SCORE, with_fire
from retrievals.images import retrieved_fields
from retrievals.intervals import LEVELS

BANDS = ("C05", "C06", "C07")
HEIGHT = np.array([60e3, 11e3, 8e3, 0.0])
SHAPE = (8, 9)
TIMES = np.array(["2019-01-03T18:00"], "datetime64[ns]")  # at perihelion: the sun is 3 % stronger
# Where it burns, how hot and how much of it [K], [-]; the last by night, another one saturated.
FIRES = {
    (1, 1): (520.0, 2e-2),
    (1, 6): (800.0, 1e-3),
    (3, 4): (700.0, 3e-3),
    (4, 1): (1100.0, 3e-2),
    (6, 6): (650.0, 4e-3),
}
SATURATED, NIGHT = (4, 1), 5  # a pixel, and the row from which on the sun is down


def scenario():
    """Bare ground whose albedo and warmth vary from pixel to pixel."""
    rng = np.random.default_rng(4)

    def columns(profile):
        return np.broadcast_to(np.asarray(profile)[:, None, None], (len(profile), *SHAPE)).copy()

    sun = np.full(SHAPE, 40.0)
    sun[NIGHT:] = 110.0
    fields = {
        "latitude": np.full(SHAPE, 33.0),
        "longitude": np.full(SHAPE, -117.0),
        "pressure": columns(101325 * np.exp(-HEIGHT / 8000)),
        "height": columns(HEIGHT),
        "liquid_mass_path": np.zeros((3, *SHAPE)),
        "liquid_number_path": np.zeros((3, *SHAPE)),
        "surface_albedo": 0.1 + 0.01 * rng.standard_normal((3, *SHAPE)),
        "solar_zenith_angle": sun,
        "view_zenith_angle": np.full(SHAPE, 45.0),
        "relative_azimuth_angle": np.full(SHAPE, 70.0),
        "quality_flag": np.where(sun > 90, QUALITY_FLAGS["night"], 0).astype(np.uint8),
    }
    variables = {name: (SCENARIO[name].dims, values) for name, values in fields.items()}
    variables["temperature"] = (("level", "y", "x"), columns([220.0, 225.0, 240.0, 295.0]))
    warmth = 300.0 + 0.5 * rng.standard_normal(SHAPE)
    variables["surface_temperature"] = (("y", "x"), warmth)
    dataset = xr.Dataset(variables, {"band": list(BANDS), "time": TIMES[0]})
    return dataset.set_coords(["latitude", "longitude"])


@pytest.fixture(scope="module")
def burning():
    """It with the operator's radiance, in which fires burn of which it says nothing."""
    made = scenario()
    # C07 alone, in which ground and air shine.
    result = simulate(made, bands=("C07",), num_streams=2, error_budget=None)
    states = with_fire(column_states(made, BANDS), 0.0)
    fraction, temperature = np.zeros(SHAPE), np.full(SHAPE, 700.0)
    for place, (kelvin, share) in FIRES.items():
        temperature[place], fraction[place] = kelvin, share
    fire = Fire(jnp.asarray(fraction.ravel()), jnp.asarray(temperature.ravel()))
    states = type(states)(
        states.atmosphere, states.albedo, states.geometry, states.surface_temperature, fire
    )
    distance = sun_distance(TIMES[0])
    assert abs(distance - 0.9833) < 1e-4  # at perihelion [AU]
    seen = radiance(states, BANDS, sun_distance=distance, num_streams=2, gases=())
    clean = result["radiance"].sel(band="C07").values.ravel()
    calm = np.asarray(fraction.ravel() == 0)
    # What does not burn is as the scene was simulated, at the sun's distance of its time.
    np.testing.assert_allclose(np.asarray(seen)[calm, 2], clean[calm], rtol=1e-9)
    image = np.moveaxis(np.asarray(seen).reshape(*SHAPE, 3), -1, 0)
    lit = xr.DataArray(image, dims=("band", "y", "x"))
    return made.assign(radiance=lit, quality_flag=result["quality_flag"]).assign_attrs(result.attrs)


def of_fires(retrieval, name):
    return np.array([retrieval[name].values[place] for place in FIRES])


def test_fires_are_found_and_retrieved_by_day_and_by_night(burning):
    retrieval = retrieve_fires(burning, diagnostics=True)
    burns = np.zeros(SHAPE, bool)
    burns[tuple(np.transpose(list(FIRES)))] = True
    np.testing.assert_array_equal(retrieval[SCORE] >= DETECTED, burns)
    codes = retrieval["result_code"].values
    assert (codes[~burns] == ResultCode.NO_PLUME).all()
    unsaturated = np.array([place != SATURATED for place in FIRES])
    assert (of_fires(retrieval, "num_values") == np.where(unsaturated, 3, 1)).all()
    assert codes[SATURATED] == ResultCode.TOO_FEW_BANDS
    assert (of_fires(retrieval, "result_code")[unsaturated] == ResultCode.SUCCESS).all()
    kelvin, share = np.array(list(FIRES.values()))[unsaturated].T
    found = of_fires(retrieval, "fire_temperature")[unsaturated]
    np.testing.assert_allclose(found, kelvin, atol=0.1)
    found = of_fires(retrieval, "fire_fraction")[unsaturated]
    np.testing.assert_allclose(found, share, rtol=1e-3)
    power = of_fires(retrieval, "fire_emitted_power")[unsaturated]
    np.testing.assert_allclose(power, 5.670374e-8 * share * kelvin**4, rtol=1e-3)
    # Temperature and share are known by their product: the power is known best.
    relative = of_fires(retrieval, "fire_emitted_power_sigma")[unsaturated] / power
    assert (relative < of_fires(retrieval, "fire_fraction_sigma")[unsaturated] / share).all()
    assert (
        of_fires(retrieval, "fire_temperature_error_due_to_surface_temperature") >= 0
    ).sum() >= 4
    bounds = [of_fires(retrieval, f"fire_temperature_{bound}")[unsaturated] for bound in LEVELS]
    assert (np.diff([*bounds[:2], kelvin, *bounds[2:]], axis=0) > 0).all()


def test_the_power_is_said_to_be_a_black_fires():
    """Emissivity is known in the bands alone, and a power of all wavelengths is no band's."""
    (power,) = fire().derived
    burning = Fire(jnp.asarray(1e-2), jnp.asarray(800.0))
    np.testing.assert_allclose(power.read(burning), 5.670374e-8 * 1e-2 * 800.0**4, rtol=1e-6)
    assert "that a black fire" in power.long_name


def test_neighbours_stand_for_the_ground(burning, monkeypatch):
    excess = []  # of which diagnostics would be

    def noted(*pixels, **how):
        excess.append(how["excess"])
        return retrieved_fields(*pixels, **how)

    monkeypatch.setattr("retrievals.fires.retrieved_fields", noted)
    known = retrieve_fires(burning, noise=True, seed=3, prior=None)
    around = retrieve_fires(burning, noise=True, seed=3, background="neighbours")
    kelvin, share = np.array(list(FIRES.values())).T
    unsaturated = np.array([place != SATURATED for place in FIRES])
    for retrieval in (known, around):
        assert (of_fires(retrieval, "result_code")[unsaturated] == ResultCode.SUCCESS).all()
        for name, truth in (("fire_temperature", kelvin), ("fire_fraction", share)):
            error = np.abs(of_fires(retrieval, name) - truth)[unsaturated]
            assert (error < 4 * of_fires(retrieval, f"{name}_sigma")[unsaturated]).all()
    assert excess == [False, True]
    wider = of_fires(around, "fire_fraction_sigma") / of_fires(known, "fire_fraction_sigma")
    assert (wider[unsaturated] > 1).all()  # by the spread of the ground


def test_all_are_pixels_without_score_too(burning):
    """Where C07 is missing nothing stands out, and C05 and C06 tell of the fire all the same."""
    place = (1, 6)
    alone = burning.copy(deep=True)
    alone["quality_flag"][:] = QUALITY_FLAGS["no_albedo"]
    alone["quality_flag"][place] = 0
    alone["radiance"][(2, *place)] = np.nan
    assert retrieve_fires(alone)["result_code"].values[place] == ResultCode.INVALID_INPUT
    found = retrieve_fires(alone, where="all")
    assert (found["result_code"].values == ResultCode.UNUSABLE).sum() == np.prod(SHAPE) - 1
    assert found["result_code"].values[place] == ResultCode.SUCCESS
    assert found["num_values"].values[place] == 2 and np.isnan(found[SCORE].values[place])
    assert abs(found["fire_temperature"].values[place] - FIRES[place][0]) < 0.1
    with pytest.raises(ValueError, match="where must be one of detected, all; got 'everywhere'"):
        retrieve_fires(alone, where="everywhere")


def test_the_command_retrieves_fires(burning, tmp_path):
    how = {"num_streams": 2, "gases": "none"}
    with ResultWriter(tmp_path / "r.nc", times=TIMES, shape=SHAPE, attributes=how) as writer:
        writer.write(0, slice(0, SHAPE[0]), burning)
    app = typer.Typer()
    app.command()(retrieve)

    def run(*arguments):
        return CliRunner().invoke(app, [str(a) for a in arguments])

    out = tmp_path / "fires.nc"
    answer = run("fire", tmp_path / "r.nc", "--out", out, "--background", "neighbours")
    assert answer.exit_code == 0, answer.output
    with xr.open_dataset(out) as written:
        assert written["fire_temperature"].dims == written[SCORE].dims == ("time", "y", "x")
        assert written.attrs["background"] == "neighbours"
        assert np.isfinite(written["fire_fraction"]).sum() == len(FIRES)
    answer = run("fire", tmp_path / "r.nc", "--out", out, "--background", "sea")
    assert answer.exit_code == 2 and "choose from stored, neighbours" in answer.stderr
    answer = run("fire", tmp_path / "r.nc", "--out", out, "--bands", "C03")
    assert answer.exit_code == 2
    answer = run("smoke", tmp_path / "r.nc", "--out", out, "--background", "stored")
    assert answer.exit_code == 2 and "smoke has none" in answer.stderr


def test_what_a_dataset_lacks_is_named(burning):
    with pytest.raises(InputError, match="no surface_temperature; simulate a scene with C07"):
        retrieve_fires(burning.drop_vars("surface_temperature"))
    with pytest.raises(InputError, match="2 unknowns need as many bands"):
        retrieve_fires(burning, bands=("C07",))


def test_a_score_is_a_departure_in_standard_deviations():
    rng = np.random.default_rng(1)
    image = 0.5 + 0.05 * rng.standard_normal((1, 40, 40))  # far above the noise of C07
    image[0, 20, 20] += 0.5
    image[0, 3, 3] = np.nan
    found = surroundings(image, ("C07",), IMAGER)
    assert found.score[20, 20] == pytest.approx(10, abs=2)  # its spread is known from 120 pixels
    assert np.isnan(found.score[3, 3])
    assert (found.score[np.isfinite(found.score)] >= DETECTED).sum() == 1
    np.testing.assert_allclose(found.mean[0, 20, 20], 0.5, atol=0.02)  # without the fire itself
    np.testing.assert_allclose(found.deviation[0, 20, 20], 0.05, rtol=0.3)
