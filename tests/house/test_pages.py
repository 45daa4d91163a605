"""Examples and scripts of pages run and are right, and the reference lists all public names."""

import importlib
import inspect
import math
import re
import runpy
import zlib
from pathlib import Path

import numpy as np
import pytest
from campaigns.engine import campaigns
from docs import reference

import asperity
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

DOCS = Path(__file__).parents[2] / "docs"
HOW_TO = sorted(path.stem for path in (DOCS / "how-to").glob("*.py"))
TUTORIALS = sorted((DOCS / "tutorials").glob("*.py"))


@pytest.fixture
def run(monkeypatch):
    """Runs a short example as a script, in which no window opens, and returns its names."""
    from matplotlib import pyplot

    monkeypatch.setattr(pyplot, "show", lambda: None)
    yield lambda name, folder="how-to": runpy.run_path(str(DOCS / folder / f"{name}.py"))
    pyplot.close("all")


def test_the_wall_and_its_law(run):
    P = run("a_wall_and_its_law")["P"]
    assert np.allclose(P.array, P.array.T, atol=1e-9) and np.allclose(P.array.sum(axis=1), 1.0)


def test_the_published_gap(run):
    names = run("a_gap_with_its_error")
    assert abs(float(names["gap"]) - 0.0373) < 5e-5 + names["gap"].error
    assert names["found"].high < 1 - float(names["gap"])


def test_the_profile_keeps_its_units(run):
    names = run("a_measured_profile")
    heights = names["height"] / 1000.0
    assert names["profile"].unit == "um"
    assert names["wall"].depth == pytest.approx(float(np.ptp(heights)), abs=1e-5)
    assert float(names["found"].tangential) == pytest.approx(1 + entry(names["law"], np.cos), abs=0.02)


def test_the_proved_interval_contains_the_estimate(run):
    names = run("a_proved_gap")
    low, high = map(float, names["proof"].interval)
    gap = spec.spectral_gap(names["law"], tolerance=1e-6)
    assert low - gap.error < gap.value < high + gap.error
    # Feres and Zhang 2010
    assert f"{low:.4f}" == f"{high:.4f}" == "0.0373"
    assert high - low < 1e-4 * high
    # in the picture the thresholds separate the eigenvalues as the proof says
    first, even, second, _ = names["steps"]
    certificate = names["proof"].certificate
    assert first < float(certificate["threshold"]) < second and float(certificate["other"]) < even


def entry(law, function):
    """3 <cos, P cos>, by sampling."""
    theta = ker.SINE.sample(200_000, np.random.default_rng(3))
    return 3 * float(np.mean(function(theta) * function(law.sample(theta, np.random.default_rng(4)))))


def test_the_disk_conserves_energy_and_rolling_momentum(run):
    names = run("a_disk")
    disk, after, before = names["disk"], names["after"], names["before"]
    assert np.allclose(disk.inner(after, after), disk.inner(before, before), rtol=1e-12)
    assert np.allclose(disk.rolling_momentum(after), disk.rolling_momentum(before), atol=1e-12)


def test_the_table_falls_in_error_and_its_draws_keep_the_cosine_law(run):
    names = run("a_table_for_dsmc")
    error = {name: [table.error for table in found] for name, found in names["tables"].items()}
    rate = {name: math.log2(found[0] / found[-1]) / 4 for name, found in error.items()}
    assert rate["round bumps"] > 1.5 and 0.8 < rate["triangular teeth"] < 1.2
    assert abs(np.mean(names["cosines"] ** 2) - 1 / 3) < 5 * 0.0018 / 1.96
    assert "error of bilinear interpolation" in names["path"].read_text(encoding="utf-8")


