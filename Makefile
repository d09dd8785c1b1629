# Every verb makes the environment it needs in .venv; Python 3.11 or newer, pip, a C compiler and make are all it takes.
# All packages have the versions in constraints.txt, except with `make PINS= ...`, which takes the newest.

PYTHON ?= python3
VENV := .venv
PINS := constraints.txt
RUN := $(VENV)/bin/python
INSTALLED := $(VENV)/.installed-
# Python compiles what is imported, when it is: most of what is installed never is.
INSTALL := $(RUN) -m pip install --quiet --disable-pip-version-check --no-compile
OLDEST_PYTHON := 3.11.0
NEWEST_PYTHON := 3.14
UNKNOWN_PYTHON := 3.15

export MPLBACKEND ?= Agg
export PYTHONDONTWRITEBYTECODE :=
# What builds the library is pinned as well: older pips read the first of these for it, newer ones the second.
export PIP_CONSTRAINT := $(PINS)
export PIP_BUILD_CONSTRAINT := $(PINS)

.DEFAULT_GOAL := help
.PHONY: help env env-docs basins figures test test-thorough test-all test-newest test-oldest test-aarch64 coverage dist mutants size check check-code check-pins check-site bench bench-history docs docs-tables pins clean

help:
	@echo "make basins       basins of the driven pendulum (figure 19), into studies/output/"
	@echo "make figures      every study, into studies/output/"
	@echo "make test         fast tests, programs of the pages, examples in docstrings"
	@echo "make test-thorough  campaigns, statistics of many seeds, slow witnesses, browsers"
	@echo "make test-all     all tests, with those that take an hour"
	@echo "make test-oldest  fast tests with the lowest versions that pyproject.toml promises, in another one"
	@echo "make test-aarch64 compiles what the tests of ROOMS=tests/maps compile for AArch64 as well"
	@echo "make coverage     lines that no test runs; of ROOMS=tests/maps alone"
	@echo "make dist         wheel and source distribution, into dist/, checked and used by all examples"
	@echo "make mutants      share of small changes of the code that the tests of the same room notice"
	@echo "make test-newest  fast tests with the newest packages, in an environment of their own"
	@echo "make size         lines of code in each subpackage, largest functions, smallest modules"
	@echo "make check        check-code, check-pins and check-site"
	@echo "make check-code   format, lint, types, import contracts, budget of sizes"
	@echo "make check-pins   whether all Pythons from $(OLDEST_PYTHON) to $(NEWEST_PYTHON) can install constraints.txt"
	@echo "make check-site   documentation, without what the studies print, in a browser without a network"
	@echo "make bench        speed against other programs, as ratios"
	@echo "make bench-history  CPU time of a few jobs at this commit, added to docs/bench_history.csv"
	@echo "make docs         the site, into docs/_build/html/"
	@echo "make docs-tables  tables of names and files in pages and READMEs, from the code"
	@echo "make pins         renew constraints.txt: the newest version of every package"
	@echo "make env          the environment alone, in .venv/"
	@echo "make env-docs     the same with what the site needs"
	@echo "make clean        remove what the other verbs have made, except .venv/"

$(RUN):
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and \
		"cellmap needs Python 3.11 or newer, and $(PYTHON) is " + sys.version.split()[0] + \
		"; choose another one with: make PYTHON=/path/to/python3 ...")'
	$(PYTHON) -m venv $(VENV)

$(INSTALLED)library: pyproject.toml $(PINS) | $(RUN)
	$(INSTALL) --editable .
	@touch $@

$(INSTALLED)%: pyproject.toml $(PINS) | $(RUN)
	$(INSTALL) --editable '.[$*]'
	@touch $@

env: $(INSTALLED)test

ifeq ($(MAKECMDGOALS),env-docs)
# With what tests need: pip chooses versions once.
$(INSTALLED)docs: pyproject.toml $(PINS) | $(RUN)
	$(INSTALL) --editable '.[test,docs]'
	@touch $(INSTALLED)test $@
else
# One after the other, with make -j as well.
$(INSTALLED)docs: | $(INSTALLED)test
endif
$(INSTALLED)lab: | $(INSTALLED)video
env-docs: $(INSTALLED)docs

basins: $(INSTALLED)library
	$(RUN) -m studies figure_19
	@echo "The pictures and the HDF5 file are in $(CURDIR)/studies/output/"

figures: $(INSTALLED)video $(INSTALLED)lab
	$(RUN) -m studies
	@echo "Everything is in $(CURDIR)/studies/output/"

# A process for each core, and whole files to each, so that what a file compiles is compiled once.  The processes share
# the cores: threads of linear algebra would only get in each other's way.
test test-thorough test-all: export OPENBLAS_NUM_THREADS ?= 1
test: env
	$(RUN) -m pytest -n auto --dist loadfile

test-thorough: env
	$(RUN) -m pytest -n auto --dist worksteal -m thorough

test-all: env
	$(RUN) -m pytest -n auto --dist loadfile -m ""

test-newest:
	rm -rf .venv-newest
	$(MAKE) --no-print-directory VENV=.venv-newest PINS= test

