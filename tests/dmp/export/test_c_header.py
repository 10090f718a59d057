"""The C header beside the controller: compiled as C and as C++, over whole movements, with goals and tempo changing."""

import re
import subprocess

import numpy as np
import pytest
from header_runs import WARNINGS, Command, compiled, compiler_of, controlled
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from kineme import DMP, Demonstrations, RhythmicDMP, Trajectory
from kineme.dmp import c_header
from kineme.dmp.discrete.specification import FORMULATIONS, GATINGS
from kineme.dmp.export_c import c_name
from kineme.errors import SpecificationError
from kineme.movements.channels.channel import Channel
from kineme.movements.trajectories.movements import of_channels
from soaking import examples

needs_gcc = pytest.mark.skipif(compiler_of("gcc") is None, reason="no C compiler")

DURATION = 2.0


def learned(n_dims=3, seed=0, **options):
    """A primitive of some smooth movement that ends elsewhere than it starts."""
    rng, times = np.random.default_rng(seed), np.linspace(0, DURATION, 80)
    waves = np.sin(np.pi / DURATION * np.arange(1, 6) * times[:, None])
    positions = 3.0 + times[:, None] * rng.uniform(0.5, 1, n_dims) + waves @ rng.normal(size=(5, n_dims)) / 3
    return DMP(**{"n_points": 80, "n_basis": 20} | options).learn([Trajectory(times, positions)])[0]


