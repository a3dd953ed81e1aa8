"""Videos read in parts: every frame once, under its own number, whatever the codec, the cuts and the damage."""

from __future__ import annotations

from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from cmpdesign.data import load
from cmpdesign.data.folder import open_folder
from cmpdesign.data.shard import make_shard
from cmpdesign.data.videos.extraction import FrameReading, index_source, name_tasks, prepare_extraction
from cmpdesign.data.videos.pieces import piece_frames, video_pieces
from cmpdesign.tracking.export.video import Codec, CodecVideo
from cmpdesign.tracking.sources import open_source
from extractor import Extractor, load_layout
from tests.support.command import refused, run
from tests.support.layouts import small_text
from tests.support.tracking.scenes import LAYERS, moving

FRAMES, SIZE = 23, (64, 48)
CODECS = {
    "ffv1.mkv": Codec("ffv1", "bgr0"),
    "open groups.mp4": Codec(
        "libx264",
        "yuv444p",
        {"crf": "0", "g": "5", "bf": "2", "x264-params": "open-gop=1:scenecut=0:b-adapt=0"},
    ),
    "closed groups.mkv": Codec("libx264", "yuv420p", {"crf": "10", "g": "7", "bf": "2"}),
    "raw.h264": Codec("libx264", "yuv444p", {"crf": "0", "g": "5", "bf": "2"}),
    "motion jpeg.avi": Codec("mjpeg", "yuvj420p", {}),
}


def numbered_frames() -> list[np.ndarray]:
    """Images whose gray level is their number."""
    noise = np.random.default_rng(0).integers(0, 6, (SIZE[1], SIZE[0], 3), np.uint8)
    return [noise + np.uint8(10 * number) for number in range(FRAMES)]


def write_numbered(path: Path) -> Path:
    video = CodecVideo(path, CODECS[path.name], 25.0)
    for image in numbered_frames():
        video.add(image)
    video.close()
    return path


def number_of(image: np.ndarray) -> int:
    return round((float(image.mean()) - 2.5) / 10)


@pytest.mark.parametrize("name", [name for name in CODECS if not name.startswith("raw")])
def test_every_frame_is_in_one_part_under_its_number(name: str, tmp_path: Path) -> None:
    path = write_numbered(tmp_path / name)
    pieces = video_pieces(path, 4)
    assert len(pieces) >= 2 and all(piece.frames >= 4 for piece in pieces[:-1])
    found = [frame for piece in reversed(pieces) for frame in piece_frames(path, piece)]
    assert sorted(frame.number for frame in found) == list(range(FRAMES))
    assert all(number_of(frame.image) == frame.number for frame in found)
    times = {frame.number: frame.time_s for frame in found}
    for number, whole in enumerate(open_source(str(path)).frames()):
        assert abs(times[number] - whole.time_s) < 2e-3
    assert number == FRAMES - 1


def test_a_file_without_time_stamps_is_one_part(tmp_path: Path) -> None:
    """Its frames come in their order, without times: FFmpeg would invent 25 per second."""
    path = write_numbered(tmp_path / "raw.h264")
    (piece,) = video_pieces(path, 4)
    found = list(piece_frames(path, piece))
    assert (piece.first, piece.frames, piece.has_stamps) == (0, FRAMES, False)
    assert [frame.number for frame in found] == [number_of(frame.image) for frame in found]
    assert len(found) == FRAMES and all(np.isnan(frame.time_s) for frame in found)


