"""Laws of finitely many states, alone and with Lambert's law and isometries, against linear algebra of this file."""

import numpy as np
import pytest

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AccuracyError, InputError
from asperity.estimates import Estimate

ENOUGH = 1e-12


def random_chain(rng, size, edges=None, scale=1.0):
    """A random reversible chain with the masses of its bins: a symmetric flux, by Sinkhorn's scaling."""
    masses = np.full(size, 1.0 / size) if edges is None else -0.5 * np.diff(np.cos(edges))
    flux = rng.random((size, size)) ** scale
    flux = flux + flux.T
    factor = np.ones(size)
    for _ in range(2000):
        factor = np.sqrt(factor * masses / (flux @ factor))
    flux = factor[:, None] * flux * factor
    return flux / flux.sum(axis=1, keepdims=True), masses


def on_finer(array, masses, coarse, fine):
    """Transition probabilities between finer bins: uniform within a bin, in the measure."""
    middle = 0.5 * (fine[1:] + fine[:-1])
    cell = np.searchsorted(coarse, middle) - 1
    weight = -0.5 * np.diff(np.cos(fine))
    return array[np.ix_(cell, cell)] * weight / masses[cell]


class Case:
    """A random law, its matrix on bins that are symmetric about pi/2, and its multiples beyond these."""

    def __init__(self, rng):
        size = int(rng.integers(2, 9))
        equal = rng.random() < 0.5
        inner = np.sort(rng.uniform(0.2, np.pi - 0.2, size - 1))
        edges = np.arccos(1.0 - 2.0 * np.arange(size + 1) / size) if equal else np.concatenate([[0.0], inner, [np.pi]])
        array, masses = random_chain(rng, size, edges)
        fine = np.unique(np.round(np.concatenate([edges, np.pi - edges]), 14))
        fine[-1] = np.pi
        weight = -0.5 * np.diff(np.cos(fine))
        a, b, c, d = rng.dirichlet(np.ones(4)) * (rng.random(4) < 0.7) + [0.1, 0.0, 0.0, 0.0]
        a, b, c, d = np.array([a, b, c, d]) / (a + b + c + d)
        exact = Estimate(0.0, 0.0, "bound", "given")
        matrix = array if equal else ker.KernelMatrix(
            np.sqrt(masses)[:, None] * array / np.sqrt(masses), ker.Bins(edges), exact
        )  # fmt: skip
        self.law = a * ker.MatrixLaw(matrix) + b * ker.lambertian() + c * ker.specular() + d * ker.retroreflection()
        identity = np.eye(fine.size - 1)
        self.matrix = a * on_finer(array, masses, edges, fine) + b * np.tile(weight, (fine.size - 1, 1))
        self.matrix = self.matrix + c * identity[::-1] + d * identity
        self.beyond = np.array([d + c, d - c])
        self.power = int(rng.integers(1, 4))
        self.root = np.sqrt(weight)

    def spectrum(self):
        """Eigenvalues on step functions, the constants first, and beyond them."""
        symmetric = self.root[:, None] * self.matrix / self.root
        values = np.sort(np.linalg.eigvalsh(0.5 * (symmetric + symmetric.T)))[::-1]
        assert abs(values[0] - 1.0) < 1e-13
        return values[1:] ** self.power, self.beyond**self.power


@pytest.mark.parametrize("seed", range(12))
def test_every_tool_is_exact_for_random_finite_laws_with_isometries(seed):
    case = Case(np.random.default_rng([7, seed]))
    law = case.law if case.power == 1 else case.law**case.power
    inside, beyond = case.spectrum()
    everything = np.concatenate([inside, beyond])
    gap = spec.spectral_gap(law)
    assert abs(gap.value - (1.0 - everything.max())) <= gap.error + 1e-14 and gap.error <= ENOUGH, law
    slem = np.abs(everything).max()
    mixing = spec.mixing_time(law, 1e-3, "L2")
    assert abs(mixing.slem.value - slem) <= mixing.slem.error + 1e-14 and mixing.slem.error <= ENOUGH
    assert mixing.steps == mixing.earliest == int(np.ceil(np.log(1e-3) / np.log(slem)))
    found = spec.spectrum(law, k=5)
    assert found.errors.total().max() <= ENOUGH and abs(found.slem - slem) <= ENOUGH
    listed = np.concatenate([[1.0], inside, np.repeat(beyond, 6) if beyond.any() else []])
    listed = listed[np.argsort(-np.abs(listed), kind="stable")]
    assert np.allclose(np.sort(np.abs(found.values))[::-1], np.abs(listed[: len(found.values)]), atol=1e-13, rtol=0.0)
    enclosed = spec.enclosures(law, 3)
    for item in enclosed:
        assert item.kind == "bound" and item.width <= 2.0 * ENOUGH
        assert (item.label == "indexed") == (abs(item.value) > np.abs(beyond).max() + ENOUGH)
        assert min(abs(item.value - value) for value in (1.0, *everything)) <= 0.5 * item.width + 1e-14
        if item.index is not None:
            assert abs(abs(item.value) - abs(listed[item.index])) <= 0.5 * item.width + 1e-14
    if len(enclosed) < len(listed):
        assert enclosed.separation.radius >= abs(listed[len(enclosed)]) - 1e-14


