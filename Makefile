# Every target sets up the environment that it needs. `make` alone lists them.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
ENV := $(PYTHON) tools/environment.py --venv $(VENV)
UV ?= $(BIN)/uv
JOBS ?= 2
# One thread for each worker: two workers with two threads each only get into each other's way.
export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 1
export VECLIB_MAXIMUM_THREADS ?= 1

NB ?=
P ?=
QUICK ?=
OUT ?=
MUTANTS ?=
PAPER ?=
SIZE ?=
REASON ?=

.DEFAULT_GOAL := help
.PHONY: help env book test check reference portable run notebooks lab bench coverage mutants multiverse picture lock clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "%-12s%s\n", $$1, $$2 }' $(MAKEFILE_LIST)

env: ## the environment in .venv, as environment.txt says
	@$(ENV)

book: env ## all notebooks at the papers' scale, and the book: book/_build/html/index.html
	@$(BIN)/geokalman build

test: ## the whole suite, quick notebooks included
	@$(ENV) test
	$(BIN)/ruff check --quiet
	$(BIN)/ruff format --check --quiet
	$(BIN)/pyrefly check --output-format min-text
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile --mpl $(PYTEST)

check: ## paper-scale results against stored references and claims; the built book in a browser
	@$(ENV) test
	$(BIN)/geokalman check
	GEOKALMAN_BOOK=book/_build/html $(BIN)/python -m pytest -n $(JOBS) --dist loadgroup -m browser tests/book

reference: env ## renew the stored references in all computing settings, print what changed: make reference REASON="why" [NB=paper/notebook]
	@test -n "$(REASON)" || { echo 'A renewed reference needs a reason, as in: make reference REASON="why the numbers moved"'; exit 2; }
	@$(BIN)/geokalman reference --reason "$(REASON)" $(NB)

portable: env ## compute in all settings of this machine and widen the stored spreads: make portable [NB=paper/notebook]
	@$(BIN)/geokalman portable $(NB)

run: env ## one notebook with other parameters: make run NB=grace-fusion/04-ukf P="days=5 mu=3" [QUICK=1] [OUT=DIR]
	@test -n "$(NB)" || { $(BIN)/geokalman list; echo 'Name one of these notebooks, as in: make run NB=grace-fusion/04-ukf P="days=5 mu=3"'; exit 2; }
	@$(BIN)/geokalman run $(NB) $(P) $(if $(QUICK),--quick) $(if $(OUT),--out "$(OUT)")

multiverse: env ## judge the claims of a paper in more readings of it: make multiverse PAPER=grace-fusion [SIZE=500]
	@test -n "$(PAPER)" || { echo 'Name a paper, as in: make multiverse PAPER=grace-fusion SIZE=500'; exit 2; }
	@$(BIN)/geokalman multiverse $(PAPER) $(if $(SIZE),--size $(SIZE))

notebooks: env ## plain .ipynb twins of the notebooks, for Jupyter and papermill
	@$(BIN)/geokalman notebooks

lab: ## the notebooks in JupyterLab
	@$(ENV) lab
	@$(BIN)/geokalman notebooks
	$(BIN)/jupyter lab book

bench: ## speed, beside the peers; never a gate
	@$(ENV) test bench
	@for script in tests/benchmarks/bench_*.py; do echo "== $$script"; $(BIN)/python $$script || exit 1; done

coverage: ## how much of src the tests execute, with compilation off
	@$(ENV) test
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -n $(JOBS) --dist loadfile -m 'not slow and not browser' --cov=geokalman --cov=execbook --cov-report=term-missing:skip-covered

mutants: ## do the tests notice a wrong estimator? make mutants [MUTANTS="--each 50 geokalman/kalman/linear.py"]
	@$(ENV) test
	nice $(BIN)/python tools/mutants.py $(MUTANTS)

picture: env ## renew the README's picture from the built book
	@$(BIN)/python tools/picture.py

lock: env ## compile the locks anew from their .in files, and try them on every machine that they are for
	sh tools/lock.sh $(UV)

clean: ## remove what was built (the environment stays)
	rm -rf book/_build runs .cache build dist .pytest_cache .hypothesis htmlcov .coverage*
	find book -name '*.ipynb' -delete
	find src tests book tools -name __pycache__ -type d -exec rm -rf {} +
