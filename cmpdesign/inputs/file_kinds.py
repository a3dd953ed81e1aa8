"""What a file is, by its first bytes: the text and the remedy where a file is no picture and no video."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from cmpdesign.errors import InputError
from cmpdesign.inputs.files import open_file

HEAD_BYTES = 4096
# First bytes -> what the file is, and the remedy.
_KINDS: Mapping[bytes, str] = {
    b"PK\x03\x04": "a zip archive; unpack it, and give the folder",
    b"\x1f\x8b": "a gzip archive; unpack it, and give the folder",
    b"7z\xbc\xaf": "a 7z archive; unpack it, and give the folder",
    b"\x93NUMPY": "a NumPy array; save it as PNG, or give the array to extractor.Extractor in Python",
    b"%PDF": "a PDF document; save its page as PNG",
    b"\x89MCAP0": "an MCAP recording; export its pictures as files first",
    b"SQLite format 3": "a database, as of a rosbag2 recording; export its pictures as files first",
    b"#ROSBAG": "a ROS 1 recording; export its pictures as files first",
    b"RRF2": "a Rerun recording; export its pictures as files first",
    b"\x89HDF": "an HDF5 file; export its pictures as files first",
    b"PAR1": "a Parquet table; give the pictures or the video that it was read from",
}
RAW = (
    "it is a camera's raw picture, whose colors are not developed; develop it to a 16-bit TIFF without a tone curve, "
    "and read that with --response linear"
)
_RAW_STARTS = (b"FUJIFILMCCD-RAW", b"IIRO", b"IIRS", b"MMOR", b"IIU\0")
_RAW_SUFFIXES = frozenset(
    {".3fr", ".arw", ".cr2", ".cr3", ".crw", ".dng", ".erf", ".iiq", ".kdc", ".mef", ".mos"}
    | {".nef", ".nrw", ".orf", ".pef", ".raf", ".raw", ".rw2", ".rwl", ".sr2", ".srw", ".x3f"}
)


def is_raw_picture(path: str | Path, head: bytes = b"") -> bool:
    """True for a raw picture of a camera, by the ending of its name or by its first bytes."""
    return Path(path).suffix.lower() in _RAW_SUFFIXES or _is_raw(head)


def describe_file(path: str | Path) -> str:
    """What a file is and what to do with it, as "it is a zip archive; unpack it, ..."; empty if not known.

    Raises:
        InputError: the file cannot be opened, or is no regular file.
    """
    with open_file(path) as file:
        try:
            head = file.read(HEAD_BYTES)
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if is_raw_picture(path, head):
        return RAW
    found = next((text for start, text in _KINDS.items() if head.startswith(start)), "")
    if not found and head[257:262] == b"ustar":
        found = "a tar archive; unpack it, and give the folder"
    if not found and b'"cmp-layout"' in head:
        found = "a layout file; the layout comes first, then the pictures: LAYOUT SOURCE"
    if not found and head and _is_text(head):
        found = "a text"
    return f"it is {found}" if found else ""


def _is_raw(head: bytes) -> bool:
    is_cr2 = head.startswith((b"II*\0", b"MM\0*")) and head[8:10] == b"CR"
    return is_cr2 or head.startswith(_RAW_STARTS) or head[4:11] == b"ftypcrx"


def _is_text(head: bytes) -> bool:
    try:
        text = (
            head[:-4].decode("utf-8", "strict") if len(head) == HEAD_BYTES else head.decode("utf-8", "strict")
        )
    except UnicodeDecodeError:
        return False
    return all(letter.isprintable() or letter in "\t\r\n\f" for letter in text)
