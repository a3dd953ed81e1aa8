"""Every command is one call: the calls have the results of the commands, and accept paths and objects."""

from __future__ import annotations

import ast
import json
import pydoc
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest

import cmpdesign
import extractor
from cmpdesign.files.images import ImageFileError
from cmpdesign.layout.build import build_layout as plain_layout
from extractor import Extractor, LayoutError, Tracker
from tests.support.command import commands, run

ROOT = Path(__file__).parents[3]
NOT_CALLS = {"serve", "studio", "view"}  # `open_sensor` for viewers; of a page


@pytest.fixture(scope="module")
def design() -> cmpdesign.Design:
    return cmpdesign.load("honeycomb", layers=3, pitch_mm="60mil")


@pytest.fixture(scope="module")
def image(design: cmpdesign.Design) -> np.ndarray:
    return cmpdesign.render(design.layout, pitch_px=30, rotation_deg=20, noise=1).image


def test_every_command_has_a_documented_call() -> None:
    for words, _ in commands():
        name = " ".join(words)
        if name in NOT_CALLS:
            continue
        # "evaluate precision" is a command of the call "evaluate"
        call = getattr(cmpdesign, "_".join(words), None) or getattr(cmpdesign, words[0])
        assert callable(call) and call.__doc__, name


def test_type_checkers_and_dir_know_every_name() -> None:
    tree = ast.parse((ROOT / "cmpdesign" / "__init__.py").read_text(encoding="utf-8"))
    (checked,) = (node for node in tree.body if isinstance(node, ast.If))
    told = {
        alias.asname: (node.module, alias.name)
        for node in checked.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if node.module != "typing"
    }
    assert sorted([*told, "__version__"]) == dir(cmpdesign) == list(cmpdesign.__all__)
    for name, (module, there) in told.items():
        assert getattr(cmpdesign, name) is getattr(sys.modules[str(module)], there)
    assert set(extractor.__all__) == set(dir(extractor))


def test_the_package_is_light() -> None:
    code = "import sys, cmpdesign; dir(cmpdesign); print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert not {"numpy", "cv2", "pydantic", "typer"} & set(loaded.stdout.split())


def test_a_design_is_loaded_with_changes_of_any_kind() -> None:
    design = cmpdesign.load("tac3d", {"laser.kerf_mm": 0.14}, layers=8, palette={"red": "#ff0000"})
    assert (design.layers, design.laser.kerf_mm, design.palette.red) == (8, 0.14, "#ff0000")
    assert design.palette.blue == cmpdesign.load("tac3d").palette.blue
    wide = design.changed(pitch_mm=None, width_mm="30mm")
    assert wide.layout.size_mm[0] == pytest.approx(30) and design.pitch_mm is not None
    assert cmpdesign.load("tac3d", layers=None, width_mm=30).layers is None
    assert design == cmpdesign.Design(**dict(design)) and design.layout is design.layout
    with pytest.raises(cmpdesign.DesignError, match="laser"):
        cmpdesign.load("tac3d", layers=8).changed(lasers={})
    with pytest.raises(cmpdesign.DesignError, match="layers"):
        cmpdesign.load("tac3d", layers=-1)


def test_write_and_check_do_what_build_and_check_do(design: cmpdesign.Design, tmp_path: Path) -> None:
    arguments = ("--set", "layers=3", "--set", "pitch_mm=60mil", "--only", "svg,layout,laser,report")
    assert run("build", "honeycomb", "-o", tmp_path / "a", *arguments).exit_code == 0
    built = design.write(tmp_path / "b", ["svg", "layout", "laser", "report"])
    files = {path.relative_to(tmp_path / "a"): path for path in (tmp_path / "a").rglob("*.*")}
    assert all((tmp_path / "b" / name).read_bytes() == path.read_bytes() for name, path in files.items())
    assert {path.relative_to(tmp_path / "b") for path in built.written} <= set(files) and built.works
    assert built.readings["laser"].share > 0.98
    assert tmp_path / "b" / "layout.json" in design.changed(layers=2).write(tmp_path / "b", "svg").removed
    tiny = design.changed(pitch_mm=0.1)
    assert not tiny.check().works and tiny.check().findings[0].severity == "error"
    with pytest.raises(cmpdesign.CmpDesignError, match="nothing"):
        design.write(tmp_path / "c", "nothing")
    with pytest.raises(cmpdesign.CmpDesignError, match="camera"):
        design.check((640,))  # type: ignore[arg-type]
    assert not (tmp_path / "c").exists()


