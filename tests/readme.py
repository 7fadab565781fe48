"""README's code."""

import re
from pathlib import Path
from typing import Any

README = (Path(__file__).parents[1] / "README.md").read_text()


def run_block(number: int, names: dict[str, Any] | None = None) -> dict[str, Any]:
    """Run a block, after another whose `names` it goes on with; return all names."""
    blocks = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert len(blocks) == 4
    names = dict(names or {})
    exec(compile(blocks[number], "README.md", "exec"), names)
    return names