def test_partly_diffuse_facets_accommodate_more_than_a_guess_and_along_by_the_probability_of_a_hit(run):
    names = run("partly_diffuse_facets")
    rng = np.random.default_rng(0)
    x, theta = rng.random(2**16), ker.SINE.sample(2**16, rng)
    for name, wall in names["walls"].items():
        hits, found = geo.trace(wall, x, theta).collisions, names["found"][name]
        mirrors = float(spec.accommodation(ker.HemisphereLaw(ker.WallLaw(wall)), 1e-3).tangential)
        for fraction, one in zip(names["fractions"], found, strict=True):
            kept = (1.0 - fraction) ** hits
            assert abs(one.along.value - 1.0 + kept.mean()) <= 4.5 * kept.std() / 2**8 + one.along.error
            assert one.tangential.value > mirrors + fraction * (1.0 - mirrors)
    # by independent rays in space
    assert names["found"]["steep grooves"][-1].across.value == pytest.approx(1.297, abs=2e-3)
    assert np.allclose(np.linalg.norm(names["reflected"], axis=1), np.linalg.norm(names["velocities"], axis=1))


def test_grains_conserve_energy_and_momentum_and_slide_if_smooth_and_roll_back_if_not(run):
    names = run("a_granular_collision")
    disks, before, rest = (names["first"], names["second"]), names["before"], names["rest"]
    contact = names["contact"]
    for law, restitution in (("smooth", -1.0), ("no-slip", 1.0)):
        after = names["laws"][law].sample(names["normal"], before, rest, rng=1)
        for one, other, factor in zip(contact(*after), contact(before, rest), (restitution, 1.0), strict=True):
            assert np.allclose(one, -factor * other)
    after = names["laws"]["rough"].sample(names["normal"], before, rest, rng=1)

    def energy(*velocities):
        return sum(
            disk.mass * (v[..., 0] ** 2 + v[..., 1] ** 2) + disk.rim_mass * v[..., 2] ** 2
            for disk, v in zip(disks, velocities, strict=True)
        )

    assert np.allclose(energy(*after), energy(before, rest), rtol=1e-12)
    momentum = [
        sum(disk.mass * v[..., :2] for disk, v in zip(disks, pair, strict=True)) for pair in (after, (before, rest))
    ]
    assert np.allclose(*momentum, rtol=1e-12)


def test_a_gas_collides_at_the_rate_of_enskog(run):
    names = run("a_gas_of_rough_disks")
    for name, rates in names["found"].items():
        for rate, theory in zip(rates, names["predicted"][name], strict=True):
            assert abs(float(rate) - theory) < 2 * rate.error < 0.08 * theory
    # the pair correlation at contact belongs to it: without it the densest gas would be .56 of the rate
    assert names["contact"](0.3) == pytest.approx((2.06316 - 1) / 0.6, rel=1e-3)


def test_no_slip_plates_confine_and_rough_plates_do_not(run):
    ratio = run("no_slip_billiards")["ratio"]
    assert ratio["no-slip plates"].max() <= 1 + 1e-12 and np.median(ratio["rough plates"]) > 1


def test_least_resistance_is_below_the_smooth_body_and_the_best_triangle_below_retroreflection(run):
    names = run("the_least_resistance")
    assert names["least"].lower < 0.987823750 < names["least"].upper + 1e-9
    assert math.sqrt(2) < float(names["best"].value) < names["most"].upper == 1.5


def test_the_mushroom_between_flat_tops_is_the_farthest_from_retroreflection(run):
    walls = run("retroreflectors")["walls"]
    distance = {name: float(ker.retroreflection_distance(wall, rng=1)) for name, wall in walls.items()}
    assert max(distance, key=distance.get) == "mushroom" and distance["helmet"] < 0.5 * distance["mushroom"]


def test_the_wall_has_the_wanted_moments(run):
    names = run("a_wall_for_a_law")
    assert abs(names["difference"]).max() < 1e-10


def test_a_measured_surface_is_levelled_and_its_quarters_differ(run):
    names = run("a_measured_surface")
    assert names["surface"].unit == "um" and names["surface"].rms_slope == pytest.approx(0.567, abs=0.002)
    whole, quarters = names["found"].tangential, [float(one) for one in names["quarters"]]
    assert whole.value == pytest.approx(0.476, abs=0.01) and max(quarters) - min(quarters) > 5 * whole.error
    assert names["gap"].verdict == "isolated" and names["ax"].get_xlabel() == "$v_x$ / speed"


