# Everything a fresh machine needs: `make demo` to see it work, `make test` to check it.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
RLACD_INSTALL := $(BIN)/pip install --quiet --constraint constraints-dev.txt --no-build-isolation \
                 --config-settings=cmake.define.RLACD_WERROR=ON
NATIVE_SOURCES := $(wildcard native/*.cpp native/*.hpp) CMakeLists.txt pyproject.toml constraints-dev.txt

.PHONY: install demo test test-fast lint fuzz-files format clean

install: $(VENV)/installed

$(VENV)/tools: constraints-dev.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet --constraint constraints-dev.txt scikit-build-core nanobind cmake ninja
	touch $@

$(VENV)/installed: $(VENV)/tools $(NATIVE_SOURCES)
	$(RLACD_INSTALL) --editable '.[view]'
	touch $@

$(VENV)/test-extras: $(VENV)/installed
	$(RLACD_INSTALL) --editable '.[view,train,usd,sim,bench,fleet]' --group test
	touch $@

demo: install
	$(BIN)/python examples/demo.py

lint: $(VENV)/test-extras
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/clang-format --dry-run --Werror native/*.cpp native/*.hpp
	$(BIN)/mypy

test: lint
	$(BIN)/pytest

test-fast: $(VENV)/test-extras
	$(BIN)/pytest -m 'not slow'

# MINUTES of damaged files of every format, made from the real meshes in MESHES; SEED for other ones.
MINUTES ?= 10
SEED    ?= 0
MESHES  ?= ../shared/meshes
fuzz-files: $(VENV)/test-extras
	$(BIN)/python benchmarks/fuzz_files.py $(MESHES) --minutes $(MINUTES) --seed $(SEED)

format: $(VENV)/test-extras
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/clang-format -i native/*.cpp native/*.hpp

clean:
	rm -rf $(VENV) build demo