def test_the_reader_takes_every_form_of_a_layout(
    design: cmpdesign.Design, image: np.ndarray, tmp_path: Path
) -> None:
    path = tmp_path / "layout.json"
    design.layout.write(path)
    forms = [
        path,
        str(path),
        design.layout,
        design.layout.reference(),
        design.layout.to_dict(),
        cmpdesign.read_layout(path),
    ]
    found = [Extractor(form).extract(image) for form in forms]
    assert all(np.array_equal(markers.xy_px, found[0].xy_px) for markers in found) and found[0].found
    assert Tracker(path).track(image).markers.found
    assert {cmpdesign.verify(form, image).verified for form in forms} == {True}
    assert json.loads(path.read_text(encoding="utf-8")) == design.layout.to_dict()


@pytest.mark.parametrize("given", [None, 3, {"layout.json"}, b"layout.json", object()])
def test_the_reader_says_what_it_takes(given: object) -> None:
    with pytest.raises(TypeError, match=r"layout is a value of the type .*; give the path"):
        Extractor(given)  # type: ignore[arg-type]


def test_a_dictionary_is_checked_as_a_file_is(design: cmpdesign.Design) -> None:
    document = design.layout.to_dict()
    document["markers"]["x"][3] += 0.01
    for bad in (document, {"format": "cmp-layout"}, {"format": {1}}, {}):
        with pytest.raises(LayoutError):
            Extractor(bad)


def test_a_plain_layout_is_taken_by_the_calls(design: cmpdesign.Design, image: np.ndarray) -> None:
    found = cmpdesign.verify(plain_layout(design), image)
    assert found.verified and found.found.markers.found
    several = cmpdesign.verify(design.layout, [image, image[::-1].copy()])
    assert [each.verified for each in several.images] == [True, False] and not several.verified
    assert several.found is None
    assert cmpdesign.Layout.of(plain_layout(design)).digest == design.layout.digest


def test_values_show_themselves(design: cmpdesign.Design, image: np.ndarray) -> None:
    markers = Extractor(design.layout).extract(image)
    for value in (design, design.layout, design.layout.reference(), markers):
        assert len(repr(value)) < 120 and type(value).__name__ in repr(value)
    assert "37 measured, 0 repaired" in repr(markers) and "37 markers" in repr(design.layout)
    assert design.layout._repr_svg_().count("<path") == 1 + len(design.layout.colored_cells)
    sides = re.findall(r'<svg[^>]*\bheight="(\d+)"[^>]*\bwidth="(\d+)"', design.layout._repr_svg_())
    assert max(map(int, sides[0])) == 420  # px: legible on a screen, whatever the pad's size
    assert "<svg" in design._repr_html_() and "37" in design._repr_html_()
    assert "<td>37</td>" in markers._repr_html_()
    named = cmpdesign.load("honeycomb", name="<script>")
    assert "<script>" not in named._repr_html_()
    nothing = Extractor(design.layout).extract(np.full((100, 100, 3), 90, np.uint8))
    assert "no_color" in repr(nothing) and "light that shows all inks" in nothing._repr_html_()
    rendered = cmpdesign.render(design.layout, pitch_px=30)
    for value in (rendered.found, rendered.truth, Tracker(design.layout).track(image)):
        assert len(repr(value)) < 120 and type(value).__name__ in repr(value) and "37" in repr(value)
    assert rendered._repr_png_().startswith(b"\x89PNG")


def test_a_report_is_what_the_command_writes(
    design: cmpdesign.Design, image: np.ndarray, tmp_path: Path
) -> None:
    design.layout.write(tmp_path / "layout.json")
    cv2.imwrite(str(tmp_path / "seen.png"), image)
    given = (tmp_path / "layout.json", tmp_path / "seen.png")
    assert run("verify", *given, "--report", tmp_path / "a.zip").exit_code == 0
    assert cmpdesign.verify(*given, tmp_path / "b", report=tmp_path / "b.zip").verified
    assert cmpdesign.verify(design.layout, image, report=tmp_path / "c.zip").verified
    command, call, array = (zipfile.ZipFile(tmp_path / f"{name}.zip") for name in "abc")
    assert command.namelist() == call.namelist() and len(array.namelist()) == len(call.namelist())
    for name in command.namelist():
        same = command.read(name) == call.read(name)
        assert same or name == "report.json"  # which holds times
    assert array.read("layout.json") == call.read("layout.json")
    reports = [json.loads(bundle.read("report.json")) for bundle in (command, call)]
    assert reports[0]["settings"] == reports[1]["settings"]


def test_help_begins_with_what_a_person_needs() -> None:
    for thing in (cmpdesign.Design, cmpdesign.Layout):
        page = pydoc.plain(pydoc.render_doc(thing))
        signature, rest = re.split(
            r"\n \| *\n", page, maxsplit=1
        )  # a line for each parameter from Python 3.13 on
        text = "\n".join(rest.splitlines()[:8])
        assert ">>> " in text and "cmpdesign.load(" in text and "Annotated" not in signature + text, text
    assert "verdict.verified" in str(cmpdesign.verify.__doc__)


