# Everything a fresh machine needs: `make demo` to see it work, `make test` to check it.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
RLACD_INSTALL := $(BIN)/pip install --quiet --constraint constraints-dev.txt --no-build-isolation \
                 --config-settings=cmake.define.RLACD_WERROR=ON
# A file's tests stay in one process, one process a processor.
PYTEST := $(BIN)/pytest --numprocesses auto --dist loadfile
KERNELS := $(wildcard native/*/*.cpp native/*/*.hpp)
CPP := $(KERNELS) $(wildcard tests/native/* examples/cpp/*.cpp)
NATIVE_SOURCES := $(KERNELS) CMakeLists.txt pyproject.toml constraints-dev.txt

# The sanitized builds live in environments of their own.
SANITIZE_address := address,undefined,float-divide-by-zero,float-cast-overflow
SANITIZE_thread  := thread

# What the fuzzers are given: time, a seed for other inputs, and the real meshes whose files are damaged.
HOURS   ?= 1
WORKERS ?= 1
SEED    ?= 0
MESHES  ?= ../shared/meshes

.PHONY: install demo docs pictures tables benchmarks test test-fast test-all test-native nightly engines lint soak soak-light soak-totals stubs sanitize sanitize-address sanitize-thread format clean

install: $(VENV)/installed

$(VENV)/tools: constraints-dev.txt
	@echo "making an environment in $(VENV) and fetching the build tools (half a minute) ..."
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(BIN)/pip install --quiet --upgrade pip
	@$(BIN)/pip install --quiet --constraint constraints-dev.txt scikit-build-core hatch-fancy-pypi-readme nanobind cmake ninja
	@touch $@

$(VENV)/installed: $(VENV)/tools $(NATIVE_SOURCES)
	@echo "fetching libraries and compiling the kernels (some minutes the first time) ..."
	@begun=$$(date +%s); $(RLACD_INSTALL) --editable '.[view]' && \
	  echo "compiled and installed in $$(($$(date +%s) - begun)) s"
	@touch $@

$(VENV)/test-extras: $(VENV)/installed
	$(RLACD_INSTALL) --editable '.[view,train,usd,draco,fbx,cad,sim,clear,fleet]' --group test --group bench
	touch $@

demo: install
	@$(BIN)/python examples/demo.py

# The site, in build/site; a broken link or reference is an error.
docs: $(VENV)/docs
	$(BIN)/mkdocs build --strict --quiet

$(VENV)/docs: $(VENV)/installed
	$(BIN)/pip install --quiet --constraint constraints-dev.txt --group docs
	touch $@

# Every picture of README and docs; needs Chromium.
pictures: $(VENV)/test-extras
	$(BIN)/python examples/pictures.py docs $(MESHES)

# The first table of docs/benchmarks.md, of the meshes that quick.txt of the folder lists, or of all if there is none.
# CoACD takes most of the half hour; a run that was stopped goes on.
benchmarks: $(VENV)/bench
	$(BIN)/python -m benchmarks compare $(MESHES) $(addprefix --list ,$(wildcard $(MESHES)/quick.txt)) \
	  --out build/benchmarks

$(VENV)/bench: $(VENV)/installed
	$(BIN)/pip install --quiet --constraint constraints-dev.txt --group bench
	@touch $@

# The page of options and the public signatures, from where options are stated.
tables: $(VENV)/installed
	$(BIN)/python -m tests.option_table

# The types of the kernels, as they were last built.
stubs: $(VENV)/installed
	$(BIN)/python -m nanobind.stubgen --quiet --exclude-docstrings -m rlacd._native -o src/rlacd/_native.pyi

# Formats and types; neither needs the kernels or the extras.
lint: $(VENV)/lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/clang-format --dry-run --Werror $(CPP)
	$(BIN)/mypy

# In tiers: two minutes while you work, ten on every push, all of it at night.
test-fast: $(VENV)/test-extras
	$(PYTEST) -m 'not slow and not nightly'

test: lint $(VENV)/test-extras
	$(PYTEST) -m 'not nightly'

test-all: lint $(VENV)/test-extras
	RLACD_RANDOM=1 $(PYTEST)

# The kernels without Python: tests in C++ (they need doctest), and an example that finds the installed library.
test-native:
	cmake -S . -B build/cpp -DRLACD_BUILD_TESTS=ON -DRLACD_WERROR=ON -DCMAKE_INSTALL_PREFIX=build/cpp/installed
	cmake --build build/cpp
	build/cpp/rlacd_tests
	cmake --install build/cpp
	cmake -S examples/cpp -B build/cpp/example -DCMAKE_PREFIX_PATH=$(CURDIR)/build/cpp/installed
	cmake --build build/cpp/example
	build/cpp/example/halves

nightly: test-all test-native sanitize soak

# Physics engines, from the registries, to hold hulls and files against: 12 GB, half of it PyTorch for Genesis.
engines: $(VENV)/test-extras build/engines/installed
	$(BIN)/pytest -m nightly tests/engines
	build/engines/bin/python -m pytest -p no:cacheprovider tests/engines/test_in_code.py

build/engines/packages: tests/engines/requirements.txt tests/engines/package.json
	test -x build/engines/bin/python || $(PYTHON) -m venv build/engines
	build/engines/bin/pip install --quiet --requirement tests/engines/requirements.txt
	test -x build/engines/usd/bin/python || $(PYTHON) -m venv build/engines/usd
	build/engines/usd/bin/pip install --quiet urdf-usd-converter==0.3.4 example-robot-data==6.0.0
	cp tests/engines/package.json build/engines
	npm install --no-audit --no-fund --prefix build/engines
	touch $@

# This package beside them, for programs that use both.
build/engines/installed: build/engines/packages $(NATIVE_SOURCES)
	build/engines/bin/pip install --quiet --no-build-isolation --editable . \
	  --config-settings=build-dir=build/engines/native
	touch $@

# The native tests and a cross-section of $$RLACD_MESHES, decomposed in every way, watched by sanitizers.
sanitize: sanitize-address sanitize-thread

sanitize-address sanitize-thread: sanitize-%: build/sanitize-%/installed
	$(PYTHON) sanitizers/run.py $* native
	$(PYTHON) sanitizers/run.py $* tests
	$(PYTHON) sanitizers/run.py $* meshes

build/sanitize-%/installed: $(NATIVE_SOURCES)
	test -x build/sanitize-$*/bin/python || $(PYTHON) -m venv build/sanitize-$*
	build/sanitize-$*/bin/pip install --quiet --constraint constraints-dev.txt \
	  scikit-build-core hatch-fancy-pypi-readme nanobind cmake ninja pytest hypothesis point-cloud-utils pycollada rtree usd-core
	build/sanitize-$*/bin/pip install --quiet --constraint constraints-dev.txt --no-build-isolation --editable . \
	  --config-settings=build-dir=build/sanitize-$*/native --config-settings=cmake.build-type=RelWithDebInfo \
	  --config-settings=cmake.define.RLACD_SANITIZE=$(SANITIZE_$*) --config-settings=cmake.define.RLACD_BUILD_TESTS=ON
	touch $@

# Everything at random, as long as you like: files, shapes, real meshes, faults, options. It goes on where it was.
soak: $(VENV)/test-extras
	nice -n 19 $(BIN)/python -m fuzz.soak --hours $(HOURS) --seed $(SEED) --workers $(WORKERS) --meshes $(MESHES)

# Many small inputs a second in one warm process: damaged files that are read, small shapes that are decomposed.
soak-light: $(VENV)/test-extras
	nice -n 19 $(BIN)/python -m fuzz.soak --light --hours $(HOURS) --seed $(SEED) --workers $(WORKERS) --meshes $(MESHES)

soak-totals: $(VENV)/test-extras
	$(BIN)/python -m fuzz.soak --totals

$(VENV)/lint: $(VENV)/tools
	@$(BIN)/pip install --quiet --constraint constraints-dev.txt --group lint
	@touch $@

format: $(VENV)/lint
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/clang-format -i $(CPP)

clean:
	rm -rf $(VENV) build demo
