# The two commands of the README are `make demo` and `make test`. Both do all set-up themselves.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
OUT ?= out/demo
PYTEST := -m pytest -q

.PHONY: demo test lint core core-numpy2 addon addon-45 extension app reference benchmarks clean

demo: $(VENV)/ready
	$(VENV)/bin/spectral-booth demo -o $(OUT)

test: lint core core-numpy2 addon addon-45 extension app

lint: $(VENV)/ready
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy

# numpy 1.26, colour-science 0.4.6: what bpy 5.0.1 resolves to.
core: $(VENV)/ready
	$(VENV)/bin/python $(PYTEST) tests/core tests/reference

# numpy 2.x and no bpy at all; LittleCMS in floats, as another reader of ICC profiles.
core-numpy2: .venv-numpy2/ready
	.venv-numpy2/bin/python $(PYTEST) tests/core tests/reference

addon: $(VENV)/ready
	$(VENV)/bin/python $(PYTEST) tests/addon

addon-45: .venv-bpy45/ready
	.venv-bpy45/bin/python $(PYTEST) tests/addon

# The built zip in environments that hold bpy and pytest only.
extension: .venv-extension45/ready .venv-extension50/ready $(VENV)/ready
	$(VENV)/bin/python tools/build_extension.py
	.venv-extension45/bin/python $(PYTEST) tests/extension
	.venv-extension50/bin/python $(PYTEST) tests/extension

app: $(VENV)/ready
	$(VENV)/bin/python $(PYTEST) tests/app

benchmarks: $(VENV)/ready
	$(VENV)/bin/python benchmarks/weighting_factors.py
	$(VENV)/bin/python benchmarks/display_speed.py
	$(VENV)/bin/python benchmarks/projection.py
	$(VENV)/bin/python benchmarks/bake_memory.py
	$(VENV)/bin/python benchmarks/assigning.py
	$(VENV)/bin/python benchmarks/relighting.py

system-libraries:
	sh tools/system_libraries.sh

$(VENV)/ready: pyproject.toml | system-libraries
	$(PYTHON) tools/make_environment.py $(VENV) '.[all,dev]'

.venv-numpy2/ready: pyproject.toml | system-libraries
	$(PYTHON) tools/make_environment.py .venv-numpy2 '.[report,dev]' 'numpy>=2' imagecodecs

# colour-science 0.4.7 without scipy on numpy 1.26: what the extension brings inside Blender 4.5 and 5.0.
.venv-bpy45/ready: pyproject.toml | system-libraries
	$(PYTHON) tools/make_environment.py .venv-bpy45 '.[report,dev]' bpy==4.5.15
	.venv-bpy45/bin/pip install -q --no-deps colour-science==0.4.7
	.venv-bpy45/bin/pip uninstall -q -y scipy imageio

.venv-extension45/ready: | system-libraries
	$(PYTHON) tools/make_environment.py .venv-extension45 bpy==4.5.15 'pytest>=8'

.venv-extension50/ready: | system-libraries
	$(PYTHON) tools/make_environment.py .venv-extension50 bpy==5.0.1 'pytest>=8'

clean:
	rm -rf .venv .venv-* build dist out *.egg-info
