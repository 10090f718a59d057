"""What `import kineme` offers, and what it does not cost."""

from __future__ import annotations

import subprocess
import sys

import pytest

import kineme


@pytest.mark.parametrize("name", kineme.__all__)
def test_every_name_leads_somewhere_and_is_documented(name):
    assert getattr(kineme, name).__doc__.strip()


def test_names_are_listed_once_and_each_has_a_home():
    assert len(kineme.__all__) == len(set(kineme.__all__))
    assert set(kineme.__all__) == set(kineme._HOME)


def test_dir_shows_the_names():
    assert set(kineme.__all__) <= set(dir(kineme))


def test_an_unknown_name_is_refused_with_the_known_ones():
    with pytest.raises(AttributeError, match=r"module 'kineme' has no attribute 'DPM'; it has .*DMP, .*DMPFeatures"):
        _ = kineme.DPM


def _loaded_by(statement):
    code = f"import sys\n{statement}\nprint(*{{name.partition('.')[0] for name in sys.modules}})"
    return set(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split())


def test_importing_kineme_loads_nothing_heavy():
    assert _loaded_by("import kineme").isdisjoint({"numpy", "scipy", "sklearn", "numba", "matplotlib", "threadpoolctl"})


def test_learning_a_few_movements_does_not_load_what_it_does_not_need():
    loaded = _loaded_by("import kineme, numpy\nkineme.DMP().learn([numpy.arange(20.0) ** 2]).weights")
    assert loaded.isdisjoint({"sklearn", "numba", "matplotlib"})