# The lowest versions that pyproject.toml promises, of what it names itself.
test-oldest: env
	rm -rf .venv-oldest
	$(VENV)/bin/uv venv --quiet --python $(PYTHON) .venv-oldest
	VIRTUAL_ENV=.venv-oldest $(VENV)/bin/uv pip install --quiet --resolution lowest-direct --editable '.[test]'
	.venv-oldest/bin/python -m pytest -W default -n auto --dist loadfile $(ROOMS)

# Object files for AArch64 of what the tests of ROOMS compile; the plugin says how an emulator runs them.
test-aarch64: env
	PYTHONPATH=tests/platforms $(RUN) -m pytest -p aarch64 -q $(ROOMS)

# Lines that the tests of ROOMS run: make coverage ROOMS=tests/maps
coverage: env
	$(RUN) -m coverage run --source=cellmap,systems -m pytest -q $(ROOMS)
	$(RUN) -m coverage report --skip-covered --sort=cover | tail -40

# What is published, checked, and used from an empty environment by all examples.
dist: env $(INSTALLED)release
	rm -rf dist .venv-dist
	$(VENV)/bin/uv build --quiet
	$(RUN) -m twine check --strict dist/*.whl dist/*.tar.gz
	$(MAKE) --no-print-directory VENV=.venv-dist .venv-dist/bin/python
	.venv-dist/bin/python -m pip install --quiet --disable-pip-version-check dist/*.whl
	mkdir dist/examples && cp docs/examples/*.py dist/examples/
	cd dist/examples && for example in *.py; do echo $$example && ../../.venv-dist/bin/python $$example > /dev/null || exit 1; done

# Hours at low priority; what has been run is kept in /tmp/cellmap-mutants, and not run again.
MUTANTS := maps=80 attractors=60 basins=80 analysis=85 bifurcations=115 _lib=35

mutants: export OPENBLAS_NUM_THREADS ?= 1
mutants: env
	nice -n 15 $(RUN) tests/mutation/run.py $(MUTANTS)

size: env
	@$(RUN) tests/size/run.py cellmap systems

# The same versions for all Pythons where that is possible; those that came later than these take what is the newest.
PIN = pip compile --quiet --no-annotate --no-header --all-extras pyproject.toml - -o
pins:
	rm -rf .venv-pins
	$(MAKE) --no-print-directory VENV=.venv-pins .venv-pins/bin/python
	PIP_CONSTRAINT= .venv-pins/bin/python -m pip install --quiet --disable-pip-version-check uv
	echo editables | .venv-pins/bin/uv $(PIN) .venv-pins/new --upgrade --universal --fork-strategy fewest --python-version $(OLDEST_PYTHON) \
		> /dev/null
	{ echo "# Exact versions of all packages, written by \`make pins\`."; \
		sed -e "/ ; python_full_version >= '$(UNKNOWN_PYTHON)'/d" -e 's/ ; \(.*\)$$/ ; (\1) and/' -e '/ ; /!s/$$/ ;/' \
			-e 's/$$/ python_version < "$(UNKNOWN_PYTHON)"/' .venv-pins/new; \
	} > constraints.txt
	rm -rf .venv-pins

# As an installation would choose, with the rules of each Python; nothing is installed.
check-pins: env
	for python in $(OLDEST_PYTHON) $(NEWEST_PYTHON); do \
		echo editables | UV_PYTHON_DOWNLOADS=never $(VENV)/bin/uv $(PIN) /dev/null --constraints constraints.txt \
			--python-version $$python --only-binary :all: > /dev/null || exit 1; done

# With `make -j2 check` the site is built while types are checked.
check: check-code check-pins check-site

check-code: env
	$(RUN) -m ruff format --check
	$(RUN) -m ruff check
	$(RUN) -m mypy
	$(VENV)/bin/lint-imports
	$(RUN) tests/size/budget.py
	$(RUN) -m check_jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml

check-site: env-docs
	@CELLMAP_STUDIES=skip $(MAKE) --no-print-directory docs
	$(RUN) -m pytest tests/site -o addopts=--import-mode=importlib

# Peers raise warnings of their own, which are not errors of ours.
bench: $(INSTALLED)bench
	$(RUN) -m pytest tests/bench -o addopts= -W default \
		--benchmark-group-by=group --benchmark-columns=min,median,rounds --benchmark-sort=min

# A line for each job in docs/bench_history.csv, and the figure of all commits.
bench-history: env
	$(RUN) tests/bench/history.py

# Studies run beside the programs of pages.
docs: env-docs
	$(RUN) -m sphinx -q -W --keep-going docs docs/_build/html
	@echo "The site starts at $(CURDIR)/docs/_build/html/index.html"

# Rows of public names, and a README of each room, as a checkout shows them; a test compares them with the code.
docs-tables: env
	$(RUN) docs/_extensions/reference_tables.py

clean:
	rm -rf .venv-newest .venv-oldest .venv-dist .venv-pins .coverage build dist *.egg-info docs/_build docs/auto docs/generated studies/output
	rm -rf .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis .benchmarks
	find cellmap systems studies tests docs -name __pycache__ -type d -exec rm -rf {} +
