"""Sources that the pages are built from: the reference by task, inventories of other documents, the gallery's order."""

from __future__ import annotations

import inspect
import sys
import zlib
from importlib import import_module
from pathlib import Path

ROOMS = ("geometry", "kernels", "spectral")
# By task: the name of its page, its title, and the folders whose public names it lists.
TASKS = (
    ("walls", "Make a wall", ("geometry.walls", "geometry.cells", "geometry.curves")),
    ("surfaces", "Make a surface that is rough in two directions", ("geometry.surfaces",)),
    ("rays", "Trace rays", ("geometry.tracing", "geometry.scene")),
    ("pictures", "Draw walls", ("geometry.plotting",)),
    ("laws", "Take and combine laws", ("kernels.laws", "kernels.hemisphere")),
    ("laws-of-walls", "Take the law of a wall", ("kernels.walls",)),
    (
        "matrices",
        "Compute the matrix of a law",
        ("kernels.discretisation", "kernels.sampling", "kernels.matrices", "kernels.bases"),
    ),
    (
        "spectra",
        "Compute spectra and gaps",
        ("spectral.gap", "spectral.eigenvalues", "spectral.bounds", "spectral.essential"),
    ),
    ("consequences", "Compute what follows from a law", ("spectral.consequences",)),
    ("sweeps", "Vary parameters", ("spectral.sweeps",)),
    ("distances", "Compare laws", ("kernels.distances",)),
    ("disks", "Collide disks", ("geometry.disk", "kernels.collisions", "geometry.collisions", "geometry.tables")),
    ("resistance", "Find the least and greatest resistance", ("kernels.aerodynamics",)),
    ("inverse", "Find a wall for a law", ("kernels.inverse",)),
    ("proofs", "Prove a gap", ("spectral.proofs",)),
    ("billiards", "Play billiards and gases", ("kernels.billiards",)),
    ("positions", "Let the law depend on the position", ("kernels.positions",)),
    ("moving-walls", "Reflect from walls that move", ("kernels.thermal",)),
    ("work-diagrams", "Measure error against time", ("spectral.work_diagrams",)),
)
# Classes that only other objects return or are built upon, by the public name on whose page they are documented: their
# names in its module, or their full names below asperity.
RETURNED = {
    "geometry.Wall": "Curve TracePlan geometry.cells.cell.Hollow",
    "geometry.wall_from_text": "NamedWall",
    "geometry.trace": "Trace",
    "geometry.Surface": "SurfaceTrace",
    "geometry.billiard_map": "BoundaryStates",
    "geometry.collide": "RigidCollision",
    "geometry.collide_cylinder": "CylinderCollision",
    "geometry.collide_modified": "ModifiedCollision",
    "geometry.collide_pair": "PairCollision",
    "geometry.shadow": "Shadow CollisionConstants",
    "kernels.Law": "BranchLaw DrivenLaw Combination Composition Power SpecularFrame kernels.laws.tables.Table",
    "kernels.KernelMatrix": "Defect SymmetryDefect",
    "kernels.SINE": "AngularMeasure",
    "kernels.CollisionLaw": "VelocityLaw CollisionCombination",
    "kernels.HemisphereLaw": "DirectionLaw DirectionFactor HemisphereCombination AzimuthalBlock "
    "kernels.hemisphere.direction_tables.DirectionTable",
    "kernels.limit_study": "LimitStudy",
    "kernels.weak_limit": "WeakLimit",
    "kernels.play": "BilliardRecord Reflector",
    "kernels.play_gas": "GasRecord GasStatistics",
    "kernels.distance": "Distance",
    "kernels.difference_test": "DifferenceTest",
    "kernels.displacements": "Displacements",
    "kernels.extremal_resistance": "ExtremalResistance",
    "kernels.PolygonalBody": "BodyForce Scattering",
    "kernels.spin_force": "SpinForce",
    "kernels.wall_for": "WallForLaw",
    "kernels.design_wall": "WallDesign",
    "kernels.exchange_hollow": "ExchangeHollow Generations",
    "kernels.dichotomy": "Dichotomy",
    "spectral.enclosures": "Enclosures Enclosure Separation",
    "spectral.exit_times": "ExitTimes",
    "spectral.conductance": "Conductance",
    "spectral.diffusivity": "Diffusivity",
    "spectral.channel_diffusivity": "ChannelDiffusivity",
    "spectral.laplacian_comparison": "LaplacianComparison",
    "spectral.mixing_time": "MixingTime",
    "spectral.accommodation": "Accommodation spectral.consequences.grooves_accommodation.SpaceAccommodation "
    "spectral.consequences.surface_accommodation.SurfaceAccommodation",
    "spectral.channel_paths": "ChannelPaths",
    "spectral.Spectrum": "SpectrumErrors",
    "spectral.hilbert_schmidt_norm": "HilbertSchmidtNorm",
    "spectral.essential_edge": "EssentialEdge",
    "spectral.ensemble": "Ensemble EnsembleRow",
    "spectral.SweepTable": "SweepRow Extremum",
    "spectral.fit_order": "FittedOrder",
    "spectral.WorkReport": "WorkRow MethodFacts Machine",
}
# docs/api/index.md documents their contents by hand
ELSEWHERE = {"asperity.geometry.symbolic", "asperity.geometry.verify"}
# Objects whose folder nothing but their own module knows.
FOLDERS = {"asperity.geometry.WALLS": "geometry.walls"}
STORY = (
    "a_wall_and_its_law",
    "a_gap_with_its_error",
    "a_proved_gap",
    "a_wall_from_a_formula",
    "a_measured_profile",
    "a_measured_surface",
    "a_disk",
    "a_granular_collision",
    "a_gas_of_rough_disks",
    "no_slip_billiards",
    "a_gas_channel",
    "a_tube",
    "a_table_for_dsmc",
    "partly_diffuse_facets",
    "knudsen_diffusion",
    "retroreflectors",
    "two_laws_compared",
    "the_least_resistance",
    "a_wall_for_a_law",
    "a_sweep",
    "error_against_time",
)


