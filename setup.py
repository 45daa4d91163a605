"""Tells setuptools where the rooms are, also in checkouts without symbolic links, such as those of Windows."""

from pathlib import Path

from setuptools import find_packages, setup

ROOMS = ("geometry", "kernels", "spectral")
PACKAGE = Path("src", "asperity")

if all((PACKAGE / room).is_dir() for room in ROOMS):
    # as editors and type checkers find an editable install
    setup(package_dir={"": "src"}, packages=find_packages("src"))
else:
    inside = [f"{room}.{name}" for room in ROOMS for name in ("", *find_packages(room))]
    setup(
        package_dir={"asperity": str(PACKAGE), **{f"asperity.{room}": room for room in ROOMS}},
        packages=["asperity", *(f"asperity.{name}".rstrip(".") for name in [*find_packages(str(PACKAGE)), *inside])],
    )
