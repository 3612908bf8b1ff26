# `make` lists what there is. Needs Python 3.11 or later and make; everything else is fetched into .venv.
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

PYTHON ?= python3
JOBS ?= 2
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

# Containers often set it: hundreds of processes would each compile the package anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup test test-browser check lint format lab report figures gpu claims docs dist bench clean distclean

help: ## list these targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-13s %s\n", $$1, $$2}' $(MAKEFILE_LIST)
	@echo "Settings: PYTHON=python3.12 (interpreter for .venv), JOBS=4 (processes), HARMOLAB_DATA=folder (your recordings)."

setup: $(STAMP) ## create or bring up to date the environment in .venv
	@echo "$(VENV) is ready: . $(BIN)/activate"

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	    echo "harmolab needs Python 3.11 or later; '$(PYTHON)' is missing or older. Try: make setup PYTHON=python3.12" >&2; exit 1; }
	@echo "Installing into $(VENV) (a few minutes the first time) ..."
	@rm -f $@
	@# uv takes a minute where pip takes four; where it cannot, pip does it.
	@set -e; if command -v uv >/dev/null 2>&1; then uv=uv; \
	    $(BIN)/python -c '' 2>/dev/null || uv venv --quiet --clear --python "$$(command -v $(PYTHON))" $(VENV); \
	else uv=$(BIN)/uv; \
	    $(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv --clear $(VENV); \
	    $(BIN)/python -m pip install --quiet --disable-pip-version-check uv || true; \
	fi; \
	links=$$($(PYTHON) -m pip config get global.find-links 2>/dev/null || true); \
	for link in $$links $$PIP_FIND_LINKS; do set -- "$$@" --find-links "$$link"; done; \
	set -- "$$@" -e '.[lab,train,cluster,docs,dev]' -c constraints.txt; \
	$$uv pip install --quiet --compile-bytecode --python $(BIN)/python "$$@" \
	    || { echo "uv could not install; pip does ..." >&2; $(BIN)/python -m pip install --quiet --disable-pip-version-check "$$@"; }
	@mkdir -p $(VENV)/etc/jupyter && cp tools/jupyter_*_config.py $(VENV)/etc/jupyter/
	@echo "Compiling librosa's beat tracker (half a minute) ..."
	@# By one process, before several run at once: numba's cache breaks for good when two fill it together.
	@find $(VENV) \( -name '*.nbi' -o -name '*.nbc' \) -delete
	@$(BIN)/python -c 'from harmolab.beats.audio import compile_tracker; compile_tracker()'
	@touch $@

test: $(STAMP) ## run every test but those in a browser (5 to 14 minutes on two cores)
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m "not browser"

test-browser: $(STAMP) ## run the tests that drive JupyterLab and the report in Chromium
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile -m browser

check: lint ## format, lint, types and the fast tests: run it before you commit
	HARMOLAB_HOSTILE_TIMES=0.2 $(BIN)/python -m pytest -n $(JOBS) --dist worksteal -q --hypothesis-profile quick -m "not slow and not data and not browser"

lint: $(STAMP) ## format, lint and types alone
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --num-workers $(JOBS)

format: $(STAMP) ## bring the code into the form that `make check` asks for
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

lab: $(STAMP) ## open JupyterLab on the first notebook
	$(BIN)/jupyter lab notebooks/00_start_here.ipynb

report: $(STAMP) ## run the notebooks in the quick profile and write report/index.html
	$(BIN)/python -m harmolab.lab.report.run --profile quick --out report --jobs $(JOBS)

figures: $(STAMP) ## full run of the notebooks into figures/; it goes on where it was; ONLY='07 19'; FROM=tables: from csv
ifeq ($(FROM),tables)
	PYTHONPATH=notebooks $(BIN)/python -m study.figures.redraw --folder figures
else ifdef FROM
	@echo "FROM=tables is all there is, not FROM=$(FROM)" >&2; exit 1
else
	$(BIN)/python -m harmolab.lab.report.run --profile full --out report --jobs $(JOBS) --figures figures $(if $(ONLY),--only $(ONLY))
endif

gpu: $(STAMP) ## full-size trainings, then notebooks 09 10 16 with them, for a machine with a GPU; MINUTES=1: how long; TINY=1
ifdef MINUTES
	HARMOLAB_ACCELERATOR=auto PYTHONPATH=notebooks $(BIN)/python -m study.full_size --minutes $(if $(TINY),--tiny)
else
	HARMOLAB_ACCELERATOR=auto PYTHONPATH=notebooks $(BIN)/python -m study.full_size $(if $(TINY),--tiny)
	HARMOLAB_ACCELERATOR=auto $(BIN)/python -m harmolab.lab.report.run --profile $(if $(TINY),quick,gpu) --out report-gpu --jobs 1 --only 09 10 16
endif

claims: $(STAMP) ## write docs/claims.md and docs/report.md from the published tables
	PYTHONPATH=notebooks $(BIN)/python -m study.claims.pages

docs: claims ## build the site in site/, readable from disk; warnings are errors
	$(BIN)/python -m sphinx -b html -W --keep-going -q docs site
	@echo "$(CURDIR)/site/index.html"

dist: $(STAMP) ## build wheel and sdist in dist/ and check what a package index would show
	rm -rf dist
	$(BIN)/python -m build --quiet
	$(BIN)/twine check --strict dist/*

bench: $(STAMP) ## measure speed: ratios against named references
	$(BIN)/python -m benchmarks

clean: ## remove reports and caches; your data, figures/ and .venv stay
	rm -rf report report-gpu .writing_* site docs/generated figures/quick build dist .mypy_cache .pytest_cache .ruff_cache .hypothesis .benchmarks
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +

distclean: clean ## remove .venv as well
	rm -rf $(VENV)
