# Every target makes .venv and installs what it needs on its first run. `make PYTHON=python3.12 test` picks another Python.
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3 python; do \
  $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
OUT ?= out/reproduce
BIN := .venv/bin

.PHONY: reproduce test test-oldest check bench docs clean

reproduce: .venv/run.stamp  ## the paper's section III: figures, data and report in $(OUT)
	$(BIN)/rockerbogie reproduce -o $(OUT)

# two processes of `rockerbogie compile` share the kernels; two of pytest would both compile those that many tests need
# in plain Python, only files with such tests are collected: importing all files takes several times as long as these tests
test: .venv/dev.stamp  ## all tests, then those marked nojit again in plain Python
	$(BIN)/rockerbogie compile
	$(BIN)/python -m pytest -n auto
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -n auto -m nojit $$(grep -rl --include='*.py' 'mark\.nojit' tests)

test-oldest: .venv-oldest/stamp  ## kernels with the oldest supported numba; test has the newest
	.venv-oldest/bin/rockerbogie compile
	.venv-oldest/bin/python -m pytest -n auto tests/kernels

check: .venv/dev.stamp  ## lint, format, strict types, layers
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

bench: .venv/dev.stamp  ## speed, as ratios to the baselines timed in the same run (docs/bench.md)
	$(BIN)/rockerbogie bench

docs: .venv/docs.stamp  ## the documentation, into docs/_build/html
	$(BIN)/python -m sphinx -W -q -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

clean:  ## what the other targets made
	rm -rf .venv .venv-oldest out docs/_build

.venv/pyvenv.cfg:
	@test -n "$(PYTHON)" || { echo "rockerbogie needs Python 3.11 or newer: none was found; name one with PYTHON=..." >&2; exit 1; }
	$(PYTHON) -m venv .venv

.venv/run.stamp: pyproject.toml .venv/pyvenv.cfg
	@echo 'installing into .venv, once: a minute or two'
	$(BIN)/python -m pip install -qq -e .
	@touch $@

.venv/dev.stamp: pyproject.toml .venv/pyvenv.cfg
	@echo 'installing into .venv, once: a minute or two'
	$(BIN)/python -m pip install -qq -e '.[dev]'
	@touch $@ .venv/run.stamp

# numba 0.61.0 has no wheels for Python 3.14 or newer
.venv-oldest/stamp: pyproject.toml
	$(PYTHON) -m venv .venv-oldest
	.venv-oldest/bin/python -m pip install -qq -e . numba==0.61.0 'pytest>=8' 'pytest-xdist>=3.6' 'hypothesis>=6.100'
	@touch $@

.venv/docs.stamp: pyproject.toml .venv/pyvenv.cfg
	@echo 'installing into .venv, once: a minute or two'
	$(BIN)/python -m pip install -qq -e '.[docs]'
	@touch $@ .venv/run.stamp
