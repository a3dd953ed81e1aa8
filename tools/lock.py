"""Writes requirements.lock: the versions of all packages that are installed here, except for this package.

    python -m tools.lock

The file is a constraint file of pip: it names versions and installs no package. It has no digests, because pip then
refuses an editable package, and because every platform has its own wheels.
"""

from __future__ import annotations

from importlib.metadata import distributions
from pathlib import Path

LOCK_PATH = Path(__file__).parents[1] / "requirements.lock"
HEADER = "# Versions that the tests ran with. Written by: make lock\n"
# setuptools only builds packages without wheels. The version beside one Python fails on a later Python.
LEFT_OUT = {"cmpdesign", "pip", "setuptools"}


def lock_text() -> str:
    """One line NAME==VERSION for each installed package, in the order of the names."""
    versions = {one.metadata["Name"]: one.version for one in distributions()}
    lines = [
        f"{name}=={versions[name]}\n"
        for name in sorted(versions, key=str.lower)
        if name.lower() not in LEFT_OUT
    ]
    return HEADER + "".join(lines)


if __name__ == "__main__":
    LOCK_PATH.write_text(lock_text(), encoding="utf-8")
    print(f"wrote {LOCK_PATH.name}")