def test_sobol_sequences_beat_independent_rays(run):
    report = run("error_against_time")["report"]
    error = {row.method: row.error for row in report.rows}  # of the largest budget
    assert error["Sobol sequence"] < error["independent rays"]


@pytest.mark.slow
def test_a_wall_of_a_formula_has_so_many_pieces_and_the_largest_gap_between(run):
    found = run("a_wall_from_a_formula")
    gaps = [row.value for row in found["table"].rows]
    assert len(found["wall"].pieces) == 28 and len(found["ramps"].pieces) == 3
    assert min(gaps[1:3]) > max(gaps[0], gaps[3]) + 0.05


@pytest.mark.parametrize("name", ["knudsen_diffusion", "two_laws_compared", "a_sweep", "a_gas_channel", "a_tube"])
def test_the_slower_examples_agree_with_what_is_known(run, name):
    names = run(name)
    if name == "knudsen_diffusion":
        eta = [found.eta for found in names["found"].values()]
        zeta = -math.log(9) / 8
        assert eta == pytest.approx([1, 1, 1, (1 + zeta) / (1 - zeta), 3], abs=1e-6)
    elif name in ("a_gas_channel", "a_tube"):
        # L/h = 10 and L/R = 10
        passing, clausing = names["passing"], {"a_gas_channel": 0.24056, "a_tube": 0.1909424}[name]
        diffuse = passing["diffuse"] if name == "a_gas_channel" else passing["diffuse"][-1]
        assert float(diffuse) == pytest.approx(clausing, abs=5e-6)
        if name == "a_tube":
            least, _, mixed, half, most = (float(passing[key][-1]) for key in (
                "grooves across", "diffuse", "Maxwell, 80 % diffuse", "grooves at random", "grooves along",
            ))  # fmt: skip
            # of an interval that ends at 1 the middle is given
            assert least < clausing < mixed < half < most == pytest.approx(1.0, abs=3e-5)
    elif name == "two_laws_compared":
        distances = [float(found) for found in names["distances"]]
        # the distance is convex in the fraction
        slopes = np.diff(distances) / np.diff(names["fractions"])
        assert np.all(np.diff(slopes) > -2e-2) and min(distances) < distances[0]
    else:
        assert names["table"].rows[-1].verdict == "essential edge"
        assert names["table"].rows[-1].value == pytest.approx(1 - 3 / 8 * math.log(9), abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_says_what_it_computes(path, run):
    """Its assertions hold, and its pages are linked where readers begin."""
    source = path.read_text(encoding="utf-8")
    run(path.stem, "tutorials")
    assert source.count("\n# %%\n") >= 12 and source.count("\nassert ") >= 8
    assert f"docs/tutorials/{path.name}" in (DOCS.parent / "README.md").read_text(encoding="utf-8")


def test_no_line_of_a_page_is_lost_as_a_comment():
    """A line that begins with a percent sign is a comment in Markdown of MyST: "95 %" may not be broken before it."""
    pages = [page for page in DOCS.rglob("*.md") if not {"_build", "generated"} & set(page.parts)]
    lines = [(page.name, line) for page in pages for line in page.read_text(encoding="utf-8").splitlines()]
    assert len(pages) > 40
    assert not [(name, line) for name, line in lines if line.lstrip().startswith("%")]


def test_every_work_of_the_bibliography_is_cited():
    """Each author of an entry is named on another page or in a docstring."""
    root = DOCS.parent
    files = [page for page in DOCS.rglob("*.md") if page.name != "bibliography.md"]
    files += [
        path for room in ("docs/how-to", "geometry", "kernels", "spectral") for path in (root / room).rglob("*.py")
    ]
    text = "".join(path.read_text(encoding="utf-8") for path in files if "_build" not in path.parts)
    entries = re.split(r"^- ", (DOCS / "bibliography.md").read_text(encoding="utf-8"), flags=re.M)[1:]
    authors = re.compile(r"[A-Z][\w.-]*\. ((?:de |Garcia )?[A-Z]\w+)")
    names = [authors.findall(re.split(r"\*|\[|\d{4}", entry)[0]) for entry in entries]
    assert len(entries) > 30 and all(names)
    assert [name for found in names for name in found if name not in text] == []


def test_the_commands_on_the_pages_exist():
    root = DOCS.parent
    pages = [root / "README.md", root / "CONTRIBUTING.md", root / "campaigns" / "README.md", *DOCS.rglob("*.md")]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages if "generated" not in page.parts)
    scripts = set(re.findall(r"python -m\s+campaigns\.([a-z][\w.]*\w)", text))
    named = set(re.findall(r"python -m\s+campaigns\s([a-z][\w-]*)", text))
    assert named <= set(campaigns()) and len(scripts | named) > 18
    paths = [root / "campaigns" / name.replace(".", "/") for name in sorted(scripts)]
    assert [str(p) for p in paths if not (p.with_suffix(".py").exists() or (p / "__main__.py").exists())] == []


