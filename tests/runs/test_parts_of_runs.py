"""Long runs in parts: the random numbers and errors of parts, and the refusal of the checkpoint of another run."""

from __future__ import annotations

import numpy as np
import pytest

from asperity import AsperityError, InputError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.long_runs import all_parts
from asperity.spectral.consequences import channel

DISK = geo.Disk(1.0, 0.5)
RAYS = 2**16 + 123


def exits(**changed):
    asked = {"law": ker.maxwell(0.5), "lengths": [2.0, 4.0, 8.0], "particles": 50, "rng": 7}
    return spec.exit_times(**{**asked, **changed})


def played(**changed):
    law = ker.CollisionLaw.from_wall(geo.focusing_arcs(0.9), DISK)
    velocity = DISK.from_angles(np.linspace(0.5, 2.5, 50), np.full(50, 1.0))
    asked = {"container": geo.Container.strip(), "laws": law, "position": np.zeros((50, 2)), "velocity": velocity}
    return ker.play(**{**asked, "collisions": 5, "rng": 7, **changed})


def studied(**changed):
    asked = {"wall": geo.triangular_teeth(1.2), "scales": [1e-3, 1e-4, 1e-5], "rng": 7, "samples": (2, 3, 4)}
    return ker.limit_study(geo.Disk(1.0, 1.0), **{**asked, "repetitions": 3, **changed})


def counted(**changed):
    asked = {"law": ker.CircularArcLaw(1.1), "basis": ker.Bins(8), "method": "monte-carlo", "samples": RAYS, "rng": 5}
    return ker.discretise(**{**asked, **changed})


def swept(**changed):
    asked = {"family": ker.maxwell, "grid": {"diffuse_fraction": [0.25, 0.5, 1.0]}, "quantities": ["gap"]}
    return spec.sweep(**{**asked, "tolerance": 1e-6, **changed})


CHANGED = [
    (exits, {"particles": 51}, "particles: 50 there, 51 here"),
    (exits, {"law": ker.maxwell(0.25)}, "law: "),
    (exits, {"rng": 8}, "seed: "),
    (exits, {"lengths": [2.0, 4.0, 9.0]}, "lengths: "),
    (exits, {"speed": 2.0}, "speed: "),
    (exits, {"arrangement": "half-turn"}, "arrangement: "),
    (played, {"laws": ker.CollisionLaw.from_wall(geo.focusing_arcs(0.8), DISK)}, "laws: "),
    (played, {"position": np.full((50, 2), 0.25)}, "start: "),
    (played, {"collisions": 6}, "collisions: "),
    (played, {"container": geo.Container.strip(2.0)}, "container: "),
    (studied, {"scales": [1e-3, 1e-4, 1e-6]}, "sizes: "),
    (studied, {"psi": 1.0}, "psi: "),
    (studied, {"wall": geo.triangular_teeth(1.2000000001)}, "wall: "),
    (studied, {"samples": (2, 3, 5)}, "samples: "),
    (studied, {"limit": geo.triangular_teeth(1.3)}, "limit: "),
    (counted, {"law": ker.CircularArcLaw(1.2)}, "law: "),
    (counted, {"rng": 6}, "seed: "),
    (counted, {"basis": ker.Bins(9)}, "basis: "),
    (counted, {"samples": RAYS + 1}, f"rays: {RAYS} there, {RAYS + 1} here"),
    (counted, {"method": "qmc"}, "computation: 'independent rays' there, 'scrambled Sobol sequences' here"),
    (swept, {"tolerance": 1e-3}, "tolerance: 1e-06 there, 0.001 here"),
    (swept, {"quantities": ["eta"]}, "quantities: ['gap'] there, ['eta'] here"),
    (swept, {"grid": {"diffuse_fraction": [0.25, 0.5]}}, "grid.diffuse_fraction: '3 from 0.25 to 1.0"),
    (swept, {"family": lambda diffuse_fraction: ker.maxwell(diffuse_fraction / 2.0)}, "last wall"),
]


@pytest.mark.parametrize(("run", "changed", "words"), CHANGED)
def test_the_checkpoint_of_another_run_is_refused_with_the_difference(run, changed, words, tmp_path):
    run(checkpoint=tmp_path / "a")
    before = (tmp_path / "a").read_bytes()
    with pytest.raises(InputError, match="is the checkpoint of something else") as refusal:
        run(**changed, checkpoint=tmp_path / "a")
    assert words in str(refusal.value) and (tmp_path / "a").read_bytes() == before


def test_each_part_has_random_numbers_of_its_own(monkeypatch):
    monkeypatch.setattr(channel, "TOGETHER", 8)
    times = exits(particles=16).times
    assert len({row.tobytes() for row in times}) == 16
    # the first part of more particles is that of fewer
    assert exits(particles=24).times[:16].tobytes() == times.tobytes()


def test_an_error_of_a_part_is_that_of_the_run(tmp_path):
    def fails(number):
        raise (InputError if number else AsperityError)("too late")

    with pytest.raises(AsperityError, match="too late"):
        all_parts(fails, 1, {}, {})
    with pytest.raises(InputError, match="too late"):
        all_parts(lambda number: fails(1), 1, {}, {"checkpoint": tmp_path / "a"})
