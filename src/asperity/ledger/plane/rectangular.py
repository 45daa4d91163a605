"""Sections 2.2.1 and 2.3.1: the laws of rectangular teeth and of their foreshortened form."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ...geometry import rectangular_teeth, trace
from ...geometry.disk import symbolic as sym
from ...geometry.disk.disk import foreshortening
from ...kernels.laws.isometry_table import crevice_retro
from ...kernels.walls.rectangular import RectangularTeethLaw
from ...verification import Verdict, agreement, verify
from ..entry import Code, row
from ..simulated import FRACTION_ERROR, fraction

HEIGHTS_TO_WIDTHS = (0.4, 1.0, 2.7)


def fraction_of_specular(height_to_width: float, theta: Any, low: float) -> Any:
    """The fraction of rays with entry points between ``low`` and 1 that leave specularly, by tracing."""

    def is_specular(x: Any, theta: Any) -> Any:
        out = trace(rectangular_teeth(height_to_width), x, theta).theta
        return np.abs(out + theta - np.pi) < np.abs(out - theta)

    return fraction(is_specular, theta, low)


def compared_with_tracing(probability: Code, low: float) -> Verdict:
    """The probability of specular reflection compared with its frequency, for several teeth."""
    theta = np.linspace(0.15, 3.0, 40)
    ratios = np.array(HEIGHTS_TO_WIDTHS)
    found = [probability(ratio, theta) for ratio in ratios]
    traced = [fraction_of_specular(ratio, theta, low) for ratio in ratios]
    return agreement(found, traced, FRACTION_ERROR, height_to_width=ratios[:, None], theta=theta)


def exchanged_cases(height_to_width: float, theta: Any) -> Any:
    """The conditional probability for a crevice as printed; p_r as printed is the mean of 1 and this."""
    whole, rest = np.divmod(2 * height_to_width / np.abs(np.tan(theta)), 1.0)
    return np.where(whole % 2 == 0, rest, 1.0 - rest)


@row(
    id="S2.01",
    section="2.2.1",
    kind="numeric",
    printed=r"p_r(\theta) = \begin{cases} \frac12 + \frac12\{d\} & \lfloor d \rfloor \text{ even} \\"
    r" 1 - \frac12\{d\} & \lfloor d \rfloor \text{ odd} \end{cases}",
    wrong=lambda ratio, theta: 0.5 + 0.5 * exchanged_cases(ratio, theta),
    corrected=r"p_r(\theta) = \begin{cases} 1 - \frac12\{d\} & \lfloor d \rfloor \text{ even} \\"
    r" \frac12 + \frac12\{d\} & \lfloor d \rfloor \text{ odd} \end{cases}, \quad d = 2r\,|\cot\theta|",
    right=lambda ratio, theta: RectangularTeethLaw(ratio).branches(theta)[0][..., 0],
)
def specular_fraction_of_rectangular_teeth(probability: Code) -> Verdict:
    """Rectangular teeth: the probability of specular reflection, r the height over the width.

    Steep rays, with d near 0, meet no side and are specular, so the even case is the one that starts at 1. The two
    cases are exchanged.
    """
    return compared_with_tracing(probability, 0.0)


@row(
    id="S2.02",
    section="2.2.1",
    kind="numeric",
    printed=r"\begin{cases} \{d\} & \lfloor d \rfloor \text{ even} \\"
    r" 1 - \{d\} & \lfloor d \rfloor \text{ odd} \end{cases}",
    wrong=exchanged_cases,
    corrected=r"\begin{cases} 1 - \{d\} & \lfloor d \rfloor \text{ even} \\"
    r" \{d\} & \lfloor d \rfloor \text{ odd} \end{cases}",
    right=lambda ratio, theta: 1.0 - crevice_retro(ratio, theta),
)
def specular_fraction_of_a_crevice(probability: Code) -> Verdict:
    """Rectangular teeth: the probability of specular reflection for rays that enter a crevice.

    Unfolded, the ray crosses d widths, hence ⌊d⌋ or ⌊d⌋ + 1 sides, the latter with probability {d}. An even number of
    sides makes it specular.
    """
    return compared_with_tracing(probability, 0.5)


@row(
    id="S2.18",
    section="2.3.1",
    equation="2.5",
    printed=r"\tilde r = (1 + m/J)^{-1/2} r",
    wrong=lambda r, m, J, xp: r / xp.sqrt(1 + m / J),
    corrected=r"\tilde r = (1 + m/J)^{1/2} r",
    right=lambda r, m, J, xp: r * xp.sqrt(1 + m / J),
)
def ratio_of_foreshortened_teeth(ratio: Code) -> Verdict:
    """The ratio r̃ of the foreshortened rectangular teeth.

    Widths are compressed and heights are not, so height over width grows. The printed exponent is for width over
    height, which section 2.3.1 says and sections 1.2.3 and 2.2.1 do not use.
    """
    width, height = sp.symbols("width height", positive=True)
    felt = height / (foreshortening(sym.m, sym.J, sp) * width)
    return verify(ratio(height / width, sym.m, sym.J, sp), felt)
