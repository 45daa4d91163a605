"""Panels in the incoming angle, with conditional expectations at Kronrod nodes and integrals over the panels."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ..bases.basis import Basis
from ..bases.measure import SINE

# Kronrod's rule with 15 nodes and the Gauss rule with 7 among them (Piessens et al., QUADPACK, 1983).
_NODES = (
    0.991455371120812639206854697526329, 0.949107912342758524526189684047851,
    0.864864423359769072789712788640926, 0.741531185599394439863864773280788,
    0.586087235467691130294144691693, 0.405845151377397166906606412076961,
    0.207784955007898467600689403773245, 0.0,
)  # fmt: skip
_KRONROD = (
    0.022935322010529224963732008058970, 0.063092092629978553290700663189204,
    0.104790010322250183839876322541518, 0.140653259715525918745189590510238,
    0.169004726639267902826583426598550, 0.190350578064785409913256402421014,
    0.204432940075298892414161999234649, 0.209482141084727828012999174891714,
)  # fmt: skip
_GAUSS = (
    0.0, 0.129484966168869693270611432679082, 0.0, 0.279705391489276667901467771423780,
    0.0, 0.381830050505118944950369775488975, 0.0, 0.417959183673469387755102040816327,
)  # fmt: skip
NODES = np.array([-x for x in _NODES[:-1]] + list(_NODES[::-1]))
KRONROD = np.array(list(_KRONROD[:-1]) + list(_KRONROD[::-1]))
GAUSS = np.array(list(_GAUSS[:-1]) + list(_GAUSS[::-1]))

# The substitution theta = low + (high - low) s^2 (3 - 2 s). Panels end where pieces of a conditional distribution
# appear or disappear; expectations behave like a square root there.
_S = 0.5 * (1.0 + NODES)
STRETCHED, SLOPES = _S * _S * (3.0 - 2.0 * _S), 3.0 * _S * (1.0 - _S)


def _null_rules(count: int) -> Floats:
    """Rules of the size of the difference of Kronrod's and Gauss's rule that vanish for polynomials of low degree.

    The first is the difference itself, of the highest degree. They are orthogonal to each other.
    """
    polynomials = np.polynomial.legendre.legvander(NODES, len(NODES) - 1)
    orthogonal, _ = np.linalg.qr(polynomials)
    return np.asarray(np.linalg.norm(KRONROD - GAUSS) * orthogonal.T[: -count - 1 : -1])


NULL_RULES = _null_rules(4)
# Where the null rules decrease with their degree, the squares of the first two below this fraction of those of the
# others, the integrand is smooth. At a kink one of them may vanish by chance, and all of them count.
SMOOTH = 1.0 / 256.0


def error_of_null_rules(squares: Floats) -> Floats:
    """Estimated errors from the squares of the null rules, which the first axis runs over."""
    high, low = squares[:2].sum(axis=0), squares[2:].sum(axis=0)
    return np.asarray(np.sqrt(np.where(high < SMOOTH * low, high, 0.25 * (high + low))))


# Where nodes sample noise, polynomials with this number of coefficients are its trend. RESIDUALS maps values at the
# nodes to their distances from the fitted polynomial.
TREND_TERMS = 5
_trends, _ = np.linalg.qr(np.polynomial.legendre.legvander(NODES, TREND_TERMS - 1))
RESIDUALS = np.eye(len(NODES)) - _trends @ _trends.T
# 95 % quantiles of the normal distribution, and of Student's for the standard errors of `standard_errors`: their square
# is a weighted sum of squares that for normal noise spreads as much as one of 4.0 equal ones on panels that begin at
# grazing, and of 4.8 on narrow ones.
NORMAL, STUDENT = 1.96, 2.8


@dataclass
class AnglePanels:
    """A set of panels; the first axis of every array runs over the panels.

    Attributes
    ----------
    low, high : array, shape (panels,)
    angle, mean_error : array, shape (panels, 15)
        The nodes, and the errors there of the vector of all expectations.
    image : array, shape (panels, 15, size)
        The expectations of the basis functions, E[e_j(Theta') | theta], at the nodes.
    error : array, shape (panels,)
        Estimated error of the integral, without the errors of the expectations; `NORMAL` standard errors of a sample.
    integral : array, shape (panels, size)
        Integrals of parts of the expectations that ``image`` leaves out, if the basis is constant on each panel.
    factor : array, shape (panels,)
        The error as a multiple of the null rules; 0 where it is not one, because the expectations are a sample.
    """

    low: Floats
    high: Floats
    angle: Floats
    mean_error: Floats
    image: Floats
    error: Floats
    integral: Floats
    factor: Floats

    @staticmethod
    def between(low: Floats, high: Floats, size: int) -> AnglePanels:
        """Panels whose expectations are not computed yet."""
        angle = low[:, None] + (high - low)[:, None] * STRETCHED
        shape, number = angle.shape, len(low)
        return AnglePanels(
            low, high, angle, np.zeros(shape), np.zeros((*shape, size)), np.zeros(number), np.zeros((number, size)),
            np.zeros(number),
        )  # fmt: skip

    @property
    def mass(self) -> Floats:
        """Measure of every panel."""
        return SINE.mass(self.low, self.high)

    def selected(self, mask: NDArray[np.bool_] | NDArray[np.int64]) -> AnglePanels:
        """The panels chosen by a mask or by indices."""
        return AnglePanels(*(getattr(self, field.name)[mask] for field in fields(self)))

    def joined(self, other: AnglePanels) -> AnglePanels:
        """These panels followed by the other ones."""
        return AnglePanels(
            *(np.concatenate((getattr(self, field.name), getattr(other, field.name))) for field in fields(self))
        )

    def _weights(self, rule: Floats) -> Floats:
        """The weights of a rule at the nodes for the measure, shape (panels, 15)."""
        return np.asarray((self.high - self.low)[:, None] * SLOPES * SINE.density(self.angle) * rule)

    def _means(self, rule: Floats) -> Floats:
        """The integrals of E[e_j(Theta') | theta] by a rule, shape (panels, size)."""
        return np.asarray(np.matmul(self._weights(rule)[:, None, :], self.image)[:, 0])

    def _here(self, basis: Basis) -> Floats:
        """The values of the functions in the middle of the panels, on all of each for indicators."""
        return basis.evaluate(self.angle[:, len(NODES) // 2])

    def _integrals(self, rule: Floats, basis: Basis) -> Floats:
        """The integrals of e_i(theta) E[e_j(Theta') | theta] over each panel, shape (panels, size, size).

        For indicators, one row of each matrix is not 0; the shape is (panels, 1, size) then.
        """
        if basis.is_partition:
            return np.asarray(np.linalg.norm(self._here(basis), axis=1)[:, None, None] * self._means(rule)[:, None, :])
        here = basis.evaluate(self.angle) * self._weights(rule)[..., None]
        return np.asarray(np.matmul(here.transpose(0, 2, 1), self.image))

    def values(self, basis: Basis) -> Floats:
        """The integrals over each panel by Kronrod's rule, as `_integrals`, with those that ``image`` leaves out."""
        found = self._integrals(KRONROD, basis)
        if basis.is_partition:
            found += np.linalg.norm(self._here(basis), axis=1)[:, None, None] * self.integral[:, None, :]
        return found

    def total(self, basis: Basis) -> Floats:
        """The sum of the integrals over all panels, shape (size, size)."""
        found = self._total(basis, KRONROD, np.ones(len(self.low)))
        return np.asarray(found + self._here(basis).T @ self.integral) if basis.is_partition else found

    def _total(self, basis: Basis, rule: Floats, factor: Floats) -> Floats:
        """The sum of the integrals by a rule, times the factors of the panels."""
        if basis.is_partition:
            return np.asarray(self._here(basis).T @ (factor[:, None] * self._means(rule)))
        here = basis.evaluate(self.angle) * (factor[:, None] * self._weights(rule))[..., None]
        return np.asarray(here.reshape(-1, basis.size).T @ self.image.reshape(-1, basis.size))

    def total_error(self, basis: Basis) -> float:
        """The error of the sum of the integrals, without the errors of the expectations.

        Errors of different signs are added in quadrature. Kinks at the same place of many panels leave errors of one
        sign; so do their null rules, and the sum of these is larger then. Samples count with `STUDENT` standard errors,
        because one of them may dominate.
        """
        of_rules = self.factor > 0.0
        summed = [np.sum(self._total(basis, rule, self.factor) ** 2) for rule in NULL_RULES]
        squares = max(float(np.sum(self.error[of_rules] ** 2)), float(np.mean(summed)))
        return math.sqrt(squares + (STUDENT / NORMAL) ** 2 * float(np.sum(self.error[~of_rules] ** 2)))

    def differences(self, basis: Basis, rules: Floats = NULL_RULES[:1]) -> Floats:
        """The norms of the differences between Kronrod's and Gauss's rule, shape (panels,).

        For more null rules, the root mean square of their norms.
        """
        return np.asarray(np.sqrt(np.mean(self._squares(basis, rules), axis=0)))

    def rule_errors(self, basis: Basis) -> Floats:
        """The errors of the integrals by `error_of_null_rules`, shape (panels,)."""
        return error_of_null_rules(self._squares(basis, NULL_RULES))

    def _squares(self, basis: Basis, rules: Floats) -> Floats:
        return np.array([np.sum(self._integrals(rule, basis) ** 2, axis=(1, 2)) for rule in rules])

    def standard_errors(self, basis: Basis) -> Floats:
        """The standard errors of the integrals, shape (panels,), if the expectations are independent around a trend.

        The variance at a node is its squared distance from the trend, over the mean of this for independent numbers of
        variance 1; so nodes of large weight count by their own noise. Null rules would not do: the weights of the
        measure make them smaller than Kronrod's rule, by a factor of 1.2, and no longer orthogonal.
        """
        variances = np.sum(np.matmul(RESIDUALS, self.image) ** 2, axis=2) / np.diag(RESIDUALS)
        size = np.linalg.norm(basis.evaluate(self.angle), axis=2)
        return np.asarray(np.sqrt(np.sum((self._weights(KRONROD) * size) ** 2 * variances, axis=1)))

    def mean_errors(self, basis: Basis) -> Floats:
        """The errors of the integrals due to the errors of the expectations, shape (panels,)."""
        size = np.linalg.norm(basis.evaluate(self.angle), axis=2)
        return np.asarray(np.sum(self._weights(KRONROD) * size * self.mean_error, axis=1))

    def mean_squares(self) -> Floats:
        """The integrals of the squared errors of the expectations, shape (panels,)."""
        return np.asarray(np.sum(self._weights(KRONROD) * self.mean_error**2, axis=1))

    def total_mean_error(self, basis: Basis) -> float:
        """A bound of the Frobenius error of all integrals together due to the errors of the expectations.

        The integrals are the product of two arrays with one row per node: the values e_i(theta) of the basis and the
        expectations, both times the roots of the weights. So errors d of the expectations change them by at most the
        norm of the first array times the root of the sum of the weighted d^2. At a few nodes with large errors the sum
        of the changes by single nodes may be smaller; the bound uses it for the largest errors, as many as is best.
        """
        weight, here, error = (
            self._weights(KRONROD).ravel(),
            basis.evaluate(self.angle.ravel()),
            self.mean_error.ravel(),
        )
        # indicators are orthogonal
        norm = float(
            np.max(weight @ here**2) if basis.is_partition else np.linalg.norm(here.T @ (weight[:, None] * here), 2)
        )
        order = np.argsort(-error)
        single = np.append(0.0, np.cumsum((weight * np.linalg.norm(here, axis=1) * error)[order]))
        squares = np.append(np.cumsum((weight * error**2)[order[::-1]])[::-1], 0.0)
        return float(np.min(single + np.sqrt(norm * squares)))
