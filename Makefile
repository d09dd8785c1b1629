# Every verb makes the environment it needs in .venv; Python 3.11 or newer, pip, a C compiler and make are all it takes.
# All packages have the versions in constraints.txt, except with `make PINS= ...`, which takes the newest.

PYTHON ?= python3
VENV := .venv
PINS := constraints.txt
RUN := $(VENV)/bin/python
INSTALLED := $(VENV)/.installed-
# Python compiles what is imported, when it is: most of what is installed never is.
INSTALL := $(RUN) -m pip install --quiet --disable-pip-version-check --no-compile
UNKNOWN_PYTHON := 3.15
ALL_EXTRAS := bench,cluster,docs,explorer,notebook,test,video,xarray

export MPLBACKEND ?= Agg
export PYTHONDONTWRITEBYTECODE :=
# What builds the library is pinned as well: older pips read the first of these for it, newer ones the second.
export PIP_CONSTRAINT := $(PINS)
export PIP_BUILD_CONSTRAINT := $(PINS)

.DEFAULT_GOAL := help
.PHONY: help env basins figures test test-all test-newest check check-code check-site bench docs pins clean

help:
	@echo "make basins       basins of the driven pendulum (figure 19), into studies/output/"
	@echo "make figures      every study, into studies/output/"
	@echo "make test         fast tests and the examples in docstrings"
	@echo "make test-all     slow tests as well"
	@echo "make test-newest  fast tests with the newest packages, in an environment of their own"
	@echo "make check        check-code and check-site"
	@echo "make check-code   format, lint, types, import contracts"
	@echo "make check-site   documentation, without what the studies print"
	@echo "make bench        speed against other programs, as ratios"
	@echo "make docs         the site, into docs/_build/html/"
	@echo "make pins         renew constraints.txt: the newest version of every package"
	@echo "make env          the environment alone, in .venv/"
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

# Together, because one installation is faster than two.
env: $(INSTALLED)docs,test

basins: $(INSTALLED)library
	$(RUN) -m studies figure_19
	@echo "The pictures and the HDF5 file are in $(CURDIR)/studies/output/"

figures: $(INSTALLED)video
	$(RUN) -m studies
	@echo "Everything is in $(CURDIR)/studies/output/"

# A process for each core, and whole files to each, so that what a file compiles is compiled once.  The processes share
# the cores: threads of linear algebra would only get in each other's way.
test test-all: export OPENBLAS_NUM_THREADS ?= 1
test: env
	$(RUN) -m pytest -n auto --dist loadfile

test-all: env
	$(RUN) -m pytest -n auto --dist loadfile -m ""

test-newest:
	rm -rf .venv-newest
	$(MAKE) --no-print-directory VENV=.venv-newest PINS= test

# Pythons that came later than these versions take what is the newest for them.
pins:
	rm -rf .venv-pins
	$(MAKE) --no-print-directory VENV=.venv-pins PINS= .venv-pins/.installed-$(ALL_EXTRAS)
	PIP_CONSTRAINT= .venv-pins/bin/python -m pip install --quiet --disable-pip-version-check hatchling editables
	{ echo "# Exact versions of all packages, written by \`make pins\`."; \
		.venv-pins/bin/python -m pip freeze --exclude cellmap-dynamics | sed 's/$$/ ; python_version < "$(UNKNOWN_PYTHON)"/'; \
	} > constraints.txt
	rm -rf .venv-pins

# With `make -j2 check` the site is built while types are checked.
check: check-code check-site

check-code: env
	$(RUN) -m ruff format --check
	$(RUN) -m ruff check
	$(RUN) -m mypy
	$(VENV)/bin/lint-imports

check-site: env
	@CELLMAP_STUDIES=skip $(MAKE) --no-print-directory docs

# Peers raise warnings of their own, which are not errors of ours.
bench: $(INSTALLED)bench
	$(RUN) -m pytest tests/bench -o addopts= -W default \
		--benchmark-group-by=group --benchmark-columns=min,median,rounds --benchmark-sort=min

# Studies and programs of pages run in one process, with all threads.
docs: env
	$(RUN) -m sphinx -q -W --keep-going docs docs/_build/html
	@echo "The site starts at $(CURDIR)/docs/_build/html/index.html"

clean:
	rm -rf .venv-newest .venv-pins build dist *.egg-info docs/_build docs/auto docs/generated studies/output
	rm -rf .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis .benchmarks
	find cellmap systems studies tests docs -name __pycache__ -type d -exec rm -rf {} +
