"""The masses of cells of outgoing angles on patches of one itinerary, against closed forms and exact laws."""

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.itineraries.compiled.patches import Cells, Grid, masses_of_patches, masses_of_rows, room_for
from asperity.geometry.itineraries.hollow import Pieces
from asperity.kernels.bases.measure import SINE
from asperity.kernels.discretisation.method import Budget
from asperity.kernels.discretisation.traced import traced_matrix
from asperity.kernels.walls.cell_masses import _PLACES, _WEIGHTS, common_pieces, interpolation, positions

# Laws with an exact matrix; the walls are traced nevertheless.
WALLS = {
    "triangular teeth": geo.triangular_teeth(0.7),
    "rectangular teeth with flat tops": geo.rectangular_teeth(0.5),
    "focusing arcs": geo.focusing_arcs(0.9),
}


def entry(position):
    """The entry point at a position before the substitution, on (0, 1)."""
    return position**2 * (3.0 - 2.0 * position)


# In the channels of rectangular teeth the error is that of a sample; campaign `traced-teeth` counts how often it holds.
@pytest.mark.parametrize(
    ("name", "tolerance"), [(name, 1e-3) for name in WALLS] + [("triangular teeth", 1e-5), ("focusing arcs", 1e-5)]
)
def test_masses_of_traced_cells_agree_with_the_exact_law_within_their_error(name, tolerance):
    exact = ker.discretise(ker.WallLaw(WALLS[name]), ker.Bins(32)).symmetric
    found, error, _ = traced_matrix(WALLS[name], ker.Bins(32), Budget(tolerance))
    assert np.linalg.norm(found - exact) <= error <= 1.2 * tolerance


def test_cells_of_unequal_measure_that_break_the_mirror_symmetry_have_the_same_masses():
    edges = np.array([0.0, 0.3, 1.1, 1.2, 2.6, np.pi])
    law = ker.WallLaw(WALLS["focusing arcs"])
    found, error, _ = traced_matrix(law.wall, ker.Bins(edges), Budget(1e-5))
    assert np.linalg.norm(found - ker.discretise(law, ker.Bins(edges)).symmetric) <= error <= 1e-5


@pytest.mark.parametrize("level", [1, 2, 3])
@pytest.mark.parametrize("shift", [0.0, 1e-3, -0.49, 0.49])
def test_a_fold_is_crossed_twice_wherever_it_lies(level, shift):
    # theta' = 2 - (s - t)^2 with its maximum at t, also between an end and the first node
    nodes, weights = positions(level)
    top, edge = 0.5 + shift, 2.0 - 1e-4
    masses, errors = np.zeros((1, 2)), np.zeros(1)
    masses_of_rows(
        Grid(nodes, weights), np.array([[[0.0, 0.0, 1.0, 1.0]]]), (2.0 - (nodes - top) ** 2)[None, None],
        np.zeros(1, np.int64), np.zeros(1), Cells(np.array([edge]), np.ones(2)), masses, errors, room_for(2, 15, 31),
    )  # fmt: skip
    above = entry(min(top + 0.01, 1.0)) - entry(max(top - 0.01, 0.0))
    assert masses[0] == pytest.approx([1.0 - above, above], abs=1e-9)


def test_gaps_at_the_ends_count_with_half_their_width_and_a_uncertain_angle_with_the_shift_of_its_crossing():
    # theta' = 1 + s crosses the edge in the middle, where dx/ds = 3/2 of the width
    nodes, weights = positions(2)
    masses, errors = np.zeros((1, 2)), np.zeros(1)
    masses_of_rows(
        Grid(nodes, weights), np.array([[[0.1, 0.2, 0.8, 0.85]]]), (1.0 + nodes)[None, None],
        np.zeros(1, np.int64), np.array([1e-3]), Cells(np.array([1.5]), np.array([3.0, 4.0])), masses, errors,
        room_for(2, 15, 15),
    )  # fmt: skip
    assert masses[0] == pytest.approx([0.4, 0.35], abs=1e-12)
    assert errors[0] == pytest.approx(0.1 * 3.0 + 0.05 * 4.0 + 1e-3 * 1.5 * 0.6 * 5.0, rel=1e-9)


def test_the_integral_over_a_patch_is_that_of_the_region_between_the_crossings():
    # theta' = 1 + x s^2 (3 - 2 s): the region above the edge has a curved boundary that leaves through x = 1
    nodes, weights = positions(3)
    low, high, edge = np.array([1.0]), np.array([1.3]), 1.5
    rows = entry(_PLACES)
    outs = 1.0 + np.outer(rows, nodes)
    ends = np.tile([0.0, 0.0, 1.0, 1.0], (len(_PLACES), 1))
    masses = np.zeros((1, len(_PLACES), 2)), np.zeros((1, 2)), np.zeros(1), np.zeros((1, 15)), np.zeros((1, 15))
    masses_of_patches(
        (low, high, SINE.mass(low, high)), Grid(_PLACES, _WEIGHTS), Grid(nodes, weights),
        (ends[None], outs[None], np.zeros(1, np.int64)), (np.zeros(1),) * 3, np.ones(1), np.full(1, 1e-12),
        Cells(np.array([edge]), np.ones(2)), masses, room_for(2, 15, 31),
    )  # fmt: skip
    from scipy.integrate import quad

    below = quad(
        lambda u: entry(min(0.5 / u, 1.0)) * np.sin(1.0 + 0.3 * u) / 2 * 0.3, 0.0, 1.0, points=[0.5], epsabs=1e-13
    )[0]
    assert masses[1][0] == pytest.approx([below, SINE.mass(low, high)[0] - below], abs=1e-9)
    assert np.sqrt(masses[2][0]) < 1e-8


def test_an_itinerary_is_common_only_if_it_occurs_equally_often_at_all_angles():
    def row(labels):
        low = np.arange(float(len(labels)))
        return Pieces(1.0, low, low + 0.9, np.array(labels, np.uint64), low, 1e-9)

    common = common_pieces([row([5, 7, 5, 9]), row([7, 5, 5, 9]), row([5, 5, 9, 9, 7])])
    # places in the order of the rows: 4 and 8 are the first ones of the second and the third row
    assert sorted(map(tuple, common.tolist())) == [(0, 5, 8), (1, 4, 12), (2, 6, 9)]


def test_interpolation_at_the_positions_of_a_rule_is_exact_for_polynomials():
    nodes, weights = positions(1)
    matrix = interpolation(nodes, weights, np.array([0.0, 0.37, 1.0]))
    assert matrix @ nodes**6 == pytest.approx([0.0, 0.37**6, 1.0], abs=1e-13)
