# make demo   the paper's tables and figures, in out/
# make check  formatter, linter, type checker, and the tests that find most: minutes
# make test   formatter, linter, type checker, tests; make lint without the tests
# make javascript  formatter, linter and type checker of the JavaScript; needs npm
# make test-pythons  the same with every Python that is found here
# make test-lowest   the tests with the lowest versions of what kineme depends on
# make package   wheel and source archive in out/package, checked, and tried in an empty environment of every Python found
# make ros2   messages of ROS 2 itself, in .venv-ros2; the tests that need them are skipped where it is not there
# make soak   faults of the action library, many times, and all tests with all that make test leaves out: an hour
# make fuzz   files and libraries damaged at random, read in child processes: minutes; FUZZ_SEED, FUZZ_ROUNDS
# make bench  speed and accuracy side by side with other libraries
# make evaluate  recognition beside its rivals, in out/evaluation/
# make figures  the pictures of docs/
# make docs   the whole site, in out/docs/index.html, without network; GALLERY=0 does not run the examples
# make check-docs   that site in a browser: its search, widths, accessibility
# make reference  docs/reference/names.md, from the stubs that list the public names
# make tables  the tables of results in docs/, from the files of the benchmark and the evaluation
# make scene  what draws the arm in the page of kineme move --view, from the npm packages; vendored.json names them
# make lock   renew the pinned requirements

PYTHON ?= python3
# Those that kineme promises to work with; name others, or by their paths, with: make test-pythons PYTHONS="..."
PYTHONS ?= python3.11 python3.12 python3.13 python3.14
DEV ?= .venv-dev

# Tests start hundreds of commands: where Python writes no bytecode, each of them compiles the package again.
export PYTHONDONTWRITEBYTECODE =

.PHONY: demo check javascript test lint warm collect test-pythons test-lowest package ros2 always soak fuzz bench evaluate docs check-docs figures reference tables scene lock clean

demo: .venv/ready
	.venv/bin/kineme reproduce --out out/

# A table of what takes batches, and one of wrong values, go through most of the package.
FIRST = house layering front_door wrong_values
CHECKED = $(FIRST:%=tests/test_%.py) tests/properties tests/dmp/discrete tests/dmp/pose tests/movements/trajectories \
  tests/recognition/test_recognition_numbers.py tests/recognition/test_recognizer.py tests/similarity/test_similarity.py \
  $(patsubst %,tests/library/test_library_%.py,learning recognition changes exchange) \
  tests/io/test_read_recordings.py tests/cli/test_learn.py tests/cli/test_recognize_command.py tests/kernels/test_gram_formulas.py

# The examples of the documentation, then in the order of the folders: what comes last is short, and leaves no worker idle.
# Three workers on two cores, as many tests wait for a process that they started. Threads of BLAS would wait actively for
# a core of another worker.
PYTEST = OPENBLAS_NUM_THREADS=1 $(DEV)/bin/pytest -n 3 --dist loadscope --no-loadscope-reorder

check: lint
	$(PYTEST) $(CHECKED)

test: $(DEV)/ready
	$(MAKE) --no-print-directory -j 3 warm lint collect
	$(PYTEST) -rs

lint: $(DEV)/ready
	$(DEV)/bin/ruff format --check .
	$(DEV)/bin/ruff check .
	$(DEV)/bin/mypy --cache-dir $(DEV)/mypy

# In a new checkout two workers would each compile all of it, to machine code and to bytecode.
warm: $(DEV)/ready
	$(DEV)/bin/python -c "import kineme; kineme.warm_up((1, 2, 3))"

collect: $(DEV)/ready
	-$(DEV)/bin/pytest --collect-only -q -q -p no:cacheprovider >/dev/null

# Each Python with an environment of its own; all are tried, though one fails.
test-pythons:
	@found=; missing=; failed=; \
	for python in $(PYTHONS); do \
	  if ! $$python -c '' 2>/dev/null; then missing="$$missing $$python"; continue; fi; \
	  found="$$found $$python"; echo "== $$python"; \
	  $(MAKE) test PYTHON=$$python DEV=.venv-dev-$$(basename $$python) || failed="$$failed $$python"; \
	done; \
	echo "tested:$${found:- none}; not found:$${missing:- none}; failed:$${failed:- none}"; \
	test -n "$$found" && test -z "$$failed"

