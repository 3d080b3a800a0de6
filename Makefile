# make demo    the main job, with photographs that it renders itself
# make test    the tests
# make picture the picture in README.md, from the demo
# make check   all that CI checks: format, lint, types, rooms, tests
# make bench   this project beside its peers; ONLY=solving runs that part (benchmarks/README.md)
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: demo test quick check format lint types rooms picture bench bench-peers clean

demo: $(VENV)/installed
	$(BIN)/orthoscope demo -o demo

test: $(VENV)/installed
	$(BIN)/pytest -n auto

quick: $(VENV)/installed
	$(BIN)/pytest -n auto -m "not slow"

check: lint types rooms test

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

bench: $(VENV)/installed
	$(BIN)/python -m benchmarks $(ONLY)

bench-peers:
	$(PYTHON) -m venv benchmarks/.peers/lensboy
	benchmarks/.peers/lensboy/bin/pip install --quiet lensboy "opencv-contrib-python<5"
	$(PYTHON) -m venv benchmarks/.peers/discorpy
	benchmarks/.peers/discorpy/bin/pip install --quiet discorpy

clean:
	rm -rf $(VENV) demo

picture: demo
	$(BIN)/python docs/make_picture.py demo docs/images/demo.png
