"""The command line on broken files and wrong options."""

import os

import netCDF4
import pytest
from demonstration import SIZE
from PIL import Image

from abi_operator import simulation
from abi_operator.files import InputError


def without(path, name):
    """Rename a variable of a file, so that it has no `name`."""
    with netCDF4.Dataset(path, "a") as file:
        file.renameVariable(name, f"not_{name}")


def shift(path, degrees):
    """Move an albedo file to the east."""
    with netCDF4.Dataset(path, "a") as file:
        file["lon"][:] += degrees


def fill(path, name, value):
    """Put a value into all places of a variable."""
    with netCDF4.Dataset(path, "a") as file:
        file[name][:] = value


def shrink(path):
    """Make a picture smaller than the grid."""
    Image.new("L", (SIZE - 1, SIZE)).save(path)


@pytest.mark.parametrize(
    ("breaks", "sentence"),
    [
        (lambda inputs: inputs.wrf.unlink(), "does not exist"),
        (lambda inputs: inputs.albedo.unlink(), "does not exist"),
        (lambda inputs: inputs.plume.unlink(), "does not exist"),
        (lambda inputs: inputs.wrf.write_text("no NetCDF"), "cannot be read as NetCDF"),
        (lambda inputs: os.truncate(inputs.wrf, 100_000), "ends after 100000 of the "),
        (lambda inputs: os.truncate(inputs.albedo, 90_000), "ends after 90000 of the "),
        (lambda inputs: inputs.albedo.write_bytes(b"\x0e\x03\x13\x01"), "is an HDF4 file, not N"),
        (lambda inputs: fill(inputs.wrf, "TSK", 9.96921e36), "was never written"),
        (lambda inputs: fill(inputs.wrf, "QCLOUD", 1e20), "plausible is 0 to 0.03 kg kg-1"),
        (lambda inputs: without(inputs.wrf, "QCLOUD"), "has no QCLOUD"),
        (
            lambda inputs: without(inputs.albedo, "BRDF_Albedo_Parameters_Band3"),
            "has no BRDF_Albedo_Parameters_Band3",
        ),
        (lambda inputs: shift(inputs.albedo, 2.0), "request albedo for the whole scene"),
        (lambda inputs: shrink(inputs.plume), "is 7 x 8 pixels where the model's grid is 8 x 8"),
    ],
)
def test_wrong_inputs_are_said_in_one_sentence(invoke, tmp_path, inputs, breaks, sentence):
    breaks(inputs)
    options = ["--albedo", inputs.albedo, "--plume", inputs.plume, "--ocean-albedo", 0.06]
    outcome = invoke("simulate", inputs.wrf, *options, "--out", tmp_path / "out")
    assert outcome.exit_code == 2
    assert sentence in outcome.stderr and outcome.stdout == ""
    assert outcome.stderr.startswith("abi-operator: ") and outcome.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["inputs"]


def test_some_albedo_is_needed(invoke, tmp_path, inputs):
    outcome = invoke("simulate", inputs.wrf, "--out", tmp_path / "out")
    assert outcome.exit_code == 2
    assert "name an albedo file, an albedo of the ocean, or both" in outcome.stderr
    assert not (tmp_path / "out").exists()


def test_trouble_on_the_way_leaves_nothing_behind(invoke, tmp_path, inputs, monkeypatch):
    def read_result(path):
        raise InputError("a value is wrong.")

    monkeypatch.setattr(simulation, "read_result", read_result)
    options = ["--plume", inputs.plume, "--plume-species", "ash"]  # programs of the test before
    options += ["--bands", "C01, C06", "--ocean-albedo", 0.06, "--num-streams", 2]
    outcome = invoke("simulate", inputs.wrf, *options, "--out", tmp_path / "out")
    assert outcome.exit_code == 2 and outcome.stderr == "abi-operator: a value is wrong.\n"
    assert [path.name for path in tmp_path.iterdir()] == ["inputs"]


