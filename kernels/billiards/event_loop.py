"""A gas of equal disks in the compiled loop over its events: tables, uniform numbers, and answers of other laws."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checkpoints import Stored
from ...core.checks import Floats
from ...core.errors import AccuracyError
from ...geometry import Container, Disk, Torus
from ...geometry.collisions.compiled import gas as g
from ...geometry.curves import columns as c
from ...geometry.curves.columns import Struct
from ...geometry.scene.compiled.compiling import checked
from ...geometry.tables.boundary import FlightStatus
from ...geometry.tracing.compiled.pieces.records import NO_DETAILS, Rays, results_for
from ...geometry.tracing.compiled.rays import SLOTS, TRACE
from ..collisions.collision_law import CollisionLaw
from ..laws.law import Law
from ..walls.conditionals import UNRESOLVED_TOLERANCE
from ..walls.wall_law import WallLaw
from .billiard import Reflector, reflected

# Uniform numbers in memory, one for each event; events after which time begins anew, for each disk and in all.
BLOCK, RESTART = 65536, (16, 1024)
# Cells are larger than the diameter by this fraction, so that disks that touch by rounding are in neighbouring cells.
ROOM = 1e-9
# Cells in each direction at least, so that the neighbours of a cell are different ones.
FEWEST_CELLS = 3
# Tables that change.
CHANGING = ("floats", "ints", "heads", "sums", "flow", "uniforms")


class EventLoop:
    """The present state of a gas; velocities are (v1, v2, r omega) for the radius r of the disks.

    ``pair`` is the law of the angles of pairs, ``walls`` has the laws of the walls.
    """

    def __init__(
        self,
        container: Container | Torus,
        pair: Law,
        walls: list[Reflector],
        disk: Disk,
        position: Floats,
        velocity: Floats,
        rng: np.random.Generator,
    ) -> None:
        self.rng, self.radius = rng, disk.radius
        self.container: Any = container
        self.laws: tuple[Any, ...] = pair, *walls
        n, mass, rim = len(position), disk.mass, disk.rim_mass
        self.period = np.array(container.periods if isinstance(container, Torus) else (0.0, 0.0))
        images = np.floor(position / np.where(self.period > 0.0, self.period, np.inf)) * (self.period > 0.0)
        self.floats, self.ints = np.zeros((n, g.FLOATS)), np.zeros((n, g.INTS), np.int64)
        self.floats[:, :2], self.floats[:, g.V1 : g.RIM + 1] = position - images * self.period, velocity
        self.ints[:, g.LAST], self.ints[:, g.IMAGE_X : g.IMAGE_Y + 1] = -1, images
        self.sums, self.flow = np.zeros(g.IMPULSE + 2 * len(walls)), np.zeros(g.FLOW, np.int64)
        self.flow[[g.FIRST, g.SECOND]], self.flow[[g.EVENT_DISK, g.EVENT_PARTNER, g.EVENT_WALL]] = -1, -1
        self.sums[g.GAP] = math.inf
        self.sums[g.SPEED] = math.sqrt(float(np.sum(velocity**2 * [1.0, 1.0, rim / mass])))
        self.uniforms, self.base, self.unresolved, self._restarted = np.empty(BLOCK), 0.0, 0, 0
        self._draw()
        self._tables = self._struct(mass, rim)
        self._restart()
        self._fly(np.arange(n))
        checked(lambda: g.start(self._tables.address))

    def _struct(self, mass: float, rim: float) -> Struct:
        """The tables of the compiled loop."""
        rows, corners, slack = np.empty((0, c.WALL_COLUMNS)), np.empty((0, 2)), 0.0
        if isinstance(self.container, Container):
            rows, corners, slack = self.container.wall_table
        self.asks_walls = isinstance(self.container, Container) and any(
            curve.wall_row is None for curve in self.container.curves
        )
        self.terms: list[Any] = []
        weights, forms, first = [], [], [0]
        for law, kind in zip(self.laws, [c.LINE_WALL, *rows[:, c.WALL_KIND]], strict=True):
            # of a curve without a row Python computes the normal
            terms = _terms(None if kind == c.GIVEN_WALL else law)
            weights += [(weight, period) for weight, period, *_ in terms]
            forms += [(form, address) for *_, form, address, _ in terms]
            self.terms += [term for *_, term in terms]
            first.append(len(weights))
        (low, size, cells), n = self._grid(rows, corners), len(self.floats)
        ray = Rays(np.zeros(1), np.zeros(1), *results_for(1), np.zeros(1, np.int64))
        self._rays = Struct(ray)
        self.heads, across = np.empty(int(np.prod(cells)), np.int64), (1.0 / mass + 1.0 / rim) ** -0.5
        return Struct(
            g.Gas._make((
                self.floats, self.ints, self.heads, rows, corners, np.array(weights), np.array(forms, np.int64),
                np.array(first, np.int64), self.sums, self.flow, self.uniforms, ray.x, ray.theta, ray.out_theta,
                ray.status, n, len(rows), len(corners), *cells, BLOCK, int(self.asks_walls), TRACE.slot,
                self._rays.address, NO_DETAILS.address, SLOTS.address, *low, *size, *self.period.tolist(),
                2.0 * self.radius, slack, mass, rim, across, math.sqrt(mass),
            ))
        )  # fmt: skip

    def _grid(self, rows: Floats, corners: Floats) -> tuple[list[float], list[float], list[int]]:
        """Lower left corner, size and numbers of the cells, about one for each disk and not smaller than the disks."""
        least = 2.0 * self.radius * (1.0 + ROOM)
        if self.period[0] > 0.0:
            side = max(math.sqrt(self.period.prod() / len(self.floats)), least)
            cells = np.floor(self.period / side)
            return [0.0, 0.0], (self.period / cells).tolist(), cells.astype(int).tolist()
        centres = self.floats[:, :2]
        boxes = np.array([curve.box for curve in self.container.curves]).reshape(-1, 2)
        points = np.concatenate([centres, corners, boxes])
        low, extent = points.min(axis=0), np.ptp(points, axis=0)
        # also where all are on a line
        side = max(math.sqrt(extent.prod() / len(centres)), float(extent.max()) / (4 * len(centres)), least)
        cells = np.maximum(np.floor(extent / side) + 1, FEWEST_CELLS).astype(int)
        return low.tolist(), [side, side], cells.tolist()

    @property
    def events(self) -> int:
        """The number of events so far."""
        return int(self.flow[g.EVENTS])

    @property
    def time(self) -> float:
        """The time of the last event."""
        return self.base + float(self.sums[g.NOW])

    @property
    def last(self) -> list[int]:
        """Disk, partner and wall of the last event; -1 for none."""
        return [int(self.flow[k]) for k in (g.EVENT_DISK, g.EVENT_PARTNER, g.EVENT_WALL)]

    @property
    def collisions(self) -> NDArray[np.int64]:
        """The number of collisions of each disk."""
        return self.ints[:, g.STAMP].copy()

    @property
    def integrals(self) -> Floats:
        """Time, its integrals of the sums of (r omega)^2, v^4 and (r omega)^4, numbers of collisions and impulses."""
        return np.array([self.time, *self.sums[g.INTEGRALS :]])

    def state(self, time: float | None = None) -> tuple[Floats, Floats, Floats]:
        """Centres (n, 2), not reduced to one period, angles (n,) and velocities (n, 3), now or at a time."""
        step = (float(self.sums[g.NOW]) if time is None else time - self.base) - self.floats[:, g.OWN]
        position = self.floats[:, :2] + self.floats[:, g.V1 : g.V2 + 1] * step[:, None]
        position += self.ints[:, g.IMAGE_X : g.IMAGE_Y + 1] * self.period
        angle = (self.floats[:, g.ARC] + self.floats[:, g.RIM] * step) / self.radius
        return position, angle, self.floats[:, g.V1 : g.RIM + 1].copy()

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """All that changes, for a checkpoint."""
        source = np.frombuffer(json.dumps(self.rng.bit_generator.state).encode(), np.uint8)
        clock = np.array([self.base, self.unresolved, self._restarted])
        return {**{name: getattr(self, name) for name in CHANGING}, "clock": clock, "rng": source}

    def stored(self) -> dict[str, Stored]:
        """What the arrays of a snapshot must be; NaN is in no range."""
        ranges = {"heads": (-1, len(self.floats) - 1), "uniforms": (0.0, 1.0)}
        found = {
            name: Stored(own.dtype.kind, own.shape, *ranges.get(name, (-math.inf, math.inf)))
            for name, own in ((name, getattr(self, name)) for name in CHANGING)
        }
        return {**found, "clock": Stored("f", (3,), 0.0), "rng": Stored("u", (None,), 0, 255)}

    def check(self, arrays: Mapping[str, NDArray[Any]], events: int) -> None:
        """Raise a ValueError if a number of a snapshot would lead the compiled loop out of its tables."""
        ints, n, walls = arrays["ints"], len(self.floats), len(self.laws) - 1
        disk, wall, index = (-1, n - 1), (-1, walls - 1), np.arange(n)
        flow = {
            g.EVENTS: (0, events), g.DRAWN: (0, BLOCK), g.ANSWERED: (g.NO_ANSWER, g.A_VELOCITY), g.FIRST: disk,
            g.SECOND: disk, g.LAW: (0, walls), g.TERM: (0, len(self.terms) - 1), g.EVENT_DISK: disk,
            g.EVENT_PARTNER: disk, g.EVENT_WALL: wall, g.CROSSED: (0, math.inf),
        }  # fmt: skip
        good = all(low <= arrays["flow"][k] <= high for k, (low, high) in flow.items())
        columns = {g.LAST: wall, g.STATUS: (0, max(FlightStatus)), g.AFTER: disk, g.BEFORE: disk, g.PLACE: (0, n - 1)}
        good &= all(np.all((ints[:, k] >= low) & (ints[:, k] <= high)) for k, (low, high) in columns.items())
        next_wall, kind = ints[:, g.WALL], ints[:, g.KIND]
        met = [(one == g.NO_EVENT) | ((one < 0) & (one >= -walls)) for one in (next_wall, kind)]
        crossed = (kind <= g.CROSSING) & (kind > g.CROSSING - 4)
        good &= bool(np.all(met[0] & (met[1] | crossed | ((kind >= 0) & (kind < n)))))
        good &= np.array_equal(np.sort(ints[:, g.HEAP]), index)
        if not (good and np.array_equal(ints[ints[:, g.PLACE], g.HEAP], index)):
            raise ValueError("a number without meaning")
        # each disk is in one list
        listed, seen = arrays["heads"][arrays["heads"] >= 0], np.zeros(n, np.int64)
        while len(listed) and seen.max(initial=0) <= 1:
            np.add.at(seen, listed, 1)
            listed = ints[listed, g.AFTER]
            listed = listed[listed >= 0]
        if np.any(seen != 1):
            raise ValueError("lists of cells that do not have each disk once")

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go on from a `snapshot` of this gas."""
        for name in CHANGING:
            getattr(self, name)[...] = arrays[name]
        self.base, self.unresolved, self._restarted = float(arrays["clock"][0]), *map(int, arrays["clock"][1:])
        self.rng.bit_generator.state = json.loads(arrays["rng"].tobytes())

    def run(self, events: int, until: float = math.inf) -> int:
        """Go on up to this number of events in all, or to a time; DONE, TIME or UNRESOLVED says which ended it.

        Raises an AccuracyError if no disk meets anything any more.
        """
        part = RESTART[0] * len(self.floats) + RESTART[1]
        while True:
            made = self.events
            if made >= self._restarted + part:
                self._restart()
            stop = min(events, self._restarted + part)
            code = self._advance(stop, until - self.base)
            if code == g.UNIFORMS:
                self._draw()
            elif code == g.QUESTION:
                self._answer()
            elif code == g.FLIGHTS:
                self._fly(self.flow[[g.FIRST, g.SECOND]][self.flow[[g.FIRST, g.SECOND]] >= 0])
            elif code == g.FREE:
                raise AccuracyError("no disk meets a wall or another disk any more; is the container closed?", math.inf)
            elif code != g.DONE or self.events >= events:
                return int(code)

    def _advance(self, events: int, until: float) -> int:
        return checked(lambda: g.advance(self._tables.address, events, until))  # type: ignore[no-any-return]

    def unresolved_status(self) -> NDArray[np.uint8]:
        """The status of each disk after UNRESOLVED: that of the disk whose event is next."""
        status, disk = np.full(len(self.floats), FlightStatus.FLYING, dtype=np.uint8), self.ints[0, g.HEAP]
        status[disk] = self.ints[disk, g.STATUS]
        return status

    def _draw(self) -> None:
        self.rng.random(out=self.uniforms)
        self.flow[g.DRAWN] = 0

    def _restart(self) -> None:
        """Count time from now on, and add the sums anew, so that rounding does not grow with time."""
        now, (v1, v2, rim) = float(self.sums[g.NOW]), self.floats[:, g.V1 : g.RIM + 1].T ** 2
        self.base, self.sums[g.NOW], self._restarted = self.base + now, 0.0, self.events
        self.floats[:, [g.OWN, g.NEXT, g.WALL_TIME]] -= now
        self.sums[[g.RIM2, g.V4, g.RIM4]] = rim.sum(), np.sum(v1 * v1 + v2 * v2), np.sum(rim * rim)

    def _fly(self, disks: NDArray[np.int64]) -> None:
        """Find the next walls of some disks."""
        time, wall = np.full(len(disks), np.inf), np.full(len(disks), -1)
        if isinstance(self.container, Container):
            last, velocity = self.ints[disks, g.LAST], self.floats[disks, g.V1 : g.V2 + 1]
            time, wall, self.ints[disks, g.STATUS] = self.container.next_wall(self.floats[disks, :2], velocity, last)
        self.floats[disks, g.WALL_TIME] = self.floats[disks, g.OWN] + time
        self.ints[disks, g.WALL] = np.where(wall < 0, g.NO_EVENT, -1 - wall)

    def _answer(self) -> None:
        """Say the outgoing angle or velocity for which the loop asks."""
        number, disk = int(self.flow[g.LAW]), int(self.ints[0, g.HEAP])
        law, term = self.laws[number], self.terms[self.flow[g.TERM]]
        if term is None:
            point = self.container.touch(number - 1, self.floats[[disk], :2])
            after = reflected(point, law, self.floats[[disk], g.V1 : g.RIM + 1], self.rng)[0]
            if not np.all(np.isfinite(after)):
                self.ints[disk, g.STATUS] = FlightStatus.UNREFLECTED
                return
            self.floats[disk, :2] = point.position[0]
            self.sums[g.ANSWER : g.ANSWER + 5], self.flow[g.ANSWERED] = [*after, *point.normal[0]], g.A_VELOCITY
            return
        theta, driven = self.sums[[g.THETA]], term.random_map()
        if driven is None:
            found, escaped = term.sample(theta, self.rng), None
        else:
            found, escaped = driven(self.sums[[g.UNIFORM]], theta)
        self.unresolved += escaped is not None and not escaped[0]
        if self.unresolved > 1 + UNRESOLVED_TOLERANCE * self.events:
            fraction = self.unresolved / (self.events + 1)
            raise AccuracyError(
                f"{term!r}: {fraction:.2g} of the rays did not escape; trace says how they end", fraction
            )
        self.sums[g.ANSWER], self.flow[g.ANSWERED] = found[0], g.AN_ANGLE


def _terms(law: Any) -> list[tuple[float, float, int, int, Any]]:
    """Cumulative weight, period, form, address of tables and law of each term; None for a law of velocities."""
    if isinstance(law, CollisionLaw):
        law = law.law
    if not isinstance(law, Law):
        return [(1.0, 1.0, g.ASKED, 0, None)]
    found, total = [], 0.0
    for weight, part in law.parts if law.is_compound else ((1.0, law),):
        total += weight
        form, period, address = g.ASKED, 1.0, 0
        if part.retro is not None and not part.is_compound:
            form = g.RETRO if part.retro else g.SPECULAR
        elif part.is_lambertian and not part.is_compound:
            form = g.LAMBERT
        elif isinstance(part, WallLaw) and part.wall.origin == (0.0, 0.0):
            form, period, address = g.TRACED, part.wall.period, part.wall.scene.tables.address
        found.append((total, period, form, address, part))
    return found
