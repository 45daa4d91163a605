"""Run a campaign: python -m campaigns NAME; without a name, list them."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from .engine import campaigns, print_run


def main() -> int:
    """Run the campaign of the given name; the exit code tells whether the library stands."""
    parser = argparse.ArgumentParser(prog="python -m campaigns", description=__doc__)
    known = campaigns()
    parser.add_argument("name", nargs="?", metavar="NAME", choices=list(known), help="one of those listed")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--count", type=int, help="number of cases; all by default")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="cases at a time")
    parser.add_argument("--record", type=Path, help="file of judgements, from which an interrupted run goes on")
    options = parser.parse_args()
    if options.name is None:
        for campaign in known.values():
            print(f"{campaign.name:24s} {campaign.cases:6d} cases  {campaign.question}")
        return 0
    stands = print_run(known[options.name], options.first, options.count, options.jobs, options.record)
    return 0 if stands else 1


if __name__ == "__main__":
    sys.exit(main())
