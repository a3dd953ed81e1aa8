"""Reads pictures with a copy of the reader.

    python -m benchmarks.suites.ablation.worker FOLDER PRESET OUT PICTURE ...

The process imports the ``extractor`` of FOLDER, and no module that needs another extractor.
"""

from __future__ import annotations

import pickle
import sys
import time
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class ReadPicture(NamedTuple):
    """The reading of one picture.

    Attributes:
        xy_px: (M, 2) float64, NaN where lost.
        cov_px2: (M, 2, 2) float64, the stated covariances, NaN where lost.
        status: (M,) uint8, a ``Status`` each.
        ms: processor time.
        raised: the text of an exception; empty without.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    status: NDArray[np.uint8]
    ms: float
    raised: str = ""


def main(folder: str, preset: str, out: str, *pictures: str) -> None:
    """Read the pictures, and write a list of ``ReadPicture`` to the file ``out``."""
    sys.path.insert(0, folder)
    import cv2

    import extractor

    assert Path(extractor.__file__).is_relative_to(folder), f"{extractor.__file__} is not in {folder}"
    cv2.setNumThreads(1)

    @cache
    def reader(layout: str) -> Any:
        return extractor.Extractor(extractor.parse_layout(layout), preset)  # type: ignore[arg-type]

    readings = []
    for path in pictures:
        with np.load(path) as kept:
            image, layout = kept["image"], str(kept["layout"])
        own = reader(layout)
        started = time.process_time()
        try:
            markers = own.extract(image)
        except Exception as error:
            count = len(own.layout.layer)
            xy_px, cov_px2 = np.full((count, 2), np.nan), np.full((count, 2, 2), np.nan)
            readings.append(ReadPicture(xy_px, cov_px2, np.zeros(count, np.uint8), float("nan"), repr(error)))
            continue
        ms = 1e3 * (time.process_time() - started)
        readings.append(ReadPicture(markers.xy_px, markers.cov_px2, np.asarray(markers.status), ms))
    Path(out).write_bytes(pickle.dumps([tuple(reading) for reading in readings]))


if __name__ == "__main__":
    main(*sys.argv[1:])
