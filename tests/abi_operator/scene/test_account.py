"""Accounts of the blocks of a scene add up to that of the scene."""

import numpy as np

from abi_operator.scene import add_accounts, negative_lines
from abi_operator.scene.account import condensate_account, negative_account
from abi_operator.scene.condensate import Condensate
from abi_operator.scene.droplet_number import assumed_droplets
from abi_operator.scene.hydrometeors import Hydrometeors, Paths


def test_blocks_add_up():
    blocks = [
        {"cell_count": 2, "num_streams": 8, "smallest_p": 3.0, "largest_p": 4.0, "source": "a; b"},
        {"cell_count": 5, "num_streams": 8, "smallest_p": 2.0, "largest_p": 3.0, "source": "b"},
        {"cell_count": 0, "num_streams": 8, "smallest_p": 5.0, "largest_p": 9.0, "source": "c"},
    ]
    assert add_accounts(blocks) == {
        "cell_count": 7,
        "num_streams": 8,
        "smallest_p": 2.0,
        "largest_p": 9.0,
        "source": "a; b; c",
    }


WSM6 = assumed_droplets(None, "wsm6")


def account(total, left_out, num_assumed=0):
    nothing = np.zeros(1)
    paths = {name: Paths(nothing, nothing, num_assumed) for name in ("cloud", "snow")}
    return condensate_account(Hydrometeors(paths, Condensate(total, left_out), "wsm6", WSM6))


def test_shares_and_assumptions_are_those_of_all_blocks():
    one, other = account(4.0, {"rain": 1.0}, 3), account(0.0, {})
    third = account(6.0, {"rain": 3.0, "hail": 1.0}, 2)
    assert one["unsimulated_condensate_share"] == 0.25
    scene = add_accounts([one, other, third])
    assert scene["unsimulated_condensate_share"] == 0.5
    assert scene["unsimulated_condensate"] == "rain; hail"
    assert scene["hydrometeors"] == "cloud; snow" and scene["microphysics"] == "wsm6"
    assert scene["assumed_snow_number_count"] == 5


def test_small_negative_numbers_are_told_of_the_whole_scene(make_model):
    blocks = []
    for count, smallest in ((3, -7e-14), (0, None), (4, -2e-6)):
        model = make_model(rain_mixing_ratio=0)
        attributes = {"num_negative_set_to_zero": count, "smallest_negative": smallest}
        model["rain_mixing_ratio"].attrs = {k: v for k, v in attributes.items() if v is not None}
        blocks.append(negative_account(model))
    assert blocks[1] == {}
    scene = add_accounts(blocks)
    assert scene == {
        "negative_rain_mixing_ratio_count": 7,
        "smallest_negative_rain_mixing_ratio": -2e-6,
    }
    lines = list(negative_lines(scene))
    assert lines == ["rain mixing ratio below 0, taken as 0: in 7 cells, down to -2e-06 kg kg-1"]
    assert list(negative_lines({})) == []
