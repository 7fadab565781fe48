"""Print pip constraints that hold every runtime dependency to the lowest version declared."""

import re
import tomllib

with open("pyproject.toml", "rb") as file:
    declared = tomllib.load(file)["project"]["dependencies"]
for requirement in declared:
    match = re.fullmatch(r"([\w.-]+)>=([\d.]+)", requirement)
    if not match:
        raise SystemExit(f"pyproject.toml: {requirement!r} is not of the form name>=version.")
    print("{}=={}".format(*match.groups()))
