"""Workers killed in mid-shard, a scheduler that goes away, a full disk: nothing lost, nothing twice, the same bytes.

The same as those of a run in one process, without any loss.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.made.datasets import contents, make_serially, write_plan

ROOT = Path(__file__).parents[3]
PROGRAM = "from cmpdesign.cli import main; main()"
SHARDS, FRAMES_A_SHARD = 6, 25
# A cluster of this machine: prints its address and its workers' numbers, and lives until its input ends.
CLUSTER = """
import os, sys
from distributed import Client, LocalCluster

if __name__ == "__main__":
    cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with Client(cluster) as client:
        print(cluster.scheduler_address, *client.run(os.getpid).values(), flush=True)
    sys.stdin.read()
    cluster.close()
"""


@pytest.fixture(scope="module")
def serial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a plan, and with its data set as "made"."""
    folder = tmp_path_factory.mktemp("serial")
    plan = write_plan(folder, frames=SHARDS * FRAMES_A_SHARD, frames_a_shard=FRAMES_A_SHARD)
    make_serially(plan, folder / "made")
    return folder


@contextmanager
def started(*command: object) -> Iterator[subprocess.Popen[str]]:
    """A program in a separate session; its remaining processes are killed at the end."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [sys.executable, *map(str, command)], cwd=ROOT, env=environment, text=True, start_new_session=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        yield process
    finally:
        if group_members(process.pid):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def dataset(serial: Path, output: Path, *words: object) -> tuple[object, ...]:
    return "-c", PROGRAM, "dataset", serial / "plan.toml", "-o", output, *words


def finish(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    printed, errors = process.communicate(timeout=300)
    return process.returncode, printed, errors


def wait_until(condition: Callable[[], object], most_s: float = 120) -> None:
    deadline = time.monotonic() + most_s
    while not condition():
        assert time.monotonic() < deadline, "it took too long"
        time.sleep(0.01)


def in_mid_shard(folder: Path, after: int = 1) -> bool:
    """Whether some shards are done, and another one has frames already."""
    begun = [path for path in folder.glob("unfinished/*/*/images.tar") if path.stat().st_size > 50_000]
    return len(list(folder.glob("shards/*.json"))) >= after and bool(begun)


def group_members(group: int) -> list[int]:
    """The numbers of the living processes of a group."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text(encoding="utf-8").rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[2]) == group and fields[0] != "Z":
            found.append(int(path.parent.name))
    return found


def workers_of(process: subprocess.Popen[str]) -> list[int]:
    """The worker processes of a run on this machine."""
    found = []
    for pid in group_members(process.pid):
        command = Path(f"/proc/{pid}/cmdline").read_bytes()
        found += [pid] if b"spawn_main" in command else []
    return found


