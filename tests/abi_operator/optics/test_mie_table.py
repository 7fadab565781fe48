"""The file of Mie tables: what it holds, where it is from, and how it is read."""

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
from abi_operator.optics.mie_table import mie_species, mie_table

FILE = Path(str(files("abi_operator.optics") / "tables" / "aerosol_mie.nc"))


@pytest.fixture(scope="module")
def dataset():
    """The file, read by the netCDF library: names of species and bands, and variables."""
    with netCDF4.Dataset(FILE) as file:
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
    assert list(mie_species()) == names["species"] == ["smoke", "ash", "dust"]
    assert names["band"] == list(BANDS)
    wavelengths = [band.wavelength_um for band in BANDS.values()]
    np.testing.assert_array_equal(variables["wavelength_um"], wavelengths)


def test_tables_are_read_as_they_are_written(dataset):
    names, variables, _ = dataset
    for i, species in enumerate(names["species"]):
        table = mie_table(species)
        np.testing.assert_array_equal(
            table.effective_radius_um, variables["effective_radius_um"][i]
        )
        for j, band in enumerate(names["band"]):
            logarithms = table.log_relative_extinction[band], table.log_coalbedo[band]
            for values, name in zip(logarithms, ("relative_extinction", "coalbedo"), strict=True):
                np.testing.assert_allclose(np.exp(values), variables[name][i, j], rtol=1e-14)
            np.testing.assert_array_equal(table.asymmetry[band], variables["asymmetry"][i, j])


def test_values_are_physical(dataset):
    _, variables, _ = dataset
    assert np.all(np.diff(variables["effective_radius_um"], axis=1) > 0)
    assert np.all(variables["relative_extinction"] > 0)
    assert np.all((variables["coalbedo"] > 0) & (variables["coalbedo"] < 1))
    assert np.all(np.abs(variables["asymmetry"]) < 1)
    assert np.all(variables["refractive_index_imaginary"] > 0)


def test_the_file_is_small_and_says_where_it_is_from(dataset):
    names, _, attributes = dataset
    assert FILE.stat().st_size < 200e3
    assert "miepython" in attributes["source"]
    for species in names["species"]:
        assert "doi:10." in attributes[f"sources_of_{species}"]


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
