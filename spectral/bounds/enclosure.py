"""Intervals that contain eigenvalues of a law (not of a matrix), each with its justification."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, instance, positive_number, whole_number
from ...core.estimates import ErrorKind, Summary, with_error
from ...core.rounding import EPS
from ...core.tables import data_frame
from ...kernels import Basis, CollisionLaw, DensityLaw, Law, Legendre, discretise
from ...kernels.bases.measure import SINE
from ...kernels.laws.law import Composition, Power
from ...kernels.laws.matrix_law import finite_matrix
from ...kernels.walls.wall_law import made_of_isometries
from ..eigenvalues.dense import Parity, extremal_by_parity, parity_basis
from ..eigenvalues.spectra import Spectrum, check_reversible, matrix_spectrum
from .contraction import refuse_unless_self_adjoint
from .images import is_traced, suits_panels
from .operator_residuals import Residuals, image_rule, residuals
from .separation import Separation, rest_of_spectrum
from .trial_space import Rank, adapted_trial_space

Label = Literal["indexed", "contains-spectrum"]

# Size of the Legendre basis: at least LEAST_DEGREE and 2 k + MORE_DEGREES. EXTRA more functions show the next values.
LEAST_DEGREE, MORE_DEGREES, EXTRA = 32, 12, 2
MATRIX_TOLERANCE = 1e-8
# Fraction of the width of an enclosure for squared residuals of adapted trial functions; for traced laws and for closed
# forms the fraction for errors of quotients, and the limit on their incoming angles.
TRIAL_FRACTION, OF_TRACED, OF_EXACT = 0.3, (0.65, 14_000), (0.3, 40_000)
# Rounding of a Rayleigh quotient, a pairwise sum of some hundred products.
QUOTIENT_ROUNDING = 4.0 * EPS


@dataclass(frozen=True, repr=False)
class Enclosure(Summary):
    """An interval that contains a point of the spectrum of a law.

    Attributes
    ----------
    value : float
        The Rayleigh quotient rho of the trial function v.
    low, high : float
        The ends of the interval.
    label : {"indexed", "contains-spectrum"}
        ``"indexed"``: the interval contains the eigenvalue number ``index``. If the moduli of m enclosures overlap,
        their union contains m eigenvalues, in unknown order; ``reason`` lists the others.
        ``"contains-spectrum"``: the interval contains a point of the spectrum, with unknown index.
    index : int or None
        Number of the eigenvalue by decreasing modulus; the constants have index 0.
    residual : float
        ||P v - rho v||.
    kind : {"bound", "estimate"}
        ``"bound"`` holds to rounding; ``"estimate"`` if a quadrature or the separation is estimated.
    reason : str
        The justification of the label, or the reason for an unknown index.
    parity : {"even", "odd", "none"}
        Parity of the trial function under theta -> pi - theta; "none" if the law is not known to be mirror-symmetric.
    """

    value: float
    low: float
    high: float
    label: Label
    index: int | None
    residual: float
    kind: ErrorKind
    reason: str
    parity: Parity = "none"
    _more = ".residual, .reason"

    @property
    def width(self) -> float:
        """The width ``high - low`` of the interval."""
        return self.high - self.low

    def __contains__(self, number: float) -> bool:
        return self.low <= number <= self.high

    def __str__(self) -> str:
        parity = "" if self.parity == "none" else f", {self.parity}"
        return f"[{self.low:.15g}, {self.high:.15g}] holds {self._held()}{parity} ({self.kind}: {self.reason})"

    def _held(self) -> str:
        return "a point of the spectrum" if self.index is None else f"eigenvalue {self.index}"

    def _headline(self) -> str:
        return with_error(0.5 * (self.low + self.high), 0.5 * self.width)

    def _facts(self) -> dict[str, object]:
        return {"holds": self._held(), "parity": self.parity, "kind": self.kind}


@dataclass(frozen=True, repr=False)
class Enclosures(Summary):
    """Enclosures, with the one of the constants first and the others by decreasing value; a sequence.

    Attributes
    ----------
    items : tuple of Enclosure
    separation : Separation
        Bound of the rest of the spectrum, which justifies the indices.
    convention : {"paper", "specular"}
    method : str
    """

    items: tuple[Enclosure, ...]
    separation: Separation
    convention: str
    method: str
    _more = ".method, .separation, .to_frame(), [k]"

    def __len__(self) -> int:
        return len(self.items)

    def __iter__(self) -> Iterator[Enclosure]:
        return iter(self.items)

    def __getitem__(self, position: int) -> Enclosure:
        return self.items[position]

    def to_frame(self) -> Any:
        """One row an enclosure, one column a field, as a pandas.DataFrame (extra ``studies``)."""
        names = [field.name for field in fields(Enclosure)]
        return data_frame({name: [getattr(item, name) for item in self.items] for name in names})

    def _facts(self) -> dict[str, object]:
        names = ("point {}" if item.index is None else f"{{}} {item.parity}" for item in self.items)
        return {"convention": self.convention, **{name.format(k): self.items[k] for k, name in enumerate(names)}}


def enclosures(
    law: Law | CollisionLaw, k: int = 4, basis: Basis | None = None, tolerance: float = MATRIX_TOLERANCE
) -> Enclosures:
    r"""Enclose the k eigenvalues of largest modulus of a reversible law (the operator, not a matrix).

    Parameters
    ----------
    law : Law or CollisionLaw
        A reversible law, in its own convention; for a collision law its P~.
    k : int
        Number of eigenvalues, including the eigenvalue 1 of the constants.
    basis : Basis, optional
        Basis of the trial functions. The default is panels that adapt to the law for walls, arcs, Lambertian reflection
        and sums of these, and Legendre polynomials for other laws. Laws of finitely many states, also in sums and
        products with Lambertian reflection and isometries, need no trial functions: they are matrices.
    tolerance : float
        Wanted half width of the enclosures on adaptive panels, otherwise the wanted Frobenius error of the matrix that
        yields the trial functions. It affects the width of the enclosures, not their validity.

    Returns
    -------
    Enclosures

    Raises
    ------
    InputError
        If the errors of conditional expectations are unknown: for compositions with laws whose expectations are
        computed by quadrature, walls with more than 64 pieces, and laws given by entry points.
    AccuracyError
        If the law is not symmetric within its error. If the law is self-adjoint in the other convention only, the
        message states the norm bound that holds in this one.

    Notes
    -----
    For a unit vector v with quotient rho and residual r, [rho - r, rho + r] meets the spectrum. Suppose all of the
    spectrum except m points has modulus at most s, and the m intervals, widened by the joint residual, stay beyond s.
    Then they contain m eigenvalues in the order of their trial functions (Kahan), and the Kato-Temple bound
    r^2/(distance to the rest of the spectrum) replaces r. The errors of the quadratures are included in r and rho.

    Source: B. N. Parlett, *The Symmetric Eigenvalue Problem* (1980), sections 10.5 and 11.5; T. Kato, J. Phys. Soc.
    Japan 4 (1949) 334.

    Examples
    --------
    >>> from asperity import kernels as ker, spectral as spec
    >>> found = spec.enclosures(ker.henyey_greenstein(0.5), 3)
    >>> [item.label for item in found], all(0.5**l in found[l] for l in range(3))
    (['indexed', 'indexed', 'indexed'], True)
    >>> max(item.width for item in found) < 1e-13
    True
    """
    whole_number("k", k, 1)
    positive_number("tolerance", tolerance)
    if isinstance(law, CollisionLaw):
        law = law.law
    instance("law", law, Law, "ker.WallLaw(wall)")
    refuse_unless_self_adjoint(law)
    if law.reversible is None:
        check_reversible(discretise(law, Legendre(MORE_DEGREES), tolerance=MATRIX_TOLERANCE))
    own = finite_matrix(law)
    matrix = finite_matrix(law, k + 1) if own is not None and own.size > 1 else None
    if matrix is not None:
        return _of_matrix(matrix_spectrum(matrix, k + 1), k, float(np.abs(matrix.beyond or ()).max()))
    power = as_power(law)
    if power is not None:
        return _raised(enclosures(power[0], k, basis, tolerance / power[1]), power[1])
    return enclosed_trial_space(law, k, basis, tolerance).enclosures


@dataclass(frozen=True)
class EnclosedTrialSpace:
    """Enclosures with their trial functions; ``vectors``, shape (n, k), holds coefficients in ``basis``.

    From the edges ``finer`` the panels of a smaller tolerance begin.
    """

    enclosures: Enclosures
    basis: Basis
    vectors: Floats
    finer: Floats | None = None

    @property
    def worst(self) -> float:
        """Half of the largest width."""
        return 0.5 * max(item.width for item in self.enclosures)

    @property
    def indexed(self) -> bool:
        """Whether all enclosures are indexed."""
        return all(item.label == "indexed" for item in self.enclosures)


def enclosed_trial_space(
    law: Law, k: int, basis: Basis | None = None, tolerance: float = MATRIX_TOLERANCE, rank: Rank = np.abs,
    start: Floats | None = None,
) -> EnclosedTrialSpace:  # fmt: skip
    """The result of `enclosures` for a self-adjoint law, with the trial functions.

    The ``finer`` edges of an earlier result may be the first ones. By value (``rank`` is np.positive) the separation
    bounds the rest of the spectrum from above only.
    """
    if basis is None and suits_panels(law):
        space = adapted_trial_space(law, k, TRIAL_FRACTION * tolerance, rank, start)
        basis, values, vectors, names = space.basis, space.values, space.vectors, space.parities
        fraction, most_angles = OF_TRACED if is_traced(law) else OF_EXACT
        # conditional expectations dominate the cost, so the following functions use the same incoming angles
        both = residuals(
            law, basis, np.column_stack([vectors, space.following]), np.append(values, space.following_values),
            most_angles, mirrored=space.mirrored, quotient_error=fraction * tolerance, leading=len(values),
            expected=space.square,
        )  # fmt: skip
        found, after = both.split(len(values))
        next_value, finer = _reach(after, rank), np.union1d(space.finer, found.marks)
    else:
        if basis is None:
            basis = Legendre(max(LEAST_DEGREE, 2 * k + MORE_DEGREES))
        values, vectors, names, next_value = _trial(law, basis, k, tolerance)
        found, finer = residuals(law, basis, vectors, values), None
    order = np.argsort(-rank(found.quotients), kind="stable")
    apart = _first_that_separates(law, found, order, next_value, rank)
    method = f"trial functions in {basis!r}, residuals by adaptive quadrature at {found.angles_used} angles"
    # exact if images are computed to rounding; otherwise the difference of two rules estimates their errors
    exact = law.eigenvalue_ratio is not None and isinstance(basis, Legendre)
    items = [_enclosed(found, apart, order, position, names, exact) for position in range(len(values))]
    return EnclosedTrialSpace(Enclosures(_with_ties(items), apart[1], law.frame, method), basis, vectors, finer)


def _with_ties(items: list[Enclosure]) -> tuple[Enclosure, ...]:
    """Add to the reason of an indexed enclosure the indices whose moduli overlap, because their order is unknown."""
    listed = []
    for item in items:
        others = [other for other in items if other is not item and other.index is not None]
        tied = [other for other in others if item.index is not None and _moduli_overlap(item, other)]
        words = ", ".join(sorted(str(other.index) for other in tied))
        listed.append(replace(item, reason=f"{item.reason}; the order with {words} is not certain") if tied else item)
    return tuple(listed)


def _moduli_overlap(one: Enclosure, other: Enclosure) -> bool:
    # the moduli in [a, b] range from max(a, -b), or 0 if this is negative, to max(-a, b)
    least = max(max(item.low, -item.high) for item in (one, other))
    return least <= min(max(-item.low, item.high) for item in (one, other))


def as_power(law: Law) -> tuple[Law, int] | None:
    """Base and exponent of a power of a law, also if written as a product, or None.

    ``law ** 1`` and a composition of one law count as powers. None is returned for other laws, irreversible bases and
    laws made of isometries.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> g = ker.henyey_greenstein(0.5)
    >>> as_power(g @ g) == as_power(g**2) == (g, 2), as_power(g) is None
    (True, True)
    """
    if isinstance(law, Power) and law.exponent >= 1:
        base, exponent = law.law, law.exponent
    elif isinstance(law, Composition) and all(part == law.laws[0] for part in law.laws):
        base, exponent = law.laws[0], len(law.laws)
    else:
        return None
    return (base, exponent) if base.reversible and not made_of_isometries(base) else None


def _raised(found: Enclosures, exponent: int) -> Enclosures:
    """Enclosures of the eigenvalues of a power, by decreasing value."""
    items = []
    for item in found:
        nearest_to_zero = min(max(item.low, 0.0), item.high)
        ends = [point**exponent for point in (item.low, nearest_to_zero, item.high)]
        # lambda^n - rho^n is lambda - rho times a sum of products, for any lambda in the spectrum
        slope = sum(min(abs(item.value), 1.0) ** degree for degree in range(exponent))
        items.append(
            replace(
                item, value=item.value**exponent, low=min(ends), high=max(ends), residual=slope * item.residual,
                reason=f"power {exponent}; {item.reason}",
            )
        )  # fmt: skip
    apart = replace(
        found.separation,
        radius=found.separation.radius**exponent,
        reason=f"power {exponent}: {found.separation.reason}",
    )
    items.sort(key=lambda item: (item.index != 0, -item.value))
    return replace(found, items=tuple(items), separation=apart, method=f"power {exponent}; {found.method}")


def _of_matrix(found: Spectrum, k: int, beyond: float) -> Enclosures:
    """Enclosures from a matrix that has the k + 1 eigenvalues of largest modulus of the law.

    Eigenvalues are indexed if they exceed the modulus ``beyond`` of the eigenvalues of infinite multiplicity.
    """
    errors, moduli = found.errors.total(), np.abs(found.values)
    reason = f"the law is a matrix on {found.basis.size} bins and known beyond them; {found.completeness}"
    order = np.append(0, 1 + np.argsort(-moduli[1:], kind="stable"))
    items = []
    for index, i in enumerate(order[:k].tolist()):
        value, error, certain = float(found.values[i]), float(errors[i]), moduli[i] - errors[i] > beyond
        why = reason if certain else f"its number is not known: infinitely many have the modulus {beyond:.6g}; {reason}"
        label: Label = "indexed" if certain else "contains-spectrum"
        items.append(
            Enclosure(
                value, value - error, min(value + error, 1.0), label, index if certain else None,
                float(found.residuals[i]), "bound", why, found.parity[i],
            )
        )  # fmt: skip
    items.sort(key=lambda item: (item.index != 0, -item.value))
    radius = float(moduli[order[k]] + errors[order[k]]) if order.size > k else 0.0
    apart = Separation(radius, "bound", f"the next eigenvalue; {reason}")
    return Enclosures(_with_ties(items), apart, found.convention, f"eigenvalues of a matrix in {found.basis!r}")


def _first_that_separates(
    law: Law, found: Residuals, order: NDArray[np.intp], next_value: float, rank: Rank = np.abs
) -> tuple[int, Separation]:
    """The largest number of leading values separated from the rest of the spectrum, and the bound of this rest."""
    modulus = rank(found.quotients[order])
    following = np.append((modulus + found.norms[order])[1:], next_value)
    refused: Separation | None = None
    for number in range(len(order), 0, -1):
        listed = found.quotients[order[:number]]
        joint = float(np.linalg.norm(found.norms[order[:number]]))
        if modulus[number - 1] - joint <= following[number - 1] and number > 1:
            # the next trial function overlaps: a multiple or unresolved eigenvalue
            continue
        apart = rest_of_spectrum(law, listed, joint, float(following[number - 1]), rank is np.positive)
        if modulus[number - 1] - joint > apart.radius:
            return number, apart
        refused = apart if refused is None else refused
    return 0, refused or Separation(np.inf, "estimate", "no trial function is apart from the next")


def _trial(law: Law, basis: Basis, k: int, tolerance: float) -> tuple[Floats, Floats, tuple[Parity, ...], float]:
    """Eigenpairs of largest modulus, constants first, then descending; their parities; modulus reached by the next."""
    symmetric = _galerkin(law, basis, tolerance)
    constant = np.asarray(basis.constant)
    found, names = extremal_by_parity(symmetric, parity_basis(basis, law), constant, len(symmetric), "largest")
    rest, inner = found.values, found.vectors
    order = np.argsort(-np.abs(rest), kind="stable")
    chosen = np.sort(order[: k - 1])
    values, vectors = np.append(1.0, rest[chosen]), np.column_stack([constant, inner[:, chosen]])
    first: Parity = "even" if law.mirror_symmetric and "none" not in names else "none"
    listed = (first, *(names[position] for position in chosen))
    following = order[k - 1 : k - 1 + EXTRA]
    if not following.size:
        return values, vectors, listed, 0.0
    after = residuals(law, basis, inner[:, following], rest[following], most_angles=0)
    return values, vectors, listed, _reach(after)


def _reach(after: Residuals, rank: Rank = np.abs) -> float:
    """The highest rank in the intervals of these functions."""
    return float(np.max(rank(after.quotients) + after.norms))


def _galerkin(law: Law, basis: Basis, tolerance: float) -> Floats:
    if isinstance(law, DensityLaw) and isinstance(basis, Legendre) and not law.outgoing_breakpoints.size:
        # a Gauss rule integrates the smooth images, at less cost than a discretisation where the density has a peak
        angle, weight = SINE.quadrature(basis.edges, basis.nodes_per_interval)
        image, _ = image_rule(law, basis, np.eye(basis.size))(angle, tolerance)
        symmetric = basis.evaluate(angle).T @ (weight[:, None] * image)
        return np.asarray(0.5 * (symmetric + symmetric.T))
    matrix = discretise(law, basis, tolerance=tolerance)
    check_reversible(matrix)
    return np.asarray(0.5 * (matrix.symmetric + matrix.symmetric.T))


def _enclosed(
    found: Residuals, known: tuple[int, Separation], order: NDArray[np.intp], position: int,
    names: tuple[Parity, ...], exact: bool,
) -> Enclosure:  # fmt: skip
    number, apart = known
    own = names[position]
    value, norm = float(found.quotients[position]), float(found.norms[position])
    rank = order.tolist().index(position)
    if rank == 0 and position == 0 and number:
        return Enclosure(1.0, 1.0, 1.0, "indexed", 0, norm, apart.kind, f"P 1 = 1; {apart.reason}", own)
    if rank < number:
        # the law preserves parity, so only enclosures of the same parity are neighbours
        alike = np.array([other for other in order[:number] if names[other] == own], dtype=np.intp)
        low, high = _temple(found, apart.radius, alike, position)
        kind: ErrorKind = "bound" if exact and apart.kind == "bound" else "estimate"
        reason = f"{apart.reason}: the rest is within {apart.radius:.6g}"
        return Enclosure(value, low, high, "indexed", rank, norm, kind, reason, own)
    radius = norm + float(found.quotient_errors[position]) + QUOTIENT_ROUNDING
    reason = f"its number is not known: the rest reaches {apart.radius:.6g} for all that is known ({apart.reason})"
    kind = "bound" if exact else "estimate"
    return Enclosure(
        value, value - radius, min(value + radius, 1.0), "contains-spectrum", None, norm, kind, reason, own
    )


def _temple(found: Residuals, rest: float, listed: NDArray[np.intp], position: int) -> tuple[float, float]:
    """The Kato-Temple interval, from the distances to neighbouring enclosures or to the rest of the spectrum."""
    uncertainty = found.quotient_errors + QUOTIENT_ROUNDING
    radius = found.norms + uncertainty
    value, norm = found.quotients[position], found.norms[position]
    others = listed[listed != position]
    near, spread = found.quotients[others], radius[others]
    above = np.concatenate([(near - spread)[near > value], [-rest] if value < -rest else []])
    below = np.concatenate([(near + spread)[near <= value], [rest] if value > rest else []])
    room_above = float(above.min()) - value if above.size else np.inf
    room_below = value - float(below.max()) if below.size else np.inf
    up = min(norm**2 / room_below, radius[position]) if room_below > 0.0 else radius[position]
    down = min(norm**2 / room_above, radius[position]) if room_above > 0.0 else radius[position]
    return float(value - down - uncertainty[position]), float(min(value + up + uncertainty[position], 1.0))
