"""Tar files for WebDataset: the files of one sample have the same name before the first dot and follow each other.

The same samples give the same bytes: times, owners and modes are fixed.
"""

from __future__ import annotations

import io
import tarfile
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

from cmpdesign.errors import InputError
from cmpdesign.inputs.files import open_file

MODE = 0o644


class Member(NamedTuple):
    """The place of the bytes of a file in a tar file."""

    start: int
    size: int


class TarWriter:
    """Writes samples one after another.

    Args:
        path: the file; it must not exist.

    Raises:
        OSError: the file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("xb")
        self._tar = tarfile.TarFile(fileobj=self._file, mode="w", format=tarfile.USTAR_FORMAT)

    def add(self, key: str, files: Mapping[str, bytes]) -> None:
        """Add the files of one sample by their endings, in alphabetical order, as WebDataset requires."""
        for ending in sorted(files):
            info = tarfile.TarInfo(f"{key}.{ending}")
            info.size, info.mode = len(files[ending]), MODE
            self._tar.addfile(info, io.BytesIO(files[ending]))

    def __enter__(self) -> TarWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._tar.close()
        finally:
            self._file.close()


def read_members(path: Path) -> dict[str, Member]:
    """The place of each file of a tar file, by its name; only the headers are read.

    Raises:
        InputError: the file cannot be read, or is no tar file.
    """
    with open_file(path) as file:
        try:
            with tarfile.TarFile(fileobj=file) as tar:
                return {info.name: Member(info.offset_data, info.size) for info in tar if info.isreg()}
        except (tarfile.TarError, OSError, ValueError) as error:
            raise InputError(f"{path} is no tar file that can be read ({error})") from None


def read_member(path: Path, member: Member) -> bytes:
    """The bytes of one file in a tar file.

    Raises:
        InputError: the file cannot be opened, or ends before the bytes do.
    """
    with open_file(path) as file:
        file.seek(member.start)
        content = file.read(member.size)
    if len(content) < member.size:
        raise InputError(f"{path}: ends too early: the shard is damaged; see cmpdesign dataset --check")
    return content
