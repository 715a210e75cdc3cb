# The contract: people and CI call these targets only.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WORKERS ?= 2
SEED ?= 0
SECONDS ?= 3600
CASES ?= 3000
KILLS ?= 20
PAIRS ?= 4
FAULTS ?= 5
GATED := scenarios/gate/*.yaml --baseline scenarios/baseline.json

.DEFAULT_GOAL := help
.PHONY: help setup eval gate previews paper baselines test fuzz chaos lint bench docs site cover clean

help:  ## list the targets
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-9s %s\n", $$1, $$2}'

$(VENV)/.ready: pyproject.toml constraints.txt build_proto.py $(wildcard proto/*.proto)
	@$(PYTHON) -m venv $(VENV) >/dev/null 2>&1 || { rm -rf $(VENV); \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	    echo "installing the system package python3-venv"; apt-get update -qq && apt-get install -y -qq python3-venv >/dev/null; \
	    $(PYTHON) -m venv $(VENV); \
	  else echo "cannot create a virtual environment: install the system package python3-venv (Debian, Ubuntu)" >&2; exit 2; fi; }
	@echo "installing hippodrome and its packages into $(VENV) (a minute or two)"
	@$(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable ".[dev]"
	@$(BIN)/python -m hippodrome.sim.render.probe --install
	@echo "compiling the inner loops (half a minute)"
	@$(BIN)/python -m hippodrome.eval.methods.warm_up
	@touch $@

setup: $(VENV)/.ready  ## install everything into .venv (the other targets do this themselves)

eval: setup  ## build, refine, localize and score maps of several generated towns, in out/eval
	@$(BIN)/hippodrome eval scenarios/towns/*.yaml --workers $(WORKERS) --out out/eval

previews: setup  ## look at every scenario: drives from above and stills, in out/preview
	@$(BIN)/hippodrome scenario preview scenarios/*.yaml scenarios/*/*.yaml --out out/preview

gate: setup  ## hold this code to scenarios/baseline.json; UPDATE=--update makes it the baseline
	@$(BIN)/hippodrome gate $(GATED) $(UPDATE) --workers $(WORKERS) --junit out/gate/gate.xml

paper: setup  ## the paper's drive: 1,315 s, 14,717 frames, about 7.2 km
	@$(BIN)/hippodrome eval scenarios/paper.yaml --workers $(WORKERS) --out out/paper

baselines: setup  ## the paper's drive with its rivals, binocular ORB-SLAM3 among them, in out/baselines
	@$(BIN)/hippodrome baselines scenarios/paper.yaml --workers $(WORKERS) --out out/baselines

test: setup  ## the whole test suite, on real SUMO and real GL, in WORKERS processes
	@$(BIN)/python -m pytest tests --numprocesses $(WORKERS) --dist loadfile

fuzz: setup  ## break the inputs of all readers: CASES of them with SEED, for at most SECONDS
	@$(BIN)/python -m tests.broken --cases $(CASES) --seed $(SEED) --seconds $(SECONDS)

chaos: setup  ## kill KILLS commands, give FAULTS a faulty disk, and run PAIRS in one folder; the reruns must give the same results
	@$(BIN)/python -m tests.chaos --kills $(KILLS) --faults $(FAULTS) --pairs $(PAIRS) --seed $(SEED) --seconds $(SECONDS)

lint: setup  ## ruff and strict mypy
	@$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy

bench: setup  ## speed and memory, as ratios measured in one run
	@$(BIN)/python -m benchmarks

docs: setup  ## make the tables of docs/scenarios.md anew from the models
	@$(BIN)/python -m hippodrome.eval.authoring.reference docs/scenarios.md

site: setup  ## these documents and the docstrings as pages, in out/site; broken links fail
	@$(BIN)/python docs/site/make.py out/site-sources
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet --clean && echo "written: out/site/index.html"

cover: eval  ## make the README's film, picture and table anew from the default run
	@$(BIN)/python -m hippodrome.eval.report.cover out/eval grid

clean:  ## remove results, keep the environment
	@rm -rf out
