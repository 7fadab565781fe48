"""The compliance checker of the CF conventions, run in a process of its own."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest

# Its list of what a Mercator map needs is one word in place of a tuple of one, of which it asks for
# the letters; and it takes differences of all coordinates along themselves, even of bands' names.
SCRIPT = """
import json, sys
from compliance_checker.cf import appendix_f
for name in dir(appendix_f):
    maps = getattr(appendix_f, name)
    if isinstance(maps, dict) and isinstance(maps.get("mercator", [None])[0], str):
        maps["mercator"][0] = (maps["mercator"][0],)
from compliance_checker.suite import CheckSuite
CheckSuite.load_all_available_checkers()
suite = CheckSuite()
skipped = ["check_coordinate_variables_strict_monotonicity"]
found, errors = suite.run_all(suite.load_dataset(sys.argv[1]), ["cf:1.11"], skip_checks=skipped)[
    "cf:1.11"
]
assert not errors, errors
def passed(check):
    return check.value[0] == check.value[1] if isinstance(check.value, tuple) else check.value
print(json.dumps([text for check in found if not passed(check) for text in check.msgs]))
"""
ORDER = "spatio-temporal dimensions are not in the recommended order"


def complaints(path: Path) -> list[str]:
    """What the checker says of a file, but for bands and layers that stand behind the time.

    That order is a recommendation, and read_result's Datasets have it as xarray's users do.
    """
    if importlib.util.find_spec("compliance_checker") is None:
        pytest.skip("compliance-checker is not installed (the extra `test` has it)")
    outcome = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(path)], capture_output=True, text=True
    )
    assert outcome.returncode == 0, outcome.stderr
    said = json.loads(outcome.stdout.splitlines()[-1])
    return [text for text in said if ORDER not in text]
