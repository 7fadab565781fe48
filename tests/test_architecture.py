"""The house: imports go down, never sideways or up, and the door opens with JAX alone."""

import ast
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]

FLOORS = [
    {"__main__"},
    {"cli"},
    {"observe_command", "simulate_command"},
    {"guard", "sensitivity", "simulate_options", "simulation"},
    {"commands", "demo", "drawing", "option_texts", "report", "request"},
    {"scene"},
    {"files", "instrument", "pictures", "products"},
    {"quality", "radiance", "reflectance"},
    {"optics_and_solver", "state_checks"},
    {"bands_of_states"},
    {"band_columns", "settings"},
    {"sun_path"},
    {"optics", "solver", "surface"},
    {"lambertian", "microphysics", "optical_properties", "plume_edges", "standard_atmospheres"},
    {"atmosphere"},
    {"geometry", "planck"},
    {"satellites", "machine"},
    {
        "_ending",
        "_keywords",
        "_numerics",
        "_version",
        "bands",
        "constants",
        "nomenclature",
        "ranges",
    },
]
FLOOR = {room: level for level, rooms in enumerate(FLOORS) for room in rooms}


@cache
def nodes(path: Path) -> list[ast.AST]:
    """All that a file's syntax tree is made of."""
    return list(ast.walk(ast.parse(path.read_text())))


@cache
def imported(path: Path, package: str) -> list[str]:
    """Modules of `package` that a file imports, as dotted names below the package."""
    names = []
    inside = list(path.relative_to(ROOT / package).parent.parts)
    for node in nodes(path):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = inside[: len(inside) - node.level + 1] + (node.module or "").split(".")
            tails = [a.name for a in node.names] if not node.module else [""]
            names += [".".join([*filter(None, base), *filter(None, [t])]) for t in tails]
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == package:
            names.append(node.module.partition(".")[2] or node.names[0].name)
    return names


@cache
def sources(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def room(path: Path) -> str:
    return path.relative_to(ROOT / "abi_operator").parts[0].removesuffix(".py")


def test_every_file_has_a_floor():
    assert {room(p) for p in sources("abi_operator")} == set(FLOOR) | {"__init__"}


def test_imports_go_down():
    wrong = []
    for path in sources("abi_operator"):
        here = room(path)
        for name in imported(path, "abi_operator"):
            there = name.split(".")[0]
            if here in ("__init__", there):
                continue
            if FLOOR[there] <= FLOOR[here]:
                wrong.append(f"{path.relative_to(ROOT)} imports {name}")
    assert not wrong


def test_no_file_or_folder_of_the_retrievals_needs_itself():
    """Whatever it imports, and what that does, imports it not: there is a lowest floor."""
    below: dict[str, set[str]] = {}
    for path in sources("retrievals"):
        here = path.relative_to(ROOT / "retrievals").parts[0].removesuffix(".py")
        there = {name.split(".")[0] for name in imported(path, "retrievals")}
        below.setdefault(here, set()).update(there - {here})
    while ready := {name for name, needs in below.items() if not needs & set(below)}:
        below = {name: needs for name, needs in below.items() if name not in ready}
    assert not below


def test_rooms_that_have_not_heard_of_each_other():
    for path in sources("abi_operator"):
        text = path.read_text()
        if room(path) == "files":
            assert "jax" not in text, f"{path}: readers know nothing of JAX"
        if room(path) == "solver":
            words = " ".join(text.split())
            assert "aerosol" not in words.replace("knows nothing of aerosols", ""), path
        assert "retrievals" not in [n.split(".")[0] for n in absolute(path)], path


# Whose words about the compiler still stand beside the steps that they are about.
SPEAK_OF_THE_COMPILER = "machine", "solver/method", "solver/gradient", "solver/problem.py"


def test_the_compiler_is_spoken_of_in_the_machine_alone():
    """Whoever reads physics need not know by what a program becomes machine code."""
    words = re.compile("(?<![a-z])(xla|llvm)(?![a-z])", re.IGNORECASE)  # and not WRF's XLAT
    for path in [*sources("abi_operator"), *sources("retrievals")]:
        exempt = [ROOT / "abi_operator" / place for place in SPEAK_OF_THE_COMPILER]
        if not any(place in (path, *path.parents) for place in exempt):
            found = words.search(path.read_text())
            assert not found, f"{path} speaks of {found[0]}"


def absolute(path: Path) -> list[str]:
    plain = [a.name for n in nodes(path) if isinstance(n, ast.Import) for a in n.names]
    return plain + [
        n.module or "" for n in nodes(path) if isinstance(n, ast.ImportFrom) and not n.level
    ]


def test_retrievals_use_public_names_only():
    for path in sources("retrievals"):
        for name in absolute(path):
            if name.startswith("abi_operator"):
                assert not any(part.startswith("_") for part in name.split(".")), (path, name)


def test_imports_stand_at_the_head_of_files():
    for path in [*sources("abi_operator"), *sources("retrievals")]:
        if "plugin" in path.parts:  # which pytest loads before JAX may be
            continue
        for node in nodes(path):
            if isinstance(node, ast.FunctionDef):
                inner = [x for x in ast.walk(node) if isinstance(x, ast.Import | ast.ImportFrom)]
                assert not inner, f"{path}: {node.name} imports inside"


LONGEST = 80  # lines of a function, of the solver with its signature and docstring


def test_functions_of_the_solver_are_short():
    for path in [*sources("abi_operator/solver"), *sources("abi_operator/machine")]:
        for node in nodes(path):
            if isinstance(node, ast.FunctionDef):
                assert node.end_lineno - node.lineno < LONGEST, (path, node.name)


def test_functions_are_short():
    for package in ("abi_operator", "retrievals"):
        for path in sources(package):
            for node in nodes(path):
                if isinstance(node, ast.FunctionDef):
                    own = node.body[1 if ast.get_docstring(node) and node.body[1:] else 0 :]
                    assert node.end_lineno - own[0].lineno < LONGEST, (path, node.name)


def test_the_door_opens_with_jax_and_equinox_alone():
    heavy = ("xarray", "netCDF4", "pandas", "pyorbital", "PIL", "typer", "optimistix", "matplotlib")
    code = f"import sys, abi_operator; print([m for m in {heavy!r} if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.stdout.strip() == "[]", result
    flags = "import abi_operator, abi_operator.solver, jax; print(jax.config.jax_enable_x64)"
    plain = {"PATH": "", "JAX_PLATFORMS": "cpu"}
    result = subprocess.run(
        [sys.executable, "-c", flags], capture_output=True, text=True, env=plain, cwd=ROOT
    )
    assert result.stdout.strip() == "False", result