def test_pictures_of_the_result_before_are_removed_and_others_stay(invoke, tmp_path, inputs):
    out = tmp_path / "out"
    options = ["--ocean-albedo", 0.06, "--num-streams", 2, "--gases", "none", "--out", out]
    first = invoke("simulate", inputs.wrf, "--bands", "C04", "--error-budget", 0, *options)
    assert first.exit_code == 0, first.output
    (out / "C04_mine.png").touch()
    outcome = invoke("simulate", inputs.wrf, "--bands", "C01, C06", *options)
    picture = "C04_2007-10-23T180000.png"
    assert f"removed {out / picture}, a picture of the result before\n" in outcome.stdout
    now = [f"{band}_2007-10-23T180000.png" for band in ("C01", "C06")]
    assert sorted(path.name for path in out.iterdir()) == sorted(
        [*now, "C04_mine.png", "result.nc"]
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--num-streams", "7"], "the number of streams is even"),
        (["--num-streams", "few"], "an even number or a percentage; got few"),
        (["--num-streams", "0.0001%"], "24 streams leave an error of"),
        (["--num-streams", "1000%"], "streams may leave is above 0% and below 100%; got 1000%."),
        (["--num-streams", "nan%"], "streams may leave is above 0% and below 100%; got nan%."),
        (["--error-budget", "1"], "an error budget is below 1; got 1.0"),
        (["--bands", "C01,C08"], "'C08'"),
        (["--satellite", "GOES-13"], "'GOES-13'"),
        (["--gases", "SO2"], "['SO2'] are not known"),
        (["--hydrometeors", "sleet"], "['sleet'] are not known"),
        (["--cloud-optics", "fu"], "cloud optics 'fu' are not known; choose from mie, mitchell"),
        (["--ice-optics", "mie"], "ice optics 'mie' are not known; choose from fu, rough"),
        (["--microphysics", "p3"], "nothing is known of microphysics 'p3'"),
        (["--bands", "all"], "C07 needs the emissivity of the ground"),
        (["--bands", "C04", "--satellite", "GOES-19"], "is not known of GOES-19"),
        (["--ocean-albedo", "0.1", "--time", "1"], "has 1 times; ask for one of them"),
        (["--ocean-albedo", "0.1", "--time", "2005-08-28"], "has no time 2005-08-28; it has"),
        (["--ocean-albedo", "1.5"], "--ocean-albedo"),
        (["--variables", "radiances"], "variables ['radiances'] are not those of a result"),
        (["--variables", "land_mask"], "variables ['land_mask'] are not those of a result"),
        (["--variables", "brightness_temperature"], "brightness_temperature is of C07"),
        (["--satellite-longitude", "90"], "GOES-19 without --satellite-longitude, or"),
        (["--land-kernels"], "kernels of the land are those of an albedo file"),
        (["--broadband"], "(--broadband) is that of an albedo file; name one (--albedo)"),
        (["--emissivity", "0.96"], "(--emissivity) is that of the ground in C07; simulate that"),
        (["--emissivity", "lava"], "(--emissivity) is that of the ground in C07; simulate that"),
        (["--plume-species", "smoke"], "--plume-species is of a plume; name its picture"),
        (["--plume-aod", "2"], "--plume-aod is of a plume; name its picture (--plume)"),
        (["--plume-aod", "inf"], "the optical depth of the plume is inf; it must be 0 or more"),
        (["--background-aerosol", "1e7"], "depth of the background aerosol is 1e+07; it must be"),
        (
            ["--bands", "C07", "--emissivity", "0.9", "--albedo", "none.nc"],
            "(--albedo) is of bands of sunlight; simulate one beside C07",
        ),
        *[
            (["--bands", "C07", "--emissivity", "0.9", option, value], f"({option}) is of bands of")
            for option, value in [
                ("--ocean-albedo", "0.06"),
                ("--ocean-wind", "5"),
                ("--land-albedo", "0.2"),
                ("--sea-ice-albedo", "0.6"),
                ("--snow-albedo", "0.8"),
            ]
        ],
        (["--ocean-wind", "gale"], "no wind is known by the name of 'gale'"),
        (["--fires", "none.csv"], "none.csv does not exist"),
        (["--plume-species", "dust"], "'dust' is not one of"),
    ],
)
def test_wrong_options_are_refused(invoke, tmp_path, inputs, options, message):
    outcome = invoke("simulate", inputs.wrf, *options, "--out", tmp_path / "out")
    assert outcome.exit_code == 2 and message in outcome.stderr
    assert not (tmp_path / "out").exists()
