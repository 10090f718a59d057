"""What `import kineme` offers, and what it does not cost."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import pytest

import kineme
from kineme._lazy import names_in

STUBS = sorted(Path(kineme.__file__).parent.rglob("*.pyi"))
MODULES = [
    ".".join(["kineme", *path.relative_to(STUBS[0].parent).with_suffix("").parts]).removesuffix(".__init__")
    for path in STUBS
]
NAMES = [(module, name) for module in MODULES for name in import_module(module).__all__]
#: Chapters that an optional package is needed for, whatever is asked of them.
OPTIONAL = {"kineme.torch": "torch", "kineme.notebook": "anywidget"}


def _skip_without_package(module):
    if module in OPTIONAL:
        pytest.importorskip(OPTIONAL[module], reason=f"the package {OPTIONAL[module]} is not installed")


@pytest.mark.parametrize(("module", "name"), NAMES)
def test_every_name_leads_somewhere(module, name):
    _skip_without_package(module)
    assert getattr(import_module(module), name) is not None  # that it is documented: tests/test_reference.py


@pytest.mark.parametrize("stub", STUBS, ids=MODULES)
def test_names_are_read_as_a_type_checker_reads_them(stub):
    tree = ast.parse(stub.read_text())
    imported = [(one.asname, node.module, one.name) for node in tree.body if isinstance(node, ast.ImportFrom)
                for one in node.names]  # fmt: skip
    assert imported == [(public, *home) for public, home in names_in(stub.read_text()).items()]


@pytest.mark.parametrize("module", MODULES)
def test_names_are_listed_once_and_hide_no_module(module):
    _skip_without_package(module)
    module = import_module(module)
    assert len(module.__all__) == len(set(module.__all__))
    assert set(module.__all__) <= set(dir(module))
    for name in module.__all__:
        if getattr(module, "__path__", None) and not isinstance(getattr(module, name), ModuleType):
            assert find_spec(f"{module.__name__}.{name}") is None, f"{name} is a module, too: which one comes first?"


def test_chapters_are_attributes_before_anybody_imports_them():
    """For each of them the package is imported anew."""
    chapters = [path.parent.name for path in sorted(STUBS[0].parent.glob("*/__init__.py"))]
    code = f"""
import sys
for chapter in {chapters}:
    for name in [name for name in sys.modules if name.partition(".")[0] == "kineme"]:
        del sys.modules[name]
    import kineme
    assert len([name for name in sys.modules if name.startswith("kineme.")]) <= 1, "more than what loads the names"
    print(getattr(kineme, chapter).__name__)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.split() == [f"kineme.{chapter}" for chapter in chapters], done.stderr


def test_a_package_without_its_stubs_says_what_it_lacks(tmp_path):
    (tmp_path / "half").mkdir()
    (tmp_path / "half" / "__init__.py").write_text(
        "from kineme._lazy import lazy_names\n__getattr__, __dir__, __all__ = lazy_names(__name__)\n"
    )
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import half"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr.splitlines()[-1].startswith("ImportError: expected the public names of half in ")
    assert "kineme needs its .pyi files when it runs" in done.stderr


def test_an_unknown_name_is_refused_with_the_known_ones():
    with pytest.raises(
        AttributeError, match=r"module 'kineme' has no attribute 'DPM' \(did you mean 'DMP'\?\); it has .*DMP, "
    ):
        _ = kineme.DPM
    with pytest.raises(AttributeError, match=r"module 'kineme.kernels' has no attribute 'rfb'; it has Kernel, RBF"):
        _ = kineme.kernels.rfb
    assert not hasattr(kineme, "__wrapped__")
    assert not hasattr(kineme, "no.such")


def _loaded_by(statement):
    code = f"import sys\n{statement}\nprint(*{{name.partition('.')[0] for name in sys.modules}})"
    return set(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split())


def test_importing_kineme_loads_nothing_heavy():
    assert _loaded_by("import kineme").isdisjoint({"numpy", "scipy", "sklearn", "numba", "matplotlib", "threadpoolctl"})


def test_learning_a_few_movements_does_not_load_what_it_does_not_need():
    loaded = _loaded_by("import kineme, numpy\nkineme.DMP().learn([numpy.arange(20.0) ** 2]).weights")
    assert loaded.isdisjoint({"sklearn", "numba", "matplotlib"})


def test_the_studio_starts_without_what_draws_compiles_or_finds_peaks():
    pytest.importorskip("fastapi", reason="the extra studio is not installed")
    show = "print(*{'.'.join(name.split('.')[:2]) for name in sys.modules})"
    code = f"import sys, kineme.studio.server.app\n{show}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert "kineme.studio" in loaded
    assert loaded.isdisjoint({"sklearn", "numba", "matplotlib", "scipy.signal", "scipy.stats"})
