"""The command line: a whole study in one line."""

from __future__ import annotations

import atexit
import errno
import gc
import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial, wraps
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from . import __version__
from .core.errors import INTERRUPTED, AccuracyError, AsperityError, FileExistsRefusal, InputError

if TYPE_CHECKING:
    from .geometry import Disk

WALL_HELP = """WALL is a named wall with parameters (focusing-arcs:half_angle=0.9), a wall file (.toml), or a text file
with the two columns x and height of a measured profile. This is mirrored to make it periodic, or repeated with
profile.txt:seam=step or, if it is periodic, seam=wrap; more of its parameters, joined by commas: units=um/nm,
delimiter=semicolon, decimal=comma, usecols=0/2, skiprows=3, encoding=latin-1, row=5, quantity=slope,
undefined=-9999, sort=yes, interpolate=yes, detrend=1."""


class OneLineErrors(click.Group):
    """Turns an error of ours into one line on standard error and exit code 1; click's own usage errors exit with 2."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            with warnings.catch_warnings():
                warnings.showwarning = lambda message, *_, **__: click.echo(f"asperity: note: {message}", err=True)
                return super().invoke(ctx)
        except KeyboardInterrupt:
            click.echo("asperity: interrupted", err=True)
            sys.exit(INTERRUPTED)
        except AsperityError as reason:
            click.echo(f"asperity: {' '.join(str(reason).split())}", err=True)
            sys.exit(1)
        except OSError as reason:
            # click ends quietly where nobody reads a pipe any more
            if reason.errno == errno.EPIPE:
                raise
            click.echo(f"asperity: cannot print the answer ({reason.strerror}); write it somewhere else", err=True)
            # else it would be written once more at the end
            with suppress(OSError):
                sys.stdout.close()
            sys.exit(1)


# Options of several commands, and their kinds.
NEW_FOLDER = click.Path(path_type=Path, file_okay=False)
FORMAT = click.Choice(["png", "svg", "pdf"])
NEW_FILE = click.Path(path_type=Path, dir_okay=False)
VERBOSE = click.option("-v", "--verbose", is_flag=True, help="Print methods and evidence too.")
JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON.")
SEED = click.option("--seed", type=click.IntRange(min=0), default=0, help="Seed of the random generator.")


def with_disk(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of a disk, and pass a Disk or, if none is given, None."""

    @click.option("--mass", type=float, help="Mass m of a disk that collides with the wall, by default 1.")
    @click.option("--inertia-ratio", type=float, help="J/(m r^2) of the disk, by default 0.5: a uniform disk.")
    @click.option("--radius", type=float, help="Radius r of the disk, by default 1. No law depends on it.")
    @click.option("--inertia", type=float, help="Moment of inertia J, with --radius, in place of the ratio.")
    @wraps(command)
    def run(
        mass: float | None, inertia_ratio: float | None, radius: float | None, inertia: float | None, **options: Any
    ) -> None:
        from .geometry import Disk

        named = (("mass", mass), ("inertia_ratio", inertia_ratio), ("radius", radius))
        given = {name: value for name, value in named if value is not None}
        disk = Disk(**given) if given else None
        if inertia is not None:
            if inertia_ratio is not None:
                raise click.UsageError("--inertia and --inertia-ratio say the same; give one of them")
            disk = Disk.from_inertia(1.0 if mass is None else mass, inertia, 1.0 if radius is None else radius)
            if radius is None:
                raise click.UsageError(
                    f"--inertia needs --radius; if that is 1, write --inertia-ratio {disk.inertia_ratio!r}"
                )
        command(disk=disk, **options)

    return run


# Incoming angles and probabilities of a table of a law, of a wall and of a height map.
TABLE_SIZE, MAP_TABLE_SIZE = (64, 65), (16, 17, 17)


