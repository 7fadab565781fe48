"""The files of Mie tables: what they hold, where they are from, and how they are read."""

import re
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import netCDF4
import numpy as np
import pytest

import abi_operator
from abi_operator.bands import BANDS
from abi_operator.optics.droplets import NU
from abi_operator.optics.mie_table import FILES, band_table, mie_species, mie_table

TABLES = Path(str(files("abi_operator.optics") / "tables"))
SPECIES = {"aerosol_mie.nc": ["smoke", "ash", "dust"], "droplet_mie.nc": ["droplets"]}
INSIDE = slice(2, -2)  # the rows of a table without what its cubics add


@pytest.fixture(scope="module", params=FILES)
def dataset(request):
    """A file, read by the netCDF library: names of species and bands, and variables."""
    with netCDF4.Dataset(TABLES / request.param) as file:
        file.set_auto_mask(False)
        variables = {name: variable[:] for name, variable in file.variables.items()}
        attributes = {name: file.getncattr(name) for name in file.ncattrs()}
    names = {
        axis: [name.strip() for name in netCDF4.chartostring(variables[f"{axis}_name"])]
        for axis in ("species", "band")
    }
    return names, variables, attributes


def test_species_and_bands_are_those_of_the_file(dataset):
    names, variables, _ = dataset
    assert names["species"] in SPECIES.values()
    assert list(mie_species()) == SPECIES["aerosol_mie.nc"]
    assert names["band"] == list(BANDS)
    wavelengths = [band.wavelength_um for band in BANDS.values()]
    np.testing.assert_array_equal(variables["wavelength_um"], wavelengths)
    if names["species"] == ["droplets"]:
        assert variables["shape"] == NU


def test_tables_are_read_as_they_are_written(dataset):
    names, variables, _ = dataset
    for i, species in enumerate(names["species"]):
        radii = mie_table(species).effective_radius_um
        np.testing.assert_array_equal(radii, variables["effective_radius_um"][i])
        # `radius_cubics` takes them to be equidistant in their logarithm.
        np.testing.assert_allclose(np.diff(np.log(radii), 2), 0, atol=1e-14)
        for j, band in enumerate(names["band"]):
            table = band_table(species, band)
            extinction, coalbedo, asymmetry = table.efficiencies[INSIDE].T
            for values, name in ((extinction, "extinction"), (coalbedo, "coalbedo")):
                np.testing.assert_allclose(np.exp(values), variables[name][i, j], rtol=1e-14)
            np.testing.assert_array_equal(asymmetry, variables["asymmetry"][i, j])
            np.testing.assert_array_equal(table.coordinate, variables["coordinate"][i, j])
            for name, values in (
                ("moments", table.moments[INSIDE].T),
                ("log_phase_function", table.log_phase[:, 0, INSIDE]),
            ):
                scale = variables[f"{name}_scale"][i, j].astype(float)[:, None]
                offset = variables[f"{name}_offset"][i, j][:, None]
                np.testing.assert_allclose(
                    values, variables[name][i, j] * scale + offset, rtol=0, atol=scale.max()
                )


def test_values_are_physical(dataset):
    _, variables, _ = dataset
    assert np.all(np.diff(variables["effective_radius_um"], axis=1) > 0)
    assert np.all(variables["extinction"] > 0)
    assert np.all((variables["coalbedo"] > 0) & (variables["coalbedo"] < 1))
    assert np.all(np.diff(variables["coordinate"], axis=-1) > 0)
    assert np.all(np.abs(variables["asymmetry"]) < 1)
    assert np.all(variables["refractive_index_imaginary"] > 0)


def test_a_file_says_where_it_is_from(dataset):
    names, _, attributes = dataset
    assert "miepython" in attributes["source"]
    for species in names["species"]:
        assert attributes[f"sources_of_{species}"]


def test_the_files_are_small():
    assert sum((TABLES / name).stat().st_size for name in FILES) < 600e3


def test_a_species_by_table_alone_is_named_in_no_code():
    package = Path(abi_operator.__file__).parent
    naming = [p for p in package.rglob("*.py") if re.search(r"\bdust\b", p.read_text(), re.I)]
    assert not naming
    assert "dust" in mie_species()


def test_unknown_species_is_named():
    with pytest.raises(ValueError, match=r"species 'fog'; choose from \['ash', 'dust', 'smoke'\]"):
        mie_table("fog")


def test_the_file_is_opened_on_first_use_and_without_netcdf4():
    code = (
        "import sys, abi_operator; early = 'scipy.io' in sys.modules;"
        "from abi_operator.optics.mie_table import mie_species; mie_species();"
        "print(early, [m for m in ('netCDF4', 'xarray') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.stdout.strip() == "False []", result
