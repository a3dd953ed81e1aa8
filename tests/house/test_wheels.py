"""Wheels for other machines: the compiler of the package ziglang, old systems, both processors."""

from __future__ import annotations

import os
import platform
import re
import struct
import subprocess
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

from tools.wheel import GLIBC, PROCESSORS, build_wheel

ELF_MACHINES = {"x86_64": 62, "aarch64": 183}  # e_machine of the ELF header
READ = """
import sys
from cmpdesign.cli import main

for command in ("build tac3d -o made --only layout,svg", "render made/layout.json -o view.png --pitch 22 --seed 1"):
    sys.argv = ["cmpdesign", *command.split()]
    try:
        main()
    except SystemExit as end:
        assert not end.code, command
sys.argv = ["cmpdesign", "verify", "made/layout.json", "view.png"]
main()
"""


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("wheels")
    return {processor: build_wheel(processor, folder) for processor in PROCESSORS}


@pytest.mark.slow
@pytest.mark.parametrize("processor", PROCESSORS)
def test_modules_are_of_the_processor_and_of_old_systems(wheels: dict[str, Path], processor: str) -> None:
    wheel = wheels[processor]
    assert wheel.name.endswith(f"manylinux_{GLIBC[0]}_{GLIBC[1]}_{processor}.whl")
    archive = zipfile.ZipFile(wheel)
    modules = [name for name in archive.namelist() if re.search(r"/_native\..*\.so$", name)]
    assert sorted(name.split("/")[0] for name in modules) == ["cmpdesign", "extractor"]
    for name in modules:
        content = archive.read(name)
        assert f"{processor}-linux-gnu" in name
        assert content[:4] == b"\x7fELF"
        assert struct.unpack_from("<H", content, 18)[0] == ELF_MACHINES[processor]
        needed = {tuple(map(int, found)) for found in re.findall(rb"GLIBC_(\d+)\.(\d+)", content)}
        assert needed and max(needed) <= GLIBC
        assert not re.search(rb"libstdc\+\+\.so|libc\+\+\.so", content)


@pytest.mark.slow
def test_wheel_reads_where_no_compiler_is(wheels: dict[str, Path], tmp_path: Path) -> None:
    venv.create(tmp_path / "env", with_pip=False, symlinks=True)
    base = str(tmp_path / "env")
    site = Path(sysconfig.get_path("purelib", vars={"base": base, "platbase": base}))
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    zipfile.ZipFile(wheels[platform.machine()]).extractall(site)
    result = subprocess.run(
        [tmp_path / "env" / "bin" / "python", "-c", READ],
        cwd=tmp_path,
        env={"PATH": str(tmp_path / "empty"), "HOME": os.environ.get("HOME", str(tmp_path))},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert "331 of 331 measured" in result.stdout
