"""A frozen corpus: digests of the programs' files and results, to compare two states of the code.

    .venv/bin/python tools/frozen_corpus.py before.txt     # on one commit
    .venv/bin/python tools/frozen_corpus.py after.txt      # on another one, on the same machine
    diff before.txt after.txt

It builds every product of every template, renders scenes, extracts them with every preset, tracks, reconstructs and
evaluates. Only documented names and commands are used, so that the internal code may be moved.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from cmpdesign import build_layout, load, write_layout
from cmpdesign.scene import (
    Blob,
    Camera,
    Damage,
    Dent,
    Glare,
    Light,
    Optics,
    Press,
    Scene,
    Scratch,
    Sensor,
    Twist,
    composed,
    render,
)
from extractor import Extractor, Tracker, load_layout

TEMPLATES = ("digit", "elliptical", "gelsight-mini", "honeycomb", "round", "square", "tac3d")
PRODUCTS = "svg,layout,preview,laser,print,report"
SOLIDS = ("digit", "round", "tac3d")  # molds and meshes of one crown, one round and one plain pad
PATTERNS = ("honeycomb", "round", "elliptical")
PRESETS = ("balanced", "accurate")


def digest(value: Any) -> str:
    """SHA-256 of an array, of bytes, or of a value's text."""
    if isinstance(value, np.ndarray):
        data = str((value.dtype.str, value.shape)).encode() + np.ascontiguousarray(value).tobytes()
    else:
        data = value if isinstance(value, bytes) else repr(value).encode()
    return hashlib.sha256(data).hexdigest()[:16]


def command(*arguments: str) -> int:
    """Run ``cmpdesign`` in this process; its exit code."""
    from typer.testing import CliRunner

    from cmpdesign.cli import app

    return CliRunner().invoke(app, list(arguments)).exit_code


def folder_digests(folder: Path) -> Iterator[tuple[str, str]]:
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            yield str(path.relative_to(folder)), digest(path.read_bytes())


def builds(folder: Path) -> Iterator[tuple[str, str]]:
    for name in TEMPLATES:
        made = folder / "made" / name
        products = PRODUCTS + (",mold,mesh" if name in SOLIDS else "")
        yield f"build {name} exit", str(command("build", name, "-o", str(made), "--only", products))
        for path, value in folder_digests(made):
            yield f"build {name} {path}", value


def scenes(pattern: str, layers: int) -> dict[str, Scene]:
    layout = build_layout(load(pattern, {"layers": str(layers)}))
    camera = Camera(pitch_px=20, rotation_deg=7.3, tilt_deg=12)
    noisy = Sensor(noise=2)

    def scene(**parts: Any) -> Scene:
        return Scene(
            **{"layout": layout, "camera": camera, "optics": Optics(1.0), "sensor": noisy, "seed": 5, **parts}
        )

    bent = composed(Press(radius_mm=5, depth_mm=0.9), Twist(radius_mm=6, angle_deg=15))
    return {
        "plain": scene(),
        "pressed": scene(surface=bent),
        "dent": scene(surface=composed(Dent(radius_mm=5, depth_mm=1))),
        "steep": scene(camera=Camera(pitch_px=20, rotation_deg=100, tilt_deg=58)),
        "small": scene(camera=Camera(pitch_px=11, rotation_deg=40)),
        "blurred": scene(optics=Optics(2.5)),
        "dim": scene(light=Light(rgb=(0.5, 0.4, 0.3), gradient=(0.4, 0.2), vignetting=0.4)),
        "mirrored": scene(camera=Camera(pitch_px=20, rotation_deg=200, mirrored=True)),
        "missing": scene(damage=Damage(missing_share=0.08)),
        "no white": scene(damage=Damage(missing_cells=(layout.reference_cell,))),
        "bled": scene(damage=Damage(bleed_mm=0.06)),
        "dirty": scene(
            damage=Damage(
                missing_share=0.03,
                blobs=(Blob((3.0, 2.0), 1.2, (90, 70, 40)), Blob((-4.0, -3.0), 1.6, (20, 20, 20))),
                scratches=(Scratch((-15.0, 4.0), (15.0, 7.0), 0.9),),
                glare=(Glare((250.0, 300.0), 28.0),),
            )
        ),
        "jpeg": scene(sensor=Sensor(noise=3, jpeg_quality=70)),
    }


