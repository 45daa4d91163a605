"""Proved gaps: each step against rays and quadrature of the library, and certificates that were tampered with."""

import ast
import copy
import json
import subprocess
import sys
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import InputError, ProofError
from asperity.estimates import Estimate
from asperity.spectral.proofs import checker
from asperity.spectral.proofs import proof as search
from asperity.spectral.proofs.checker import Bumps, Refused, Trial, acb, arb, exact

CHECKER = Path(checker.__file__)
HG, DIFFUSE, MIRROR, RETRO = ker.henyey_greenstein, ker.lambertian(), ker.specular(), ker.retroreflection()
# a rough trial function for curvature 1: cos(theta), sin(2 theta), cos(3 theta), ... if odd, 1, sin(theta), ... if even
EFFORT = {"first": "1e-6", "bits": 16}
TRIAL = ["1.1", "-0.2", "0.1", "-0.05"]


def bumps(curvature):
    return ker.WallLaw(geo.dispersing_arcs(curvature)).in_specular_frame()


def values(trial, theta, odd=True):
    """Without the mean of even functions."""
    functions = [(np.sin if (m + odd) % 2 else np.cos)(m * theta) for m in range(odd, len(trial) + odd)]
    return sum(float(c) * function for c, function in zip(trial, functions, strict=True))


@pytest.fixture(autouse=True)
def precision():
    """That of the library of balls, which the checker alone sets for itself, and leaves."""
    with checker.ctx.workprec(53):
        yield


