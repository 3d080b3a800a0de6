# make demo    the main job, with photographs that it renders itself
# make test    the tests, without the slow ones
# make test-all all of them
# make picture the picture in README.md, from the demo
# make check   all that CI checks: format, lint, types, rooms, tests
# make bench   this project beside its peers; ONLY=solving runs that part (benchmarks/README.md)
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
export OPENBLAS_NUM_THREADS ?= 1
# Workers and the commands that tests start then share what one of them has compiled.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: compiled release-check demo test test-all check format lint types rooms picture bench bench-peers clean

demo: $(VENV)/installed
	$(BIN)/orthoscope demo -o demo

test: $(VENV)/installed
	$(BIN)/pytest -n auto --dist worksteal -m "not slow"

test-all: $(VENV)/installed
	$(BIN)/pytest -n auto --dist worksteal

check: lint types rooms test-all

lint: $(VENV)/installed
	$(BIN)/ruff format --check
	$(BIN)/ruff check

types: $(VENV)/installed
	$(BIN)/pyright

rooms: $(VENV)/installed
	$(BIN)/lint-imports

format: $(VENV)/installed
	$(BIN)/ruff format
	$(BIN)/ruff check --fix

$(VENV)/installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/pip install --quiet --editable . --group dev
	touch $@

compiled: $(VENV)/installed
	$(BIN)/python -m compileall -q src benchmarks

# as an installed package is: else each process compiles again where Python may not write beside the source
bench: compiled
	$(BIN)/python -m benchmarks $(ONLY)

bench-peers:
	$(PYTHON) -m venv benchmarks/.peers/lensboy
	benchmarks/.peers/lensboy/bin/pip install --quiet lensboy "opencv-contrib-python<5"
	$(PYTHON) -m venv benchmarks/.peers/discorpy
	benchmarks/.peers/discorpy/bin/pip install --quiet discorpy

release-check: $(VENV)/installed
	$(BIN)/pip install --quiet build twine
	rm -rf dist build/bare
	$(BIN)/python -m build --quiet --outdir dist
	$(BIN)/twine check --strict dist/*
	$(PYTHON) -m venv build/bare
	build/bare/bin/pip install --quiet "$$(ls dist/*.whl)[opencv]"
	cd build && bare/bin/python ../tests/helpers/run_readme.py ../README.md

clean:
	rm -rf $(VENV) demo

picture: demo
	$(BIN)/python docs/make_picture.py demo docs/images/demo.png
