"""The studio's page: time to its first answer, from a changed field to the drawing, bytes of its files, frames shown.

The times are those of requests to a running ``cmpdesign studio`` on this machine. With an installed Chromium, frames of
640 x 480 px and 331 markers are shown by the part Touch: of a file that stands for the browser's camera, and of
``view`` over a video with one view, and with two views, whose surface and force are shown. "frames/s" is the source's
rate; "read/s" the rate at which the reader gives results; "shown/s" counts the frames whose number stands on the page
at an animation frame of the browser; "longest gap" is the time between two of these. "server ms" and "browser ms" are
the processor time of a shown frame, of all processes of each; Chromium draws without a graphics card. Videos are MJPG:
4:2:2 as cameras send it, 4:2:0 as most files have it. A camera that is exactly as fast as the limit is shown at that
rate only if no frame is lost, so each source also runs twice as fast.
"""

from __future__ import annotations

import gzip
import http.client
import json
import resource
import time
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.frame.published import Page
from benchmarks.frame.table import TEXT, Table
from benchmarks.studio.page import chromium, served
from benchmarks.studio.shown import SHOWN, shown_rows
from cmpdesign.studio.app import PAGE

LAYERS, CHANGES, SECONDS, QUICK_SECONDS = 20, 200, 10.0, 3.0


def measure(quick: bool = False) -> Shown:
    """One row a figure, then the frames that are shown.

    Args:
        quick: frames are shown for few seconds.
    """
    began_s = time.perf_counter()
    with served() as printed:
        address = urlsplit(printed)
        connection = http.client.HTTPConnection(str(address.hostname), address.port)
        connection.request("GET", f"/?{address.query}")
        cookie = str(connection.getresponse().getheader("set-cookie")).partition(";")[0]
        first_s = time.perf_counter() - began_s
        times_ms = []
        for change in range(CHANGES):
            fields = {"pattern": "honeycomb", "layers": LAYERS, "pitch_mm": 1 + change / CHANGES}
            start_s = time.perf_counter()
            connection = http.client.HTTPConnection(str(address.hostname), address.port)
            connection.request("POST", "/api/design", json.dumps({"fields": fields}), {"cookie": cookie})
            answer = connection.getresponse()
            assert answer.status == 200 and json.loads(answer.read())["svg"]
            times_ms.append(1e3 * (time.perf_counter() - start_s))
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    size = sum(len(gzip.compress(path.read_bytes())) for path in PAGE.iterdir())
    p50, p95 = np.percentile(times_ms, [50, 95])
    changes = f"changed field to drawing, {LAYERS} layers, {CHANGES} changes, ms"
    rows = [
        ("start to first answer, s", first_s),
        (f"{changes}: median", p50),
        (f"{changes}: 95 %", p95),
        ("processor time of the server for all of this, s", used.ru_utime + used.ru_stime),
        ("the page's own files, compressed, kB", size / 1e3),
    ]
    yield Table("studio", {"figure": TEXT, "value": ".2f"}, rows)
    if chromium() is None:
        yield "no Chromium is installed: frames on the page are not counted"
        return None
    shown = Table("frames on the page", SHOWN, list(shown_rows(QUICK_SECONDS if quick else SECONDS)))
    yield shown
    return Found({"shown": shown.records()})


def page(results: dict[str, Any]) -> Page:
    """The table of docs/how-to/studio.md."""
    rows = [tuple(row[name] for name in SHOWN) for row in results["shown"]]
    machine = f"Machine: {results['conditions']['cpu']}, of which other programs have their share, too."
    return Page({"studio": f"{Table('', SHOWN, rows).markdown()}\n\n{machine}"})


main = Experiment("studio", measure, page)
main.run_as(__name__)
