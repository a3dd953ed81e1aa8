"""Speed of making and reading data sets, on one and on two workers, and the size of data sets.

"rendered": the plan template pressed-objects: every frame is drawn, its contact solved, rendered, encoded as JPEG and
read. "extracted": the same pictures as videos (FFV1, 640 x 480 px), decoded and read. Frames a second are those of the
whole command, the start of its workers included; "efficiency" is the rate on two workers over twice that on one. Core
milliseconds a frame depend little on other load of the machine; "in core time" is the core time on one worker over that
on two. Sizes are those of the shards' files. "start" and "a shard without work" are times of the scheduler itself. The
estimate for 10 million frames multiplies core time and sizes; its prices are assumptions, stated beside it.
"""

from __future__ import annotations

import resource
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks.frame.conditions import conditions_text
from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.frame.published import Page
from benchmarks.frame.table import TEXT, Table
from cmpdesign.data import load
from cmpdesign.data.run import ShardRange, extract_markers, make_dataset
from cmpdesign.data.schedule.schedulers import Scheduler
from cmpdesign.data.schedule.schedulers import results as results_of
from cmpdesign.data.videos.extraction import FrameReading
from cmpdesign.design.templates import find_plan
from cmpdesign.files.images import to_png
from cmpdesign.tracking.export.video import Codec, CodecVideo
from extractor import load_layout

FRAMES_A_SHARD, SHARDS, QUICK_SHARDS = 8, 32, 2
VIDEOS, REPEATS = 2, 32  # every picture is in the videos several times
EMPTY_SHARDS = 200
MILLIONS = 10
CORE_HOUR_USD, GB_MONTH_USD = 0.04, 0.023  # assumed: a spot core and object storage of a large provider, 2025


@dataclass(frozen=True)
class Rates:
    """Frames a second, and core milliseconds a frame, on one and on two workers."""

    what: str
    frames: int
    one: float
    two: float
    ms_one: float
    ms_two: float

    @property
    def efficiency(self) -> float:
        return self.two / (2 * self.one)


@dataclass(frozen=True)
class Spent:
    """The time of some work: time, and the time of all cores, of this process and of its workers."""

    seconds: float
    core_seconds: float


@dataclass(frozen=True)
class Overhead:
    """A scheduler without work: time to start, and for each shard."""

    scheduler: str
    start_s: float
    ms_a_shard: float


@dataclass(frozen=True)
class Sizes:
    """Bytes of a frame: encoded as JPEG, as PNG, and of its row in the table."""

    jpeg: float
    png: float
    table: float


def spent(work: Callable[[], object]) -> Spent:
    started, before = time.perf_counter(), core_seconds()
    work()
    return Spent(time.perf_counter() - started, core_seconds() - before)


def core_seconds() -> float:
    """Of this process, and of workers that have ended."""
    kinds = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    used = [resource.getrusage(kind) for kind in kinds]
    return sum(each.ru_utime + each.ru_stime for each in used)


def rates_of(what: str, frames: int, one: Spent, two: Spent) -> Rates:
    return Rates(
        what,
        frames,
        frames / one.seconds,
        frames / two.seconds,
        1e3 * one.core_seconds / frames,
        1e3 * two.core_seconds / frames,
    )


def small_plan(folder: Path, shards: int) -> Path:
    """The plan template with few frames."""
    text = find_plan("pressed-objects").read_text(encoding="utf-8")
    lines = [
        f"frames = {shards * FRAMES_A_SHARD}"
        if line.startswith("frames = ")
        else f"frames_a_shard = {FRAMES_A_SHARD}"
        if line.startswith("frames_a_shard = ")
        else line
        for line in text.splitlines()
    ]
    path = folder / "plan.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def measure_rendering(folder: Path, shards: int) -> Rates:
    """The plan made by one and by two workers; it is left in the folder "data1"."""
    plan, frames = small_plan(folder, shards), shards * FRAMES_A_SHARD
    times = [
        spent(
            lambda count=count: make_dataset(  # type: ignore[misc]
                plan, folder / f"data{count}", ShardRange(), Scheduler(workers=count)
            )
        )
        for count in (1, 2)
    ]
    if (folder / "data1/manifest.json").read_bytes() != (folder / "data2/manifest.json").read_bytes():
        raise RuntimeError("one and two workers made different bytes")
    return rates_of("rendered", frames, times[0], times[1])


def write_videos(folder: Path, shards: int) -> list[str]:
    """The pictures of the data set as videos."""
    images = [frame.image for frame in load(folder / "data1").frames(range(min(shards, 8)))]
    paths = [folder / f"video{number}.mkv" for number in range(VIDEOS)]
    for path in paths:
        video = CodecVideo(path, Codec("ffv1", "bgr0", {"g": "1"}), 30.0)
        for image in images * REPEATS:
            video.add(image)
        video.close()
    return [str(path) for path in paths]


def measure_extraction(folder: Path, shards: int) -> Rates:
    videos, layout = write_videos(folder, shards), load_layout(folder / "data1/layouts/tac3d.json")
    times, frames = [], 0
    for count in (1, 2):
        out = folder / f"markers{count}"
        options = (FrameReading(), Scheduler(workers=count), 4 * FRAMES_A_SHARD)
        times.append(spent(lambda: extract_markers(layout, videos, out, *options)))  # noqa: B023
        frames = len(load(out))
    return rates_of("extracted", frames, times[0], times[1])


