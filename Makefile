# Commands for a fresh machine with Python, make and git: `make demo`, `make test`, `make test-fast`.

PYTHON ?= python3
BIN    := .venv/bin
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --prefer-binary --constraint constraints.txt

.DEFAULT_GOAL := help
.PHONY: help demo test test-fast bench-guard docs wheel release machine-code clean

# What is tested in a minute: formulas and models, the translator, machine code, equations, the rules of
# the house, and one motion of each system of the catalogue. Random programs and what stays in memory take
# a third as long again.
FAST := tests/test_house.py tests/symbolic tests/model tests/translator tests/machine_code tests/catalogue \
	--ignore=tests/translator/test_random_programs.py --ignore=tests/machine_code/test_memory.py

help:
	@echo "make demo   create the environment, run three examples and the paper, and print where the figures are"
	@echo "make test   create the environment, check style and types, run the tests"
	@echo "make test-fast   check style, and run a part of the tests: one to two minutes"
	@echo "make bench-guard BASE=COMMIT   run motions of this version and of another alternately: ratios of times, 5 minutes"
	@echo "make docs   build the documentation: docs/_build/html/index.html"
	@echo "make wheel  build the package with the engine's machine code: dist/"
	@echo "make release VERSION=1.2.3   commit and tag a release, if all files name this version"
	@echo "make clean  remove what these commands have created"

demo: .venv/ready machine-code
	$(BIN)/stickslip run examples/rocking-toy.toml --out out/rocking-toy
	$(BIN)/stickslip run examples/spring-slider.toml --out out/spring-slider
	$(BIN)/python examples/play-moving-threshold.py
	$(BIN)/stickslip paper --out out/paper
	@echo
	@echo "The figures:   out/rocking-toy/overview.png"
	@echo "               out/spring-slider/overview.png"
	@echo "               out/play-moving-threshold/figure-2-1.png"
	@echo "The paper:     out/paper/index.html"
	@echo
	@echo "Try it out:    $(BIN)/stickslip explore"

# Two processes run the tests: threads of NumPy's linear algebra in each would wait for each other.
test test-fast: export OPENBLAS_NUM_THREADS = 1

test: .venv/ready-for-tests machine-code
	$(BIN)/ruff check .
	$(BIN)/ruff format --quiet --check .
	$(BIN)/pyright
	$(BIN)/pytest -n 2 --dist loadfile --no-loadscope-reorder --max-worker-restart 1

test-fast: .venv/ready-for-tests machine-code
	$(BIN)/ruff check .
	$(BIN)/ruff format --quiet --check .
	$(BIN)/pytest -q -n 2 $(FAST)

# The last release, or the previous commit if there is none.
BASE ?= $(shell git describe --tags --abbrev=0 2>/dev/null || git rev-parse HEAD~1)

bench-guard: .venv/ready-for-tests
	$(BIN)/python benchmarks/versions.py $(BASE)

docs: .venv/ready-for-docs machine-code
	$(BIN)/sphinx-build -W --keep-going -E -q -j 2 -b html docs docs/_build/html
	$(BIN)/python docs/check_site.py docs/_build/html
	$(BIN)/python docs/check_search.py docs/_build/html

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "stickslip needs Python 3.11 or newer; name one: make demo PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv .venv

# The engine's machine code for this machine, made once and again after its sources have changed.
machine-code:
	@$(BIN)/python -m stickslip.machine_code.shipping

wheel: .venv/ready
	$(BIN)/python -m pip wheel --quiet --no-deps --no-build-isolation --wheel-dir dist .

# Publishes nothing: pushing the tag does, .github/workflows/wheels.yml.
release:
	@$(PYTHON) packaging/release.py "$(VERSION)"

.venv/ready: .venv/bin/python pyproject.toml constraints.txt
	$(INSTALL) hatchling editables
	$(INSTALL) --no-build-isolation --editable '.[all]'
	@touch $@

.venv/ready-for-tests: .venv/bin/python pyproject.toml constraints.txt
	$(INSTALL) hatchling editables
	$(INSTALL) --no-build-isolation --editable '.[test]'
	@touch $@ .venv/ready

.venv/ready-for-docs: .venv/bin/python pyproject.toml constraints.txt
	$(INSTALL) hatchling editables
	$(INSTALL) --no-build-isolation --editable '.[docs]'
	@touch $@ .venv/ready

clean:
	rm -rf .venv out dist src/stickslip/machine_code/shipped docs/_build docs/gallery docs/reference docs/generated