test-lowest: .venv-lowest/ready
	OPENBLAS_NUM_THREADS=1 .venv-lowest/bin/pytest -n 2 --dist loadscope -p no:cacheprovider

package: .venv-package/ready
	.venv-package/bin/python -m release $(PYTHONS)

.venv-package/ready: requirements/package.txt
	$(PYTHON) -m venv --clear .venv-package
	.venv-package/bin/pip install --quiet --require-hashes -r requirements/package.txt
	touch $@

ros2: .venv-ros2/ready

# Wheels that others build, for Linux and the Pythons they chose. What only builds packages of ROS is not in the list,
# so the dependencies are not followed. Two interfaces that no wheel has are compiled by what the wheels bring.
.venv-ros2/ready: requirements/ros2.txt requirements/ros2_build.txt tests/ros_interfaces.py
	$(PYTHON) -m venv --clear .venv-ros2
	.venv-ros2/bin/pip install --quiet --no-deps --only-binary :all: --require-hashes -r requirements/ros2.txt
	.venv-ros2/bin/python -c 'import rclpy.serialization, geometry_msgs.msg, nav_msgs.msg, sensor_msgs.msg, trajectory_msgs.msg'
	.venv-ros2/bin/pip install --quiet --no-deps --no-build-isolation --require-hashes -r requirements/ros2_build.txt && \
	  .venv-ros2/bin/python tests/ros_interfaces.py >/dev/null 2>&1 || \
	  echo "== two interfaces of ROS 2 could not be compiled: tests of frames and of arms will be skipped"
	touch $@

soak: $(DEV)/ready
	KINEME_SOAK=1 $(PYTEST) soak tests -p no:cacheprovider

fuzz: $(DEV)/ready
	$(DEV)/bin/pytest fuzz -p no:cacheprovider

.venv/ready: requirements/run.txt pyproject.toml .venv/python
	$(call environment,.venv,requirements/run.txt)

$(DEV)/ready: requirements/dev.txt pyproject.toml $(DEV)/python
	$(call environment,$(DEV),requirements/dev.txt)

.venv-lowest/ready: requirements/lowest.txt pyproject.toml .venv-lowest/python
	$(call environment,.venv-lowest,requirements/lowest.txt)

# Which Python an environment was made with; it is made anew when PYTHON names another one.
%/python: always
	@mkdir -p $(@D)
	@now=$$($(PYTHON) -c 'import sys; print(sys.executable, sys.version)' 2>&1 || echo none); \
	test "$$now" = "$$(cat $@ 2>/dev/null)" || echo "$$now" > $@

# The packages of a lock file, which names all that they need, each checked against its hash, then this project on top. One
# pip waits for each file and unpacks on one core: three take less time. Python writes bytecode when it first loads a module;
# toppra is compiled here, as the compiler warns of it, and in tests a warning is an error.
define environment
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "kineme needs Python 3.11 or later, found " + sys.version.split()[0] + "; choose one with: make PYTHON=python3.12")'
	@$(PYTHON) -c 'import ensurepip' || { echo "This Python cannot create environments; on Debian: apt-get install python3-venv"; exit 1; }
	@cp $(1)/python $(1).python
	$(PYTHON) -m venv --clear $(1)
	@mv $(1).python $(1)/python
	@awk '/^[^ ]/ { part = ++n % 3 } { print > ("$(1)/part" part ".txt") }' $(2)
	ls $(1)/part*.txt | xargs -n 1 -P 3 $(1)/bin/pip install --quiet --no-compile --no-deps --require-hashes -r
	$(1)/bin/pip install --quiet --no-deps --no-build-isolation --editable .
	-$(1)/bin/python -m compileall -q -q $(1)/lib/python3.*/site-packages/toppra
	touch $@
endef

# Formatter, linter and type checker of the JavaScript, each checked against its hash; what is shipped needs none of them.
javascript: node_modules/ready
	node_modules/.bin/biome ci --reporter=summary
	node_modules/.bin/tsc --project jsconfig.json