def marker_digests(label: str, markers: Any) -> Iterator[tuple[str, str]]:
    for name in ("xy_px", "cov_px2", "status", "virtual_xy_px", "virtual_cov_px2", "virtual_status"):
        yield f"{label} {name}", digest(getattr(markers, name))
    reason = markers.reason.name if markers.reason else "-"
    origin = markers.origin.name if markers.origin is not None else "-"
    yield f"{label} found", f"{int((markers.status == 1).sum())} {markers.mirrored} {reason} {origin}"


def reads(folder: Path) -> Iterator[tuple[str, str]]:
    for pattern in PATTERNS:
        for name, scene in scenes(pattern, 9).items():
            rendered = render(scene)
            yield f"render {pattern} {name}", digest(rendered.image)
            yield f"truth {pattern} {name}", digest(rendered.truth.marker_xy_px)
            path = folder / f"{pattern}.json"
            write_layout(scene.layout, path)
            for preset in PRESETS:
                markers = Extractor(load_layout(path), preset, side="either").extract(rendered.image)
                yield from marker_digests(f"extract {pattern} {name} {preset}", markers)


def tracks(folder: Path) -> Iterator[tuple[str, str]]:
    layout = folder / "made" / "tac3d" / "layout.json"
    frames = folder / "frames"
    yield (
        "sequence exit",
        str(command("render", str(layout), "--scene", "press-and-twist", "-o", str(frames))),
    )
    from cv2 import imread

    for warm in (True, False):
        tracker = Tracker(load_layout(layout), warm=warm)
        for i, path in enumerate(sorted(frames.glob("*.png"))):
            tracked = tracker.track(imread(str(path)), time_s=i / 15)
            yield from marker_digests(f"track warm={warm} {i} {tracked.status.name}", tracked.markers)


def shapes(folder: Path) -> Iterator[tuple[str, str]]:
    layout = folder / "made" / "tac3d" / "layout.json"
    scene = Path(__file__).parent.parent / "templates" / "scenes" / "tac3d-binocular.toml"
    rest = folder / "rest.toml"
    rest.write_text(scene.read_text(encoding="utf-8").replace("press_mm = 0.8", "press_mm = 0.0"), "utf-8")
    views = folder / "views"
    views.mkdir()
    for name, file in (("0", rest), ("1", scene)):
        exit_code = command("render", str(layout), "--scene", str(file), "-o", str(views / f"{name}.png"))
        yield f"views {name} exit", str(exit_code)
    run = folder / "run.npz"
    arguments = ("reconstruct", str(layout), str(scene), "0", str(views), "-o", str(run), "--fps", "10")
    yield "reconstruct exit", str(command(*arguments))
    with np.load(run, allow_pickle=False) as columns:
        for name in sorted(columns.files):
            if not name.endswith("_ms"):
                yield f"reconstruct {name}", digest(columns[name])


def evaluations(folder: Path) -> Iterator[tuple[str, str]]:
    import json

    for name, options in (
        ("precision", ("--trials", "1")),
        ("reliability", ("--trials", "1")),
        ("angles", ()),
    ):
        out = folder / name
        yield f"evaluate {name} exit", str(command("evaluate", name, "-o", str(out), *options))
        report = json.loads((out / "report.json").read_text(encoding="utf-8"))
        yield f"evaluate {name}", digest(json.dumps(without_times(report), sort_keys=True))


def without_times(value: Any) -> Any:
    """A report without the values that differ from run to run."""
    if isinstance(value, dict):
        return {
            k: without_times(v) for k, v in value.items() if not k.endswith(("_ms", "_s", "digest", "code"))
        }
    return [without_times(item) for item in value] if isinstance(value, list) else value


def main(target: str) -> None:
    os.environ.setdefault("COLUMNS", "120")
    with tempfile.TemporaryDirectory() as name, Path(target).open("w", encoding="utf-8") as file:
        for part in (builds, reads, tracks, shapes, evaluations):
            for label, value in part(Path(name)):
                file.write(f"{value:16}  {label}\n")
            file.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
