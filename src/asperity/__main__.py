"""``python -m asperity`` is the command ``asperity``."""

from .cli import main

if __name__ == "__main__":
    main(prog_name="python -m asperity")
