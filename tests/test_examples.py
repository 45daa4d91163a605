"""The examples run, and what they return is right."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "docs" / "examples"


def load(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_example_has_a_test():
    tested = {"measured_profile", "published_gap", "no_slip_or_smooth"}
    assert {path.stem for path in EXAMPLES.glob("*.py")} == tested


def test_a_measured_profile_is_studied_from_end_to_end(tmp_path):
    report = load("measured_profile").main(tolerance=1e-2, out=tmp_path)
    wall = report.wall
    assert wall.period == pytest.approx(2 * 402 * 111_200 / 1200 * np.cos(np.radians(36.733)), rel=1e-4)
    assert report.tracer is not None and report.tracer.counts["escaped"] == sum(report.tracer.counts.values())
    assert abs(report.tracer.z_score) < 4.5
    assert report.matrix.symmetry_defect().z_score < 4.5
    assert report.gap.verdict == "no gap"  # a measured profile is a polygon
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        ["wall.png", "kernel.png", "spectrum.png", "collision.png", "kernel.npz", "study.json"]
    )


def test_the_published_gap_is_found():
    found = load("published_gap").main(half_angles=(0.2,))
    assert found["dispersing"] == pytest.approx(0.0373, abs=5e-5)
    assert found["focusing 0.2, gap/(4h)"] == pytest.approx(0.9876, abs=2e-4)


def test_deep_teeth_toss_a_coin_between_smooth_and_no_slip():
    found = load("no_slip_or_smooth").main()
    # facts 1 with the foreshortened ratio r (1 + m/J)^(1/2)
    for ratio, share in found.items():
        d = 2 * ratio * np.sqrt(3) / np.tan(1.0)
        specular = 1 - (d % 1) / 2 if int(d) % 2 == 0 else 0.5 + (d % 1) / 2
        assert share == pytest.approx(1 - specular, abs=1e-12)
