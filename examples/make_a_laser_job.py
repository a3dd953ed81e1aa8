"""From a measured kerf to the files of a laser job, and the predicted pad.

    python examples/make_a_laser_job.py [template] [kerf in mm]

The example needs ezdxf and SciPy: pip install '.[laser]'.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cmpdesign


def main(template: str = "tac3d", kerf_mm: str = "0.14") -> None:
    if Path("pad").exists():
        sys.exit("the folder pad exists: rename or remove it, so that no file is overwritten")
    design = cmpdesign.load(template, {"laser.kerf_mm": float(kerf_mm)}, layers=6)
    checked = design.check(read=True)
    for finding in checked.findings:
        print(f"{finding.severity}: {finding}")
    built = design.write("pad", products=["layout", "laser"], camera=(1280, 960))
    print(f"{design!r} with a kerf of {kerf_mm} mm:")
    for path in built.written:
        print(f"  {path}")


if __name__ == "__main__":
    main(*sys.argv[1:3])