def numbers_of(option: str, what: str, text: str) -> list[float]:
    """The numbers of an option such as 0,30,60."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as reason:
        raise InputError(f"--{option}: expected {what} joined by commas, such as 0,30,60, got {text!r}") from reason


def surface_law_of(text: str, spacing: str | None, orientation: str | None) -> Any:
    """The law of a height map, from options of the command line."""
    from .geometry.surfaces.reading import surface_from_text
    from .kernels import SurfaceLaw

    apart = None if spacing is None else numbers_of("spacing", "one or two distances", spacing)
    turn: Any = "random" if orientation in (None, "random") else numbers_of("orientation", "an angle", orientation)[0]
    return SurfaceLaw(surface_from_text(text, apart[0] if apart and len(apart) == 1 else apart), turn)


# Pictures for which nothing is traced.
EARLY = {"kernel", "spectrum"}


class _Early:
    """The lines and pictures of a wall, which come before those of the disk."""

    def __init__(self, pictures: list[Path], dpi: float, how: dict[str, bool]) -> None:
        self.pictures, self._dpi, self._how, self._lines = pictures, dpi, how, list[str]()

    def tell(self, study: Any) -> None:
        """Print the lines before those of the disk, and draw the pictures."""
        lines = study.summary(**self._how).splitlines()
        self._lines = lines[: next((k for k, line in enumerate(lines) if line.startswith("disk")), len(lines))]
        click.echo("\n".join(self._lines))
        for path in study._drawn(self.pictures, self._dpi):
            click.echo(f"wrote      {path}")

    def finish(self, study: Any) -> None:
        """Print the lines of the disk."""
        for line in study.summary(**self._how).splitlines()[len(self._lines) :]:
            click.echo(line)


@click.group(cls=OneLineErrors, context_settings={"help_option_names": ["-h", "--help"], "show_default": True})
@click.version_option(__version__, prog_name="asperity")
def main() -> None:
    """Reflection and collision laws of rough walls: kernels, spectra and gaps, each with its error.

    \b
    Examples:
      asperity walls
      asperity study focusing-arcs --out study
      asperity study triangular-teeth:angle=0.7 --inertia-ratio 0.5 --json
      asperity study my-wall.toml --out my-study
      asperity gap dispersing-arcs:curvature=0.333333 --specular
      asperity sweep focusing-arcs --over half_angle=0.2:1.5:50 --out arcs
      asperity ensemble gaussian:length=0.3 --points 12 --rms-slope 0.1 --smooth --quantity gap_specular --out gaussian
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            # names of files need not be text
            stream.reconfigure(errors="backslashreplace")
    # at its end Python would look through all objects of numba for garbage, which takes 0.3 s
    atexit.register(gc.freeze)


