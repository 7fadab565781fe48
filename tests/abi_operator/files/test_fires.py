"""The table of fires: what it says, and what it is refused for."""

import numpy as np
import pytest

from abi_operator.files import InputError, read_fires
from abi_operator.nomenclature import FIRE_TABLE

HEAD = "latitude,longitude,temperature,area\n"


@pytest.fixture
def written(tmp_path):
    def write(text, **options):
        path = tmp_path / "fires.csv"
        path.write_text(text, **options)
        return path

    return write


def test_a_table_is_read_in_any_order_of_its_columns(written):
    text = "area, temperature, longitude, latitude, start, end\n"
    text += "4e4, 900, -117.5, 33.5, 2007-10-23T18:00, \n5e4,800,242.5,34,,2007-10-23T19:00Z\n"
    fires = read_fires(written(text, encoding="utf-8-sig"))
    assert set(fires.variables) == set(FIRE_TABLE) and fires.sizes == {"fire": 2}
    np.testing.assert_array_equal(fires["area"], [4e4, 5e4])
    np.testing.assert_array_equal(fires["temperature"], [900.0, 800.0])
    np.testing.assert_array_equal(fires["longitude"], [-117.5, 242.5])
    assert fires["start"].values[0] == np.datetime64("2007-10-23T18:00")
    assert fires["end"].values[1] == np.datetime64("2007-10-23T19:00")
    assert np.isnat(fires["start"].values[1]) and np.isnat(fires["end"].values[0])
    assert fires["area"].attrs["units"] == "m2"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the first line of .* has to name latitude, .*; it has nothing"),
        ("latitude,longitude,area\n", "it has latitude, longitude, area"),
        (HEAD.replace("area", "area,power"), "area, power"),
        (HEAD, "has no fire"),
        (HEAD + "33,-117,900\n", "line 2 has another number of values"),
        (HEAD + "33,-117,900,4e4,1\n", "line 2 has another number of values"),
        (HEAD + "33,-117,hot,4e4\n", "line 2: temperature is 'hot'; it must be a number"),
        (HEAD + "33,-117,627,4e4\n-91,0,900,1\n", "line 3: latitude is -91; it must be -90 to 90"),
        (HEAD + "33,-117,27,4e4\n", "temperature is 27; it must be 400 to 3000 K"),
        (HEAD + "33,-117,900,0\n", "area is 0; it must be above 0"),
        (HEAD + "33,-117,900,nan\n", "area is nan"),
        (HEAD[:-1] + ",start\n33,-117,900,4e4,noon\n", "start is 'noon'; it must be a time"),
        # A year of many digits, which NumPy takes for another.
        (HEAD[:-1] + ",end\n33,-117,900,4e4,20071023\n", "end is '20071023'; it must be a time"),
        (
            HEAD[:-1] + ",start,end\n33,-117,900,4e4,2007-10-23T19,2007-10-23T18\n",
            "the fire ends at 2007-10-23T18:00:00.000000000, which is not after start",
        ),
    ],
)
def test_a_wrong_table_is_refused_with_its_line(written, text, message):
    with pytest.raises(InputError, match=message):
        read_fires(written(text))


def test_what_is_no_table_is_refused(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_fires(tmp_path / "none.csv")
    (tmp_path / "picture.png").write_bytes(b"\x89PNG\r\n\xff\xfe")
    with pytest.raises(InputError, match="cannot be read as a table"):
        read_fires(tmp_path / "picture.png")
