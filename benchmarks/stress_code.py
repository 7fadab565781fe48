"""Which code the figures of `stress.py` hang on: what draws columns, solves them and checks them.

A long run goes on over days, while commands, files and retrievals are being worked on. Its folder
is therefore named by the modules that `stress_columns` and `stress_checks` import, and those that
these import, with the tables beside them, and by nothing else of the package.
"""

import ast
import hashlib
from pathlib import Path

import jax

import abi_operator

PACKAGE = Path(abi_operator.__file__).parent
ROOTS = ("stress_columns.py", "stress_directions.py", "stress_checks.py")


def state_of_code() -> str:
    """Name of a folder: results of other code, or of another JAX, are other results."""
    code = hashlib.sha256(jax.__version__.encode())
    for path in sources():
        code.update(path.read_bytes())
    return code.hexdigest()[:12]


def sources() -> list[Path]:
    """Files of the code and of its tables, in order."""
    found: set[Path] = set()
    waiting = [Path(__file__).with_name(name) for name in ROOTS]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += [x for name in _imported(path) for x in _files(name)]
    folders = {path.parent for path in found if path.is_relative_to(PACKAGE)} - {PACKAGE}
    tables = [x for folder in folders for x in folder.glob("tables/**/*") if x.suffix != ".py"]
    return sorted(found | {x for x in tables if x.is_file()})


def _imported(path: Path) -> list[str]:
    """Names that a file imports from the package, from its top, with dots."""
    package = path.parent.relative_to(PACKAGE).parts if path.is_relative_to(PACKAGE) else ()
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            parts = (node.module or "").split(".") if node.module else []
            if node.level:
                parts = [*package[: len(package) - node.level + 1], *parts]
            elif parts[:1] == [PACKAGE.name]:
                parts = parts[1:]
            else:
                continue
            found += [".".join(parts), *(".".join([*parts, x.name]) for x in node.names)]
        elif isinstance(node, ast.Import):
            names = [x.name.split(".") for x in node.names]
            found += [".".join(x[1:]) for x in names if x[0] == PACKAGE.name]
    return found


def _files(name: str) -> list[Path]:
    """A module's file, or that of a package but for the whole one, which imports everything."""
    path = PACKAGE.joinpath(*name.split("."))
    candidates = [path.with_suffix(".py")] + ([path / "__init__.py"] if name else [])
    return [x for x in candidates if x.is_file()]
