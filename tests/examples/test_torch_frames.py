"""The example of an IterableDataset: every frame once, shared out to workers and machines; with PyTorch where it is."""

from __future__ import annotations

import importlib.util
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cmpdesign.data import load
from tests.support.made.datasets import make_serially, write_plan

EXAMPLE = Path(__file__).parents[2] / "examples" / "torch_frames.py"
SHARDS = 3


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("frames")
    return make_serially(write_plan(folder, frames=2 * SHARDS), folder / "made")


@pytest.fixture
def worker() -> SimpleNamespace:
    """The result of ``get_worker_info``."""
    return SimpleNamespace(info=None)


@pytest.fixture
def example(worker: SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The example's names, without PyTorch."""
    data = ModuleType("torch.utils.data")
    data.IterableDataset = object  # type: ignore[attr-defined]
    data.get_worker_info = lambda: worker.info  # type: ignore[attr-defined]
    for name in ("torch", "torch.utils"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setitem(sys.modules, "torch.utils.data", data)
    return runpy.run_path(str(EXAMPLE), run_name="torch_frames")


def numbers(samples: Any) -> list[int]:
    return [target["frame"] for _, target in samples]


def test_a_sample_is_a_frame(example: dict[str, Any], made: Path) -> None:
    frames = load(made)
    for image, target in example["TactileFrames"](made):
        frame = frames[target["frame"]]
        np.testing.assert_array_equal(image, frame.image[:, :, ::-1].transpose(2, 0, 1))
        np.testing.assert_allclose(target["force_n"], frame.values["force_n"], rtol=1e-6)
        assert target["marker_xyz_mm"].shape == (37, 3)


def test_every_frame_comes_once_in_another_order(example: dict[str, Any], made: Path) -> None:
    samples = example["TactileFrames"](made, seed=3)
    orders = []
    for epoch in range(3):
        samples.epoch = epoch
        orders.append(numbers(samples))
        assert numbers(samples) == orders[-1]
    assert all(sorted(order) == list(range(2 * SHARDS)) for order in orders)
    assert orders[0] != orders[1] != orders[2]


def test_workers_and_machines_share_the_shards(
    example: dict[str, Any], made: Path, worker: SimpleNamespace
) -> None:
    found = []
    for rank in range(2):
        for own in range(2):
            worker.info = SimpleNamespace(id=own, num_workers=2)
            found += numbers(example["TactileFrames"](made, rank=rank, machines=2))
    assert sorted(found) == list(range(2 * SHARDS))


def test_a_small_buffer_keeps_all(example: dict[str, Any]) -> None:
    found = list(example["shuffled"](iter(range(100)), 7, np.random.default_rng(0)))
    assert sorted(found) == list(range(100)) and found != sorted(found)


@pytest.mark.skipif(importlib.util.find_spec("torch") is None, reason="PyTorch is not installed")
@pytest.mark.slow
def test_pytorch_loads_batches(made: Path) -> None:
    from torch.utils.data import DataLoader

    frames = runpy.run_path(str(EXAMPLE), run_name="torch_frames")["TactileFrames"](made)
    batches = list(DataLoader(frames, batch_size=2))
    assert len(batches) == SHARDS
    assert batches[0][0].shape == (2, 3, 180, 200) and batches[0][1]["force_n"].shape == (2, 3)
