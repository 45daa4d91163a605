"""What the spread of the parts of a randomised net says of the error of the whole net."""

from __future__ import annotations

# Where the variance V(n) of the mean of n rays of a net falls like n^-q, q = 3/2, halves of a part differ by twice the
# root of V(n/2) - V(n) = (2^q - 1) V(n). Of the 7 differences of 8 parts 1, 2 and 4 are between halves, quarters and
# eighths, so that the spread tells V (2^q - 1) (1 + 2 2^q/2 + 4 4^q/4)/7 for V: this is V over that.
NET_OVER_SPREAD = 7.0 / ((2.0**1.5 - 1.0) * (1.0 + 2.0**1.5 + 4.0**1.5))