def test_a_law_and_its_mirror_image_share_bins_and_a_product_is_a_matrix():
    """P = M J M with J f(theta) = f(pi - theta), by the matrix of three states and the reversal of bins."""
    edges = np.array([0.0, 0.7, 1.9, np.pi])
    rng = np.random.default_rng(3)
    array, masses = random_chain(rng, 3, edges)
    exact = Estimate(0.0, 0.0, "bound", "given")
    root = np.sqrt(masses)
    law = ker.MatrixLaw(ker.KernelMatrix(root[:, None] * array / root, ker.Bins(edges), exact))
    fine = np.array([0.0, 0.7, np.pi - 1.9, 1.9, np.pi - 0.7, np.pi])
    finer = on_finer(array, masses, edges, fine)
    whole = finer @ finer[::-1]
    weight = np.sqrt(-0.5 * np.diff(np.cos(fine)))
    symmetric = weight[:, None] * whole / weight
    top = np.sort(np.linalg.eigvalsh(0.5 * (symmetric + symmetric.T)))[-2]
    gap = spec.spectral_gap(law @ ker.specular() @ law)
    assert abs(gap.value - (1.0 - max(top, 0.0))) <= gap.error + 1e-14 and gap.error <= ENOUGH


def test_the_other_convention_turns_the_signs_beyond_the_bins():
    array = np.array([[0.6, 0.3, 0.1], [0.3, 0.4, 0.3], [0.1, 0.3, 0.6]])
    law = (0.5 * ker.MatrixLaw(array) + 0.5 * ker.specular()).in_specular_frame()
    values = np.linalg.eigvalsh(0.5 * array[:, ::-1] + 0.5 * np.eye(3))
    gap = spec.spectral_gap(law)
    assert abs(gap.value - (1.0 - max(np.sort(values)[-2], 0.5))) <= gap.error <= ENOUGH


@pytest.mark.parametrize("bins", [4, 12, 16])
def test_the_matrix_of_a_finite_law_in_finer_bins_has_the_laws_gap(bins):
    array, _ = random_chain(np.random.default_rng(5), 4)
    matrix = ker.discretise(ker.MatrixLaw(array), ker.Bins(bins))
    gap = spec.spectral_gap(matrix)
    assert abs(gap.value - (1.0 - np.sort(np.linalg.eigvals(array).real)[-2])) <= gap.error <= ENOUGH
    assert gap.verdict == "isolated" and spec.spectrum(matrix, 3).errors.total().max() <= ENOUGH
    assert abs(spec.mixing_time(matrix).slem.error) <= ENOUGH


def test_the_error_of_a_matrix_in_other_bins_is_said_to_be_that_of_the_law():
    array, _ = random_chain(np.random.default_rng(5), 4)
    matrix = ker.discretise(ker.MatrixLaw(array), ker.Bins(6))
    gap = spec.spectral_gap(matrix)
    assert gap.verdict == "undecided" and "distance from the law's" in gap.evidence[0]
    itself = float(gap.evidence[0].split("itself is ")[1].split("(")[0])
    assert abs(itself - (1.0 - np.sort(np.linalg.eigvals(matrix.array).real)[-2])) < 1e-13


def test_a_saved_matrix_still_has_the_laws_spectrum(tmp_path):
    matrix = ker.discretise(0.5 * ker.MatrixLaw([[0.7, 0.3], [0.3, 0.7]]) + 0.5 * ker.specular(), ker.Bins(4))
    again = ker.load_matrix(matrix.save(tmp_path / "matrix.npz"))
    assert again.beyond == matrix.beyond == (0.5, -0.5)
    assert (matrix @ again).beyond == (matrix**2).beyond == (0.25, 0.25)
    assert (0.5 * matrix + 0.5 * again).beyond == (0.5, -0.5) and matrix.in_specular_frame().beyond == (0.5, 0.5)
    assert ker.discretise(ker.specular(), ker.Bins([0.0, 1.0, np.pi])).beyond is None


# ---- laws that fall apart ----------------------------------------------------------------------------------------
BLOCKS = np.kron(np.eye(2), [[0.6, 0.4], [0.4, 0.6]])


