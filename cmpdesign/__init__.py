"""Design, make and read multicolor continuous marker patterns (CMP) for vision-based tactile sensors.

Every command that ends by itself has its call:

    cmpdesign.init("mine"), build("mine.toml", "out"), check("mine.toml")
    design = cmpdesign.load("tac3d", layers=8)      a design; design.layout, design.check(), design.write("out")
    cmpdesign.size((1280, 960), (24, 18))           a design for a camera and its field of view
    cmpdesign.render(design.layout, noise=2)        a picture with its exact truth
    cmpdesign.verify("layout.json", "photo.png")    a verdict on a picture; extractor.Extractor reads without a verdict
    cmpdesign.track("layout.json", "a.mp4", "run.npz"), reconstruct, load_run, plot_history
    cmpdesign.open_sensor("thumb.toml", "index.toml")     sensors of a robot: the newest result, and what was dropped
    cmpdesign.dataset("plan.toml", "pressed"), extract, cmpdesign.data.load("pressed")
    cmpdesign.kerf, calibrate_camera, calibrate_pattern, evaluate, export_lerobot, export_zarr

The rooms of the package, each of which imports only rooms above it, left column first:

    patterns  graphs, numbering and positions      contact   objects pressed into the elastic layer
    design    validated parameters of a pattern    scene     rendered images with exact ground truth
    layout    markers, cells, edges; checks        proposal  a design for a camera
    files     layout.json, images, videos          tracking  markers of videos and cameras as tables
    products  drawings, lasers, molds, prints      evaluate  the article's experiments, simulated
    reading   layouts and pictures verified        runtime   sensors of a robot, opened once
                                                   data      data sets made on many machines
                                                   api, cli  the calls, and the command line

Public names are loaded at their first use, and this file imports nothing: until ``main`` runs, Ctrl-C ends in a
traceback.
"""

from __future__ import annotations

TYPE_CHECKING = False  # type checkers take this name for true, wherever it comes from
if TYPE_CHECKING:
    from typing import Any

    from cmpdesign.api.calibration import calibrate_camera as calibrate_camera
    from cmpdesign.api.calibration import calibrate_check as calibrate_check
    from cmpdesign.api.calibration import calibrate_pattern as calibrate_pattern
    from cmpdesign.api.calibration import calibrate_rig as calibrate_rig
    from cmpdesign.api.datasets import dataset as dataset
    from cmpdesign.api.datasets import extract as extract
    from cmpdesign.api.designs import Design as Design
    from cmpdesign.api.designs import load as load
    from cmpdesign.api.layouts import Layout as Layout
    from cmpdesign.api.layouts import build_layout as build_layout
    from cmpdesign.api.layouts import read_layout as read_layout
    from cmpdesign.api.making import build as build
    from cmpdesign.api.making import check as check
    from cmpdesign.api.making import init as init
    from cmpdesign.api.making import schema as schema
    from cmpdesign.api.making import templates as templates
    from cmpdesign.api.pictures import load_scene as load_scene
    from cmpdesign.api.pictures import render as render
    from cmpdesign.api.plots import plot_displacement as plot_displacement
    from cmpdesign.api.plots import plot_history as plot_history
    from cmpdesign.api.plots import plot_layout as plot_layout
    from cmpdesign.api.plots import plot_markers as plot_markers
    from cmpdesign.api.sequences import cameras as cameras
    from cmpdesign.api.sequences import open_source as open_source
    from cmpdesign.api.sequences import reconstruct as reconstruct
    from cmpdesign.api.sequences import recover_run as recover_run
    from cmpdesign.api.sequences import track as track
    from cmpdesign.api.verifying import Verifier as Verifier
    from cmpdesign.api.verifying import verify as verify
    from cmpdesign.api.workshop import calibrate_force as calibrate_force
    from cmpdesign.api.workshop import calibrate_gel as calibrate_gel
    from cmpdesign.api.workshop import evaluate as evaluate
    from cmpdesign.api.workshop import export_lerobot as export_lerobot
    from cmpdesign.api.workshop import export_zarr as export_zarr
    from cmpdesign.api.workshop import kerf as kerf
    from cmpdesign.errors import CmpDesignError as CmpDesignError
    from cmpdesign.errors import DesignError as DesignError
    from cmpdesign.errors import InputError as InputError
    from cmpdesign.errors import OutputError as OutputError
    from cmpdesign.files.layout_json import layout_to_json as layout_to_json
    from cmpdesign.files.layout_json import write_layout as write_layout
    from cmpdesign.inputs.cameras import CameraSettings as CameraSettings
    from cmpdesign.layout.checks import check_design as check_design
    from cmpdesign.products.drawing.svg import write_svg as write_svg
    from cmpdesign.proposal.sizing import size as size
    from cmpdesign.runtime.health import Health as Health
    from cmpdesign.runtime.opening import Sensors as Sensors
    from cmpdesign.runtime.opening import open_sensor as open_sensor
    from cmpdesign.runtime.result import SensorFrame as SensorFrame
    from cmpdesign.runtime.result import SensorFrames as SensorFrames
    from cmpdesign.runtime.sensor import LateError as LateError
    from cmpdesign.runtime.sensor import Sensor as Sensor
    from cmpdesign.runtime.zero import TouchedError as TouchedError
    from cmpdesign.tracking.export.runs import load_run as load_run
    from cmpdesign.tracking.jobs.options import ReadingOptions as ReadingOptions
    from cmpdesign.tracking.jobs.options import SequenceOptions as SequenceOptions
    from cmpdesign.tracking.jobs.options import ShapeOptions as ShapeOptions
    from cmpdesign.tracking.jobs.options import TrackOptions as TrackOptions

