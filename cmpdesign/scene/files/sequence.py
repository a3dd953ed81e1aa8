"""A scene file with [sequence], drawn into a video or a folder with the truth of every frame."""

from __future__ import annotations

from pathlib import Path

from cmpdesign.errors import CmpDesignError
from cmpdesign.scene.drawing.render import render
from cmpdesign.scene.files.frame_writer import open_frame_writer
from cmpdesign.scene.files.scene_file import SceneFile
from cmpdesign.scene.truth import Truth, save_truths
from cmpdesign.watch import told


def write_sequence(file: SceneFile, output: Path, truth: Path | None) -> dict[str, int]:
    """Draw every frame of a sequence.

    Args:
        file: a scene file with [sequence].
        output: video or folder to write.
        truth: .npz file for the truth of all frames, if any.

    Returns:
        Warnings of doubtful parts, each with the number of its first frame.

    Raises:
        CmpDesignError: an ending of ``output`` that does not suit the sequence, or a value that cannot be rendered.
        OutputError: a file cannot be written; neither a part of the video nor of the folder is left.
    """
    if truth is not None and truth.suffix.lower() != ".npz":
        raise CmpDesignError(f"{truth}: unknown ending of a truth file; expected .npz")
    writer = open_frame_writer(output, file.fps or 1.0, file.size_px, file.bits)
    truths: list[Truth] = []
    warnings: dict[str, int] = {}
    try:
        for scene in told(file.scenes(), file.frames, "frames"):
            rendered = render(scene, size=file.size_px)
            writer.add(rendered.image)
            truths.append(rendered.truth)
            for warning in rendered.warnings:
                warnings.setdefault(warning, scene.frame)
        if truth is not None:
            save_truths(truths, [file.time_s(frame) for frame in range(file.frames)], truth)
        writer.close()
    except BaseException:
        writer.discard()
        raise
    return warnings