@pytest.fixture(scope="module")
def proof():
    """A coarse one, which takes a few seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "BINS", 60)
        patch.setattr(search, "GRAZING", 1e-3)
        patch.setattr(search, "TERMS", (4, 6))
        patch.setattr(search, "ACCURACY", 16)
        return spec.prove_gap(bumps(0.5), width=0.2)


@pytest.mark.parametrize(
    "law",
    [
        HG(0.5), HG(-0.5), HG(0.5).in_specular_frame(), DIFFUSE, ker.maxwell(0.3),
        0.3 * MIRROR + 0.7 * HG(0.5), 0.2 * RETRO + 0.8 * HG(-0.5), (0.2 * RETRO + 0.8 * HG(-0.5)).in_specular_frame(),
        (0.3 * MIRROR + 0.7 * HG(0.5)).in_specular_frame(),
        0.1 * RETRO + 0.2 * MIRROR + 0.3 * DIFFUSE + 0.4 * HG(0.9),
    ],
    ids=repr,
)  # fmt: skip
def test_gaps_of_powers_are_proved_to_rounding(law):
    low, high = spec.prove_gap(law, width=1e-9).interval
    gap = spec.spectral_gap(law)
    assert high - low < Decimal("1e-14")
    # of the whole program, not of the proof
    assert checker.ctx.prec == 53
    assert float(low) - gap.error <= gap.value <= float(high) + gap.error


def test_the_interval_of_bumps_contains_the_gap(proof):
    low, high = map(float, proof.interval)
    # by polynomials and by indexed enclosures
    assert low < 0.084695 < high
    assert high - low < 0.2 * high


def test_specular_reflection_scales_the_gap_and_other_laws_add_to_it(proof, monkeypatch):
    ends = [exact(text) for text in proof.certificate["interval"]]
    monkeypatch.setattr(checker, "of_bumps", lambda *_: {True: ends, False: (exact("0.6"), exact("2"))})
    low, high = map(float, ends)
    for weights, gap in (
        ((0.7, 0.3, 0.0, 0.0), lambda x: 0.7 * x),
        ((0.5, 0.0, 0.0, 0.5), lambda x: 0.5 * x + 0.5),
        # odd functions are turned by retroreflection, even ones are not
        ((0.9, 0.0, 0.1, 0.0), lambda x: 0.9 * x + 0.2),
        ((0.5, 0.0, 0.5, 0.0), lambda x: 0.3),
    ):
        texts = dict(zip(proof.certificate["weights"], map(str, weights), strict=True))
        found = [float(end) for end in checker.enclose({**proof.certificate, "weights": texts})]
        assert found[0] == pytest.approx(gap(low), rel=1e-12)
        assert found[1] >= gap(high) * (1.0 - 1e-12)


@pytest.mark.slow
def test_the_width_of_the_page_is_reached():
    """With twelve cosines, which are nearly dependent, so that their coefficients are large."""
    low, high = map(float, spec.prove_gap(bumps(2 / 3), width=1e-5).interval)
    assert low < 0.1519123 < high


@pytest.mark.parametrize("curvature", ["1/3", "1", "1.4"])
def test_no_ray_is_reflected_three_times_and_some_are_twice(curvature):
    rng = np.random.default_rng(4)
    ray = geo.trace(geo.dispersing_arcs(eval(curvature)), rng.random(2**16), np.arccos(1.0 - 2.0 * rng.random(2**16)))
    assert set(ray.collisions) == {1, 2}


@pytest.mark.parametrize("odd", [True, False])
@pytest.mark.parametrize("curvature", ["1/3", "1", "1.4"])
def test_reflected_trial_functions_are_those_of_the_law(curvature, odd):
    size = eval(curvature)
    law, v, steepest = Bumps(exact(repr(size)), EFFORT), Trial(TRIAL, odd), np.arcsin(size / 2.0)
    theta = np.array([1e-3, 0.1, 0.5 * steepest, 1.1 * steepest, 0.6, 0.9, 1.1, 1.3, 1.5, 1.57])
    known = bumps(size).apply(lambda angle: values(TRIAL, angle, odd), theta)
    mean = float(v(acb(1)).real) - values(TRIAL, 1.0, odd)
    for angle, value in zip(theta.tolist(), known, strict=True):
        sides = tuple(angle > kink for kink in (steepest, 3.0 * steepest, np.pi - 3.0 * steepest))
        found = law.reflected(v, acb(angle), sides, False, 40).real
        assert float(found.rad()) < 1e-9
        assert float(found.mid()) == pytest.approx(value + mean, abs=2e-7)
        # a ball of complex angles around it
        around = acb(arb(angle, 1e-5 * angle), arb(0, 1e-5 * angle))
        assert law.reflected(v, around, sides, True, 40).overlaps(acb(found))


@pytest.mark.slow
@pytest.mark.parametrize(("curvature", "sign"), [("1/3", -1), ("1.3", 1)])
def test_the_form_is_that_of_traced_rays_and_the_residual_that_of_quadrature(curvature, sign):
    size = eval(curvature)
    rng, wall, rays = np.random.default_rng(4), geo.dispersing_arcs(size), 2**18
    theta = np.arccos(1.0 - 2.0 * rng.random(rays))
    ray = geo.trace(wall, rng.random(rays), theta)
    each = 0.5 * (values(TRIAL, theta) - sign * values(TRIAL, np.pi - ray.theta)) ** 2
    with checker.ctx.workprec(search.BITS):
        form, square = Bumps(exact(repr(size)), EFFORT).form_and_residual(Trial(TRIAL, True), sign, arb("0.34"))
    deviation = 5.0 * each.std() / np.sqrt(rays)
    assert float(form.lower()) - deviation < each.mean() < float(form.upper()) + deviation
    assert float(form.rad()) < 1e-3
    node, weight = np.polynomial.legendre.leggauss(300)
    theta = 0.25 * np.pi * (node + 1.0)
    after = bumps(size).apply(lambda angle: values(TRIAL, angle), theta)
    missed = 0.66 * values(TRIAL, theta) - sign * after
    known = 0.25 * np.pi * float(weight @ (missed**2 * np.sin(theta)))
    assert float(square.mid()) == pytest.approx(known, abs=1e-4)
    assert float(square.rad()) < 1e-3


def test_eigenvalues_are_counted(proof):
    """Odd ones of curvature 1: 0.3425 and 0.871; even ones: 0 and 0.716."""
    law, bins = Bumps(exact("1"), {}), proof.certificate["bins"]
    assert [law.count(bins, True, 1, exact(text)) for text in ("0.2", "0.55")] == [0, 1]
    assert [law.count(bins, False, 1, exact(text)) for text in ("0.2", "0.55")] == [1, 1]
    with pytest.raises(Refused):
        law.count(bins, True, 1, exact("0.99"))


def changed(certificate, path, value):
    new = copy.deepcopy(certificate)
    place = new
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return new


# Each path is refused with its number changed so; what needs the form again is slow.
AT_ONCE = [
    (("law",), lambda law: {**law, "note": "0.5"}),
    (("weights",), lambda weights: {**weights, "specular reflection": "0"}),
    (("weights", "law"), lambda pair: ["0.9", "0"]),
    (("weights", "specular"), lambda pair: ["1e-6", "0"]),
    (("weights", "lambertian"), lambda pair: ["-1e-6", "0"]),
    (("odd",), lambda odd: False),
    (("trial", 1), lambda text: "nan"),
    (("guess",), lambda text: "nan"),
    (("threshold",), lambda text: "0.95"),
    (("other",), lambda text: "0.95"),
    (("bins", 5), lambda text: "1.0"),
    (("bins", -1), lambda text: "1.6"),
    (("effort", "first"), lambda text: "-0.1"),
    (("effort", "first"), lambda text: "0.6"),
    (("precision",), lambda bits: 20),
    (("format",), lambda text: "asperity proved gap 2"),
    (("interval",), lambda ends: "09"),
    # what is printed is what is proved
    (("weights", "law"), lambda pair: [f"{pair[0]}\0 and more", pair[1]]),
    (("weights", "law"), lambda pair: [*pair, "0"]),
]
WITH_THE_FORM = [
    (("law", "curvature"), lambda pair: [str(float(pair[0]) * 1.001), pair[1]]),
    (("frame",), lambda text: "paper"),
    (("trial", 0), lambda text: str(float(text) * 0.9)),
    (("guess",), lambda text: str(float(text) * 1.05)),
    (("effort", "first"), lambda text: "0.1"),
    (("effort", "bits"), lambda number: 2),
]


@pytest.mark.parametrize(
    ("path", "change"), [*AT_ONCE, *(pytest.param(*one, marks=pytest.mark.slow) for one in WITH_THE_FORM)]
)
def test_a_certificate_that_was_tampered_with_is_refused(proof, path, change):
    old = proof.certificate
    for key in path:
        old = old[key]
    with pytest.raises(Refused):
        checker.check(changed(proof.certificate, path, change(old)))


@pytest.mark.parametrize(("end", "inwards"), [(0, "1e-9"), (1, "-1e-9")])
def test_an_interval_that_is_shorter_than_the_proved_one_is_refused(end, inwards):
    certificate = spec.prove_gap(HG(0.5)).certificate
    moved = str(Decimal(certificate["interval"][end]) + Decimal(inwards))
    with pytest.raises(Refused, match="the interval from"):
        checker.check(changed(certificate, ("interval", end), moved))


@pytest.mark.parametrize(
    "text", ["1/3", "--0.3", "-inf", "nan", "0.4 +/- 0.01", "[0.3 +/- 0.1]", " 0.3", "0.3\n", "٠.٣"]
)
@pytest.mark.parametrize(
    "place", [("guess",), ("trial", 0), ("weights", "law"), ("law", "curvature", 1), ("interval", 0)]
)
def test_a_number_that_is_no_finite_decimal_is_refused(proof, place, text):
    with pytest.raises(Refused, match="finite decimals"):
        checker.check(changed(proof.certificate, place, text))


@pytest.mark.parametrize("path", ["/dev/zero", "/proc/kmsg", "deep.json", "missing.json"])
def test_what_is_no_certificate_is_refused_at_once(tmp_path, monkeypatch, path):
    monkeypatch.chdir(tmp_path)
    Path("deep.json").write_text("[" * 200_000)
    with pytest.raises(InputError, match=r"cannot read|expected a certificate"):
        spec.check_proof(path)


def test_an_entry_of_unknown_sign_is_not_left_out_of_a_factorisation():
    rng = np.random.default_rng(2)
    full = rng.normal(size=(9, 9))
    full += full.T
    known = int((np.linalg.eigvalsh(full) < 0).sum())
    assert checker.negative_pivots([[arb(x) for x in row] for row in full.tolist()]) == known
    with pytest.raises(Refused, match="known sign"):
        checker.negative_pivots([[arb(1), None], [arb(0, 3), arb(1)]])


def test_a_bound_that_is_not_a_number_is_not_left_out(proof, monkeypatch):
    monkeypatch.setattr(checker, "of_bumps", lambda *_: {True: (arb("0.3"), arb("0.4")), False: (-1 / arb(0), arb(2))})
    weights = {"law": "0", "specular": "0.3", "retroreflection": "0.6", "lambertian": "0.1"}
    with pytest.raises(Refused, match="finite"):
        checker.enclose({**proof.certificate, "weights": weights})


def test_a_saved_certificate_is_checked_without_asperity(tmp_path):
    proof = spec.prove_gap(0.3 * MIRROR + 0.7 * HG(0.5))
    imported = {
        name.name if isinstance(node, ast.Import) else node.module
        for node in ast.walk(ast.parse(CHECKER.read_text(encoding="utf-8")))
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for name in node.names
    }
    assert imported == {"flint", "itertools", "json", "re", "sys"}
    path = proof.save(tmp_path / "gap.json")
    with pytest.raises(FileExistsError):
        proof.save(path)
    assert spec.check_proof(path) == proof
    for name, code in (("interval", 0), ("wrong", 1)):
        content = dict(proof.certificate)
        if name == "wrong":
            content["interval"] = ["0.524", "0.5249"]
        done = subprocess.run(
            [sys.executable, "-I", str(CHECKER)], input=json.dumps(content), text=True, capture_output=True, check=False
        )
        assert done.returncode == code, done.stderr
        # it says what it has proved
        assert (done.stdout.startswith("Proved:") and "0.5" in done.stdout) == (code == 0)
    path.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(ProofError, match="the interval from"):
        spec.check_proof(path)
    path.write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match=r"Proof\.save"):
        spec.check_proof(path)
    with pytest.raises(InputError, match="cannot read"):
        spec.check_proof(tmp_path / "none.json")


def test_what_is_not_proved_says_so(monkeypatch):
    with pytest.raises(ProofError, match=r"between 0 and sqrt\(2\)"):
        spec.prove_gap(bumps(1.9))

    def refuse(certificate):
        raise Refused("a step")

    monkeypatch.setattr("asperity.spectral.proofs.proof.enclose", refuse)
    with pytest.raises(ProofError, match="not proved: expected a step"):
        spec.prove_gap(HG(0.5))


def proved_gap(law):
    """As on the page of sweeps."""
    low, high = map(float, spec.prove_gap(law, width=1e-9).interval)
    return Estimate((low + high) / 2, (high - low) / 2 + 2e-16, "bound", "Temple's inequality in balls")


def test_a_sweep_proves_the_gap_at_each_point_and_goes_on(tmp_path):
    grid, path = {"g": [0.2, 0.5, 1.0]}, tmp_path / "proofs.sweep"
    table = spec.sweep(HG, grid, proved_gap, checkpoint=path)
    assert [row.value for row in table.rows] == [pytest.approx(0.8), pytest.approx(0.5), None]
    assert [row.kind for row in table.rows] == ["bound", "bound", ""]
    assert table.rows[0].error < 1e-14
    assert spec.sweep(HG, grid, proved_gap, checkpoint=path).rows[:2] == table.rows[:2]
