"""The pytest fixture ``jacobian_guard``; pytest finds it by its entry point.

A module of its own, installed beside the packages: pytest loads it whenever it starts, and
importing anything below `abi_operator` would load JAX, before a run of tests had set its flags.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that accepts what moved."""
    parser.getgroup("abi-operator").addoption(
        "--jacobian-accept",
        metavar="REASON",
        help="write baselines of jacobian_guard anew where something moved or there is none",
    )


@pytest.fixture
def jacobian_guard(request: pytest.FixtureRequest) -> Callable[..., None]:
    """Compare values and Jacobians of states with a baseline kept beside the test.

    ``jacobian_guard(name, states, bands=None, folder=None, **settings)`` takes states by name, or
    one `State` with a leading axis, evaluates all bands that they are specified for, or `bands`,
    with `settings` of the operator (``num_streams=4``), and fails with a table of what moved. The
    baseline is ``name.nc`` in `folder`, by default ``baselines`` beside the test file.
    ``pytest --jacobian-accept "why"`` writes it where there is none and accepts what moved.
    """
    reason = request.config.getoption("--jacobian-accept")

    def guard(
        name: str,
        states: Any,
        *,
        bands: Sequence[str] | None = None,
        folder: str | Path | None = None,
        **settings: Any,
    ) -> None:
        # Here and not above, for the reason that the module's head gives.
        from abi_operator.guard import guard_states

        file = Path(folder or request.path.parent / "baselines") / f"{name}.nc"
        trouble = guard_states(file, states, bands, reason=reason, **settings)
        if trouble:
            pytest.fail(trouble, pytrace=False)

    return guard