def test_every_campaign_of_the_table_has_a_section():
    page = (DOCS / "checked.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| \[([^]]+)\]\(#([\w-]+)\) \| [^|]+\| ([^|]+) \| ([^|]+) \| (\d+) \| `", page, re.MULTILINE)
    assert len(rows) > 20
    headings = {line[3:].lower().replace(" ", "-") for line in page.splitlines() if line.startswith("## ")}
    assert {anchor for _, anchor, *_ in rows} == headings


def test_every_short_example_is_in_the_story_and_runs_here():
    assert sorted(reference.STORY) == HOW_TO
    # `make check` builds the documentation without running them
    text = Path(__file__).read_text(encoding="utf-8")
    assert [name for name in HOW_TO if f'"{name}"' not in text] == []


def test_small_pictures_of_pages_are_drawn_and_exist(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(DOCS)
    thumbnails = importlib.import_module("thumbnails")
    thumbnails.write_thumbnails(tmp_path / "generated" / "thumbnails")
    asked = [
        re.findall(r'^# sphinx_gallery_thumbnail_path = "(.*)"$', path.read_text(encoding="utf-8"), re.M)
        for folder in ("tutorials", "how-to", "examples") for path in (DOCS / folder).glob("*.py")
    ]  # fmt: skip
    names = {name for found in asked for name in found}
    assert {f"generated/thumbnails/{name}.png" for name in thumbnails.PICTURES} <= names
    assert all((DOCS / name).exists() or (tmp_path / name).stat().st_size > 2000 for name in names)


def test_the_reference_lists_every_public_name_once(tmp_path):
    reference.write_pages(tmp_path)
    listed = [
        line.strip().removeprefix("~")
        for page in tmp_path.glob("task-*.rst")
        for line in page.read_text(encoding="utf-8").splitlines()
        if line.startswith("   ~asperity.")
    ]
    rooms = (asperity.geometry, asperity.kernels, asperity.spectral)
    public = {f"{room.__name__}.{name}" for room in rooms for name in room.__all__}
    assert len(listed) == len(set(listed)) and set(listed) | reference.ELSEWHERE == public
    by_hand = (DOCS / "api" / "index.md").read_text(encoding="utf-8")
    assert "automodule:: asperity.geometry.disk.symbolic" in by_hand and "   verify\n" in by_hand


def test_classes_that_functions_return_are_documented_with_them_and_are_no_public_names():
    documented = {name for names in reference.returned_classes().values() for name in names}
    for name in documented:
        module, _, last = name.rpartition(".")
        room = importlib.import_module(".".join(module.split(".")[:2]))
        assert inspect.getdoc(getattr(importlib.import_module(module), last)), name
        assert last not in dir(room) and not hasattr(room, last), name
    for room in (asperity.geometry, asperity.kernels, asperity.spectral):
        for function in filter(inspect.isfunction, (getattr(room, name) for name in room.__all__)):
            found = vars(inspect.getmodule(function)).get(inspect.signature(function).return_annotation)
            if inspect.isclass(found) and found.__module__.startswith(f"{room.__name__}."):
                public = found.__name__ in dir(room) or issubclass(found, ker.Law)
                assert public or f"{found.__module__}.{found.__name__}" in documented, function


def test_a_folder_without_a_task_has_its_own_page(monkeypatch, tmp_path):
    monkeypatch.setattr(reference, "TASKS", reference.TASKS[1:])
    reference.write_pages(tmp_path)
    assert "asperity.geometry.Wall" in (tmp_path / "task-geometry-walls.rst").read_text(encoding="utf-8")


def test_inventories_have_the_links_of_the_table(tmp_path):
    found = reference.write_inventories(DOCS / "links.txt", tmp_path)
    assert set(found) == {"python", "numpy", "scipy", "matplotlib"}
    head, packed = Path(found["matplotlib"]).read_bytes().split(b"by zlib.\n")
    assert head.startswith(b"# Sphinx inventory version 2\n# Project: matplotlib\n")
    page = "api/_as_gen/matplotlib.axes.Axes.html#matplotlib.axes.Axes"
    for name in ("Axes", "matplotlib.axes.Axes"):
        assert f"{name} py:class 1 {page} -" in zlib.decompress(packed).decode().splitlines()


# What a block of these pages expects before it, and its numbers in small.
BEFORE = {"sweeps.md": "law, client = ker.lambertian(), None"}
SMALLER = {
    "points=50": "points=8",
    "10**10": "2**12",
    "resolution=0.01": "resolution=0.5",
    "in geo.WALLS.items()": "in list(geo.WALLS.items())[1:2]",
}


def python_blocks():
    pages = [page for page in DOCS.rglob("*.md") if not {"_build", "generated"} & set(page.parts)]
    for page in [*pages, DOCS.parent / "README.md"]:
        blocks = re.findall(r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.M)
        # neither a batch system nor a package that the library does not use is at hand; scripts that start workers are
        # run in tests/spectral/sweeps/test_sweep_faults.py
        blocks = [block for block in blocks if not re.search(r"SLURMCluster|uncertainties|client=\d", block)]
        if blocks:
            yield pytest.param(page.name, blocks, id=page.name)


@pytest.mark.slow
@pytest.mark.parametrize(("page", "blocks"), list(python_blocks()))
def test_the_scripts_on_a_page_run_in_small(page, blocks, tmp_path, monkeypatch):
    h5py = pytest.importorskip("h5py")
    monkeypatch.chdir(tmp_path)
    with h5py.File("pairs.h5", "w") as file:
        file["in"], file["out"] = np.arccos(np.random.default_rng(0).uniform(-1.0, 1.0, (2, 1000)))
    names = {"__name__": "__main__", "h5py": h5py, "geo": geo, "ker": ker, "spec": spec}
    exec(BEFORE.get(page, ""), names)
    for block in blocks:
        for full, small in SMALLER.items():
            block = block.replace(full, small)
        exec(compile(block, page, "exec"), names)


@pytest.mark.parametrize("room", ["geometry", "kernels", "spectral"])
def test_the_help_of_a_room_lists_each_public_name_once_below_what_people_do(room):
    module = importlib.import_module(f"asperity.{room}")
    lines = [line.partition(": ") for line in module.__doc__.split("\n- ")[1:]]
    listed = [name for _, _, names in lines for name in re.findall(r"\w+", names)]
    assert sorted(listed) == sorted(module.__all__)
    titles, heads = [title for _, title, _ in reference.sections()], [head for head, _, _ in lines]
    assert [*(title for title in titles if title in heads), *(set(heads) - set(titles))] == heads
    assert set(heads) - set(titles) <= {"Verify a formula, and the formulas of a disk"}
    assert set(dir(module)) == set(module.__all__) and set(dir(asperity)) == set(asperity.__all__)
