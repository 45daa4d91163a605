"""Pictures say what they show: labels, units, scales, and no gap where there is none."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.geometry.plotting.walls import vertical_stretch
from asperity.spectral.gap.verdict import draw_spectrum
from asperity.study import study_wall
from asperity.study.pictures import MOST_BOUNCES, chosen_rays, draw_outgoing_velocities, draw_study_wall, gallery


def new_axes():
    return Figure().subplots()


def lines_of(ax):
    return [line.get_xydata() for line in ax.lines]


@pytest.mark.parametrize("name", sorted(geo.WALLS))
def test_every_named_wall_has_labelled_axes_and_its_whole_depth(name):
    wall = geo.WALLS[name].build()
    ax = geo.draw_wall(wall, ax=new_axes())
    assert ax.get_xlabel() == "x (length units of the wall)" and ax.get_ylabel().startswith("y")
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    assert left < 0.0 and right > 1.0 and bottom < -wall.depth and top > 0.0
    outline = lines_of(ax)[0]
    assert outline[:, 1].min() == pytest.approx(-wall.depth, abs=2e-3)
    assert ax.get_aspect() == 1.0


@pytest.mark.parametrize("wall", [geo.rectangular_teeth(1e4), geo.dispersing_arcs(1e-3)])
def test_a_wall_that_is_not_drawn_to_scale_says_so(wall):
    ax = geo.draw_wall(wall, ax=new_axes())
    factor = vertical_stretch(wall)
    assert ax.get_aspect() == factor != 1.0
    words = f"stretched {factor:.3g}" if factor > 1.0 else f"compressed {1 / factor:.3g}"
    assert words in ax.get_ylabel()
    # the cell fills a picture of ordinary shape
    (bottom, top), (left, right) = ax.get_ylim(), ax.get_xlim()
    assert 0.3 < factor * (top - bottom) / (right - left) < 2.0


def test_shallow_curves_are_drawn_smoothly():
    outline = lines_of(geo.draw_wall(geo.focusing_arcs(1e-3), ax=new_axes()))[0]
    assert np.sum((outline[:, 0] >= 0.0) & (outline[:, 0] <= 1.0)) > 20


def test_a_wall_of_very_many_pieces_is_thinned_below_a_pixel():
    wall = geo.koch(6)
    outline = lines_of(geo.draw_wall(wall, ax=new_axes()))[0]
    assert len(wall.pieces) == 4096 and len(outline) < 3 * 4096 + 2
    cell = outline[(outline[:, 0] >= 0.0) & (outline[:, 0] <= 1.0)]
    distance, _ = cKDTree(cell).query(wall.vertices)
    assert distance.max() < 3e-3


def test_a_ray_enters_at_its_dot_and_leaves_at_its_ring():
    ax = geo.draw_wall(geo.focusing_arcs(1.2), [0.1, 0.7], [2.3, 1.1], ax=new_axes())
    ray = geo.trace(geo.focusing_arcs(1.2), [0.1, 0.7], [2.3, 1.1])
    points = [line for line in lines_of(ax) if len(line) == 1]
    assert np.allclose(np.concatenate(points), [[0.1, 0], [ray.x[0], 0], [0.7, 0], [ray.x[1], 0]], atol=1e-12)
    # an arrow in and an arrow out for each
    assert len(ax.texts) == 4


def test_a_path_continues_in_the_incoming_and_outgoing_direction():
    theta = 2.3
    ax = geo.draw_wall(geo.focusing_arcs(1.2), 0.1, theta, ax=new_axes())
    path = next(line for line in lines_of(ax)[2:] if len(line) > 3)
    out = float(geo.trace(geo.focusing_arcs(1.2), 0.1, theta).theta)
    before, after = path[0] - path[1], path[-1] - path[-2]
    assert np.arctan2(before[1], before[0]) == pytest.approx(theta, abs=1e-12)
    assert np.arctan2(after[1], after[0]) == pytest.approx(out, abs=1e-12)


def test_an_open_wall_shows_as_many_cells_as_its_rays_visit():
    wall = geo.Wall([geo.Segment((0, -0.5), (1, -0.5))], 1.0)
    low, high = geo.draw_wall(wall, 0.9, 2.6, ax=new_axes()).get_xlim()
    x = float(geo.trace(wall, 0.9, 2.6).x)
    assert low < min(0.9, x) and high > max(0.9, x)


@pytest.mark.parametrize(
    "name", [*sorted(geo.WALLS), "rectangular-teeth:height_to_width=500", "focusing-arcs:half_angle=0.001"]
)
def test_rays_chosen_for_a_picture_leave_soon(name):
    wall = geo.wall_from_text(name)
    x, theta = chosen_rays(wall)
    assert len(x) >= 3
    ray = geo.trace(wall, x, theta)
    assert ray.escaped.all() and ray.collisions.max() <= MOST_BOUNCES


def test_a_gap_is_shaded_and_named_with_its_verdict():
    law = ker.henyey_greenstein(0.5)
    ax = draw_spectrum(spec.spectrum(law, k=6), spec.spectral_gap(law), new_axes())
    labels = ax.get_legend_handles_labels()[1]
    assert any(label.startswith("gap 0.50000") and "isolated" in label for label in labels)
    assert "paper convention" in ax.get_title() and ax.get_ylabel() == "eigenvalue"
    low, high = ax.patches[0].get_bbox().intervaly
    assert (low, high) == pytest.approx((0.5, 1.0))


def test_no_gap_is_suggested_where_there_is_none():
    law = ker.TriangularTeethLaw(0.7)
    found = spec.spectrum(ker.discretise(law, ker.Bins(32)), k=6)
    ax = draw_spectrum(found, spec.spectral_gap(law), new_axes())
    labels = ax.get_legend_handles_labels()[1]
    assert not ax.patches and not any(label.startswith("gap") for label in labels)
    assert any("no gap" in label for label in labels) and any("matrix in Bins(32)" in label for label in labels)


def test_a_bare_spectrum_speaks_of_its_matrix_only():
    ax = spec.spectrum(ker.discretise(ker.TriangularTeethLaw(0.7), ker.Bins(32)), k=6).plot(new_axes())
    assert any("of this matrix" in label for label in ax.get_legend_handles_labels()[1])


def test_outgoing_velocities_lie_on_the_allowed_ones_and_carry_their_units():
    figure = Figure()
    K = ker.CollisionLaw.from_wall(geo.rectangular_teeth(1.0), geo.Disk(1.0, 0.5))
    draw_outgoing_velocities(K, figure)
    above, below = figure.axes
    assert above.get_ylabel() == "outgoing v2 (radius / time)" and below.get_xlabel() == "outgoing v1 (radius / time)"
    assert "probability" in below.get_ylabel()
    samples = next(line.get_xydata() for line in above.lines if "samples" in str(line.get_label()))
    # unit disk with m = 1, J = 1/2, from (1, -1, 0): v1^2 + v2^2 + 2 (v1 - 1)^2 = 2
    v1, v2 = samples.T
    assert np.allclose(v1**2 + v2**2 + 2.0 * (v1 - 1.0) ** 2, 2.0, atol=1e-12)
    labels = above.get_legend_handles_labels()[1]
    assert {"smooth disk", "no-slip disk"} <= set(labels)
    spin = above.child_axes[0]
    assert spin.get_xlabel() == "outgoing r omega (radius / time)"


def test_the_gallery_shows_every_named_wall_with_its_parameters():
    titles = [ax.get_title() for ax in gallery().axes if ax.axison]
    assert [title.split("\n")[0] for title in titles] == list(geo.WALLS)
    assert any("half_angle=1.2" in title for title in titles)


def test_the_picture_of_a_study_names_its_wall():
    ax = new_axes()
    draw_study_wall(study_wall(geo.flat(), "a flat wall", bins=4), ax)
    assert ax.get_title() == "a flat wall\ndot: a ray enters, ring: it leaves"