@main.command(epilog=WALL_HELP)
@click.argument("wall")
@with_disk
@click.option(
    "--facets",
    help="Law of the facets, by default mirrors: maxwell:diffuse_fraction=0.2, another LAW of `asperity realise`, or a "
    "finer WALL.",
)
@click.option("--out", type=click.Path(path_type=Path), help="Folder for pictures, matrix and JSON; made if missing.")
@click.option("--tolerance", default=1e-3, help="Error asked of gaps, and of matrices for every bin.")
@click.option("--bins", default=128, help="Number of equal-measure bins of the matrix.")
@SEED
@JSON
@click.option("--force", is_flag=True, help="Replace the files of an earlier study in the folder.")
@click.option("-v", "--verbose", is_flag=True, help="Print methods, spectrum, enclosures and evidence too.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
@click.option("--format", "picture_format", type=FORMAT, default="png", help="Format of the pictures.")
@click.option("--dpi", type=click.FloatRange(10, 2400), default=100, help="Dots per inch of the pictures.")
@click.option(
    "--incidence", help="Also print the accommodation of momentum: degrees from the normal, joined by commas."
)
@click.option("--table", type=NEW_FILE, help="Also write a table of the law for other codes, .csv, .npz or .h5.")
@click.option("--spacing", help="WALL is a height map with points at this distance, or DX,DY.")
@click.option("--orientation", help="WALL is a height map, of random orientation or turned by this angle in radians.")
def study(
    wall: str, disk: Disk | None, facets: str | None, seed: int, out: Path | None, force: bool, picture_format: str,
    dpi: float, as_json: bool, verbose: bool, quiet: bool, incidence: str | None, table: Path | None,
    spacing: str | None, orientation: str | None, **asked: Any,
) -> None:  # fmt: skip
    """Study WALL: law, symmetry, spectrum, gap, and the collision law of a disk.

    With --spacing or --orientation WALL is a file with a height map, of what is rough in two directions; its name may
    be followed by units=um/nm, degree=2, tiling=wrap, spikes=fill, undefined=-9999. Of it the law in space, the
    accommodation of momentum and the gap are found.

    \b
    Examples:
      asperity study focusing-arcs:half_angle=0.9 --out study
      asperity study profile.txt --inertia-ratio 0.5 --json
      asperity study triangular-teeth --incidence 0,30,60 --table law.csv
      asperity study triangular-teeth:angle=0.9 --facets maxwell:diffuse_fraction=0.2
      asperity study map.txt:units=um/nm --spacing 0.5 --out study
    """
    from .core.files import removed_on_failure
    from .core.long_runs import QUIET
    from .geometry import wall_from_text
    from .kernels.inverse.named_laws import facets_from_text
    from .study import PICTURES, SavedStudy, SurfaceStudy, picture_names, prepare_folder, study_surface, study_wall
    from .study.study import law_of

    if quiet and (as_json or verbose):
        raise click.UsageError("--quiet prints nothing; leave --json and --verbose out")
    if quiet:
        os.environ[QUIET] = "1"
    is_map = spacing is not None or orientation is not None
    if is_map and (disk is not None or facets is not None):
        raise click.UsageError("a disk and --facets belong to a wall; leave them out with a height map")
    of_facets = None if facets is None else facets_from_text(facets)
    found: Any = surface_law_of(wall, spacing, orientation) if is_map else law_of(wall_from_text(wall), of_facets)
    # what may be refused comes before the work
    degrees = None if incidence is None else numbers_of("incidence", "degrees", incidence)
    if table is not None:
        written = found.table(*(MAP_TABLE_SIZE if is_map else TABLE_SIZE))
        written.save(table, overwrite=force)
    with removed_on_failure(out):
        if out is not None:
            # refuse before the work, not after it
            names = picture_names(picture_format, SurfaceStudy.pictures if is_map else PICTURES)
            prepare_folder(out, names, overwrite=force)
        file, *how = wall.partition(":")
        name = "".join((Path(file).name, *how))
        asked |= {"rng": seed, "progress": not quiet, "incidence_deg": degrees}
        early = None
        if is_map:
            asked.pop("bins")
        elif not (quiet or as_json or disk is not None):
            pictures = [] if out is None else [Path(out, one) for one in names if Path(one).stem in EARLY]
            early = _Early(pictures, dpi, {"verbose": verbose, "by_angle": degrees is not None})
        report: SavedStudy = (
            study_surface(found, name, **asked)
            if is_map
            else study_wall(found.wall, name, disk, facets=of_facets, first=early.tell if early else None, **asked)
        )
        if early is not None:
            early.finish(report)
        elif not quiet:
            click.echo(report.to_json() if as_json else report.summary(verbose=verbose, by_angle=degrees is not None))
        if table is not None and not quiet:
            reached = f"distribution error {written.distribution_error:.2g}, {written.tolerance:g} wanted"
            missed = f" ({reached})" * (written.distribution_error > written.tolerance)
            click.echo(f"wrote      {table}{missed}", err=as_json)
        if out is not None:
            drawn = early.pictures if early else []
            for path in report.save(out, overwrite=force, picture_format=picture_format, dpi=dpi, drawn=drawn):
                if not quiet:
                    click.echo(f"wrote      {path}", err=as_json)


# Tolerances and time limits in seconds of the gaps that `asperity gap` prints before the one asked for.
FIRST_GAPS = (1e-2, 2.0), (1e-4, 10.0)


@main.command(epilog=WALL_HELP)
@click.argument("wall")
@click.option("--specular", is_flag=True, help="In Feres' convention, where specular reflection is the identity.")
@click.option("--tolerance", default=1e-6, help="Error asked for.")
@click.option("--enclose", default=0, type=click.IntRange(min=0), help="Also enclose this many eigenvalues.")
@VERBOSE
@JSON
def gap(wall: str, specular: bool, tolerance: float, enclose: int, verbose: bool, as_json: bool) -> None:
    """The spectral gap of WALL's reflection law, with its error and its verdict; with --verbose also the evidence.

    The first line can be pasted into a paper: value, error, whether that is a bound or an estimate, verdict,
    convention. In Feres' convention the law of a wall without mirror symmetry is not self-adjoint; the number
    is 1 - its norm on functions of mean 0 then, and the lines below say so.
    """
    import json

    from .geometry import wall_from_text
    from .kernels import WallLaw
    from .spectral import enclosures, spectral_gap
    from .study.result import enclosures_as_list, enclosures_as_text, gap_as_dict, quotation

    law = WallLaw(wall_from_text(wall))
    chosen = law.in_specular_frame() if specular else law
    for rough, seconds in FIRST_GAPS if not as_json else ():
        if rough > tolerance:
            found = spectral_gap(chosen, rough, time_limit=seconds)
            if found.error <= tolerance:
                break
            click.echo(f"so far: {quotation(found)}", err=True)
    found = spectral_gap(chosen, tolerance)
    why = [found.method, *found.evidence] if verbose else []
    lines, plain = [quotation(found), *(f"  {line}" for line in why)], gap_as_dict(found)
    if enclose:
        try:
            enclosed = enclosures(chosen, enclose)
            shown = ["enclosures:", *enclosures_as_text(enclosed)] if verbose else repr(enclosed).splitlines()
            lines.append("\n  ".join(shown))
            plain["enclosures"] = enclosures_as_list(enclosed)
        except (AccuracyError, InputError) as reason:
            lines.append(f"enclosures refused: {reason}")
            plain |= {"enclosures": None, "refusals": {"enclosures": str(reason)}}
    click.echo(json.dumps(plain, indent=2, allow_nan=False) if as_json else "\n".join(lines))


@main.command()
@click.option("--out", type=NEW_FILE, help="Draw them all into this picture file.")
@click.option("--force", is_flag=True, help="Replace the picture if it exists.")
def walls(out: Path | None, force: bool) -> None:
    """List the named walls with their parameters and defaults, and draw them."""
    from .geometry import WALLS
    from .study.pictures import draw_gallery

    if out is not None:
        # refused before anything is printed
        draw_gallery(out, overwrite=force)
    for entry in WALLS.values():
        parameters = ", ".join(f"{key}={value:g}" for key, value in entry.defaults.items())
        click.echo(f"{entry.name:20s} {entry.summary}" + (f" [{parameters}]" if parameters else ""))
    if out is not None:
        click.echo(f"wrote {out}")


def with_engine(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of commands that compute many walls into a folder."""
    for add in (
        click.option("--force", is_flag=True, help="Replace other results in the folder; by default a run goes on."),
        click.option("--scheduler", help="Address of a dask scheduler, whose workers are used."),
        click.option("--workers", type=click.IntRange(min=1), help="So many processes on this machine."),
        click.option("--out", required=True, type=NEW_FOLDER, help="Folder for the tables."),
        click.option("--tolerance", default=1e-6, help="Error asked of each quantity."),
        click.option(
            "--quantity",
            default="gap",
            help="Of gap, gap_specular, slem, relaxation_time, resistance, eta, accommodation, joined by commas.",
        ),
    ):
        command = add(command)
    return command


def _run_in_folder(
    run: Callable[..., Any], out: Path, force: bool, workers: int | None, scheduler: str | None, **asked: Any
) -> Any:
    """What a sweep or an ensemble finds, with its checkpoint in the folder; Ctrl-C ends the program at once."""
    from .spectral.sweeps.named_families import checkpoint_in

    if workers is not None and scheduler is not None:
        raise click.UsageError("--workers are started here, a --scheduler has its own; choose one")
    checkpoint = checkpoint_in(out, overwrite=force)
    quantities = [name.strip() for name in asked.pop("quantity").split(",")]
    with _long_run():
        return run(quantities=quantities, checkpoint=checkpoint, client=scheduler or workers, progress=True, **asked)


@contextmanager
def _long_run() -> Iterator[None]:
    """Say after a second that the work is under way; at Ctrl-C say what is stopped, and end the program at once."""
    # the first wall may take minutes, and a pipe shows no bar
    words = "asperity: computing; Ctrl-C stops it, and the same command goes on"
    timer = threading.Timer(1.0, click.echo, [words], {"err": True})
    timer.daemon = True
    timer.start()
    try:
        yield
    except KeyboardInterrupt as stop:
        click.echo(f"asperity: {stop}", err=True)
        # libraries would wait for their threads
        os._exit(INTERRUPTED)
    finally:
        timer.cancel()


@main.command(name="sweep", epilog=WALL_HELP)
@click.argument("walls", nargs=-1, required=True, metavar="WALL...")
@click.option("--over", multiple=True, help="NAME=LOW:HIGH:POINTS or NAME=VALUE,VALUE; several are multiplied.")
@click.option("--zip", "zipped", is_flag=True, help="Take the k-th values of all --over together instead.")
@click.option("--adaptive", is_flag=True, help="Put the points of LOW:HIGH:POINTS where the first quantity bends.")
@click.option("--resolution", type=float, help="With --adaptive: enough at this loss, 0.01 by default.")
@with_engine
def sweep_walls(
    walls: tuple[str, ...], over: tuple[str, ...], zipped: bool, adaptive: bool, resolution: float | None, out: Path,
    **asked: Any,
) -> None:  # fmt: skip
    """Compute quantities of a family of walls: of one named WALL over values of its parameters, or of several WALLs.

    The folder gets table.csv, table.json, a picture, and with asperity[studies] table.parquet. A sweep that was
    stopped, by Ctrl-C or otherwise, goes on when the same command is given again.

    \b
    Examples:
      asperity sweep focusing-arcs --over half_angle=0.2:1.5:50 --quantity gap,resistance --out arcs --workers 2
      asperity sweep first.toml second.toml koch --quantity gap_specular,accommodation --out walls
    """
    from .spectral import sweep
    from .spectral.sweeps.named_families import family_and_grid, save_all

    family, grid = family_and_grid(walls, over, adaptive, resolution)
    table = _run_in_folder(partial(sweep, family, grid, zipped=zipped), out, **asked)
    click.echo(repr(table))
    for path in save_all(table, out):
        click.echo(f"wrote {path}")


@main.command()
@click.argument("spectrum")
@click.option("--points", default=64, help="Heights of each wall, at equal distances.")
@click.option("--rms-slope", type=float, help="Root mean squared slope; this or --rms-height.")
@click.option("--rms-height", type=float, help="Root mean squared height about the mean.")
@click.option("--period", default=1.0, help="Period of the walls, in the unit of all lengths.")
@click.option("--smooth", is_flag=True, help="Join the heights by cubics: polygons have no spectral gap.")
@click.option("--walls", default=100, type=click.IntRange(min=4), help="Number of walls.")
@SEED
@click.option("--bins", type=click.IntRange(min=1), help="Also write the mean law on so many bins, as mean-law.npz.")
@with_engine
def ensemble(spectrum: str, walls: int, seed: int, bins: int | None, out: Path, **given: Any) -> None:
    """Compute mean and spread of quantities over random walls with normal heights.

    SPECTRUM is gaussian:length=NUMBER or exponential:length=NUMBER, the correlation function of the heights, or
    self-affine:hurst=NUMBER with longest=NUMBER and shortest=NUMBER, the ends of its wave lengths, or without. Needs
    asperity[profiles].

    The folder gets means.csv, with --bins the mean law, and table.csv, table.json and with asperity[studies]
    table.parquet, in which each wall has the seed that makes it again. A run that was stopped, by Ctrl-C or otherwise,
    goes on when the same command is given again.

    \b
    Examples:
      asperity ensemble gaussian:length=0.3 --points 12 --rms-slope 0.1 --smooth --quantity gap_specular --out gaussian
      asperity ensemble self-affine:hurst=0.8 --rms-slope 0.2 --quantity resistance,accommodation --out affine
    """
    from .geometry import random_wall
    from .kernels import Bins
    from .spectral import ensemble as over_random_walls
    from .spectral import mean_law
    from .spectral.sweeps.named_families import LAW_CHECKPOINT, MEAN_LAW, save_ensemble, spectrum_from_text

    kind = {name: given.pop(name) for name in ("points", "rms_slope", "rms_height", "period", "smooth")}
    family = partial(random_wall, spectrum_from_text(spectrum), **kind)
    # a wall that cannot be made is refused before the work
    family(rng=seed)
    found = _run_in_folder(partial(over_random_walls, family, walls, rng=seed), out, **given)
    click.echo(repr(found))
    for path in save_ensemble(found, out):
        click.echo(f"wrote {path}")
    if bins is not None:
        with _long_run():
            law = mean_law(
                family, walls, Bins(bins), given["tolerance"], rng=seed, checkpoint=out / LAW_CHECKPOINT,
                client=given["scheduler"] or given["workers"],
            )  # fmt: skip
        law.save(out / MEAN_LAW, overwrite=True)
        click.echo(f"mean law on {bins} bins, Frobenius error {float(law.error):.2g}\nwrote {out / MEAN_LAW}")


@main.command(epilog=WALL_HELP)
@click.argument("wall", default="focusing-arcs")
@click.option("--port", type=click.IntRange(0, 65535), default=5006, help="0 for any that is free.")
@click.option("--no-browser", is_flag=True, help="Print the address, and open no browser.")
@click.option("--out", type=NEW_FOLDER, help="Write what is saved into this folder.")
def explore(wall: str, port: int, no_browser: bool, out: Path | None) -> None:
    """Show WALL on a page in the browser: drag its vertices, and law, spectrum and collision follow.

    The page is for this machine only. Without --out the browser takes what is saved. Needs asperity[explore].

    \b
    Examples:
      asperity explore
      asperity explore focusing-arcs:half_angle=0.9 --no-browser --port 8080
    """
    from .explore.server import serve_page

    serve_page(wall, port, out, browser=not no_browser, say=lambda line: click.echo(f"asperity: {line}", err=True))


@main.command()
@click.argument("law")
@click.option("--moments", default=10, help="Meet <e_l, P e_m> for all l, m below this number.")
@click.option("--tolerance", default=1e-10, help="Defect asked for.")
@click.option("--hollows", type=click.IntRange(min=1), help="At most this many hollows, with a larger defect.")
@with_disk
@SEED
@VERBOSE
@click.option("--out", type=NEW_FILE, help="Write the wall into this TOML file.")
@click.option("--force", is_flag=True, help="Replace the file if it exists.")
def realise(
    law: str, moments: int, tolerance: float, hollows: int | None, disk: Disk | None, seed: int, verbose: bool,
    out: Path | None, force: bool,
) -> None:  # fmt: skip
    """Find a wall whose reflection law has the moments of LAW, or on which a disk collides by it.

    LAW is lambertian, specular, retroreflection, least-resistance, maxwell:NUMBER, henyey-greenstein:NUMBER, or a file
    that KernelMatrix.save wrote.

    \b
    Examples:
      asperity realise lambertian --out lambert.toml
      asperity realise maxwell:0.5 --inertia-ratio 0.5 --out wall.toml
    """
    from .core.files import check_writable
    from .kernels import wall_for
    from .kernels.inverse.named_laws import law_from_text

    if out is not None:
        check_writable(out)
        if out.exists() and not force:
            raise FileExistsRefusal(f"{out} exists; use another name or --force to replace it")
    found = wall_for(law_from_text(law), moments, tolerance, rng=seed, most_hollows=hollows)
    wall = found.wall if disk is None else found.wall.unforeshorten(disk)
    click.echo(
        f"wall       {len(found.hollows)} hollows, {len(wall.pieces)} pieces, depth {wall.depth:.6g}\n"
        f"defect     {found.defect} in {found.moments} moments; at most {float(found.bound):.2g} too much"
    )
    if found.law is not None:
        click.echo(f"distance   {found.distance} (joint)")
    if verbose:
        click.echo(f"methods    of the defect: {found.defect.method}; of the distance: {found.distance.method}")
    if out is not None:
        wall.save(out, overwrite=force)
        click.echo(f"wrote      {out}")


@main.command()
@click.argument("ids", nargs=-1, metavar="[ID]...")
@JSON
@click.option("--latex", "as_latex", is_flag=True, help="Print the formulas in LaTeX; no check is run.")
def verify(ids: tuple[str, ...], as_json: bool, as_latex: bool) -> None:
    """Check the ledger: every formula of the paper, each against the status that it has here.

    ID is the id of a row (S2.01) or its beginning (S2); without one all rows are checked. Exit code 1 if a row is not
    as stated.

    \b
    Examples:
      asperity verify
      asperity verify S2.01 S1
      asperity verify S2 --json
    """
    import json

    from .core.long_runs import progress_bar
    from .ledger import findings, selected
    from .ledger.entry import finding_as_dict, latex_of, table_of

    chosen = selected(ids)
    if as_latex:
        click.echo(latex_of(chosen))
        return
    found = []
    with progress_bar(len(chosen), "row", "verify") as bar:
        for finding in findings(chosen):
            found.append(finding)
            bar.update()
    click.echo(json.dumps([finding_as_dict(one) for one in found], indent=2) if as_json else table_of(found))
    if any(one.as_stated is False for one in found):
        sys.exit(1)


@main.command(name="warm-up")
def warm_up() -> None:
    """Compile what the other commands use, and store it, so that no later call has to.

    Useful in the image of a container, and before a job on many nodes.
    """
    import time

    from .study.warm_up import TASKS, folder

    for name, task in TASKS.items():
        start = time.perf_counter()
        task()
        click.echo(f"{name:40s} {time.perf_counter() - start:6.1f} s")
    click.echo(f"stored in {folder()}")


@main.command(epilog=WALL_HELP)
@click.argument("problems", nargs=-1, metavar="[PROBLEM|WALL]...")
@click.option("--quick", is_flag=True, help="Short ladders and cheap references: under three minutes.")
@click.option("--out", default="bench-results", type=click.Path(path_type=Path), help="Folder for results.")
@click.option(
    "--force", is_flag=True, help="Measure again and replace reports in the folder; by default a run goes on."
)
def bench(problems: tuple[str, ...], quick: bool, out: Path, force: bool) -> None:
    """Error against run time, with tables and a picture of each wall.

    PROBLEM is SCENE, QUANTITY or SCENE/QUANTITY of the standard set, which is the default; its references are stored.
    Of another WALL all methods are measured that apply to its law, for the law in bins, its first moment and the
    resistance, beside references made from the finest run of each method, and from rays.

    \b
    Examples:
      asperity bench --quick
      asperity bench focusing-arc/moment lambda2 --out my-bench
      asperity bench my-wall.toml --quick --out my-wall
    """
    from .bench import problems as known
    from .bench import standard_set
    from .bench import standard_set as run

    names = known.problem_names(problems)
    run.prepare_folder(out, names, force=force)
    effort = standard_set.QUICK if quick else standard_set.FULL
    found = list(standard_set.run_problems(names, effort, out, lambda line: click.echo(line, err=True)))
    click.echo(run.summary(found))
    for path in run.save(found, out):
        click.echo(f"wrote {path}", err=True)
