# make demo | test | check | bench | docs, from a fresh clone. What each needs is set up in .venv once
# and again only when what it was made from has changed. Override with: make PYTHON=/path/to/python3.12
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

CARGO ?= $(shell command -v cargo || { [ -x "$$HOME/.cargo/bin/cargo" ] && echo "$$HOME/.cargo/bin/cargo"; })
VENV := $(CURDIR)/.venv
BIN := $(VENV)/bin
STAMPS := $(VENV)/stamps
PIP := $(BIN)/python -m pip

export VIRTUAL_ENV := $(VENV)
export PYO3_PYTHON := $(BIN)/python
export PATH := $(BIN):$(if $(CARGO),$(dir $(CARGO)):)$(PATH)
export PIP_QUIET := 1
export PIP_DISABLE_PIP_VERSION_CHECK := 1
unexport CONDA_PREFIX
# Commands start sooner where what Python compiles of their modules is kept.
unexport PYTHONDONTWRITEBYTECODE

# Kernels index their lanes in plain loops, which are sure to be inlined and vectorised.
CLIPPY := -D warnings -D clippy::too_many_lines -A clippy::needless_range_loop

NEEDED := import tomllib; \
  print(*tomllib.load(open("pyproject.toml", "rb"))["project"]["dependencies"], sep="\n")
