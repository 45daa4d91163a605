"""The table of the stiff and extreme cases: ``python -m campaigns.extremes [--quick]``."""

import argparse

from .report import run_extremes

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m campaigns.extremes", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="smaller sizes: about a minute")
    print(run_extremes(parser.parse_args().quick).table())
