# Everything runs in a virtual environment of its own; `make demo` and `make test` set it up.
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin
# Cloth and rope are single-threaded; without this every worker starts a thread per core.
export OMP_NUM_THREADS ?= 1
# Containers often forbid to store bytecode; pytest then rewrites all test modules in each worker.
export PYTHONDONTWRITEBYTECODE =

.PHONY: demo notebooks outputs test test-long test-all lint bench sheets videos gallery renders docs native clean

demo: $(VENV)/.installed
	$(BIN)/softgym-mj demo --out demo

# JupyterLab refuses to run as root, as in a container, unless it is told to.
AS_ROOT = $(if $(filter 0,$(shell id -u)),--allow-root)

# Opens the notebooks in a browser, from the first one on.
notebooks: $(VENV)/.installed-notebooks
	$(BIN)/jupyter lab $(AS_ROOT) notebooks/01_quickstart.ipynb

test: $(VENV)/.installed-dev
	$(BIN)/python -m pytest

# Most notebooks, and other tests that take long each.
test-long: $(VENV)/.installed-dev
	$(BIN)/python -m pytest --dist load -m long

test-all: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -m "slow or not slow"

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy lerobot_env_softgym_mj/src
	$(BIN)/codespell $$(git ls-files)
	$(BIN)/clang-format --dry-run --Werror $$(git ls-files 'softgym_mj/*.h' 'softgym_mj/*.cc')

bench: $(VENV)/.installed
	$(BIN)/python -m benchmarks.throughput --out benchmarks/throughput.json
	$(BIN)/python -m benchmarks.vector --out benchmarks/vector.json
	$(BIN)/python -m benchmarks.fluid --out docs/fluid.json
	$(BIN)/python -m benchmarks.cloth --out benchmarks/cloth.json

# Writes the tasks' data sheets, docs/tasks, and the tables of scores anew: after a change to a task.
sheets: $(VENV)/.installed-dev
	$(BIN)/python -m tools.data_sheets
	$(BIN)/python -m tools.tables
	$(BIN)/python -m tools.architecture

# Plays the tasks for the README's moving pictures, docs/videos.
videos: $(VENV)/.installed
	$(BIN)/python -m tools.videos

# Draws every task with every actor, docs/gallery.
gallery: $(VENV)/.installed
	$(BIN)/python -m tools.gallery

# Photographs of each material, docs/renders: some minutes.
renders: $(VENV)/.installed-dev
	$(BIN)/python -m tools.renders

# The folder of the notebooks in the site: by default they are executed, minutes after a change to
# them; `make docs NOTEBOOKS=notebooks` shows them as they are committed, without videos.
NOTEBOOKS ?= build/notebooks

# Builds the documentation site into build/site; a warning is an error.
docs: $(VENV)/.installed-dev $(addprefix $(NOTEBOOKS)/,$(notdir $(wildcard notebooks/*.ipynb)))
	NOTEBOOKS=$(NOTEBOOKS) $(BIN)/mkdocs build --strict

build/notebooks/%.ipynb: notebooks/%.ipynb
	$(BIN)/jupyter nbconvert --to notebook --execute --output-dir $(@D) $<

# Copies the outputs of executed notebooks into the committed ones: after a change to their code.
outputs: $(VENV)/.installed-dev $(addprefix build/notebooks/,$(notdir $(wildcard notebooks/*.ipynb)))
	$(BIN)/python -m tools.notebook_outputs build/notebooks
	touch build/notebooks/*.ipynb

NATIVE = softgym_mj/native
# Rebuilds the installed plugins after a change to their sources. It has no prerequisite: that would
# install everything again.
native:
	cmake --build $(NATIVE)

$(VENV)/.installed: pyproject.toml $(NATIVE)/CMakeLists.txt \
		$(foreach folder,$(NATIVE) softgym_mj/batch softgym_mj/*/plugin softgym_mj/*/batch,$(wildcard $(folder)/*.cc $(folder)/*.h))
	PYTHON="$(PYTHON)" VENV="$(VENV)" sh tools/setup.sh
	touch $@

$(VENV)/.installed-notebooks: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --editable '.[notebooks]'
	touch $@

# What tests, checks and documentation need, PyTorch and Ray among it, is some gigabytes.
$(VENV)/.installed-dev: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	touch $@

clean:
	rm -rf $(VENV) demo build dist
