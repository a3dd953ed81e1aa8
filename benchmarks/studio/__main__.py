"""The studio's page: time to its first answer, from a changed field to the drawing, bytes of its own files.

The times are those of requests to a running ``cmpdesign studio`` on this machine.
"""

from __future__ import annotations

import gzip
import http.client
import json
import resource
import subprocess
import sys
import time
from urllib.parse import urlsplit

import numpy as np

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import TEXT, Table
from cmpdesign.studio.app import PAGE

LAYERS, CHANGES = 20, 200


def measure() -> Shown:
    """One row a figure."""
    began_s = time.perf_counter()
    command = [sys.executable, "-m", "cmpdesign", "studio", "--port", "0", "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    with process.stdout as printed:
        try:
            address = urlsplit(printed.readline().strip())
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
        finally:
            process.terminate()
            process.wait(20)
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


main = Experiment("studio", measure)

if __name__ == "__main__":
    raise SystemExit(main())
