"""Measurements of one machine, one pad, one sensor: ``kerf``, ``calibrate``, ``evaluate`` of the command line."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cmpdesign import documents
from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.inputs.files import MAX_PIXELS, require_suffix
from cmpdesign.inputs.options import Preset, Response, Written

if TYPE_CHECKING:
    from cmpdesign.api.layouts import AnyLayout
    from cmpdesign.design.design import Design as Parameters


def kerf(
    coupon: str | Path,
    photo: str | Path,
    *,
    face: Literal["front", "back"] | None = None,
    response: Response | None = None,
    max_pixels: int = MAX_PIXELS,
) -> documents.reading.KerfDocument | documents.reading.GridDocument:
    """Measure the kerf on a cut coupon.

    Of a grid of settings, those that cut through are read.

    >>> found = cmpdesign.kerf("made/laser/coupon.json", "scan.png")
    >>> [(one.name, one.kerf_x_mm, one.kerf_y_mm) for one in found.patches]
    >>> cmpdesign.kerf("made/laser/grid.json", "grid.jpg").best

    Args:
        coupon: the coupon.json or grid.json that build wrote.
        photo: a photo or scan of the cut piece; of a grid, with loose pieces pushed out.
        face: the face whose openings are seen; None: the face with the narrower openings, by the taper.
        response: response of the camera; None: the response in the file, else sRGB, corrected by the edges.
        max_pixels: see ``SequenceOptions``.

    Raises:
        CmpDesignError: a file that cannot be read, or a picture that does not show the coupon or the grid.
    """
    from cmpdesign.files.images import read_image
    from cmpdesign.products.laser.coupon.design import load_coupon
    from cmpdesign.products.laser.coupon.picture import PhotoError
    from cmpdesign.products.laser.grid.reading import GridReading, read_cut

    cut, image = load_coupon(Path(coupon)), read_image(photo, max_pixels, gray=True)
    try:
        found = read_cut(cut, Path(photo), image, response, face)
    except PhotoError as error:
        raise CmpDesignError(f"{photo}: {error}") from None
    if isinstance(found, GridReading):
        return documents.reading.GridDocument.of(found, **found.to_json())
    return documents.reading.KerfDocument.of(found, **found.to_json(cut))


def calibrate_gel(
    layout: AnyLayout,
    rig: str | Path,
    output: Annotated[str | Path | None, Written(needed=True)] = None,
    *,
    margin_mm: Annotated[float, Written(metavar="MM")] = 0.0,
) -> documents.reading.CalibrateGelDocument:
    """Compute a pad's elastic response once, so that forces can be read from its displacement.

    >>> gel = cmpdesign.calibrate_gel("layout.json", "sensor.toml", "gel.npz").found
    >>> reader = extractor.contact.ContactReader("layout.json", gel, young_mpa=0.3)

    Args:
        layout: the pad's layout.json; or a layout, a ``Reference``, the JSON object of a layout file.
        rig: TOML file with [elastomer]: thickness_mm, poisson, marker_depth_mm.
        output: file to write: .npz; None: none.
        margin_mm: width of the gel beyond the layout's outline.

    Raises:
        CmpDesignError, extractor.ExtractorError: a file that cannot be read, or a value out of range.
        OutputError: the file cannot be written.
    """
    import io

    from cmpdesign.api.layouts import reference_from
    from cmpdesign.contact.finite_block import make_gel
    from cmpdesign.files.atomic import write_file
    from cmpdesign.tracking.marker_depth import read_elastomer

    require_suffix("output", output, ".npz")
    gel = make_gel(reference_from(layout), read_elastomer(Path(rig)), margin_mm=margin_mm)
    if output is not None:
        stream = io.BytesIO()
        gel.write(stream)
        write_file(Path(output), stream.getvalue())
    return documents.reading.CalibrateGelDocument.of(
        gel, written=str(output or ""), markers=len(gel.matrix) // 3, loads=len(gel.loads_mm)
    )


def calibrate_force(run: str | Path, weights: str | Path) -> documents.reading.CalibrateForceDocument:
    """Fit Young's modulus and the force at rest to known weights, best on a ball.

    >>> cmpdesign.calibrate_force("run.npz", "weights.csv").young_mpa

    Args:
        run: the .npz file of a reconstruction with contact.
        weights: CSV file, columns frame and mass_g: 3 or more different weights, each on the pad in its frame.

    Raises:
        CmpDesignError: a file that cannot be read, a run without forces, or weights that do not determine the modulus.
    """
    import numpy as np

    from cmpdesign.contact.force_scale import fit_force_scale, parse_weights
    from cmpdesign.files.npz import NpzError, read_npz
    from cmpdesign.inputs.files import read_text
    from cmpdesign.tracking.export.runs import load_run
    from extractor.contact import ContactReason

    load_run(run)
    names = ("frame", "contact_reason", "force_n", "force_cov_n2", "young_mpa")
    try:
        arrays = read_npz(run, *names)
    except NpzError:
        raise CmpDesignError(f"{run} holds no forces; write it with reconstruct --contact") from None
    known = parse_weights(read_text(Path(weights)), str(weights))
    missing = np.setdiff1d(known.frame, arrays["frame"])
    if len(missing):
        raise CmpDesignError(f"{weights}: frame {missing[0]} is not in {run}")
    at = np.searchsorted(arrays["frame"], known.frame)
    good = arrays["contact_reason"][at] == ContactReason.NONE
    force = np.where(good, -arrays["force_n"][at, 2], np.nan)
    scale = fit_force_scale(known, force, arrays["force_cov_n2"][at, 5], float(arrays["young_mpa"]))
    return documents.reading.CalibrateForceDocument.of(scale)


def evaluate(
    experiment: Literal["precision", "response", "reliability", "angles", "designs"],
    output: Annotated[str | Path, Written(metavar="DIR")],
    designs: Mapping[str, Parameters] | Sequence[str | Path] = (),
    *,
    trials: Annotated[int | None, Written(least=1)] = None,
    seed: Annotated[int, Written(least=0)] = 0,
    workers: Annotated[int | None, Written(least=1)] = None,
    sensor: Annotated[str, Written(metavar="NAME|FILE")] = "tac3d",
    preset: Preset = "balanced",
) -> documents.runs.EvaluateDocument:
    """Run an experiment on a simulated sensor, as the commands ``evaluate NAME`` do.

    >>> cmpdesign.evaluate("designs", "compared", {"ten": load("tac3d"), "eight": load("tac3d", layers=8)})

    Args:
        experiment: the command's name.
        output: folder for the report and the journal; or of an interrupted run, which is continued.
        designs: name -> design, or names of templates and TOML files; for "designs" only.
        trials: places for every contact, object or mode; None: the command's default.
        seed: seed of all random values: the same seed gives the same figures.
        workers: number of processes; None: one for each core.
        sensor: simulated sensor: a template's name, or a TOML file.
        preset: see ``SequenceOptions``.

    Returns:
        The written files, and the JSON object of report.json.

    Raises:
        CmpDesignError: a value out of range, two designs of one name, or the folder holds a run under other
            conditions.
        OutputError: a file cannot be written; finished trials are kept.
    """
    from cmpdesign.evaluation import experiments
    from cmpdesign.evaluation.defaults import PRESETS, USUAL_TRIALS
    from cmpdesign.evaluation.designs import design_entries
    from cmpdesign.evaluation.runner import RunOptions
    from cmpdesign.evaluation.simulated.sensor import load_sensor

    if preset not in PRESETS:
        raise CmpDesignError(f"preset {preset}: unknown; there are {', '.join(PRESETS)}")
    compared = design_entries(_by_name(designs)) if experiment == "designs" else ()
    found = experiments.find_experiment(experiment, compared)
    count = USUAL_TRIALS[experiment] if trials is None else trials
    options = RunOptions(count, seed, load_sensor(sensor).text, preset, workers or os.cpu_count() or 1)
    report, files = experiments.run_experiment(found, options, Path(output))
    return documents.runs.EvaluateDocument(written=tuple(map(str, files)), report=report)


def _by_name(designs: Mapping[str, Parameters] | Sequence[str | Path]) -> Mapping[str, Parameters]:
    """Designs under the stems of their names."""
    from cmpdesign.design.design import load_design

    if isinstance(designs, Mapping):
        return designs
    loaded: dict[str, Parameters] = {}
    for given in designs:
        name = Path(given).stem
        if name in loaded:
            raise CmpDesignError(f"two designs are called {name!r}; rename one of the files")
        loaded[name] = load_design(given)
    return loaded


def export_lerobot(
    runs: Sequence[str | Path],
    output: Annotated[str | Path, Written(metavar="FOLDER")],
    *,
    task: str = "contact",
    fps: Annotated[float | None, Written(above=0)] = None,
    robot: str | None = None,
    images: Annotated[Sequence[str | Path], Written(metavar="SOURCE")] = (),
    max_pixels: int = MAX_PIXELS,
) -> documents.runs.ExportDocument:
    """Write a data set that LeRobot loads: displacement, position and status of every marker, and images if given.

    Args:
        runs: files of track or reconstruct, .npz; each file is an episode.
        output: data set to write; a new folder.
        task: task that the runs show, in words.
        fps: frames per second; None: from the runs' times.
        robot: type of the robot; None: none.
        images: video or folder of images of a RUN; one for each, in order.
        max_pixels: see ``SequenceOptions``.

    Raises:
        CmpDesignError: a library is missing, or the runs or their images cannot be used together.
        OutputError: the data set cannot be written, or the folder exists.
    """
    from cmpdesign.tracking.export.lerobot import LeRobotDataSet, write_lerobot
    from cmpdesign.tracking.export.runs import frames_per_second, require_one_kind, tidy_fps, uneven_times

    if fps is not None and not 0 < fps < float("inf"):
        raise CmpDesignError(f"{parameter('fps')} is {fps:g}; expected a number above 0")
    paths = _paths(runs)
    require_one_kind(paths)
    rate = frames_per_second(paths) if fps is None else tidy_fps(fps)
    about = LeRobotDataSet(rate, task, robot, tuple(map(str, images)), max_pixels)
    frames = write_lerobot(paths, Path(output), about)
    return documents.runs.ExportDocument.of(
        uneven_times(paths, rate),
        kind="lerobot",
        written=str(output),
        episodes=len(paths),
        frames=frames,
        fps=rate,
    )


def export_zarr(
    runs: Sequence[str | Path],
    output: Annotated[str | Path, Written(metavar="FOLDER")],
    *,
    images: Annotated[Sequence[str | Path], Written(metavar="SOURCE")] = (),
    max_pixels: int = MAX_PIXELS,
) -> documents.runs.ExportDocument:
    """Write a replay buffer in the form of Diffusion Policy: the frames of all runs, and meta/episode_ends.

    Args:
        runs, images, max_pixels: see ``export_lerobot``.
        output: buffer to write: a new .zarr folder.

    Raises:
        CmpDesignError, OutputError: see ``export_lerobot``.
    """
    from cmpdesign.tracking.export.zarr_buffer import write_zarr

    require_suffix("output", output, ".zarr")
    paths = _paths(runs)
    frames = write_zarr(paths, Path(output), tuple(map(str, images)), max_pixels)
    return documents.runs.ExportDocument.of(
        (), kind="zarr", written=str(output), episodes=len(paths), frames=frames, fps=None
    )


def _paths(runs: Sequence[str | Path]) -> list[Path]:
    """The files; a single name would be split into letters.

    Raises:
        CmpDesignError: one name instead of a list.
    """
    if isinstance(runs, str | Path):
        raise CmpDesignError(f"runs is {str(runs)!r}; give a list of files, as [{str(runs)!r}]")
    return [Path(run) for run in runs]
