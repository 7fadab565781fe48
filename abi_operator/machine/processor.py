"""What of the machine this process may use."""

import hashlib
import os
import platform
from functools import cache
from pathlib import Path

_CGROUP = Path("/sys/fs/cgroup")


def usable_cores() -> int:
    """Cores that this process may keep busy: by its affinity, and by the quota of its cgroup."""
    affinity = getattr(os, "sched_getaffinity", None)
    cores = len(affinity(0)) if affinity else os.cpu_count() or 1
    quota = _quota()
    return cores if quota is None else max(1, min(cores, round(quota)))


@cache
def _quota() -> float | None:
    """Processors' worth of time that a cgroup grants, None without a limit."""
    try:
        limit, period = (_CGROUP / "cpu.max").read_text().split()
    except (OSError, ValueError):
        try:  # version 1
            limit, period = (
                (_CGROUP / "cpu" / f"cpu.cfs_{name}_us").read_text().strip()
                for name in ("quota", "period")
            )
        except OSError:
            return None
    if limit == "max" or float(limit) <= 0:
        return None
    return float(limit) / float(period)


def vector_bits() -> int | None:
    """Width of the processor's vectors where XLA would not use all of it, else None.

    LLVM by itself stops at 256 bits on most processors with AVX-512, the first of which slowed down
    for wider ones; a solve gains about a third by 512.
    """
    return 512 if "avx512f" in _described("flags").split() else None


def processor_key() -> str:
    """A short name, the same for processors that run the same machine code."""
    words = [_described(name) for name in ("model name", "flags", "Features")]
    described = "\n".join(words) if any(words) else platform.processor()
    digest = hashlib.sha256(described.encode())
    return f"{platform.machine() or 'unknown'}-{digest.hexdigest()[:8]}"


def _described(name: str) -> str:
    """What Linux says about the first processor, empty where it does not."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return ""
    lines = (line.partition(":") for line in text.splitlines())
    return next((value.strip() for key, _, value in lines if key.strip() == name), "")
