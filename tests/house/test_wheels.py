"""Wheels for other machines: the compiler of the package ziglang, old systems, both processors."""

from __future__ import annotations

import os
import platform
import re
import shutil
import struct
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest

from cmpdesign import build_layout, layout_to_json, load, render
from tools.wheel import GLIBC, PROCESSORS, build_wheel

ROOT = Path(__file__).parents[2]
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


QEMU = shutil.which("qemu-aarch64-static")
# Debian 12: Python 3.11, and what its modules and OpenCV need.
DEBIAN = """python3.11-minimal libpython3.11-minimal libpython3.11-stdlib libc6 zlib1g libexpat1 libssl3 libffi8
libbz2-1.0 liblzma5 libuuid1 libgcc-s1 libstdc++6"""
ARM_READ = """
import platform, sys
import cv2, numpy as np
from extractor import Extractor, load_layout

markers = Extractor(load_layout(sys.argv[1])).extract(cv2.imread(sys.argv[2]))
print(platform.machine(), int((markers.status == 1).sum()))
np.save(sys.argv[3], markers.xy_px)
"""


def make_arm_root(folder: Path) -> Path:
    """Debian's Python for aarch64, in a folder of its own; skips where apt does not offer it."""
    (folder / "lists" / "partial").mkdir(parents=True)
    (folder / "status").touch()
    names = {"Dir::State": folder, "Dir::State::status": folder / "status", "Dir::Cache": folder / "cache"}
    names |= {"APT::Architecture": "arm64", "APT::Architectures": "arm64"}
    options = [word for name, value in names.items() for word in ("-o", f"{name}={value}")]
    for words in (["update"], ["download", *DEBIAN.split()]):
        command = ["apt-get", *options, *words]
        if subprocess.run(command, cwd=folder, capture_output=True, timeout=300, check=False).returncode:
            pytest.skip("Debian's packages for arm64 are not at hand")
    for package in folder.glob("*.deb"):
        subprocess.run(["dpkg", "-x", package, folder / "root"], check=True)
    return folder / "root"


def add_arm_libraries(wheel: Path, folder: Path) -> None:
    """The wheel, and NumPy and OpenCV of its processor, in a folder."""
    lines = (ROOT / "requirements.lock").read_text(encoding="utf-8").splitlines()
    locked = [line for line in lines if line.startswith(("numpy==", "opencv-"))]
    systems = [f"--platform=manylinux_{each}" for each in ("2_17_aarch64", "2_28_aarch64")]
    words = ["download", "--quiet", "--no-deps", "--only-binary=:all:", "--python-version=3.11", *systems]
    subprocess.run([sys.executable, "-m", "pip", *words, "-d", folder.parent / "wheels", *locked], check=True)
    for each in (wheel, *(folder.parent / "wheels").iterdir()):
        zipfile.ZipFile(each).extractall(folder)


@pytest.mark.slow
@pytest.mark.skipif(
    QEMU is None or sys.version_info[:2] != (3, 11), reason="needs qemu-aarch64-static and Python 3.11"
)
def test_the_aarch64_wheel_reads_as_the_x86_one(wheels: dict[str, Path], tmp_path: Path) -> None:
    read_on_both(wheels["aarch64"], tmp_path)


def read_on_both(wheel: Path, folder: Path) -> None:
    root = make_arm_root(folder / "arm")
    add_arm_libraries(wheel, folder / "site")
    layout = build_layout(load("tac3d"))
    (folder / "layout.json").write_text(layout_to_json(layout), encoding="utf-8")
    cv2.imwrite(str(folder / "view.png"), render(layout, noise=2, seed=1).image)
    libraries = ":".join(str(root / part / "aarch64-linux-gnu") for part in ("lib", "usr/lib"))
    emulated = [QEMU, "-L", root, "-E", f"LD_LIBRARY_PATH={libraries}", root / "usr" / "bin" / "python3.11"]
    arm = {**os.environ, "PYTHONHOME": str(root / "usr"), "PYTHONPATH": str(folder / "site")}
    found = []
    for name, program, environment in (("arm", emulated, arm), ("here", [sys.executable], None)):
        words = ["-c", ARM_READ, folder / "layout.json", folder / "view.png", folder / f"{name}.npy"]
        done = subprocess.run(
            [*program, *words], cwd=folder if name == "arm" else ROOT, env=environment, capture_output=True,
            text=True, timeout=600, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert done.stdout.split()[1] == str(len(layout.marker_xy_mm))
        found.append(np.load(folder / f"{name}.npy"))
    np.testing.assert_allclose(*found, atol=1e-4)


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
