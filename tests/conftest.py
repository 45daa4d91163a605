"""What tests share: a test that takes ``wall`` runs on all of them, or on those whose names it gives indirectly."""

from __future__ import annotations

from functools import cache

import pytest

from wall_shapes import CLOSED, OPEN

# ---- walls -------------------------------------------------------------------------------------------------------
built = cache(lambda name: (CLOSED | OPEN)[name]())


@pytest.fixture(params=CLOSED | OPEN)
def wall(request):
    """Each wall by its name."""
    return built(request.param)


@pytest.fixture(params=CLOSED)
def closed_wall(request):
    """Each wall without islands."""
    return built(request.param)