class StoryOrder:
    """Sorts short examples as STORY, tutorials and studies by name; sphinx-gallery takes it by its name."""

    def __init__(self, folder: object) -> None:
        self.folder = folder

    def __call__(self, filename: object) -> tuple[int, str]:
        name = Path(str(filename)).stem
        return STORY.index(name) if name in STORY else len(STORY), name


def home_of(thing: object) -> str:
    """The module of an object; of a constant, that of its class."""
    return getattr(thing, "__module__", None) or type(thing).__module__


def folder_of(name: str, thing: object) -> str:
    """Room and folder of a public name, as "geometry.walls"."""
    return FOLDERS.get(name) or ".".join(home_of(thing).split(".")[1:3])


def returned_classes() -> dict[str, list[str]]:
    """Full names of the classes of `RETURNED`, by the full name of the object on whose page they are documented."""
    found = {}
    for name, classes in RETURNED.items():
        room, _, public = name.partition(".")
        home = sys.modules[home_of(getattr(import_module(f"asperity.{room}"), public))]
        paths = [one.rpartition(".") for one in classes.split()]
        every = [getattr(import_module(f"asperity.{path}") if path else home, last) for path, _, last in paths]
        found[f"asperity.{name}"] = [f"{one.__module__}.{one.__name__}" for one in every]
    return found


def names_by_folder() -> dict[str, list[str]]:
    """Full names of everything that the rooms export, by folder; what is documented elsewhere is left out."""
    found: dict[str, list[str]] = {}
    for room in ROOMS:
        module = import_module(f"asperity.{room}")
        for name in module.__all__:
            full = f"asperity.{room}.{name}"
            if full not in ELSEWHERE:
                found.setdefault(folder_of(full, getattr(module, name)), []).append(full)
    return found


def sections() -> list[tuple[str, str, list[tuple[str, list[str]]]]]:
    """By page: its name, its title, and folders with their names. A folder that no task has gets a page of its own."""
    names = names_by_folder()
    used = {folder for _, _, folders in TASKS for folder in folders}
    pages = [*TASKS, *((folder.replace(".", "-"), first_line(folder), (folder,)) for folder in names.keys() - used)]
    return [(page, title, [(f, names[f]) for f in folders if f in names]) for page, title, folders in pages]


def first_line(folder: str) -> str:
    """The first sentence of the docstring of a folder, without its full stop."""
    text = inspect.getdoc(import_module(f"asperity.{folder}")) or folder
    return text.splitlines()[0].rstrip(".")


def write_pages(target: Path) -> None:
    """Write a page for each task, with tables whose entries have pages of their own, and the list of the pages."""
    target.mkdir(parents=True, exist_ok=True)
    listed = sections()
    for page, title, folders in listed:
        lines = [title, "=" * len(title), ""]
        for folder, names in folders:
            lines += [first_line(folder) + ".", ""]
            for template, wanted in (("noun", True), ("action", False)):
                chosen = [name for name in names if is_class(name) == wanted]
                if chosen:
                    lines += [".. autosummary::", "   :toctree:", f"   :template: autosummary/{template}.rst", ""]
                    lines += [f"   ~{name}" for name in chosen] + [""]
        write(target / f"task-{page}.rst", "\n".join(lines))
    entries = "".join(f"   generated/task-{page}\n" for page, _, _ in listed)
    write(target / "tasks.txt", f".. toctree::\n   :maxdepth: 1\n\n{entries}")


def is_class(name: str) -> bool:
    module, _, last = name.rpartition(".")
    return inspect.isclass(getattr(sys.modules[module], last))


def write(path: Path, text: str) -> None:
    """Only if it differs, so that a second build reads it again only then."""
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def write_inventories(table: Path, target: Path) -> dict[str, str]:
    """Write an inventory for each project of a table of links, in Sphinx's format; returns the files by project."""
    lines: dict[str, list[str]] = {}
    for row in table.read_text(encoding="utf-8").splitlines():
        if not row.startswith("#"):
            project, kind, page, *names = row.split()
            lines.setdefault(project, []).extend(f"{name} py:{kind} 1 {page}#{names[0]} -" for name in names)
    found = {}
    for project, entries in lines.items():
        head = f"# Sphinx inventory version 2\n# Project: {project}\n# Version: \n# The rest is compressed by zlib.\n"
        file = target / f"{project}.inv"
        file.write_bytes(head.encode() + zlib.compress("\n".join(entries).encode()))
        found[project] = str(file)
    return found