def test_render_draws_what_the_command_draws(design: cmpdesign.Design, tmp_path: Path) -> None:
    design.layout.write(tmp_path / "layout.json")
    words = ("--pitch", 25, "--tilt", 10, "--noise", 2, "--press", 0.1, "--seed", 3, "--size", "320x240")
    run("render", tmp_path / "layout.json", "-o", tmp_path / "a.png", "--truth", tmp_path / "a.npz", *words)
    drawn = cmpdesign.render(
        design.layout, size=(320, 240), seed=3, pitch_px=25, tilt_deg=10, noise=2, press_mm=0.1
    )
    drawn.save(tmp_path / "b.png", truth=tmp_path / "b.npz")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    with np.load(tmp_path / "a.npz") as a, np.load(tmp_path / "b.npz") as b:
        assert all(np.array_equal(a[name], b[name], equal_nan=True) for name in a.files)
    with pytest.raises(TypeError, match="pitch is no option; there are pitch_px"):
        cmpdesign.render(design.layout, pitch=25)  # type: ignore[call-arg]
    with pytest.raises(
        cmpdesign.CmpDesignError, match=r"pitch_px cannot be given with scene; write \[camera\] pitch_px"
    ):
        cmpdesign.render(design.layout, "pressed-ball", pitch_px=25)
    with pytest.raises(cmpdesign.CmpDesignError, match="ending"):
        drawn.save(tmp_path / "c.gif", truth=tmp_path / "c.npz")
    assert not (tmp_path / "c.npz").exists()


@pytest.mark.parametrize(
    ("picture", "said"),
    [
        (np.zeros((40, 40), np.uint8), "40x40"),
        (np.zeros((40, 40, 3)), "float64"),
        (np.zeros((4, 4, 3), np.uint8), "4x4x3"),
        (None, "NoneType"),
        ("missing.png", "missing.png"),
    ],
)
def test_what_is_no_picture_is_one_error(design: cmpdesign.Design, picture: object, said: str) -> None:
    with pytest.raises(ImageFileError, match=said):
        cmpdesign.verify(design.layout, picture)  # type: ignore[arg-type]


def test_track_writes_what_the_command_writes(design: cmpdesign.Design, tmp_path: Path) -> None:
    design.layout.write(tmp_path / "layout.json")
    (tmp_path / "frames").mkdir()
    for number in range(3):
        picture = cmpdesign.render(
            design.layout, size=(320, 240), seed=number, pitch_px=30, noise=1, press_mm=0.05 * number
        )
        cv2.imwrite(str(tmp_path / "frames" / f"{number}.png"), picture.image)
    words = ("--rest", 0, "--fps", 10)
    assert (
        run(
            "track", tmp_path / "layout.json", tmp_path / "frames", "-o", tmp_path / "a.npz", *words
        ).exit_code
        == 0
    )
    seen = []
    followed = cmpdesign.track(
        design.layout,
        tmp_path / "frames",
        tmp_path / "b.npz",
        rest=0,
        fps=10,
        quiver=tmp_path / "q.png",
        on_frame=seen.append,
    )
    a, b = (cmpdesign.load_run(tmp_path / name) for name in ("a.npz", "b.npz"))
    assert np.array_equal(a.arrays["displacement_mm"], b.arrays["displacement_mm"], equal_nan=True)
    assert len(b) == len(seen) == 3 and set(followed.written) == {
        str(tmp_path / name) for name in ("b.npz", "b.npz.summary.json", "q.png")
    }
    assert followed.frames.tracked == 3 and followed.ended_early is None
    stated = json.loads((tmp_path / "b.npz.summary.json").read_text())
    assert json.loads(followed.to_json()) == {**stated, "live": None, "written": list(followed.written)}
    tracked = [
        Tracker(design.layout).track(frame.image)
        for frame in cmpdesign.open_source(tmp_path / "frames").frames()
    ]
    assert len(tracked) == 3
    with pytest.raises(cmpdesign.CmpDesignError, match="fps is -1"):
        cmpdesign.track(design.layout, tmp_path / "frames", tmp_path / "c.npz", fps=-1)
    with pytest.raises(TypeError, match="speed"):
        cmpdesign.track(design.layout, tmp_path / "frames", tmp_path / "c.npz", speed=2)  # type: ignore[call-arg]
    with pytest.raises(cmpdesign.CmpDesignError, match=r"give a list of files, as \['b.npz'\]"):
        cmpdesign.export_zarr("b.npz", tmp_path / "c.zarr")
    assert not list(tmp_path.glob("c.*"))


def test_plots_show_what_is_there(design: cmpdesign.Design, image: np.ndarray) -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    markers = Extractor(design.layout).extract(image)
    axes = cmpdesign.plot_layout(design.layout, ids=True)
    assert len(axes.texts) == 37 and sum(len(group.get_paths()) for group in axes.collections) == 1 + len(
        design.layout.colored_cells
    )
    over = cmpdesign.plot_markers(image, markers)
    assert len(over.collections[0].get_offsets()) == 37
    pyplot.close("all")