def commands_of(primitive, dt, change, seed=0):
    """Half again as many steps as the movement takes, in which goal and tempo change."""
    rng, n = np.random.default_rng(seed), int(1.5 * DURATION / dt)
    extent, commands = primitive.extents.max(), []
    for i in range(n):
        goal = velocity = None
        tempo = 1.0 if change == "nothing" else 1 + 0.5 * np.sin(9 * i / n)
        if change == "goal that is set" and (i % 3 == 0 or i > n // 2):
            goal = primitive.goals[0] + 0.2 * extent * np.sin(5 * i / n)
        if change == "goal that moves" and i % (n // 4) == 0:
            goal = primitive.goals[0] + 0.1 * extent * rng.normal(size=primitive.n_dims)
            velocity = 0.1 * extent / DURATION * rng.normal(size=primitive.n_dims)
        if change != "nothing" and n // 3 <= i < n // 3 + 2:
            tempo = 0.0
        commands.append(Command(dt, tempo, goal, velocity))
    return commands


def assert_alike(primitive, commands, run, tolerance=1e-5, **place):
    used, states = run(commands, **place)
    assert used
    expected = controlled(primitive, commands, **{"tau": None} | place)
    d = primitive.n_dims
    for k, name in enumerate(("position", "velocity", "acceleration", "goal")):
        columns = slice(k * d, (k + 1) * d)
        unit = primitive.extents.max() if name in ("position", "goal") else np.abs(expected[:, columns]).max()
        off = np.abs(states - expected)[:, columns].max() / unit
        assert off <= tolerance * (30 if name == "acceleration" else 3 if name == "velocity" else 1), name
    np.testing.assert_allclose(states[:, -1], expected[:, -1], rtol=0, atol=1e-6)


SPECIFICATIONS = st.fixed_dictionaries(
    {"formulation": st.sampled_from(sorted(FORMULATIONS)), "gating": st.sampled_from(GATINGS)},
    optional={
        "n_basis": st.integers(3, 60), "stiffness": st.sampled_from([10.0, 1e4]),
        "damping": st.sampled_from([5.0, 20.0, 50.0]), "phase_end": st.sampled_from([1e-5, 0.3]),
        "fit": st.just("forcing"), "overlap": st.sampled_from([0.05, 0.8]),
    },
)  # fmt: skip


@needs_gcc
@settings(max_examples=examples(8, 60), deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(options=SPECIFICATIONS, n_dims=st.integers(1, 16), seed=st.integers(0, 99))
def test_every_specification_steps_as_the_controller(tmp_path_factory, options, n_dims, seed):
    primitive = learned(n_dims, seed, **options)
    run = compiled(primitive, tmp_path_factory.mktemp("header"))
    start, goal = primitive.starts[0] - 0.1, primitive.goals[0] + 0.2
    for dt, change in ((0.02, "goal that moves"), (0.13, "goal that is set")):
        assert_alike(primitive, commands_of(primitive, dt, change, seed), run, start=start, goal=goal, tau=2.5)


@needs_gcc
@pytest.mark.parametrize("change", ["nothing", "goal that is set", "goal that moves"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_steps_of_any_length(tmp_path, formulation, change):
    primitive = learned(formulation=formulation)
    run = compiled(primitive, tmp_path)
    for dt in (0.003, 0.05, 0.3):
        assert_alike(primitive, commands_of(primitive, dt, change), run, 2e-7)


@pytest.mark.parametrize(("language", "flags"), [("gcc", ["-O2"]), ("g++", []), ("g++", ["-O2", "-DKINEME_FLOAT"])])
def test_compilers(tmp_path, language, flags):
    """With everything that they warn of; in single precision it is less exact."""
    if compiler_of(language) is None:
        pytest.skip(f"no {language}")
    primitive = learned(damping=5.0)
    run = compiled(primitive, tmp_path, language, flags)
    single = "-DKINEME_FLOAT" in flags
    assert_alike(primitive, commands_of(primitive, 0.01, "goal that moves"), run, 1e-4 if single else 1e-5)


@needs_gcc
def test_what_cannot_be_used_changes_nothing(tmp_path):
    """A closed dimension of the original formulation has no other goal; as NaN, and steps that are none."""
    times = np.linspace(0, DURATION, 80)
    positions = np.column_stack((times, np.sin(np.pi * times / DURATION) * 0.5))
    primitive = DMP("original", n_basis=20).learn([Trajectory(times, positions)])[0]
    run = compiled(primitive, tmp_path)
    along = commands_of(primitive, 0.05, "nothing")
    moved = [command._replace(goal=primitive.goals[0] + [0.5, 0.0]) for command in along]
    assert_alike(primitive, moved, run)
    for wrong in ([0.5, 0.3], [np.nan, 0.0]):
        used, states = run([command._replace(goal=primitive.goals[0] + wrong) for command in along])
        assert not used
        np.testing.assert_array_equal(states, run(along)[1])
    for wrong in (Command(0.0), Command(-0.1), Command(np.nan), Command(2.5), Command(0.1, -1.0), Command(0.1, np.inf)):
        used, states = run([wrong, *along])
        assert not used
        np.testing.assert_array_equal(states[1:], run(along)[1])
    assert not run(along, goal=primitive.goals[0] + [0.0, 1.0])[0]
    for place in ({"tau": -1.0}, {"tau": np.nan}, {"tau": 1e-200}, {"start": [np.nan, 0.0]}, {"goal": [np.inf, 0.0]}):
        used, states = run(along, **place)
        assert not used
        assert not states.any()  # it has not started


@needs_gcc
def test_closed_movements_keep_their_size(tmp_path):
    angle = np.linspace(0, 2 * np.pi, 80)
    path = np.column_stack((np.cos(angle), np.sin(angle) + 0.01 * angle))
    primitive = DMP("amplitude-scaled", n_basis=20).learn([Trajectory(angle / np.pi, path)])[0]
    run, commands = compiled(primitive, tmp_path), commands_of(primitive, 0.05, "goal that is set")
    assert_alike(primitive, commands, run, goal=primitive.goals[0] + 1.0)


@needs_gcc
def test_what_leads_out_of_the_range_of_numbers_is_not_done(tmp_path):
    """In single precision, too, or there is no header."""
    primitive = learned(2)
    used, states = compiled(primitive, tmp_path)([Command(0.05)] * 40, goal=np.full(2, 9e149))
    assert not used
    assert np.isfinite(states).all()
    assert "#error" not in c_header(primitive)
    assert "#error" in c_header(learned(2, phase_end=1e-60))


def test_numbers_read_back_exactly():
    primitive = learned(2)
    text = c_header(primitive)
    table = re.search(r"movement_weights\[20\]\[2\] = (\{.*?\n\})", text, re.DOTALL)[1]
    read = np.array([float(number) for number in re.findall(r"[-\d.e+]+", table)]).reshape(20, 2)
    np.testing.assert_array_equal(read, primitive.scaled_weights[0].T)
    assert f"movement_tau = {float(primitive.durations[0])!r};" in text


NAMES = [
    "int",
    '*/ #error "x"',
    "9 lives",
    "__x__",
    "",
    "波",
    "E0",
    "a\\\n b",
    "??/",
    "/*",
    "_" * 50 + "Wave-2",
    "x" * 300,
]


@pytest.mark.parametrize("name", NAMES)
def test_names_become_identifiers(name):
    """They cannot end a comment or begin with what is reserved; a suffix follows a keyword."""
    prefix = c_name(name)
    assert re.fullmatch("[a-z][a-z0-9]*(_[a-z0-9]+)*", prefix), prefix
    assert len(prefix) <= 50


@needs_gcc
def test_hostile_names_compile(tmp_path):
    """Several headers in one program, of columns with such names."""
    times, columns = np.linspace(0, 1, 50), NAMES[:2] + NAMES[5:6] + NAMES[7:10]
    channels = tuple(Channel(name, "position", (name,)) for name in columns)
    plain = Demonstrations.from_arrays([np.outer(times, np.arange(1.0, 7.0))], times=[times])
    demos = Demonstrations.of_movements(of_channels(plain.movements, channels))
    primitive, code = DMP(n_basis=5).learn(demos)[0], ""
    for i, name in enumerate(NAMES):
        text = c_header(primitive, name)
        assert "#error" not in text
        assert "columns: int, __ _error _x_, _, a__ b, ___, __\n" in text
        (tmp_path / f"{i}.h").write_text(text)
        code += f'#include "{i}.h"\n{c_name(name)}_state state{i};\n'
    options = [*WARNINGS, "-std=c99", "-trigraphs", "-fsyntax-only", "-xc", "-"]
    done = subprocess.run(["gcc", *options], input=code, cwd=tmp_path, text=True, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@needs_gcc
def test_two_movements_of_one_prefix_do_not_compile_and_one_that_is_included_twice_does(tmp_path):
    for i, (name, seed) in enumerate((("wave 1", 0), ("Wave-1", 1), ("wave_1", 0))):
        (tmp_path / f"{i}.h").write_text(c_header(learned(n_dims=1, seed=seed), name))
    for others, fits in (("02", True), ("01", False)):
        code = "".join(f'#include "{i}.h"\n' for i in others) + "wave_1_state state;\n"
        options = [*WARNINGS, "-std=c99", "-fsyntax-only", "-xc", "-"]
        done = subprocess.run(["gcc", *options], input=code, cwd=tmp_path, text=True, capture_output=True, check=False)
        assert (done.returncode == 0, "redefinition of" in done.stderr) == (fits, not fits)


def test_what_has_no_header_is_refused():
    primitive = learned()
    rhythm = RhythmicDMP().learn([np.sin(np.linspace(0, 30, 400))[:, None]])
    with pytest.raises(SpecificationError, match="got RhythmicPrimitives"):
        c_header(rhythm)
    with pytest.raises(SpecificationError, match="expected one primitive to export, got 2"):
        c_header(type(primitive).concatenate([primitive, primitive]))
    with pytest.raises(SpecificationError, match="softer"):
        c_header(learned(stiffness=1e13))
