"""Writes the golden markers of tests/extractor/golden anew, after a change that moves markers on purpose.

    python -m tools.golden_markers

The pictures are not changed. The largest move of each picture and preset is printed for the commit's message.
"""

from __future__ import annotations

import numpy as np

from tests.extractor.test_golden import FILES, FOLDER, read

PRESETS = ("balanced", "accurate")


def main() -> None:
    for name in FILES:
        path = FOLDER / f"{name}.npz"
        with np.load(path) as file:
            arrays = dict(file)
        for preset in PRESETS:
            found, expected = read(name, preset)
            move_px = np.nanmax(np.abs(found["xy_px"] - expected["xy_px"]))
            print(f"{name} {preset}: markers move by at most {move_px:.4f} px")
            arrays |= {f"{preset}_{key}": value for key, value in found.items()}
        np.savez_compressed(path, **arrays)


if __name__ == "__main__":
    main()
