"""What cameras, phones and programs bring: each row of docs/reference/sources.md is a test here."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image as PillowImage

from cmpdesign.data.videos.pieces import piece_frames, video_pieces
from cmpdesign.files.images import read_image
from cmpdesign.inputs.sources import name_sources
from cmpdesign.tracking.sources import Reading, SourceError, open_named, open_source, open_sources
from tests.support.command import refused, run
from tests.support.made.videos import cut_jpeg, cut_without_encoding, turn_in_player, write_video
from tests.support.tracking.files import loaded, write_moving_pattern

COUNT = 14


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_moving_pattern(tmp_path_factory.mktemp("made"))


@pytest.fixture(scope="module")
def images(made: Path) -> list[Any]:
    found = [cv2.imread(str(made / "frames" / f"frame{k}.png")) for k in range(COUNT)]
    assert all(image is not None for image in found)
    return found


def times_of(source: Any, **options: Any) -> list[float]:
    return [round(frame.time_s, 6) for frame in open_source(source, Reading(**options)).frames()]


def shown(path: Path) -> list[Any]:
    """The images that ``track``, ``verify`` and ``extract`` read, which must be the same at the same times."""
    tracked = list(open_source(str(path)).frames())
    verified = list(open_named(name_sources([str(path)])[0]).frames())
    parts = [frame for piece in video_pieces(path, 4) for frame in piece_frames(path, piece)]
    for one, other, part in zip(tracked, verified, parts, strict=True):
        assert one.time_s == other.time_s == part.time_s or one.time_s != one.time_s
        assert (one.image is None) == (other.image is None) == (part.image is None)
        assert one.image is None or ((one.image == other.image) & (one.image == part.image)).all()
    return [frame.image for frame in tracked]


def near(one: Any, other: Any) -> bool:
    return one is not None and float(np.abs(one.astype(float) - other).mean()) < 4


# -- videos


def test_a_clip_cut_without_encoding(made: Path, images: list[Any], tmp_path: Path) -> None:
    whole = write_video(tmp_path / "whole.mp4", images)
    clip = cut_without_encoding(whole, tmp_path / "clip.mp4", 0.16)
    found = shown(clip)
    assert len(found) == COUNT - 4 and all(map(near, found, images[4:]))
    result = run("track", made / "layout.json", clip, "-o", tmp_path / "a.npz")
    assert result.exit_code == 0, result.output
    assert (loaded(tmp_path / "a.npz")["frame_status"] == 1).all()


def test_a_video_that_players_turn(images: list[Any], tmp_path: Path) -> None:
    """The sensor's pixels, everywhere; OpenCV's own readers turn them."""
    path = turn_in_player(write_video(tmp_path / "phone.mp4", images[:6]))
    found = shown(path)
    assert len(found) == 6 and all(map(near, found, images))
    _, turned = cv2.VideoCapture(str(path)).read()
    assert turned is not None and turned.shape[:2] == images[0].shape[1::-1]


def test_a_photo_that_viewers_turn(images: list[Any], tmp_path: Path) -> None:
    path = tmp_path / "photo.jpg"
    exif = PillowImage.Exif()
    exif[0x0112] = 6
    PillowImage.fromarray(images[0][:, :, ::-1]).save(path, quality=95, exif=exif)
    found = next(iter(open_source(str(path)).frames())).image
    assert near(found, images[0]) and near(read_image(path), images[0])
    turned = cv2.imread(str(path))
    assert turned is not None and turned.shape[:2] == images[0].shape[1::-1]


@pytest.mark.parametrize("name", ["a.mkv", "a.mp4", "a.avi"])
def test_a_variable_frame_rate(name: str, images: list[Any], tmp_path: Path) -> None:
    """An AVI counts every slot; a count is no end."""
    stamps_ms = [0, 40, 80, 200, 240, 400, 440, 480]
    codec = "mjpeg" if name.endswith("avi") else "libx264"
    path = write_video(tmp_path / name, images[:8], codec, stamps_ms)
    source = open_source(str(path))
    assert [round(1e3 * frame.time_s) for frame in source.frames()] == stamps_ms
    assert source.ended_early == "" and len(shown(path)) == 8


@pytest.mark.parametrize("file_format", ["h264", "hevc", "mjpeg"])
def test_a_stream_without_a_container(
    file_format: str, made: Path, images: list[Any], tmp_path: Path
) -> None:
    """No times, said so, and no invented rate; with --fps they are counted."""
    codec = {"h264": "libx264", "hevc": "libx265"}.get(file_format, file_format)
    path = write_video(tmp_path / f"raw.{file_format}", images[:6], codec, file_format=file_format)
    assert len(shown(path)) == 6 and np.isnan(times_of(str(path))).all()
    assert times_of(str(path), fps=50) == [0, 0.02, 0.04, 0.06, 0.08, 0.1]
    if file_format == "h264":
        result = run("track", made / "layout.json", path, "-o", tmp_path / "a.npz")
        assert result.exit_code == 0 and "give the rate with --fps" in result.stderr
        assert np.isnan(loaded(tmp_path / "a.npz")["time_s"]).all()


def test_a_jpeg_of_a_video_that_is_cut_off(made: Path, images: list[Any], tmp_path: Path) -> None:
    path = cut_jpeg(write_video(tmp_path / "usb.avi", images[:6], "mjpeg"), 3)
    found = shown(path)
    assert [image is None for image in found] == [False, False, False, True, False, False]
    run("track", made / "layout.json", path, "-o", tmp_path / "a.npz")
    table = loaded(tmp_path / "a.npz")
    assert table["frame_status"].tolist() == [1, 1, 1, 3, 1, 1] and "cut off" in table["reason"][3]


def test_two_streams_one_after_another_in_a_file(images: list[Any], tmp_path: Path) -> None:
    """Time stamps that go back go on."""
    parts = [write_video(tmp_path / f"{k}.ts", images[7 * k : 7 * k + 7]) for k in range(2)]
    path = tmp_path / "both.ts"
    path.write_bytes(b"".join(part.read_bytes() for part in parts))
    times_s = times_of(str(path))
    assert len(shown(path)) == 14 and np.diff(times_s).min() > 0 and np.diff(times_s).max() < 0.2


def test_a_split_recording(made: Path, images: list[Any], tmp_path: Path) -> None:
    for k in range(2):
        write_video(tmp_path / f"rec_{k:03d}.mp4", images[7 * k : 7 * k + 7])
    both = str(tmp_path / "rec_*.mp4")
    assert times_of(both) == [round(0.04 * k, 6) for k in range(14)]
    assert run("track", made / "layout.json", both, "-o", tmp_path / "a.npz").exit_code == 0
    assert len(loaded(tmp_path / "a.npz")["frame"]) == 14


def test_the_time_of_a_recording(made: Path, images: list[Any], tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.mp4", images[:3], creation_time="2026-03-01T12:00:00Z")
    assert run("track", made / "layout.json", path, "-o", tmp_path / "a.npz").exit_code == 0
    assert loaded(tmp_path / "a.npz")["began_unix_s"] == 1772366400
    times = json.loads((tmp_path / "a.npz.summary.json").read_text())["times"]
    assert times["began"] == "2026-03-01T12:00:00+00:00" and times["began_of"] == "file"


def test_an_animated_picture_is_a_video_or_is_refused(images: list[Any], tmp_path: Path) -> None:
    gif = write_video(tmp_path / "a.gif", images[:5], "gif")
    assert len(shown(gif)) == 5
    pictures = [PillowImage.fromarray(image[:, :, ::-1]) for image in images[:3]]
    for name in ("a.tif", "a.png", "a.webp"):
        pictures[0].save(tmp_path / name, save_all=True, append_images=pictures[1:])
        frame = next(iter(open_source(str(tmp_path / name)).frames()))
        assert frame.image is None and "holds 3 pictures" in frame.problem, name


# -- pictures


def test_raw_pictures_are_refused_with_the_remedy(images: list[Any], tmp_path: Path) -> None:
    """Also under another name: a DNG is a TIFF with a preview."""
    cv2.imwrite(str(tmp_path / "a.tif"), images[0])
    shutil.copy(tmp_path / "a.tif", tmp_path / "a.dng")
    with PillowImage.open(tmp_path / "a.tif") as picture:
        picture.save(tmp_path / "preview.tif", tiffinfo={254: 1})
    frame = next(iter(open_source(str(tmp_path / "preview.tif")).frames()))
    assert frame.image is None and "--response linear" in frame.problem
    with pytest.raises(SourceError, match="--response linear"):
        open_source(str(tmp_path / "a.dng"))


@pytest.mark.parametrize("bits", [10, 12, 14])
@pytest.mark.parametrize("at_top", [False, True])
def test_fewer_bits_in_a_file_of_16(bits: int, at_top: bool, images: list[Any], tmp_path: Path) -> None:
    wide = (images[0].astype(np.float64) / 255 * ((1 << bits) - 1)).round().astype(np.uint16)
    cv2.imwrite(str(tmp_path / "a.png"), wide << (16 - bits) if at_top else wide)
    found = read_image(tmp_path / "a.png")
    assert found.dtype == np.uint16
    expected = wide.astype(np.float64) * 65535 / ((1 << int(wide.max()).bit_length()) - 1)
    expected = wide * (65535 / ((1 << bits) - 1)) if at_top else expected
    assert np.abs(found - expected).max() <= 1


def test_bits_are_found_from_all_pictures_or_stated(made: Path, images: list[Any], tmp_path: Path) -> None:
    """A dark picture alone looks like one of fewer bits; its light stays comparable to that of the others."""
    for k, share in enumerate((1.0, 0.1)):
        wide = (images[0].astype(np.float64) / 255 * share * 4095).round().astype(np.uint16)
        wide[0, 0] = 4095 * share
        cv2.imwrite(str(tmp_path / f"{k}.png"), wide)
    source = open_source(str(tmp_path))
    bright, dark = (frame.image for frame in source.frames())
    assert np.median(bright / np.maximum(dark, 1)) == pytest.approx(10, rel=0.02)
    assert "values of 12 bits in 16" in source.notes[0]
    alone = next(iter(open_source(str(tmp_path / "1.png"), Reading(bits=12)).frames())).image
    assert (alone == dark).all()
    frame = next(iter(open_source(str(tmp_path / "0.png"), Reading(bits=10)).frames()))
    assert frame.image is None and "have 12 bits, bits states 10" in frame.problem
    result = run("track", made / "layout.json", tmp_path, "-o", tmp_path / "a.npz")
    assert result.exit_code == 0 and result.stderr.count("values of 12 bits in 16") == 1
    assert json.loads((tmp_path / "a.npz.summary.json").read_text())["notes"]
    assert "--bits is 17; expected 8 to 16" in refused(
        "track", made / "layout.json", tmp_path, "-o", tmp_path / "b.npz", "--bits", 17
    )


def test_a_folder_with_other_files(images: list[Any], tmp_path: Path) -> None:
    for k in range(6):
        cv2.imwrite(str(tmp_path / f"frame{k}.png"), images[k])
    (tmp_path / "frame4.png").write_bytes((tmp_path / "frame4.png").read_bytes()[:4000])
    (tmp_path / "frame2.png").write_bytes(b"")
    for name in ("._frame1.png", "Thumbs.db", ".DS_Store"):
        (tmp_path / name).write_bytes(b"\0\5\x16\7")
    source = open_source(str(tmp_path))
    assert "3 files are left out" in source.times.text and "2 numbers are missing" in source.times.text
    frames = list(source.frames())
    assert all(frame.image is not None for frame in frames)
    assert [round(30 * frame.time_s) for frame in frames] == [0, 1, 3, 5]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"PK\x03\x04", "zip archive"),
        (b"\x93NUMPY\x01\0", "NumPy array"),
        (b"%PDF-1.7", "PDF document"),
        (b"\x89MCAP0\r\n", "MCAP recording"),
        (b'{"format": "cmp-layout"}', "LAYOUT SOURCE"),
    ],
)
@pytest.mark.parametrize("name", ["a.bin", "a.png"])
def test_files_of_other_programs(content: bytes, said: str, name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content + bytes(100) if b"{" not in content else content)
    try:
        problem = next(iter(open_source(str(tmp_path / name)).frames())).problem
    except SourceError as error:
        problem = str(error)
    assert said in problem


# -- names that no protocol may read


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_named_pipe_is_refused_at_once(made: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "x.mp4")
    assert "it is a pipe" in refused(
        "track", made / "layout.json", tmp_path / "x.mp4", "-o", tmp_path / "a.npz"
    )
    with pytest.raises(SourceError, match="it is a pipe"):
        video_pieces(tmp_path / "x.mp4", 4)


def test_lists_of_other_files_are_not_followed(images: list[Any], tmp_path: Path) -> None:
    secret = write_video(tmp_path / "secret.ts", images[:3])
    (tmp_path / "list.m3u8").write_text(
        f"#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:9,\nfile://{secret}\n#EXT-X-ENDLIST\n"
    )
    (tmp_path / "list.ffconcat").write_text("ffconcat version 1.0\nfile secret.ts\n")
    for name in ("list.m3u8", "list.ffconcat"):
        with pytest.raises(SourceError, match="is no video"):
            open_source(str(tmp_path / name))
    odd = tmp_path / "concat:a|b.mkv"
    shutil.copy(write_video(tmp_path / "a.mkv", images[:3]), odd)
    assert len(shown(odd)) == 3


# -- what names say


@pytest.mark.parametrize(
    ("names", "times_s", "said"),
    [
        (
            ["1700000000.1234567", "1700000000.15", "1700000000.1834567", "1700000000.2"],
            [0, 0.026543, 0.06, 0.076543],
            "stamps in 4 names",
        ),
        (["1700000000123456789", "1700000000156790122"], [0, 0.033333], "stamps in 2 names"),
        (["cam_1700000000_000000005", "cam_1700000000_100000005"], [0, 0.1], "stamps in 2 names"),
        (["0.0", "0.033", "0.1"], [0, 0.033, 0.1], "seconds in 3 names"),
        (["frame8", "frame9", "frame11"], [0, 0.033333, 0.1], "1 numbers are missing"),
        (["run1.9", "run1.10", "run1.11"], [0, 0.033333, 0.066667], "numbers in 3 names"),
        (["left", "right"], [0, 0.033333], "by the order of 2 pictures"),
        (["20260101", "20260707"], [0, 0.033333], "by the order of 2 pictures"),
    ],
)
def test_names_carry_times(
    names: list[str], times_s: list[float], said: str, images: list[Any], tmp_path: Path
) -> None:
    for name, image in zip(names, images, strict=False):
        cv2.imwrite(str(tmp_path / f"{name}.png"), image)
    source = open_source(str(tmp_path))
    frames = list(source.frames())
    assert [frame.path.stem for frame in frames if frame.path] == names
    np.testing.assert_allclose([frame.time_s for frame in frames], times_s, atol=1e-6)
    assert said in source.times.text


def test_times_are_said_first_and_can_be_given(made: Path, images: list[Any], tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    for k in range(4):
        cv2.imwrite(str(folder / f"1700000000.{k}5.png"), images[k])
    result = run("track", made / "layout.json", folder, "-o", tmp_path / "a.npz")
    assert "times: the stamps in 4 names" in result.stdout.splitlines()[0]
    assert loaded(tmp_path / "a.npz")["began_unix_s"] == 1700000000.05
    assert times_of(str(folder), times="index", fps=10) == [0, 0.1, 0.2, 0.3]
    table = tmp_path / "t.csv"
    table.write_text("file,time_s\n1700000000.05.png,5\n1700000000.15.png,6.5\n2,6.25\n3,7\n")
    assert times_of(str(folder), times=str(table)) == [0, 1.5, 1.25, 2]
    run("track", made / "layout.json", folder, "-o", tmp_path / "b.npz", "--times", table)
    reasons = loaded(tmp_path / "b.npz")["reason"].tolist()
    assert reasons[:2] == ["", ""] and "not after that of the frame before" in reasons[2] and not reasons[3]


# -- views


def two_folders(images: list[Any], tmp_path: Path, lacks: tuple[int, int], name: Callable[[int], str]) -> str:
    for folder, lack in zip(("left", "right"), lacks, strict=True):
        (tmp_path / folder).mkdir()
        for k in range(6):
            if k != lack:
                cv2.imwrite(str(tmp_path / folder / f"{name(k)}.png"), images[k])
    return f"{tmp_path / 'left'},{tmp_path / 'right'}"


@pytest.mark.parametrize("name", ["f{}", "17000000{}.02"])
@pytest.mark.parametrize("lacks", [(2, 4), (0, 3)])
def test_views_are_joined_by_time(
    lacks: tuple[int, int], name: str, images: list[Any], tmp_path: Path
) -> None:
    both = two_folders(images, tmp_path, lacks, lambda k: name.format(k if "f" in name else 40 + k))
    source = open_sources(both)
    frames = list(source.frames())
    assert len(frames) == 6 and not source.ended_early
    for k, frame in enumerate(frames):
        for view, lack in enumerate(lacks):
            assert (frame.image[view] is None) == (k == lack)
            assert frame.image[view] is None or (frame.image[view] == images[k]).all()
        assert ("has no frame within" in frame.problem) == (k in lacks)
    assert "joined by time" in source.times.text and "2 frames have no partner" in source.times.text


def test_videos_that_are_open_at_the_same_time(images: list[Any], tmp_path: Path) -> None:
    """Each keeps the frames that its decoder holds back, and gets none of those of another one."""
    path = str(write_video(tmp_path / "a.mp4", images))
    ahead, *others = (open_source(path).frames() for _ in range(3))
    for _ in range(3):
        next(ahead)
    for one, other in zip(*others, strict=True):
        assert one.image is not None and other.image is not None and one.time_s == other.time_s
    assert [frame.image is None for frame in ahead] == [False] * (COUNT - 3)


def test_videos_of_which_one_lacks_a_frame(images: list[Any], tmp_path: Path) -> None:
    stamps = [40 * k for k in range(8)]
    left = write_video(tmp_path / "l.mkv", images[:8], stamps_ms=stamps)
    right = write_video(
        tmp_path / "r.mkv", images[:3] + images[4:8], stamps_ms=[t + 7 for t in stamps if t != 120]
    )
    frames = list(open_sources(f"{left},{right}").frames())
    assert [frame.image[1] is None for frame in frames] == [k == 3 for k in range(8)]
    assert all(
        near(frame.image[view], images[k]) for k, frame in enumerate(frames) for view in (0, 1) if k != 3
    )