RUST_SOURCES := Cargo.toml Cargo.lock $(shell find crates -name '*.rs' -path '*/src/*') $(wildcard crates/*/Cargo.toml)
PY_PATHS := python tests benches docs examples

# Much of it takes one processor: pip, types, the last crates of a build.
ifeq ($(MAKELEVEL),0)
MAKEFLAGS += --jobs=$(shell getconf _NPROCESSORS_ONLN || echo 2)
endif

# The first interpreter that is new enough and can make a virtual environment.
define FIND_PYTHON
for name in python3 python3.13 python3.12 python3.14 python3.11; do \
  if "$$name" -c 'import sys, ensurepip, venv; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
    "$$name" -c 'import sys; print(sys.executable)'; break; \
  fi; \
done
endef
PYTHON ?= $(shell $(FIND_PYTHON))

.PHONY: help setup demo test trials check check-capi check-report bench docs site figures py-check rust-check rust-test py-test clean

help:
	@echo 'make setup  make .venv with truearm in it'
	@echo 'make demo   the cell of the paper in small: plan, measure, calibrate, compensate (a minute)'
	@echo 'make test   Rust and Python tests'
	@echo 'make trials the measurement cell killed and with faults, in full (TRIALS="-k kill")'
	@echo 'make check  formatting, lint, types and layers'
	@echo 'make check-capi  the C and C++ examples under sanitizers'
	@echo 'make check-report  the report in headless Chromium and as PDF'
	@echo 'make bench  speed against peers, with the ratio to reach beside each (BENCH=--write keeps them in docs/)'
	@echo 'make figures  errors on public measurements, into docs/reference/results.md'
	@echo 'make docs   write the generated pages of docs/reference again'
	@echo 'make site   the documentation as a site, into build/site'

demo: $(STAMPS)/built
	$(BIN)/truearm demo

test: rust-test py-test

# With the extension's features and profile, so that what both rest on is built once.
RUST_WHOLE := --release --locked --workspace --features truearm-python/extension-module

rust-test: $(STAMPS)/built
	$(CARGO) test $(RUST_WHOLE)

# Tests of cells and servers wait for a part of their time: half as many more at once as there are processors.
# They mind how long things take, so that nothing else that was asked for runs beside them.
py-test: $(STAMPS)/built | $(if $(filter check,$(MAKECMDGOALS)),py-check rust-check) $(if $(filter test,$(MAKECMDGOALS)),rust-test)
	$(BIN)/python -m pytest --numprocesses "$$($(BIN)/python -c 'import os; print((3 * (os.cpu_count() or 1) + 1) // 2)')" \
	  --dist worksteal --durations=15

# The measurement cell killed, interrupted and with faults, in full; takes half an hour or more. What it finds is
# kept in build/trials: python docs/make_trials.py build/trials
trials: $(STAMPS)/built
	TRUEARM_TRIALS=full $(BIN)/python -m pytest tests/test_cell_trials.py -s $(TRIALS)

check: rust-check py-check

# Reads the sources: while Rust is built.
py-check: $(STAMPS)/tools
	$(BIN)/ruff check $(PY_PATHS)
	$(BIN)/ruff format --check $(PY_PATHS)
	$(BIN)/mypy
	PYTHONPATH=python $(BIN)/lint-imports

rust-check: $(STAMPS)/built
	$(CARGO) fmt --all --check
	$(CARGO) clippy $(RUST_WHOLE) --all-targets -- $(CLIPPY)

# Needs a C and a C++ compiler with address and undefined-behaviour sanitizers.
check-capi: $(STAMPS)/built
	TRUEARM_SANITIZE=1 $(CARGO) test $(RUST_WHOLE) --test examples

# Installs Chromium where there is none and apt-get may install packages.
check-report: $(STAMPS)/built
	@command -v chromium >/dev/null || command -v google-chrome >/dev/null || { \
	  command -v apt-get >/dev/null && apt-get install -y -qq chromium; } || { \
	  echo 'The report is looked at in Chromium; install the package "chromium".' >&2; exit 1; }
	TRUEARM_BROWSER=1 $(BIN)/python -m pytest tests/test_report_browser.py

bench: $(STAMPS)/built $(STAMPS)/bench
	$(BIN)/python -m benches $(BENCH)

docs: $(STAMPS)/built
	$(BIN)/python docs/make_cli.py
	$(BIN)/python docs/make_docstrings.py
	$(BIN)/python docs/make_header_page.py
	$(BIN)/python docs/make_schemas.py
	$(BIN)/python docs/make_notebook.py
	$(BIN)/python docs/make_picture.py

# Any warning is an error: links, headings and code blocks are checked. It opens from disk without a network.
site: $(STAMPS)/site
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going -c docs/site -b html docs build/site
	@echo "The site: build/site/index.html"

setup: $(STAMPS)/built

# Needs public measurement data, see docs/reference/results.md; takes hours for ten seeds.
figures: $(STAMPS)/built
	$(BIN)/python -m benches.figures build/figures $(FIGURES)
	$(BIN)/python docs/make_results.py build/figures

clean:
	rm -rf $(VENV) target demo

$(STAMPS)/venv:
	@[ -n '$(PYTHON)' ] && '$(PYTHON)' -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo 'truearm needs Python 3.11 or newer with the venv module; none was found (PYTHON=$(PYTHON)).' >&2; \
	  echo 'Install one, or name it: make PYTHON=/path/to/python3.12 $(MAKECMDGOALS)' >&2; exit 1; }
	@$(PIP) --version >/dev/null 2>&1 || '$(PYTHON)' -m venv --clear '$(VENV)'
	@$(PIP) install --upgrade 'pip>=25.1'
	@mkdir -p $(STAMPS) && touch $@

# maturin alone, so that Rust is built while pip brings the rest.
$(STAMPS)/maturin: pyproject.toml $(STAMPS)/venv
	@$(if $(CARGO),:,echo 'truearm needs Rust 1.89 or newer; cargo was not found.' >&2; \
	  echo 'Install it from https://rustup.rs, or name it: make CARGO=/path/to/cargo $(MAKECMDGOALS)' >&2; exit 1)
	@minor="$$($(CARGO) --version | cut -d. -f2)"; [ "$$minor" -ge 89 ] || { \
	  echo "truearm needs Rust 1.89 or newer; $$($(CARGO) --version) was found. Try: rustup update stable" >&2; exit 1; }
	$(PIP) install --group build
	@touch $@

# With what truearm itself needs, so that nothing is left to bring once it is built.
$(STAMPS)/tools: pyproject.toml $(STAMPS)/maturin
	@$(BIN)/python -c '$(NEEDED)' | $(PIP) install --group dev --requirement /dev/stdin
	@touch $@

$(STAMPS)/site: pyproject.toml $(STAMPS)/venv
	$(PIP) install --group docs
	@touch $@

$(STAMPS)/bench: pyproject.toml $(STAMPS)/venv | $(STAMPS)/built
	$(PIP) install --group bench
	@touch $@

# In place, beside the modules in Python. The stamp is as old as the start of the build, so an edit made meanwhile is
# built next time.
$(STAMPS)/extension: $(RUST_SOURCES) pyproject.toml $(STAMPS)/maturin
	@touch $@.started
	$(BIN)/maturin develop --release --locked --quiet --skip-install
	@mv $@.started $@

$(STAMPS)/built: $(STAMPS)/extension | $(STAMPS)/tools
	$(BIN)/maturin develop --release --locked --quiet
	@touch -r $(STAMPS)/extension $@
