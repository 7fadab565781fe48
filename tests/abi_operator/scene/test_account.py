"""Accounts of the blocks of a scene add up to that of the scene."""

from abi_operator.scene import add_accounts
from abi_operator.scene.account import condensate_account
from abi_operator.scene.liquid import Condensate


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


def test_shares_are_those_of_all_blocks():
    one = condensate_account(Condensate(4.0, {"rain": 1.0}, 0.0))
    other = condensate_account(Condensate(0.0, {}, 0.0))
    third = condensate_account(Condensate(6.0, {"rain": 3.0, "snow": 1.0}, 2.0))
    assert one["unsimulated_condensate_share"] == 0.25
    scene = add_accounts([one, other, third])
    assert scene["unsimulated_condensate_share"] == 0.5
    assert scene["ice_as_droplets_share"] == 0.2
    assert scene["unsimulated_condensate"] == "rain; snow"
