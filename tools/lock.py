"""Writes requirements.lock: the versions of all packages that are installed here, but for this one.

    python -m tools.lock

It is a constraint file of pip: it names versions and installs nothing by itself. It holds no digests, because pip then
refuses an editable package beside them, and every platform has wheels of its own.
"""

from __future__ import annotations

from importlib.metadata import distributions
from pathlib import Path

LOCK_PATH = Path(__file__).parents[1] / "requirements.lock"
HEADER = "# Versions that the tests ran with. Written by: make lock\n"
OWN = {"cmpdesign", "pip"}


def lock_text() -> str:
    """One line NAME==VERSION for each installed package, in the order of the names."""
    versions = {one.metadata["Name"]: one.version for one in distributions()}
    lines = [
        f"{name}=={versions[name]}\n" for name in sorted(versions, key=str.lower) if name.lower() not in OWN
    ]
    return HEADER + "".join(lines)


if __name__ == "__main__":
    LOCK_PATH.write_text(lock_text(), encoding="utf-8")
    print(f"wrote {LOCK_PATH.name}")