def measure_sizes(folder: Path) -> Sizes:
    frames = load(folder / "data1")
    tables = sum(path.stat().st_size for path in (folder / "data1/tables").iterdir())
    images = [(len(frame.image_bytes), len(to_png(frame.image))) for frame in frames.frames([0, 1])]
    jpeg, png = (sum(sizes) / len(images) for sizes in zip(*images, strict=True))
    return Sizes(jpeg, png, tables / len(frames))


def do_nothing(number: int) -> int:
    return number


def measure_overhead(name: str, scheduler: Scheduler) -> Overhead:
    start_s = spent(lambda: list(results_of(do_nothing, [0, 1], scheduler))).seconds
    many_s = spent(lambda: list(results_of(do_nothing, range(EMPTY_SHARDS), scheduler))).seconds
    return Overhead(name, start_s, max(0.0, 1e3 * (many_s - start_s) / EMPTY_SHARDS))


def measure_overheads() -> list[Overhead]:
    """The pool of this machine, and a dask cluster of two workers on it, whose own start is not counted."""
    from distributed import LocalCluster

    found = [measure_overhead("local, 2 workers", Scheduler(workers=2))]
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        found.append(measure_overhead("dask, 2 workers", Scheduler(cluster.scheduler_address)))
    return found


def sum_on_paper(results: Mapping[str, Any]) -> dict[str, float]:
    """Core hours, GB and USD of 10 million frames."""
    hours = MILLIONS * 1e6 * results["rates"][0]["ms_one"] / 3.6e6
    size_gb = MILLIONS * 1e6 * (results["bytes"]["jpeg"] + results["bytes"]["table"]) / 1e9
    return {
        "hours": hours,
        "size_gb": size_gb,
        "compute_usd": hours * CORE_HOUR_USD,
        "store_usd_month": size_gb * GB_MONTH_USD,
    }


def tables(results: Mapping[str, Any]) -> dict[str, Table]:
    """The tables of the terminal and of docs/how-to/datasets.md, by name."""
    rates = [
        (row["what"], row["one"], row["two"], row["efficiency"], ms, on_two, ms / on_two)
        for row, ms, on_two in ((row, row["ms_one"], row["ms_two"]) for row in results["rates"])
    ]
    columns = {"frames a second": TEXT, "one worker": ".1f", "two workers": ".1f", "efficiency": ".2f"}
    columns |= {"core ms a frame": ".0f", "on two workers": ".0f", "in core time": ".2f"}
    names = {"jpeg": "picture, JPEG of quality 95, 4:4:4", "png": "the same as PNG"}
    names["table"] = "row of the table: truth, markers, covariances, parameters"
    sizes = [(text, results["bytes"][name] / 1e3) for name, text in names.items()]
    starts = [(row["scheduler"], row["start_s"], row["ms_a_shard"]) for row in results["overheads"]]
    paper = sum_on_paper(results)
    on_cores = ", ".join(f"{paper['hours'] / count:,.0f} on {count:,}" for count in (64, 1000))
    sums = [
        ("core hours", f"{paper['hours']:,.0f}; so many hours on cores: {on_cores}"),
        ("JPEG and tables", f"{paper['size_gb'] / 1e3:.2f} TB"),
        (f"computed, at {CORE_HOUR_USD} USD a core hour", f"{paper['compute_usd']:,.0f} USD"),
        (f"kept, at {GB_MONTH_USD} USD a GB and month", f"{paper['store_usd_month']:,.0f} USD a month"),
    ]
    return {
        "rates": Table("", columns, rates),
        "sizes": Table("", {"a frame": TEXT, "kB": ".0f"}, sizes),
        "starts": Table(
            "", {"scheduler": TEXT, "start, s": ".1f", "a shard without work, ms": ".0f"}, starts
        ),
        "sums": Table("", {f"{MILLIONS} million frames": TEXT, "": TEXT}, sums),
    }


def page(measured: Mapping[str, Any]) -> Page:
    """The blocks of the page."""
    found = {name: table.markdown() for name, table in tables(measured).items()}
    caption = f"Measured: {conditions_text(measured['conditions'])}"
    parts = (found["rates"], found["sizes"], found["starts"], caption)
    return Page({"datasets": "\n\n".join(parts), "datasets-sum": found["sums"]})


def measure(quick: bool = False) -> Shown:
    """Rates, sizes and overheads.

    Args:
        quick: few frames.
    """
    shards = QUICK_SHARDS if quick else SHARDS
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rates = [measure_rendering(folder, shards), measure_extraction(folder, shards)]
        sizes = measure_sizes(folder)
    results = {
        "rates": [asdict(one) | {"efficiency": one.efficiency} for one in rates],
        "bytes": asdict(sizes),
        "overheads": [asdict(one) for one in measure_overheads()],
    }
    yield from tables(results).values()
    return Found(results)


main = Experiment("datasets", measure, page)
main.run_as(__name__)