node_modules/ready: package-lock.json
	npm install --silent --no-audit --no-fund  # not `ci`: the lock names what other systems need, which a mirror may lack
	touch $@

bench: .venv-bench/ready
	PYTHONPATH=src:experiments .venv-bench/bin/python -m bench

# Two steps: the peer that comes as source is compiled with pinned tools, nothing is fetched aside.
.venv-bench/ready: requirements/run.txt experiments/build.txt experiments/peers.txt
	$(PYTHON) -m venv --clear .venv-bench
	.venv-bench/bin/pip install --quiet --require-hashes -r requirements/run.txt -r experiments/build.txt
	.venv-bench/bin/pip install --quiet --require-hashes --no-build-isolation -r experiments/peers.txt
	touch $@

evaluate: .venv-rivals/ready
	.venv-rivals/bin/kineme evaluate lasa --out out/evaluation/

.venv-rivals/ready: experiments/rivals.txt pyproject.toml .venv-rivals/python
	$(call environment,.venv-rivals,experiments/rivals.txt)

# Warnings are errors; all that is wrong is told. What Sphinx read and the examples drew is kept, so that the next build is
# short. GALLERY=0 shows the examples without running them.
GALLERY ?= 1
docs: $(DEV)/ready
	$(DEV)/bin/sphinx-build -b html -W --keep-going -j 2 --quiet -D plot_gallery=$(GALLERY) -d out/doctrees docs out/docs

# The site that make docs built, in a browser: its search, its widths, and what readers with other senses meet.
check-docs: $(DEV)/ready
	KINEME_SITE=out/docs $(DEV)/bin/pytest -p no:cacheprovider tests/test_built_site.py

figures: $(DEV)/ready
	PYTHONPATH=experiments $(DEV)/bin/python docs/make_figures.py

reference: $(DEV)/ready
	$(DEV)/bin/python docs/make_reference.py

tables: $(DEV)/ready
	PYTHONPATH=experiments $(DEV)/bin/python -m result_tables

# After another version: its numbers and sums in vendored.json, which tests compare.
SCENE = src/kineme/robots/view/vendor
scene:
	mkdir -p out/scene && cp $(SCENE)/scene.js $(SCENE)/package.json out/scene/
	cd out/scene && npm install --silent --no-package-lock && npm run build
	cp out/scene/scene.min.js $(SCENE)/

lock:
	uv pip compile pyproject.toml --extra robot --group build --universal --generate-hashes --no-emit-index-url --no-header --quiet -o requirements/run.txt
	uv pip compile pyproject.toml --group dev --universal --generate-hashes --no-emit-index-url --no-header --quiet -o requirements/dev.txt
	uv pip compile pyproject.toml --group lowest --resolution lowest-direct --python-version 3.11 --generate-hashes --no-emit-index-url --no-header --quiet -o requirements/lowest.txt
	uv pip compile --group package --universal --generate-hashes --no-emit-index-url --no-header --quiet -o requirements/package.txt
	uv pip compile requirements/ros2.in --universal --python-version 3.11 --no-emit-package empy --generate-hashes --no-annotate --no-emit-index-url --no-header --quiet -o requirements/ros2.txt
	uv pip compile requirements/ros2_build.in --universal --python-version 3.11 --generate-hashes --no-annotate --no-emit-index-url --no-header --quiet -o requirements/ros2_build.txt
	uv pip compile experiments/build.in -c requirements/run.txt --universal --generate-hashes --no-emit-index-url --no-header --quiet -o experiments/build.txt
	uv pip compile experiments/peers.in pyproject.toml --extra parquet --extra ros --extra robot --extra studio -c requirements/run.txt --universal --generate-hashes --no-emit-index-url --no-header --quiet -o experiments/peers.txt
	uv pip compile pyproject.toml experiments/rivals.in --group build --universal --generate-hashes --no-emit-index-url --no-header --quiet -o experiments/rivals.txt

clean:
	rm -rf .venv .venv-dev .venv-dev-* .venv-lowest .venv-package .venv-ros2 .venv-bench .venv-rivals node_modules out docs/gallery docs/reference/generated docs/concepts/interactive/primitive.html
