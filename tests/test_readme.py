"""README's code runs, and its test line is the one that the full check runs."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def test_python_blocks_run():
    blocks = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert blocks
    for block in blocks:
        names = {}
        exec(compile(block, "README.md", "exec"), names)
        slope = names["K"].atmosphere.plumes["smoke"].ssa["C01"]
        assert slope.shape == names["rho"].shape == (4,)
        assert slope[0] > 0 and (slope[1:] == 0).all()


def test_the_test_line_is_the_one_of_the_full_check():
    (line,) = re.findall(r"python (-P -m pytest .*)\n", README)
    assert f'"$python" {line}\n' in (ROOT / ".ci" / "run").read_text()


def test_files_and_commands_that_it_names_exist():
    for name in re.findall(r"(?:examples|tests|benchmarks|abi_operator)/[\w/]+\.\w+", README):
        assert (ROOT / name).exists(), name
