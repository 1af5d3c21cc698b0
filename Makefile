# make demo: from a log of a cable to a law that runs, on one page; make test: everything that must hold; make help: the rest.

PYTHON ?= python3
BIN := .venv/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help demo paper test computed live long portable lint types docs console notebooks site lock release bench soak walk clean

help:
	@echo "make demo    a cable before and after, on one page: log, model, rig, check, law, live on a twin; LOG=my.csv for yours"
	@echo "make paper   reproduce the paper's bench and say where the report is"
	@echo "make test    tests, doctests, lint and types"
	@echo "make long    more cases of what make test tries, and 20 mutants of the package; half an hour, resumable"
	@echo "make portable    some of the tests as another processor computes, half a minute"
	@echo "make lint    ruff alone"
	@echo "make types   mypy alone"
	@echo "make docs    write what is made from the code: docs/rig.md, docs/commands.md, tables of faults and results"
	@echo "make console write the console's page from web/ into the package (needs Node and npm)"
	@echo "make notebooks   execute docs/notebooks again and keep their outputs"
	@echo "make site    the documentation as a site in out/site, with search and the Python API; loads nothing from elsewhere"
	@echo "make lock    which version of every package was tested, with hashes: requirements/ (needs uv)"
	@echo "make release check what may be released: versions, lock, wheel, sources, a clean install"
	@echo "make bench   speed against others; check and the suit on random draws (quarter of an hour)"
	@echo "make soak    the long tests, hours: kills, faults, releases, fuzzing; resumable; PARTS=kills for one"
	@echo "make walk    all commands of README and of every page, in a fresh environment (half an hour)"
	@echo "make clean   remove what make and the tools have made"
	@echo
	@echo "make LOCKED=1 demo (or paper, test) installs the very versions of requirements/, and no file with another hash"

.venv/made:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "bowden needs Python 3.11 or newer: make PYTHON=python3.11")'
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	touch $@

# What is in it is installed anew when pyproject.toml changes. Demo and paper need the package alone. Python compiles what it
# imports when it does; all of it at once would take half a minute more.
.venv/runtime: pyproject.toml | .venv/made
ifdef LOCKED
	$(PIP) --require-hashes --requirement requirements/core.txt
	$(PIP) --no-deps --editable .
else
	$(PIP) --editable .
endif
	touch $@

.venv/dev: pyproject.toml | .venv/made
ifdef LOCKED
	$(PIP) --require-hashes --requirement requirements/dev.txt
	$(PIP) --no-deps --editable .
else
	$(PIP) --editable '.[dev]'
endif
	touch .venv/runtime $@

demo: .venv/runtime
	$(BIN)/bowden demo $(if $(LOG),'$(LOG)') --out out/demo

paper: .venv/runtime
	$(BIN)/bowden reproduce --out out/paper

# What runs in real time mostly waits; what computes meanwhile gives way to it. A make that a test calls is no part of
# this one.
test: lint
	$(MAKE) --no-print-directory --jobs 3 live computed types

# A computer that others use stalls, and a run in real time ends by right; so does a partner in another process. What
# failed is run once more, at the end; both reports are printed.
PYTEST := env -u MAKEFLAGS -u MAKELEVEL $(BIN)/python -m pytest
LIVE := $(PYTEST) -o cache_dir=.pytest_cache/live -m 'live and not long' tests
COMPUTED := nice -n 19 $(PYTEST) -o cache_dir=.pytest_cache/computed -m 'not live and not long'

live: .venv/dev
	rm -rf .pytest_cache/live
	$(LIVE) || { [ $$? = 1 ] && echo "live tests failed; they are run once more" && $(LIVE) --last-failed; }

computed: .venv/dev
	rm -rf .pytest_cache/computed
	$(COMPUTED) -n 2 --dist worksteal || { [ $$? = 1 ] && echo "tests failed; they are run once more" && \
		$(COMPUTED) --last-failed; }

long: .venv/dev
	$(BIN)/python -m pytest -n 2 -m 'long and not live'
	$(BIN)/python -m pytest -m 'long and live' tests
	nice -n 19 $(BIN)/python benchmarks/mutants.py 20 --least 0.8

# No test may hang on the last bit of a sum. It would show first in those that solve least squares.
PORTABLE := identify_path identify_sensitivity identify_uncertainty design_linearise models_bouc_wen metrics \
	paper_static_plant

portable: .venv/dev
	nice -n 19 $(BIN)/python tools/other_processor.py -n 2 -m 'not live and not long' $(PORTABLE:%=tests/test_%.py)

lint: .venv/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/dev
	nice -n 19 $(BIN)/mypy

docs: .venv/dev
	$(BIN)/python tools/make_docs.py

console:
	npm --prefix web ci --silent
	npm --prefix web run --silent types
	npm --prefix web run --silent build

notebooks: .venv/dev
	$(BIN)/python tools/make_notebooks.py

site: .venv/made
	$(PIP) --editable '.[docs]'
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet
	$(BIN)/python tools/site_check.py out/site
	@echo "out/site/index.html; to look at it with search: python3 -m http.server --bind 127.0.0.1 --directory out/site"

lock: .venv/dev
	$(BIN)/python tools/lock.py

release: .venv/dev
	$(BIN)/python tools/release.py --install

bench: .venv/dev
	$(PIP) --editable '.[bench]'
	$(BIN)/python benchmarks/run.py bench
	$(BIN)/python benchmarks/exported.py

soak: .venv/dev
	$(BIN)/python benchmarks/run.py $(or $(PARTS),soak)

walk: .venv/dev
	$(BIN)/python tools/walk.py --write

clean:
	rm -rf .venv out build dist web/node_modules .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