__version__ = "0.1.0"

_HOMES = {
    "CameraSettings": "cmpdesign.inputs.cameras",
    "CmpDesignError": "cmpdesign.errors",
    "Design": "cmpdesign.api.designs",
    "DesignError": "cmpdesign.errors",
    "Health": "cmpdesign.runtime.health",
    "InputError": "cmpdesign.errors",
    "LateError": "cmpdesign.runtime.sensor",
    "Layout": "cmpdesign.api.layouts",
    "OutputError": "cmpdesign.errors",
    "Sensor": "cmpdesign.runtime.sensor",
    "SensorFrame": "cmpdesign.runtime.result",
    "SensorFrames": "cmpdesign.runtime.result",
    "Sensors": "cmpdesign.runtime.opening",
    "ReadingOptions": "cmpdesign.tracking.jobs.options",
    "SequenceOptions": "cmpdesign.tracking.jobs.options",
    "ShapeOptions": "cmpdesign.tracking.jobs.options",
    "TouchedError": "cmpdesign.runtime.zero",
    "TrackOptions": "cmpdesign.tracking.jobs.options",
    "Verifier": "cmpdesign.api.verifying",
    "build": "cmpdesign.api.making",
    "build_layout": "cmpdesign.api.layouts",
    "calibrate_camera": "cmpdesign.api.calibration",
    "calibrate_check": "cmpdesign.api.calibration",
    "calibrate_force": "cmpdesign.api.workshop",
    "calibrate_gel": "cmpdesign.api.workshop",
    "calibrate_pattern": "cmpdesign.api.calibration",
    "calibrate_rig": "cmpdesign.api.calibration",
    "cameras": "cmpdesign.api.sequences",
    "check": "cmpdesign.api.making",
    "check_design": "cmpdesign.layout.checks",
    "dataset": "cmpdesign.api.datasets",
    "evaluate": "cmpdesign.api.workshop",
    "export_lerobot": "cmpdesign.api.workshop",
    "export_zarr": "cmpdesign.api.workshop",
    "extract": "cmpdesign.api.datasets",
    "init": "cmpdesign.api.making",
    "kerf": "cmpdesign.api.workshop",
    "layout_to_json": "cmpdesign.files.layout_json",
    "load": "cmpdesign.api.designs",
    "load_run": "cmpdesign.tracking.export.runs",
    "load_scene": "cmpdesign.api.pictures",
    "open_sensor": "cmpdesign.runtime.opening",
    "open_source": "cmpdesign.api.sequences",
    "plot_displacement": "cmpdesign.api.plots",
    "plot_history": "cmpdesign.api.plots",
    "plot_layout": "cmpdesign.api.plots",
    "plot_markers": "cmpdesign.api.plots",
    "read_layout": "cmpdesign.api.layouts",
    "reconstruct": "cmpdesign.api.sequences",
    "recover_run": "cmpdesign.api.sequences",
    "render": "cmpdesign.api.pictures",
    "schema": "cmpdesign.api.making",
    "size": "cmpdesign.proposal.sizing",
    "templates": "cmpdesign.api.making",
    "track": "cmpdesign.api.sequences",
    "verify": "cmpdesign.api.verifying",
    "write_layout": "cmpdesign.files.layout_json",
    "write_svg": "cmpdesign.products.drawing.svg",
}

__all__ = sorted([*_HOMES, "__version__"])


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'cmpdesign' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