@pytest.mark.slow
def test_a_killed_process_is_replaced(serial: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with started(*dataset(serial, out, "--workers", 2)) as run:
        wait_until(lambda: in_mid_shard(out))
        os.kill(workers_of(run)[0], signal.SIGKILL)
        code, printed, errors = finish(run)
    assert code == 0 and errors == "" and f"{SHARDS} shards" in printed
    assert contents(out) == contents(serial / "made")


@pytest.mark.slow
def test_workers_end_with_the_program_and_the_next_run_goes_on(serial: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with started(*dataset(serial, out, "--workers", 2)) as run:
        wait_until(lambda: in_mid_shard(out))
        os.kill(run.pid, signal.SIGKILL)
        wait_until(lambda: not group_members(run.pid), most_s=10)
    done = {path: path.stat().st_mtime_ns for path in out.glob("images/*")}
    assert done and len(done) < SHARDS and not (out / "manifest.json").exists()
    with started(*dataset(serial, out, "--workers", 1)) as run:
        assert finish(run)[0] == 0
    assert all(path.stat().st_mtime_ns == before for path, before in done.items())
    assert contents(out) == contents(serial / "made")


@pytest.mark.slow
def test_ctrl_c_leaves_whole_shards(serial: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with started(*dataset(serial, out, "--workers", 2)) as run:
        wait_until(lambda: in_mid_shard(out))
        os.killpg(run.pid, signal.SIGINT)
        code, _, errors = finish(run)
    assert code == 130 and len(errors.splitlines()) == 1 and "interrupted" in errors
    made = contents(serial / "made")
    assert all(content == made[name] for name, content in contents(out).items())


@contextmanager
def cluster() -> Iterator[tuple[subprocess.Popen[str], str, list[int]]]:
    """A cluster's process, its address and its workers."""
    with started("-c", CLUSTER) as process:
        assert process.stdout
        address, *workers = process.stdout.readline().split()
        yield process, address, list(map(int, workers))


@pytest.mark.slow
def test_the_cluster_replaces_a_killed_worker(serial: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with (
        cluster() as (_, address, workers),
        started(*dataset(serial, out, "--scheduler", f"dask={address}")) as run,
    ):
        wait_until(lambda: in_mid_shard(out))
        os.kill(workers[0], signal.SIGKILL)
        code, printed, errors = finish(run)
    assert code == 0 and errors == "" and f"{SHARDS} shards" in printed, errors
    assert contents(out) == contents(serial / "made")


@pytest.mark.slow
def test_without_its_scheduler_a_run_ends_and_another_goes_on(serial: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with cluster() as (process, address, _):
        with started(*dataset(serial, out, "--scheduler", f"dask={address}")) as run:
            wait_until(lambda: in_mid_shard(out))
            os.killpg(process.pid, signal.SIGKILL)
            code, printed, errors = finish(run)
        assert (code, printed) == (2, "")
        assert len(errors.splitlines()) == 1 and f"the scheduler at {address} was lost" in errors
        with started(*dataset(serial, out, "--scheduler", f"dask={address}")) as run:
            code, printed, errors = finish(run)
        assert code == 2 and "no dask scheduler answers at" in errors and len(errors.splitlines()) == 1
    with started(*dataset(serial, out, "--workers", 2)) as run:
        assert finish(run)[0] == 0
    assert contents(out) == contents(serial / "made")


def can_mount() -> bool:
    """Whether this user may mount a small file system."""
    if shutil.which("unshare") is None:
        return False
    mount = "mount -t tmpfs -o size=1m none /mnt"
    return (
        subprocess.run(["unshare", "-m", "sh", "-c", mount], capture_output=True, check=False).returncode == 0
    )


@pytest.mark.slow
@pytest.mark.skipif(not can_mount(), reason="this user may not mount a small disk")
def test_a_full_disk_ends_a_run_and_room_lets_it_go_on(serial: Path, tmp_path: Path) -> None:
    """A disk for about half of the shards, which is then made larger; the files are copied away at the end."""
    bytes_of_all = sum(map(len, contents(serial / "made").values()))
    disk, saved = tmp_path / "disk", tmp_path / "saved"
    disk.mkdir()
    command = f'"{sys.executable}" -c "{PROGRAM}" dataset {serial}/plan.toml -o {disk}/out --workers 2'
    script = f"""
        mount -t tmpfs -o size={bytes_of_all // 2} none {disk} || exit 90
        {command} && exit 91
        ls {disk}/out/unfinished && exit 92
        ls {disk}/out/shards | wc -l
        mount -o remount,size={4 * bytes_of_all} {disk} || exit 93
        {command} && cp -r {disk}/out {saved}
    """
    result = subprocess.run(
        ["unshare", "-m", "sh", "-c", script], cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stdout + result.stderr
    errors = [line for line in result.stderr.splitlines() if line.startswith("error: ")]
    assert (
        len(errors) == 1
        and "No space left on device" in errors[0]
        and "the same command makes the other shards" in errors[0]
    )
    assert 0 < int(result.stdout.splitlines()[0]) < SHARDS
    assert contents(saved) == contents(serial / "made")
