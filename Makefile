# make install | native | test | test-all | test-other | test-app | demo | extension | release | clean.  BPY=5.0.1 picks another Blender.
PYTHON ?= python3.11
VENV   ?= .venv
BPY    ?= 4.5.15
TORCH  ?= 2.13.0
RUN    := $(VENV)/bin/python
PACKAGES := import sysconfig; print(sysconfig.get_path("purelib"))
STAMP  := $(VENV)/.installed-bpy-$(BPY)-torch-$(TORCH)

PLATFORMS ?= linux-x64 windows-x64 macos-arm64
SUITES ?= trixie sid
# The project's address, for the manifest, the package and the page of a release.
WEBSITE ?=

# A second Blender for the tests: its bpy alone, all else comes from $(VENV).
OTHER_BPY  ?= 5.0.1
OTHER_VENV := $(VENV)-bpy-$(OTHER_BPY)
OTHER_RUN  := $(OTHER_VENV)/bin/python

# Tests of what differs between Blenders: `make test` runs them on the second one, too.
VERSIONS := interface/test_engine cycles/test_passes rendering/test_features rendering/test_full_size

# The C core; what is installed anew compiles it, too.
NATIVE  := xrds_core/native/lib/.compiled
SOURCES := $(wildcard xrds_core/native/*.[ch]) xrds_core/native/compile.py

.PHONY: install native test test-all test-other test-app demo extension release clean

install: $(STAMP) $(NATIVE)

native: $(NATIVE)

$(NATIVE): $(SOURCES) | $(STAMP)
	$(RUN) xrds_core/native/compile.py
	touch $@

$(STAMP): pyproject.toml setup.py blender_manifest.toml xrds_lab/pyproject.toml
	test -x $(RUN) || $(PYTHON) -m venv $(VENV)
	$(RUN) -m pip install --quiet "torch==$(TORCH)"
	$(RUN) -m pip install --quiet --editable ".[blender,dev]" --editable ./xrds_lab "bpy==$(BPY)"
	rm -f $(VENV)/.installed-*
	touch $@

test: install $(OTHER_VENV)/.installed
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m mypy
	$(RUN) tests/run.py
	$(OTHER_RUN) tests/run.py $(VERSIONS)

# All of it, as for a night: what takes minutes, and every test on a second Blender.
test-all: install test-other
	$(RUN) tests/run.py --all

test-other: install $(OTHER_VENV)/.installed
	$(OTHER_RUN) tests/run.py --all blender/

$(OTHER_VENV)/.installed: $(STAMP)
	$(PYTHON) -m venv --without-pip $(OTHER_VENV)
	$(RUN) -m pip --python $(OTHER_RUN) install --quiet --no-deps "bpy==$(OTHER_BPY)"
	echo "import site; site.addsitedir('$$($(RUN) -c '$(PACKAGES)')')" \
	    > "$$($(OTHER_RUN) -c '$(PACKAGES)')/others.pth"
	touch $@

# Real Blender programs out of Debian, fetched once into build/blender; needs root.
test-app: install
	for suite in $(SUITES); do \
	    PYTHON=$(RUN) tests/app/fetch_blender.sh $$suite build/blender/$$suite || exit 1; \
	done
	$(RUN) -m pytest tests/app -s -rs

demo: install
	$(RUN) -m xrds_lab.demo --out demo

extension: install
	$(RUN) extension/build.py --out dist --torch $(TORCH) --platform $(PLATFORMS) --website "$(WEBSITE)"

# What a release consists of, as static files that any web server can hold.
release: extension
	$(RUN) extension/build.py --out dist --kind bare --website "$(WEBSITE)"
	$(RUN) extension/release.py --zips dist --out dist/release --website "$(WEBSITE)"

clean:
	rm -rf build dist demo xrds_core/native/lib *.egg-info .pytest_cache .mypy_cache .ruff_cache
	find xrds_core xrds_blender xrds_lab tests -name __pycache__ -prune -exec rm -rf {} +
