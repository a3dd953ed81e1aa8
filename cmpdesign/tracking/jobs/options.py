"""The options of ``track`` and ``reconstruct``: stated once, for calls and for commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypedDict

from cmpdesign.inputs.files import MAX_PIXELS
from cmpdesign.inputs.options import Channels, Preset, Response, Side, Usual

RESPONSE = "srgb|linear|EXPONENT"


class ReadingOptions(TypedDict, total=False):
    """How pictures are read.

    Keys:
        preset: speed or accuracy of the positions; the ids are the same.
        response: response of the camera; with an exponent, light is value ** exponent; None: srgb; 16 bits linear.
        side: side of the pattern that the camera sees; designed: as stated in the layout.
        channels: rgb: the pictures' red and blue are swapped, as an RGB array saved by OpenCV.
    """

    preset: Annotated[Preset, Usual("balanced")]
    response: Annotated[Response | None, Usual(None, metavar=RESPONSE)]
    side: Annotated[Side, Usual("designed")]
    channels: Annotated[Channels, Usual("bgr")]


class SequenceOptions(ReadingOptions, total=False):
    """How a sequence is read and shown.

    Keys:
        preset, response, side, channels: see ``ReadingOptions``.
        fps: frames per second; None: a video's own; 30 for a folder.
        times: times of the frames: names (their numbers), index (the count), or a .csv of FRAME,SECONDS; None: what the
            names say; a video's own.
        bits: bits of the camera's values in pictures of 16 bits, 8 to 16; None: found from the values.
        camera_size: size that a camera is asked for.
        camera_fps: frames per second that a camera is asked for.
        camera_format: pixel format that a camera is asked for, four letters as MJPG or YUYV.
        exposure_ms: time of exposure, ms; switches automatic exposure off.
        gain: gain in the camera's own unit, as cameras prints it.
        white_balance_k: color temperature, K; switches automatic white balance off.
        focus: focus in the camera's own unit; switches automatic focus off.
        frames: stop after this many frames.
        cold: number every frame without the previous frame: slower.
        max_pixels: largest image that is read: width times height.
        frame_id: coordinate frame and first part of the topics of a recording.
        with_images: also record or show the frames' images, without loss.
        live: also show the frames during the run, by a server on this machine.
        live_port: port of the server; 0: any; None: 8765 of Foxglove, 9876 of Rerun.
        live_wait_s: how long the first frame waits for a viewer of Foxglove, s.
    """

    fps: Annotated[float | None, Usual(None, above=0)]
    times: Annotated[str | None, Usual(None, metavar="names|index|FILE")]
    bits: Annotated[int | None, Usual(None, least=8)]
    camera_size: Annotated[str | None, Usual(None, metavar="WIDTHxHEIGHT")]
    camera_fps: Annotated[float | None, Usual(None, metavar="FPS", above=0)]
    camera_format: Annotated[str | None, Usual(None, metavar="LETTERS")]
    exposure_ms: Annotated[float | None, Usual(None, metavar="MS", above=0, name="--exposure")]
    gain: Annotated[float | None, Usual(None, least=0)]
    white_balance_k: Annotated[float | None, Usual(None, metavar="K", above=0, name="--white-balance")]
    focus: Annotated[float | None, Usual(None, least=0)]
    frames: Annotated[int | None, Usual(None, least=1)]
    cold: Annotated[bool, Usual(False)]
    max_pixels: Annotated[int, Usual(MAX_PIXELS, metavar="COUNT", least=256)]
    frame_id: Annotated[str, Usual("tactile", metavar="NAME")]
    with_images: Annotated[bool, Usual(False)]
    live: Annotated[Literal["foxglove", "rerun"] | None, Usual(None)]
    live_port: Annotated[int | None, Usual(None, metavar="PORT")]
    live_wait_s: Annotated[float, Usual(0.0, metavar="SECONDS", name="--live-wait")]


class TrackOptions(SequenceOptions, total=False):
    """Options of ``track``, beside ``SequenceOptions``.

    Keys:
        rest: frame or image from which displacement is counted; None: the first tracked frame.
        mm_per_px: scale for mm along the image's axes; None: mm in the layout's frame.
        overlay: video of the found markers: .mp4, .avi or .mkv.
        quiver: arrows of the frame with the largest displacement: .png.
        contact: also write force, torque and traction, by this file of calibrate gel; needs rig.
        rig: file with the camera's view and the [elastomer], for contact.
    """

    rest: Annotated[str | Path | int | None, Usual(None, metavar="N|IMAGE")]
    mm_per_px: Annotated[float | None, Usual(None, metavar="SCALE", above=0)]
    overlay: Annotated[str | Path | None, Usual(None, metavar="VIDEO")]
    quiver: Annotated[str | Path | None, Usual(None, metavar="PNG")]
    contact: Annotated[str | Path | None, Usual(None, metavar="GEL")]
    rig: Annotated[str | Path | None, Usual(None, metavar="RIG")]


class ShapeOptions(SequenceOptions, total=False):
    """Options of ``reconstruct``, beside ``SequenceOptions``.

    Keys:
        from_rest: place all views by the rest frame, also the views whose pose the rig gives.
        flatness_mm: standard deviation of the markers from a plane at rest.
        model_px: error of the camera model, pixels; None: from the rest frame.
        surface: also write the touched surface, by the [elastomer] of the rig, in separate columns.
        contact: also write force, torque and traction, by this file of calibrate gel and the modulus of the rig's
            [elastomer].
    """

    from_rest: Annotated[bool, Usual(False)]
    flatness_mm: Annotated[float, Usual(0.0, metavar="MM", least=0)]
    model_px: Annotated[float | None, Usual(None, metavar="PX", least=0)]
    surface: Annotated[bool, Usual(False)]
    contact: Annotated[str | Path | None, Usual(None, metavar="GEL")]