def test_a_damaged_part_costs_its_frames_only(tmp_path: Path) -> None:
    path = write_numbered(tmp_path / "closed groups.mkv")
    pieces = video_pieces(path, 4)
    content = bytearray(path.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 300] = bytes(300)
    path.write_bytes(content)
    found = [frame for piece in pieces for frame in piece_frames(path, piece)]
    good = [frame for frame in found if frame.image is not None]
    assert len(good) > FRAMES / 2 and {frame.number for frame in good} >= set(range(pieces[1].first))
    wrong = [frame.number for frame in good if abs(number_of(frame.image) - frame.number) > 2]
    assert len(wrong) <= pieces[1].frames


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A layout, a folder of 3 pictures, one of which is none, and a video of 2 frames."""
    folder = tmp_path_factory.mktemp("sources")
    (folder / "layout.json").write_text(small_text("honeycomb", LAYERS), encoding="utf-8")
    (folder / "frames").mkdir()
    images = [rendered.image for rendered in moving(2)]
    for number, image in enumerate(images):
        cv2.imwrite(str(folder / "frames" / f"{number}.png"), image)
    (folder / "frames" / "2.png").write_bytes(b"no picture")
    video = CodecVideo(folder / "press.mkv", CODECS["ffv1.mkv"], 25.0)
    for image in images:
        video.add(image)
    video.close()
    return folder


def test_the_rows_are_what_the_extractor_finds(sources: Path, tmp_path: Path) -> None:
    texts = [str(sources / "press.mkv"), str(sources / "frames")]
    layout = load_layout(sources / "layout.json")
    prepared = prepare_extraction(
        layout, [index_source(task) for task in name_tasks(texts, 1)], FrameReading()
    )
    open_folder(tmp_path / "markers", prepared)
    for number in reversed(range(prepared.shards)):
        make_shard(str(tmp_path / "markers"), number)
    frames = load(tmp_path / "markers")
    assert [(frame.values["source"], frame.values["frame"]) for frame in frames] == [
        *((texts[0], number) for number in range(2)),
        *((texts[1], number) for number in range(3)),
    ]
    extractor = Extractor(layout)
    for number, rendered in enumerate(moving(2)):
        markers = extractor.extract(rendered.image)
        for frame in (frames[number], frames[2 + number]):
            np.testing.assert_allclose(frame.arrays["xy_px"][0], markers.xy_px, atol=5e-5)
            np.testing.assert_array_equal(frame.arrays["status"][0], markers.status)
            covariance = markers.cov_px2[:, [0, 0, 1], [0, 1, 1]]
            np.testing.assert_allclose(frame.arrays["cov_px2"][0], covariance, rtol=1e-5, atol=1e-12)
    assert frames[1].values["time_s"] == pytest.approx(0.04, abs=1e-3)
    lost = frames[4]
    assert lost.values["reason"] == ["unreadable"] and not lost.arrays["status"].any()
    assert np.isnan(lost.arrays["xy_px"]).all() and list(frames.layouts) == [""]
    with pytest.raises(ValueError, match="the frame has no picture"):
        _ = lost.image


def test_a_source_is_given_once(sources: Path, tmp_path: Path) -> None:
    words = (sources / "layout.json", sources / "press.mkv", sources / "press.mkv")
    assert "press.mkv is given twice" in refused("extract", *words, "-o", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("0", "camera 0: expected files"),
        ("missing.mp4", "missing.mp4: cannot be read (No such file"),
        ("layout.json", "layout.json is no video: it is a layout file"),
        ("*.mov", "no file matches this pattern"),
    ],
)
def test_what_cannot_be_read_in_parts_is_one_line(
    sources: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, source: str, said: str
) -> None:
    monkeypatch.chdir(sources)
    assert said in refused("extract", "layout.json", source, "-o", tmp_path / "out", "--workers", 1)
    assert not (tmp_path / "out").exists()


def test_a_picture_that_is_too_small_is_a_row_with_its_reason(sources: Path, tmp_path: Path) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for name, size in (("a.png", 2), ("b.png", 40)):
        cv2.imwrite(str(pictures / name), np.full((size, size, 3), 90, np.uint8))
    result = run("extract", sources / "layout.json", pictures, "-o", tmp_path / "out", "--workers", 1)
    assert result.exit_code == 0, result.output
    assert [frame.values["reason"] for frame in load(tmp_path / "out")] == [["unreadable"], ["no_color"]]


def test_a_file_with_sound_alone_is_one_line(sources: Path, tmp_path: Path) -> None:
    with av.open(str(tmp_path / "sound.mp4"), "w") as file:
        stream = file.add_stream("aac", rate=48000)
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
        sound.sample_rate = 48000
        for packet in (*stream.encode(sound), *stream.encode(None)):
            file.mux(packet)
    for command in ("extract", "track", "verify"):
        output = () if command == "verify" else ("-o", tmp_path / "out.npz")
        line = refused(command, sources / "layout.json", tmp_path / "sound.mp4", *output)
        assert "sound.mp4: holds no video" in line