@pytest.mark.parametrize(
    "kernel",
    [
        ker.MatrixLaw(BLOCKS),
        ker.MatrixLaw(BLOCKS) @ ker.MatrixLaw(BLOCKS),
        0.5 * ker.MatrixLaw(BLOCKS) + 0.5 * ker.retroreflection(),
        ker.discretise(ker.MatrixLaw(BLOCKS), ker.Bins(8)),
        ker.KernelMatrix(BLOCKS, ker.Bins(4), Estimate(0.0, 0.0, "bound", "given"), reversible=True),
    ],
    ids=repr,
)
def test_a_law_that_falls_apart_has_no_gap_and_says_that_1_is_double(kernel):
    gap = spec.spectral_gap(kernel)
    assert (gap.value, gap.error, gap.verdict) == (0.0, 0.0, "no gap")
    assert "multiplicity 2" in " ".join(gap.evidence)
    with pytest.raises(AccuracyError, match="gap"):
        spec.mixing_time(kernel)


def test_a_law_that_alternates_has_the_slem_1_and_a_gap():
    law = ker.MatrixLaw([[0.0, 1.0], [1.0, 0.0]])
    assert spec.spectral_gap(law).value == 1.0 and spec.spectrum(law).slem == pytest.approx(1.0, abs=1e-14)
    with pytest.raises(AccuracyError, match="gap"):
        spec.mixing_time(law)


def test_a_nearly_split_law_has_its_small_gap():
    law = ker.MatrixLaw([[1.0 - 1e-9, 1e-9], [1e-9, 1.0 - 1e-9]])
    gap = spec.spectral_gap(law)
    assert abs(gap.value - 2e-9) <= gap.error < 1e-13 and gap.verdict == "isolated"


def test_rays_that_show_no_transition_bound_the_gap_by_their_number():
    law = ker.MatrixLaw([[1.0 - 1e-6, 1e-6], [1e-6, 1.0 - 1e-6]])
    theta = ker.Bins(2).measure.sample((4000,), np.random.default_rng(0))
    matrix = ker.estimate(theta, law.sample(theta, np.random.default_rng(1)), ker.Bins(2))
    gap = spec.spectral_gap(matrix)
    assert gap.value == 0.0 and 2e-6 <= gap.error <= 0.01 and gap.verdict == "undecided"


# ---- messages ----------------------------------------------------------------------------------------------------
ARRAY = np.array([[0.75, 0.25], [0.25, 0.75]])


def test_single_precision_has_its_own_tolerance():
    array, _ = random_chain(np.random.default_rng(1), 7)
    law = ker.MatrixLaw(array.astype(np.float32))
    assert law.reversible
    gap = spec.spectral_gap(law)
    assert abs(gap.value - (1.0 - np.sort(np.linalg.eigvalsh(array))[-2])) < 1e-6 and gap.error < 1e-6
    with pytest.raises(InputError, match="rows that sum to 1"):
        ker.MatrixLaw(array.astype(np.float32).astype(np.float64))


def test_the_diffusivity_of_a_sweep_is_called_eta():
    found = spec.sweep(lambda a: ker.maxwell(a), {"a": [0.5]}, quantities=["eta"])
    assert found.rows[0].value * 4.0 / np.pi == pytest.approx(float(spec.diffusivity(ker.maxwell(0.5))))


def test_the_gap_in_the_specular_convention_of_a_law_that_is_in_it_is_its_own():
    law = (0.5 * ker.MatrixLaw(ARRAY) + 0.5 * ker.specular()).in_specular_frame()
    found = spec.sweep(lambda a: law, {"a": [1.0]}, quantities=["gap_specular"])
    assert found.rows[0].value == pytest.approx(float(spec.spectral_gap(law)), abs=1e-14)


@pytest.mark.parametrize("kind", ["rows", "sup"])
def test_distances_of_finite_laws_have_small_true_errors(kind):
    """By integrals of the difference of distribution functions, which are linear in cos(theta) on every bin."""
    rng = np.random.default_rng(3)
    one, other = random_chain(rng, 4)[0], random_chain(rng, 4)[0]
    angle = np.linspace(0.0, np.pi, 200_001)
    jumps = np.concatenate([np.zeros((4, 1)), np.cumsum(one - other, axis=1)], axis=1)
    areas = [np.trapezoid(np.abs(np.interp(-np.cos(angle), np.linspace(-1.0, 1.0, 5), row)), angle) for row in jumps]
    exact = np.mean(areas) if kind == "rows" else max(areas)
    laws = [ker.MatrixLaw(array) for array in (one, other)]
    mixed = [0.5 * law + 0.2 * ker.lambertian() + 0.3 * ker.specular() for law in laws]
    pair, part = (laws, 1.0) if kind == "rows" else (mixed, 0.5)
    found = ker.distance(*pair, kind=kind, tolerance=1e-9)
    assert abs(found.value - part * exact) <= found.error + 1e-10 and found.error <= 1e-8
