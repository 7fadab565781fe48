"""Names of variables tell whose they are."""

from abi_operator.nomenclature import PLUME, variable


def test_a_species_may_have_a_name_of_several_words():
    for name in (*PLUME, "optical_depth", "aod_550"):
        one, other = variable(f"ash_{name}"), variable(f"volcanic_ash_{name}")
        assert one is not None and other is not None and one.dims == other.dims, name
    words = "optical depth of the volcanic_ash plume at 550 nm"
    assert variable("volcanic_ash_aod_550").long_name == words
    assert variable("snow_mass_path").long_name == "snow of the layer"


def test_what_has_no_owner_or_no_quantity_is_no_variable():
    assert variable("_ssa") is None and variable("ssa") is None and variable("ash_colour") is None
