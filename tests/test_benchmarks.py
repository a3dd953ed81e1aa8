"""The benchmarks that figures are quoted from run, and their arithmetic is right."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parent.parent


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("startup", {"conditions", "processes", "largest"}),
        ("rendering", {"conditions", "errors", "speeds"}),
        ("contact", {"conditions", "contacts", "closed_forms_percent"}),
        (
            "extraction",
            {"conditions", "standard", "large", "accuracy", "over_pixels", "over_markers", "growth"},
        ),
    ],
)
def test_a_quick_run_prints_and_writes(name: str, keys: set[str], tmp_path: Path) -> None:
    out = tmp_path / "figures.json"
    command = [sys.executable, "-m", f"benchmarks.{name}", "--quick", "--json", str(out)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600, check=False)
    assert result.returncode == 0, result.stderr
    assert "Python" in result.stdout and "…" not in result.stdout
    figures = json.loads(out.read_text(encoding="utf-8"))
    assert set(figures) == keys and figures["conditions"]["cpu"]
    for error in figures.get("errors", []):
        assert error["edge_rms_px"] < 3e-4 and error["edge_largest_px"] < 1e-3 and error["edges"] > 50
    for scene in figures.get("accuracy", []):
        assert scene["wrong"] == 0 and scene["measured_share"] > 0.99
        assert scene["rms_inner_px"] > 0.9 * scene["bound_inner_px"]


def test_the_benchmark_of_molds_runs(tmp_path: Path) -> None:
    out = tmp_path / "figures.json"
    command = [sys.executable, "-m", "benchmarks.molds", "--quick", "--json", str(out)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert result.returncode == 0, result.stderr
    figures = json.loads(out.read_text(encoding="utf-8"))
    assert set(figures) == {"conditions", "seconds", "exponents", "booleans", "processes"}
    assert list(figures["seconds"]) == ["9", "36"] and list(figures["booleans"]) == ["36"]
    first, second = figures["processes"]
    # Two processes, the same bytes.
    assert first["digest"] == second["digest"] and first["gb"] < 1.5


def test_exponents_are_slopes_in_the_logarithm() -> None:
    code = (
        "from benchmarks.extraction import exponent, per_unit, side_px\n"
        "x = [1, 2, 4, 8]\n"
        "print(exponent(x, [3 * v ** 1.5 for v in x]), *per_unit(x, [7 + 0.5 * v for v in x]), *side_px(12.0))"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=60, check=True
    )
    np.testing.assert_allclose(
        [float(word) for word in result.stdout.split()], (1.5, 7, 0.5, 4000, 3000), rtol=1e-9
    )
