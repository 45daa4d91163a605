"""Kernel matrices: their algebra and its errors, defects, files, pictures."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asperity import kernels as ker
from asperity.errors import FileExistsRefusal, InputError
from asperity.estimates import Estimate
from asperity.kernels.matrices.matrix import frobenius_error

NO_ERROR = Estimate(0.0, 0.0, "bound", "given")
ROUNDING = 1e-13


def random_reversible(basis: ker.Basis, rng: np.random.Generator, error: float = 0.0) -> ker.KernelMatrix:
    """A symmetric array of norm 1 that keeps the constant."""
    array = rng.normal(size=(basis.size, basis.size))
    array = array + array.T
    constant = basis.constant
    project = np.eye(basis.size) - np.outer(constant, constant)
    array = project @ array @ project
    array = array / max(np.linalg.norm(array, 2), 1e-300) + np.outer(constant, constant)
    return ker.KernelMatrix(
        array, basis, frobenius_error(error, "bound", "given"), reversible=True, mirror_symmetric=True
    )


def stochastic(n: int, rng: np.random.Generator) -> ker.KernelMatrix:
    basis = ker.Bins(n)
    array = rng.random((n, n)) + 0.1
    array /= array.sum(axis=1, keepdims=True)
    return ker.KernelMatrix(array / basis.normalisation[:, None] * basis.normalisation, basis, NO_ERROR)


seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


@settings(max_examples=30, deadline=None)
@given(seeds, st.integers(1, 8))
def test_products_are_associative_and_adjoints_reverse_them(rng: np.random.Generator, n: int) -> None:
    p, q, r = (stochastic(n, rng) for _ in range(3))
    assert np.abs(((p @ q) @ r).array - (p @ (q @ r)).array).max() < ROUNDING
    assert np.abs((p @ q).adjoint().array - (q.adjoint() @ p.adjoint()).array).max() < ROUNDING
    assert np.abs((p**3).array - (p @ p @ p).array).max() < ROUNDING
    assert np.abs((p**0).array - np.eye(n)).max() == 0.0


@settings(max_examples=20, deadline=None)
@given(seeds, st.integers(1, 8))
def test_an_operator_and_its_adjoint_pass_the_dot_test(rng: np.random.Generator, n: int) -> None:
    p = stochastic(n, rng)
    f, g = rng.normal(size=n), rng.normal(size=n)
    assert np.sum(p.weights * f * (p @ g)) == pytest.approx(np.sum(p.weights * (p.adjoint() @ f) * g), abs=ROUNDING)
    mu = rng.random(n)
    assert (mu @ p) @ f == pytest.approx(mu @ (p @ f), abs=1e-12)
    operator = p.as_linear_operator()
    assert np.allclose(operator @ f, p @ f) and np.allclose(operator.T @ f, f @ p)


def test_first_p_then_q() -> None:
    to_first = ker.KernelMatrix(np.array([[1.0, 0.0], [1.0, 0.0]]), ker.Bins(2), NO_ERROR, law="to the first bin")
    swap = ker.KernelMatrix(np.array([[0.0, 1.0], [1.0, 0.0]]), ker.Bins(2), NO_ERROR, law="swap")
    assert (to_first @ swap).array.round(15).tolist() == [[0.0, 1.0], [0.0, 1.0]]
    assert (swap @ to_first).array.round(15).tolist() == [[1.0, 0.0], [1.0, 0.0]]
    assert (np.array([0.25, 0.75]) @ swap).round(15).tolist() == [0.75, 0.25]


def test_functions_and_densities_are_projected() -> None:
    flat = ker.discretise(ker.lambertian(), ker.Bins(16))
    assert np.abs(flat @ (lambda theta: np.cos(theta) ** 2) - 1.0 / 3.0).max() < ROUNDING
    assert np.abs((lambda theta: 1.0 + np.cos(theta)) @ flat - flat.weights).max() < ROUNDING
    smooth = ker.discretise(ker.lambertian(), ker.Legendre(4))
    assert np.abs(smooth @ np.cos).max() < ROUNDING


def test_combinations_of_matrices_are_linear() -> None:
    rng = np.random.default_rng(3)
    p, q = stochastic(5, rng), stochastic(5, rng)
    mixed = 0.25 * p + np.float64(0.75) * q
    assert np.abs(mixed.array - (0.25 * p.array + 0.75 * q.array)).max() < ROUNDING
    assert float(mixed.stochastic_defect()) < ROUNDING
    assert np.abs((p - p).array).max() == 0.0
    assert float((-p).stochastic_defect()) == pytest.approx(2.0)


@settings(max_examples=30, deadline=None)
@given(seeds, st.integers(2, 6), st.floats(1e-6, 0.1), st.floats(1e-6, 0.1))
def test_errors_of_the_algebra_bound_the_true_ones(
    rng: np.random.Generator, n: int, first_error: float, second_error: float
) -> None:
    basis = ker.Legendre(n)
    exact = [random_reversible(basis, rng) for _ in range(2)]
    found = []
    for matrix, size in zip(exact, (first_error, second_error), strict=True):
        wrong = rng.normal(size=(n, n))
        wrong *= size / np.linalg.norm(wrong)
        error = frobenius_error(size * (1.0 + 1e-9), "bound", "given")
        found.append(dataclasses.replace(matrix, symmetric=matrix.symmetric + wrong, error=error))
    (a, b), (x, y) = exact, found
    for true, computed in [
        (a @ b, x @ y),
        (0.3 * a - 2.0 * b, 0.3 * x - 2.0 * y),
        (a**4, x**4),
        ((a - b) @ a, (x - y) @ x),
        ((a - b) ** 3, (x - y) ** 3),
        (a.tensor(b), x.tensor(y)),
        (a.in_specular_frame(), x.in_specular_frame()),
    ]:
        # the last term is rounding
        distance = np.linalg.norm(true.symmetric - computed.symmetric)
        assert distance <= float(computed.error) + 1e-12
        assert computed.error.kind == "bound"


def test_a_tensor_product_acts_on_both_angles() -> None:
    rng = np.random.default_rng(5)
    p, q = stochastic(3, rng), stochastic(4, rng)
    both = p.tensor(q)
    f, g = rng.normal(size=3), rng.normal(size=4)
    assert np.abs(both @ np.kron(f, g) - np.kron(p @ f, q @ g)).max() < ROUNDING
    assert both.basis == ker.TensorBasis((p.basis, q.basis))
    assert np.abs(both.flux.sum() - 1.0) < ROUNDING


def test_flux_and_weights_are_those_of_the_bins() -> None:
    matrix = ker.discretise(ker.TriangularTeethLaw(1.0), ker.Bins([0.0, 0.5, 1.7, np.pi]))
    assert (
        np.abs(matrix.weights - 0.5 * (np.cos(matrix.basis.edges[:-1]) - np.cos(matrix.basis.edges[1:]))).max() < 1e-15
    )
    assert np.abs(matrix.flux - matrix.weights[:, None] * matrix.array).max() < 1e-15


@pytest.mark.parametrize(
    "matrix",
    [
        ker.discretise(ker.TriangularTeethLaw(0.7), ker.Bins(33)),
        ker.discretise(ker.CircularArcLaw(1.0), ker.Bins(8), method="qmc", samples=4096, symmetrise=True),
        ker.discretise(ker.CircularArcLaw(0.1), ker.Bins(200), method="qmc", samples=8192),
        ker.discretise(ker.lambertian().in_specular_frame(), ker.Panels([0.0, 1.0, np.pi], 2)),
        ker.discretise(ker.lambertian(), ker.Legendre(3)).tensor(
            ker.discretise(ker.lambertian(), ker.Bins([0, 1, np.pi]))
        ),
        dataclasses.replace(stochastic(2, np.random.default_rng(0)), metadata={"wall": "mine", "rays": [1, 2]}),
    ],
    ids=repr,
)
def test_files_keep_every_field_to_the_last_bit(matrix: ker.KernelMatrix, tmp_path: Path) -> None:
    path = matrix.save(tmp_path / "kernel.npz")
    loaded = ker.load_matrix(path)
    for field in dataclasses.fields(matrix):
        before, after = getattr(matrix, field.name), getattr(loaded, field.name)
        if field.name == "replicates":
            assert len(before) == len(after)
            for one, other in zip(before, after, strict=True):
                assert type(one) is type(other)
                assert abs(one - other).max() == 0.0
        elif isinstance(before, np.ndarray):
            assert before.dtype == after.dtype and np.array_equal(before, after)
        elif field.name == "raw_defect" and before is not None:
            assert (before, before.norm, before.z_score) == (after, after.norm, after.z_score)
        else:
            assert before == after
    assert repr(loaded) == repr(matrix)


@pytest.mark.parametrize("frame", ["paper", "specular"])
def test_a_csv_has_the_probabilities_between_the_edges_of_its_bins(frame: str, tmp_path: Path) -> None:
    law = ker.maxwell(0.25) if frame == "paper" else ker.maxwell(0.25).in_specular_frame()
    matrix = ker.discretise(law, ker.Bins([0.0, 0.5, 2.0, np.pi]))
    path = matrix.save(tmp_path / "kernel.csv")
    numbers = np.loadtxt(path, delimiter=",")
    edges = matrix.basis.edges
    assert np.array_equal(numbers[:2], [[0.0, 0.0, *edges[:-1]], [0.0, 0.0, *edges[1:]]])
    assert np.array_equal(numbers[2:, :2], np.transpose([edges[:-1], edges[1:]]))
    assert np.array_equal(numbers[2:, 2:], matrix.array)
    header = [line for line in path.read_text().splitlines() if line.startswith("#")]
    same = {"paper": "retroreflection", "specular": "specular reflection"}[frame]
    assert f"# convention of '{frame}': theta_out = theta_in is {same}" in header
    assert f"# frobenius_error: {float(matrix.error)}" in header


def test_a_csv_replaces_no_file_unasked_and_needs_bins(tmp_path: Path) -> None:
    path = stochastic(2, np.random.default_rng(0)).save(tmp_path / "kernel.csv")
    with pytest.raises(FileExistsRefusal):
        stochastic(3, np.random.default_rng(0)).save(path)
    assert np.loadtxt(path, delimiter=",").shape == (4, 4)
    stochastic(3, np.random.default_rng(0)).save(path, overwrite=True)
    assert np.loadtxt(path, delimiter=",").shape == (5, 5)
    with pytest.raises(InputError, match="has no bins"):
        ker.discretise(ker.lambertian(), ker.Legendre(3)).save(tmp_path / "legendre.csv")
    assert [entry.name for entry in tmp_path.iterdir()] == ["kernel.csv"]


def test_a_path_is_used_as_it_stands(tmp_path: Path) -> None:
    stochastic(2, np.random.default_rng(0)).save(tmp_path / "kernel.with.dots")
    assert [entry.name for entry in tmp_path.iterdir()] == ["kernel.with.dots"]


def test_other_files_are_refused_by_name(tmp_path: Path) -> None:
    text, archive, array = tmp_path / "a.txt", tmp_path / "b.npz", tmp_path / "c.npy"
    text.write_text("no matrix")
    np.savez(archive, x=np.ones(3))
    np.save(array, np.ones(3))
    for path in (text, archive, array):
        with pytest.raises(InputError, match=f"{path.name} is not a kernel matrix"):
            ker.load_matrix(path)
    whole = stochastic(2, np.random.default_rng(0)).save(tmp_path / "whole.npz").read_bytes()
    (tmp_path / "half.npz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="is not a kernel matrix"):
        ker.load_matrix(tmp_path / "half.npz")


def test_metadata_that_a_file_cannot_hold_are_refused(tmp_path: Path) -> None:
    matrix = dataclasses.replace(stochastic(2, np.random.default_rng(0)), metadata={"function": np.sin})
    with pytest.raises(InputError, match="metadata"):
        matrix.save(tmp_path / "kernel.npz")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("basis", [ker.Bins(12), ker.Legendre(5)], ids=repr)
def test_the_picture_labels_its_axes_with_units(basis: ker.Basis) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    ax = ker.discretise(ker.TriangularTeethLaw(1.0), basis).plot()
    assert "incoming angle" in ax.get_xlabel() and "(rad)" in ax.get_xlabel()
    assert "outgoing angle" in ax.get_ylabel()
    assert [label.get_text() for label in ax.get_xticklabels()] == ["0", "π/2", "π"]
    labels = [axes.get_ylabel() for axes in ax.get_figure().axes if axes is not ax]
    assert any("invariant measure" in label for label in labels)
    pyplot.close(ax.get_figure())


def test_the_repr_is_one_line_and_owns_up_to_a_missed_tolerance() -> None:
    text = repr(ker.discretise(ker.CircularArcLaw(1.0), ker.Bins(8), method="qmc", samples=4096))
    assert "\n" not in text
    for part in ("Bins(8)", "CircularArcLaw", "qmc", "4096 samples", "tolerance 1e-08 not met"):
        assert part in text
    assert "not met" not in repr(ker.discretise(ker.TriangularTeethLaw(1.0), ker.Bins(8)))
