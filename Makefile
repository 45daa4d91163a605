# `make study` runs the main job on a default wall, `make test` the tests; both set themselves up in .venv.
# Another interpreter: make PYTHON=python3.12 test

PYTHON ?= python3
WALL ?= focusing-arcs

VENV := .venv
PY := $(VENV)/bin/python
RUN := $(VENV)/.installed
DEV := $(VENV)/.installed-dev

# Bytecode is kept: each of the hundreds of processes that tests start would compile the sources again.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help study test test-all test-lowest test-newest test-wheel check format-check lint types docs bench build format clean distclean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 24

study: $(RUN) ## study a wall and draw it into study/ (WALL=NAME or NAME:parameter=value for another)
	$(VENV)/bin/asperity study $(WALL) --out study --force

test: $(DEV) ## run the tests, but the slow ones, on every core
	$(PY) -m pytest --numprocesses auto --dist worksteal -m 'not slow'

test-all: $(DEV) ## run all tests, on every core
	$(PY) -m pytest --numprocesses auto --dist worksteal --durations 50

# pip takes the newest versions by itself, but leaves alone what an environment has: so these two start from nothing.
test-lowest: ## run the tests with the lowest versions of all dependencies, in .venv-lowest
	$(PYTHON) -m venv --clear .venv-lowest
	.venv-lowest/bin/python -m pip install --quiet --constraint constraints/lowest.txt --editable '.[dev]'
	.venv-lowest/bin/python -m pytest --numprocesses auto --dist worksteal

# The sdist has the tests and pages; the package is the installed wheel's, because no test imports `src`.
test-wheel: $(DEV) ## run the tests, but the slow ones, of the sdist with the wheel built from it, in .venv-wheel
	rm -rf dist
	$(PY) -m build
	$(PYTHON) -m venv --clear .venv-wheel
	.venv-wheel/bin/python -m pip install --quiet "$$(echo dist/*.whl)[dev]"
	mkdir .venv-wheel/sdist && tar --extract --gzip --file dist/*.tar.gz --strip-components 1 --directory .venv-wheel/sdist
	cd .venv-wheel/sdist && ../bin/python -m pytest --numprocesses auto --dist worksteal -m 'not slow' tests

test-newest: ## run the tests with the newest versions of all dependencies, in .venv-newest
	$(PYTHON) -m venv --clear .venv-newest
	.venv-newest/bin/python -m pip install --quiet --upgrade --upgrade-strategy eager --editable '.[dev]'
	.venv-newest/bin/python -m pytest --numprocesses auto --dist worksteal

# without the gallery, whose examples the tests run
check: $(DEV) ## everything a change must pass; test-all and the campaigns before a release
	$(MAKE) --jobs 2 --output-sync format-check lint types docs GALLERY='-D plot_gallery=0'
	$(MAKE) test

format-check: $(DEV)
	$(PY) -m ruff format --check .

lint: $(DEV)
	$(PY) -m ruff check .

types: $(DEV)
	$(PY) -m mypy

docs: $(DEV) ## build the documentation into docs/_build/html, warnings are errors
	$(PY) -m sphinx -b html -W --keep-going -q $(GALLERY) -d docs/_build/doctrees docs docs/_build/html
	@echo "documentation: docs/_build/html/index.html"

bench: $(RUN) ## measure everything that is timed, tables and pictures into bench-results/, up to 50 minutes
	mkdir -p bench-results
	$(VENV)/bin/asperity bench --out bench-results/standard
	$(VENV)/bin/asperity bench 'random-*' --out bench-results/random
	$(PYTHON) -m venv bench-results/peers/environment
	-for peer in numpy mitsuba deeptime; do \
	    bench-results/peers/environment/bin/python -m pip install --quiet --prefer-binary --timeout 10 $$peer; done
	$(PY) -m campaigns.speed.peers bench-results/peers | tee bench-results/peers.md
	-$(PY) -m campaigns.speed.goals | tee bench-results/goals.md

build: $(DEV) ## build the sdist and the wheel into dist/
	$(PY) -m build

format: $(DEV) ## rewrite the sources as `make check` wants them
	$(PY) -m ruff format .
	$(PY) -m ruff check --fix .

clean: ## remove what the other targets wrote, except the environments
	rm -rf build dist study bench-results docs/_build docs/api/generated docs/generated src/asperity.egg-info
	rm -rf .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -path './.venv*' -prune -o -name __pycache__ -prune -exec rm -rf {} +

distclean: clean ## remove the environments too
	rm -rf $(VENV) .venv-lowest .venv-newest .venv-wheel

# An environment that was left half made (no pip in it) is made again.
define make_environment
	@command -v $(PYTHON) >/dev/null || { echo "make: no '$(PYTHON)' here; name a Python 3.11 or later: make PYTHON=/path/to/python3" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "make: asperity needs Python 3.11 or later, and '$(PYTHON)' is $$($(PYTHON) -V 2>&1); name another: make PYTHON=python3.12" >&2; exit 1; }
	@$(PY) -c 'import pip' 2>/dev/null || $(PYTHON) -m venv --clear $(VENV) || { rm -rf $(VENV); echo "make: '$(PYTHON) -m venv' failed; on Debian and Ubuntu install the package python3-venv" >&2; exit 1; }
endef

$(RUN): pyproject.toml
	$(make_environment)
	$(PY) -m pip install --quiet --editable .
	@touch $@

$(DEV): pyproject.toml | $(RUN)
	$(PY) -m pip install --quiet --editable '.[dev]'
	@touch $@
