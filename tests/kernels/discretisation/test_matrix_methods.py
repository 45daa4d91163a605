"""The table of methods: its order, how a method is added, and what laws made of others make of it."""

import re

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import InputError
from asperity.kernels.discretisation import methods
from asperity.kernels.discretisation.method import Method, computed

BASIS = ker.Bins(4)
HG, TEETH = ker.henyey_greenstein, ker.RectangularTeethLaw(0.8)


def test_the_docstring_of_discretise_is_the_table_of_methods():
    stated = re.findall(r"^ *(\d+)\. ``(\w+)`` \((.+?)\):", ker.discretise.__doc__, re.MULTILINE)
    asked = [(method.matrix.__name__, method.name) for method in methods.METHODS + methods.SAMPLED]
    assert stated == [(str(number), *names) for number, names in enumerate(asked, start=1)]


@pytest.mark.parametrize(
    ("law", "name", "method"),
    [
        (TEETH, "by_isometry_table", "exact"), (TEETH, "by_branches", "exact"), (TEETH, "by_sobol_rays", "qmc"),
        (HG(0.5), "by_density", "quadrature"), (HG(0.5), "by_independent_rays", "monte-carlo"),
        (0.5 * HG(0.5) + 0.5 * ker.lambertian(), "by_conditionals", "quadrature"),
        (ker.InvolutionLaw(lambda theta: np.pi - theta), "by_map", "quadrature"),
    ],
)  # fmt: skip
def test_a_method_is_called_by_its_name(law, name, method):
    P, usual = (ker.discretise(law, BASIS, one, samples=2**14) for one in (name, "auto"))
    assert P.method == method and np.linalg.norm(P.symmetric - usual.symmetric) <= 2.0 * (
        float(P.error) + float(usual.error)
    )


def test_a_method_that_does_not_take_the_law_is_refused():
    with pytest.raises(InputError, match=r"has no method 'by_arc_polygons'; it has exact, qmc, monte-carlo"):
        ker.discretise(TEETH, BASIS, "by_arc_polygons")


def one_product(law, basis, budget):
    """The recipe "Add a method" of CONTRIBUTING.md: the Lambertian law, whose matrix is a product of two vectors."""
    return computed(np.outer(basis.constant, basis.constant), basis, "exact", 1e-15, "one product", "bound")


@pytest.fixture
def _with_flat(monkeypatch):
    monkeypatch.setattr(
        methods, "METHODS", (Method("exact", lambda law, _: law == ker.lambertian(), one_product), *methods.METHODS)
    )


@pytest.mark.usefixtures("_with_flat")
def test_a_new_method_is_used_for_the_law_and_for_all_that_is_made_of_it():
    found = ker.discretise(ker.lambertian(), BASIS)
    assert found.method == "exact" and found.error.method == "one product"
    assert ker.discretise(ker.lambertian(), BASIS, "quadrature").method == "quadrature"
    assert ker.discretise(ker.maxwell(0.5), BASIS, "exact").method == "exact"
    assert ker.discretise(0.5 * ker.lambertian() + 0.5 * HG(0.5), BASIS).method == "exact + quadrature"
    frame = ker.lambertian().in_specular_frame()
    assert ker.discretise(frame, BASIS).method == ker.discretise(frame, BASIS, "exact").method == "exact"


def test_sums_with_chains_that_are_too_long_to_be_multiplied_out_have_matrices():
    long = (0.5 * TEETH + 0.5 * HG(0.4)) ** 6
    total = 0.5 * long + 0.5 * ker.lambertian()
    found, part = (ker.discretise(law, BASIS, tolerance=1e-4) for law in (total, long))
    flat = ker.discretise(ker.lambertian(), BASIS)
    error = float(found.error) + float(part.error)
    assert np.linalg.norm(found.symmetric - 0.5 * part.symmetric - 0.5 * flat.symmetric) <= error
    mirrored = ker.discretise(total @ ker.specular(), BASIS, tolerance=1e-4)
    turned = found.in_specular_frame()
    assert np.linalg.norm(mirrored.symmetric - turned.symmetric) <= float(mirrored.error) + float(found.error)


def test_a_wall_takes_a_tolerance_of_zero_as_one_that_is_out_of_reach():
    found = ker.discretise(ker.WallLaw(geo.dispersing_arcs(0.5)), ker.Legendre(2), tolerance=0.0, samples=2**14)
    assert 0.0 < float(found.error) < 1e-2


def test_sums_of_chains_in_both_frames_and_walls_of_parts_in_the_other_frame_have_matrices():
    square = ker.discretise((0.5 * ker.lambertian() + 0.5 * ker.specular()) ** 2, BASIS)
    assert np.allclose(
        square.symmetric,
        ker.discretise(ker.maxwell(0.5), BASIS).symmetric @ (ker.discretise(ker.maxwell(0.5), BASIS).symmetric),
    )
    mixed = ker.discretise(0.5 * TEETH + 0.5 * (ker.TriangularTeethLaw(0.7) @ ker.specular()), BASIS, "exact")
    parts = ker.discretise(TEETH, BASIS), ker.discretise(ker.TriangularTeethLaw(0.7), BASIS).in_specular_frame()
    assert np.allclose(mixed.symmetric, 0.5 * parts[0].symmetric + 0.5 * parts[1].symmetric, atol=1e-13)
    wall = ker.WallLaw(
        geo.Wall.from_vertices([(0, 0), (1, -1), (2, 0), (3, 0), (3, -1.5), (3.5, -1.5), (3.5, 0), (5, 0)])
    )
    exact, rays = (ker.discretise(wall.in_specular_frame(), BASIS, method) for method in ("exact", "qmc"))
    assert rays.method == "qmc" and np.linalg.norm(rays.symmetric - exact.symmetric) <= 2.0 * float(rays.error)
