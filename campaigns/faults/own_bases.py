"""Bases of a user's own class, a third of them broken on purpose.

Right is a matrix of a mixture of Lambert's law, specular reflection and retroreflection within its error of the
judge's, who knows the functions and their kinks and integrates by a Gauss rule of his own; for a broken basis an
InputError.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from asperity import Estimate
from asperity import kernels as ker
from asperity.errors import InputError
from asperity.kernels.bases.measure import AngularMeasure
from campaigns.engine import Campaign, Judged

Functions = Callable[[Any], Any]
NODES = 120


@dataclass(frozen=True, eq=False)
class Own(ker.Basis):
    """Functions of u = (1 - cos theta)/2 that are smooth between knots."""

    functions: Functions
    knots: Any
    coefficients: Any
    nodes: Any = 48
    partition: Any = False
    polynomial: bool = False
    coarser: Any = None

    @property
    def measure(self) -> AngularMeasure:
        return ker.SINE

    @property
    def size(self) -> int:
        return len(self.coefficients)

    @property
    def edges(self) -> Any:
        return angles_of(self.knots)

    @property
    def nodes_per_interval(self) -> Any:
        return self.nodes

    @property
    def constant(self) -> Any:
        return self.coefficients

    @property
    def is_partition(self) -> bool:
        return bool(self.partition)

    @property
    def is_polynomial(self) -> bool:
        return self.polynomial

    @property
    def normalisation(self) -> Any:
        return 1.0 / self.coefficients if self.partition else super().normalisation

    def evaluate(self, angle: Any) -> Any:
        return self.functions(np.sin(0.5 * np.asarray(angle)) ** 2)

    def key(self) -> tuple[object, ...]:
        return (id(self),)

    def coarsened(self) -> Any:
        return self.coarser


def angles_of(knots: Any) -> Any:
    """Increasing angles from 0 to pi."""
    edges = 2.0 * np.arcsin(np.sqrt(knots))
    edges[-1] = np.pi
    return edges


def rule(knots: Any) -> tuple[Any, Any]:
    """Gauss nodes and weights between knots and their mirror images, in the angle, for sin(theta)/2."""
    edges = np.unique(np.round(np.concatenate([angles_of(knots), np.pi - angles_of(knots)]), 15))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    low, half = edges[:-1, None], 0.5 * np.diff(edges)[:, None]
    angle = low + half * (1.0 + nodes)
    return angle.ravel(), (half * weights * 0.5 * np.sin(angle)).ravel()


def orthonormal(functions: Functions, knots: Any) -> tuple[Functions, Any]:
    """Functions made orthonormal, with the coefficients of 1, which is among their combinations."""
    angle, weight = rule(knots)
    values = functions(np.sin(0.5 * angle) ** 2)
    _, triangle = np.linalg.qr(np.sqrt(weight)[:, None] * values)
    inverse = np.linalg.inv(triangle)
    return (lambda u: functions(u) @ inverse), (values @ inverse).T @ weight


class Maker:
    """Draws bases."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng([72, seed])
        self.size = int(self.rng.integers(2, 11))
        cells = np.sort(self.rng.dirichlet(np.full(self.size, 4.0)).cumsum())
        self.knots = np.concatenate(([0.0], cells[:-1], [1.0]))
        self.ends = np.array([0.0, 1.0])

    def cosines(self) -> Own:
        order = np.arange(self.size)
        scale = np.where(order, np.sqrt(2.0), 1.0)
        coarse = Own(lambda u: np.ones((*np.shape(u), 1)), self.ends, np.ones(1))
        return Own(lambda u: scale * np.cos(np.pi * order * np.asarray(u)[..., None]), self.ends, 1.0 - (order > 0),
                   64,
                   coarser=(coarse, np.eye(1, self.size)))  # fmt: skip

    def rotated(self) -> Own:
        """Legendre polynomials in another order and direction: a basis of all their combinations."""
        turn = np.linalg.qr(self.rng.normal(size=(self.size, self.size)))[0]
        scale = np.sqrt(2.0 * np.arange(self.size) + 1.0)
        turned = np.diag(scale) @ turn
        return Own(lambda u: np.polynomial.legendre.legvander(2.0 * np.asarray(u) - 1.0, self.size - 1) @ turned,
                   self.ends, turn[0])  # fmt: skip

    def polynomials(self) -> Own:
        scale = (-1.0) ** np.arange(self.size) * np.sqrt(2.0 * np.arange(self.size) + 1.0)
        return Own(lambda u: scale * np.polynomial.legendre.legvander(2.0 * np.asarray(u) - 1.0, self.size - 1),
                   self.ends, np.eye(1, self.size)[0], polynomial=True)  # fmt: skip

    def hats(self) -> Own:
        made, constant = orthonormal(self._bends, self.knots)
        return Own(made, self.knots, constant)

    def _bends(self, u: Any) -> Any:
        u = np.asarray(u)[..., None]
        return np.concatenate([np.ones_like(u), u, np.maximum(u - self.knots[1:-1], 0.0)], axis=-1)

    def cells(self) -> Own:
        height = 1.0 / np.sqrt(np.diff(self.knots))

        def indicators(u: Any) -> Any:
            index = np.clip(np.searchsorted(self.knots, u, side="right") - 1, 0, self.size - 1)
            return height * (np.asarray(index)[..., None] == np.arange(self.size))

        return Own(indicators, self.knots, 1.0 / height, 24, partition=True)

    def waves(self) -> Own:
        """Of the angle itself."""

        def waves(u: Any) -> Any:
            angle = 2.0 * np.arcsin(np.sqrt(np.asarray(u)))[..., None]
            return np.cos(np.arange(self.size) * angle)

        made, constant = orthonormal(waves, self.ends)
        return Own(made, self.ends, constant, 64)

    def sound(self) -> tuple[str, Own]:
        kind = str(self.rng.choice(["cosines", "rotated", "polynomials", "hats", "cells", "waves"]))
        return kind, getattr(self, kind)()

    def broken(self) -> tuple[str, Own]:
        """A basis that breaks one promise."""
        kind, good = self.sound()
        f, n, some = good.functions, good.size, float(self.rng.uniform(0.2, 0.8))
        far = 10.0 ** self.rng.uniform(-7.0, 0.0)
        faults: dict[str, Callable[[], dict[str, Any]]] = {
            "a function twice": lambda: {"functions": lambda u: f(u)[..., [0, *range(n - 1)]]},
            "another size": lambda: {"functions": lambda u: (1.0 + far) * f(u)},
            "another function": lambda: {"functions": lambda u: f(u) + far * np.sin(9.0 * np.asarray(u)[..., None])},
            "a kink": lambda: {"functions": lambda u: f(u) + far * np.abs(np.asarray(u)[..., None] - some)},
            "a jump": lambda: {"functions": lambda u: f(u) * (1.0 + far * (np.asarray(u)[..., None] > some))},
            "few nodes": lambda: {"nodes": 1}, "nodes that are no number": lambda: {"nodes": 12.0},
            "edges that do not begin at 0": lambda: {"knots": np.array([0.2, 1.0])},
            "edges that decrease": lambda: {"knots": np.array([0.0, 0.7, 0.5, 1.0])},
            "complex values": lambda: {"functions": lambda u: f(u) * (1.0 + 0.0j)},
            "transposed values": lambda: {"functions": lambda u: np.moveaxis(f(u), -1, 0)},
            "a function less": lambda: {"functions": lambda u: f(u)[..., :-1]},
            "NaN": lambda: {"functions": lambda u: np.where(np.asarray(u)[..., None] > some, np.nan, f(u))},
            "an exception": lambda: {"functions": lambda u: {}["nothing"]},
            "for numbers only": lambda: {"functions": lambda u: f(u) if u > some else 0.0 * f(u)},
            "strings": lambda: {"functions": lambda u: f(u).astype(str)},
            "another constant": lambda: {"coefficients": -good.coefficients},
            "a constant as a list": lambda: {"coefficients": good.coefficients.tolist()},
            "no cells": lambda: {"partition": True} if kind != "cells" else {"functions": lambda u: -f(u)},
            "no polynomials": lambda: {"polynomial": True, "functions": lambda u: f(u)[..., ::-1],
                                       "coefficients": good.coefficients[::-1].copy()},
            "a false coarser basis": lambda: {"coarser": (Maker(int(9999 * some)).rotated(), np.eye(n)[: n // 2])},
        }  # fmt: skip
        name = str(self.rng.choice(list(faults)))
        parts = {part: getattr(good, part) for part in good.__dataclass_fields__}
        return name, Own(**{**parts, **faults[name]()})


def draw(number: int) -> tuple[int, str, Own, bool]:
    """A basis with its kind, and whether it is broken."""
    maker = Maker(number)
    is_broken = bool(maker.rng.random() < 1 / 3)
    return number, *(maker.broken() if is_broken else maker.sound()), is_broken


def judge(case: tuple[int, str, Own, bool]) -> Iterator[Judged]:
    """The matrix in the basis beside the judge's, and the doors through which a basis comes."""
    number, kind, basis, is_broken = case
    rng = np.random.default_rng(number)
    diffuse, mirrored, back = rng.dirichlet(np.ones(3)).tolist()
    law = diffuse * ker.lambertian() + mirrored * ker.specular() + back * ker.retroreflection()
    theta = np.arccos(1.0 - 2.0 * rng.random((2, 2000)))
    doors = {
        "discretise": lambda: ker.discretise(law, basis),
        "estimate": lambda: ker.estimate(*theta, basis),
        "KernelMatrix": lambda: ker.KernelMatrix(np.eye(basis.size), basis, Estimate(0.0, 0.0, "bound", "given")),
        "estimate_stream": lambda: ker.estimate_stream(iter([tuple(theta)]), basis),
    }
    for door in ("discretise", str(rng.choice(list(doors)[1:]))):
        label, fault, claimed, true = f"broken, {door}" if is_broken else kind, "", 0.0, 0.0
        try:
            found = doors[door]()
        except InputError as reason:
            outcome, fault = "refused", "" if is_broken else f"REFUSED: {reason}"
        except Exception as reason:  # what users must never see
            outcome, fault = "raw", f"RAW {type(reason).__name__}: {reason}"
        else:
            outcome, fault = "taken", f"TAKEN: {kind}" if is_broken else ""
            if not is_broken and door == "discretise":
                angle, weight = rule(basis.knots)
                values, images = basis.evaluate(angle), basis.evaluate(np.pi - angle)
                constant = values.T @ weight
                exact = diffuse * np.outer(constant, constant) + back * np.eye(basis.size)
                exact += mirrored * values.T @ (weight[:, None] * images)
                claimed, true = float(found.error), float(np.linalg.norm(found.symmetric - exact))
        # of the judge's sums
        yield Judged(label, claimed, true, 1e-13 if claimed else 0.0, fault, outcome)


QUESTION = "Does a matrix in a user's basis keep its error, and is a broken basis refused?"
CAMPAIGNS = (Campaign("own-bases", QUESTION, draw, judge, 2000, range(60)),)
