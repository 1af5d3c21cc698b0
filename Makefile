# make demo: reproduce the paper's bench; make test: everything that must hold; make help: the rest.

PYTHON ?= python3
BIN := .venv/bin
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help demo test lint types docs bench soak clean

help:
	@echo "make demo    reproduce the paper's bench and say where the report is"
	@echo "make test    tests, doctests, lint and types"
	@echo "make lint    ruff alone"
	@echo "make types   mypy alone"
	@echo "make docs    write what is made from the code: docs/rig.md, JSON schemas, tables of safety.md and campaign.md"
	@echo "make bench   speed against others; check and our law on random rigs (half an hour)"
	@echo "make soak    the long tests, hours: live loop for MINUTES=10, kills, faults; resumable; PARTS=live for one"
	@echo "make clean   remove what make and the tools have made"

# The environment, made anew when pyproject.toml changes. The demo needs the package alone.
.venv/runtime: pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "bowden needs Python 3.11 or newer: make PYTHON=python3.11")'
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	touch $@

.venv/dev: .venv/runtime
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

demo: .venv/runtime
	$(BIN)/bowden reproduce --out out/demo

test: lint types
	$(BIN)/python -m pytest -n 2 --dist loadfile -m 'not live'
	$(BIN)/python -m pytest -m live

lint: .venv/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/dev
	$(BIN)/mypy

docs: .venv/dev
	$(BIN)/python -c 'from pathlib import Path; from bowden.app.rig_page import write_docs; write_docs(Path("docs"))'
	$(BIN)/python -c 'from pathlib import Path; from bowden.app.safety_page import write_docs; write_docs(Path("docs"))'
	$(BIN)/python -c 'from pathlib import Path; from bowden.app.study_page import write_docs; write_docs(Path("docs"))'

bench: .venv/dev
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	$(BIN)/python benchmarks/run.py
	$(BIN)/python benchmarks/exported.py

soak: .venv/dev
	$(BIN)/python benchmarks/soak.py $(PARTS) --minutes $(or $(MINUTES),10)

clean:
	rm -rf .venv out build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
