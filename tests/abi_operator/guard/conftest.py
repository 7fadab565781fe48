"""The project's baseline."""

from pathlib import Path

import pytest

from abi_operator import guard

BASELINE = Path(__file__).parents[2] / "baselines" / "standard.nc"


@pytest.fixture(scope="session")
def baseline():
    """What the standard columns gave when last accepted."""
    return guard.read_baseline(BASELINE).jacobians
