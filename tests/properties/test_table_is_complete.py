"""A new function of a batch must stand in the table of `batched_functions`, or say here why it need not."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import sys
import threading
import warnings
from functools import cached_property

import pytest
from batched_functions import TABLE, partly_seen, recognizer
from drawn_movements import reaches

import kineme

#: Parameters that hold many movements, or many rows.
MANY = {
    "A", "B", "X", "arrays", "demonstrations", "demos", "features", "movements", "p", "paths", "positions",
    "primitives", "q", "queries", "recordings", "rows", "trajectories",
}  # fmt: skip

#: Chapters and rooms whose functions do not answer for each movement by itself.
OTHER_PARTS = {
    "anchoring": "clusters, merges and names depend on the company by intent; movements are seen by recognition's view",
    "cli": "calls the layers below",
    "dmp.control": "one movement by contract",
    "datasets": "reads files",
    "dmp.generation": "one movement by contract",
    "io": "reads and writes files, one by one; reports on whole sets",
    "library": "its class is in the table; what lies under it writes and reads rows of a database",
    "movements.segmentation": "one recording by contract",
    "pieces": "whole archives, with and without pieces, and brute force beside bounds; see tests/pieces",
    "planning": "one domain, one plan and one execution by contract",
    "recognition.monitor": "what many show is one corridor, and an execution is one movement; see test_monitor.py",
    "robots": "one movement by contract",
    "sensors": "one stream by contract; see tests/sensors",
    "studio": "its snapshots are a whole library, its server calls the layers below; see tests/studio",
    "torch": "tensors of any batch shape, and each by itself; see tests/tensors",
    "validation": "checks that raise",
}

#: Functions that depend on the whole batch by intent, or on one movement by contract.
EXEMPT = {
    "movements.trajectories.demonstrations.Demonstrations.dimensions": "of columns",
    "movements.trajectories.demonstrations.Demonstrations.from_dataframe": "reads tables; from_arrays does the rest",
    "dmp.batch.Batch.plain_names": "of columns",
    "dmp.batch.Batch.plot": "one picture",
    "dmp.batch.Batch.rollout": "that of the subclasses",
    "recognition.differences.confusion": "counts over a whole set by intent",
    "dmp.discrete.rollout.BaseRollout.rate_names": "of columns",
    "movements.channels.column_match.Columns.are_nameless": "of columns",
    "movements.channels.column_match.Columns.names": "of columns",
    "movements.channels.column_match.Columns.rotations": "of columns",
    "movements.channels.column_match.columns_like": "orders columns of one array",
    "movements.trajectories.as_learned.by_names": "orders columns of one array; see test_library_channels.py",
    "recognition.answer.Answer.plot": "one picture",
    "recognition.answer_figure.draw_answer": "one picture",
    "dmp.pose.pose_dmp.PosePrimitives.controller": "one movement by contract",
    "dmp.discrete.dmp.Primitives.controller": "one movement by contract",
    "dmp.rhythmic.rhythmic_dmp.RhythmicPrimitives.controller": "one movement by contract",
    "dmp.pose.pose_controller.PoseState.orientation": "of one movement at one moment",
    "dmp.pose.pose_controller.PoseState.pose": "of one movement at one moment",
    "movements.episodes.Episode.label": "of one episode",
    "audit.motion.Motion.frames": "of one episode",
    "audit.motion.Motion.seconds": "of one episode",
    "recognition.answer_figure.View.points": "one picture",
    "movements.preparation.glitches.without_jumps": "one recording by contract",
    "recognition.coarse_windows.coarse_distances": "windows of one recording by contract",
    "recognition.compared_windows.Templates.levels": "windows of one recording by contract",
    "recognition.compared_windows.Templates.level_scores": "windows of one recording by contract",
    "recognition.compared_windows.Templates.of": "windows of one recording by contract",
    "recognition.edges.placed": "windows of one recording by contract",
    "recognition.edges.settled": "windows of one recording by contract",
    "recognition.levels.level_scores": "windows of one recording by contract",
    "reporting.figures.flat": "of pictures",
    "similarity.describe.describe": "takes principal points of many from the batch, unlike `Comparison.describe`",
    "similarity.bounds.ReducedFeatures.take": "an index into arrays",
    "kernels.procrustes.Procrustes.by_points": "an order of numbers; see test_points.py",
    "similarity.bounds.log_bounds": "of pairs; see test_bounds.py",
    "similarity.comparison.StoredReferences.bounds": "of pairs; see test_bounds.py",
    "recognition.outliers.find_outliers": "compares each with the others of its label",
    "recognition.early.evidence.earliness": "a score of the whole set",
    "recognition.early.live_state.LiveState.certainty": "of one stream",
    "recognition.early.live_state.LiveState.in_words": "of one stream",
    "recognition.early.live_state.LiveState.probabilities": "of one stream",
    "recognition.early.live_state.LiveState.to_dict": "of one stream",
    "recognition.early.live_state.LiveStatus.messages": "of one stream; its length counts problems",
    "movements.preparation.perturbations.Perturbation.apply": "random numbers are drawn for the batch in its order",
    "recognition.recognizer.Recognizer.score": "a score of the whole set",
    "recognition.two_stage_search.TwoStageSearch.recognize": "of large libraries; see test_two_stage_search.py",
    "similarity.comparison.StoredReferences.reduced_at": "reads stored rows",
    "similarity.scores.Compared.with_squares": "of large libraries; see test_two_stage_search.py",
    "similarity.describe.Described.empty": "holds nothing yet",
    "similarity.describe.Described.put": "writes rows that are described already; see test_two_stage_search.py",
    "kernels.procrustes.Prepared.empty": "holds nothing yet",
    "kernels.pair_distances.Shapes.put": "writes rows that are described already; see test_two_stage_search.py",
    "similarity.comparison.HeldReferences.described": "reads stored rows",
    "similarity.comparison.StoredReferences.described": "reads stored rows",
    "similarity.scores.most_similar": "what predict asks, see test_most_similar.py",
    "similarity.scores.nearest_above": "bounds, some of them tighter in company; see test_most_similar.py",
    "similarity.similarity.similarities": "of pairs of the batch",
    "recognition.early.evidence.PredictsPartial.predict_partial": "a protocol; the recognizer is in the table",
    "recognition.compared_windows.surroundings": "windows of one recording by contract",
    "recognition.compared_windows.compare_windows": "windows of one recording by contract",
    "recognition.compared_windows.compare_candidates": "windows of one recording by contract",
    "recognition.compared_windows.Candidates.weighted": "windows of one recording by contract",
    "recognition.compared_windows.size_and_slowness": "windows of one recording by contract",
    "recognition.explanation.Transform.apply": "one movement by contract",
    "dmp.contextual.Contextual.fit": "a regression over the batch; see test_contextual.py",
    "dmp.discrete.encode.choose": "one specification for the whole batch; see test_choose.py",
    "dmp.discrete.encode.relative_paths": "of `choose`, subsampled from the whole batch",
    "dmp.discrete.encode.score": "one score of the whole batch",
    "dmp.discrete.dmp.DMP.choose": "one specification for the whole batch; see test_choose.py",
    "dmp.styles.average.average": "a mean of the batch; see test_order_of_training.py",
    "dmp.styles.average.AveragePrimitive.log_likelihood": "one by one, too, in test_likelihood.py",
    "dmp.styles.parameters.as_primitives": "`DMP.learn`, or what it is given, in one turn; see test_whole_turns.py",
    "dmp.styles.parameters.without_turns": "turns of the whole batch; see test_whole_turns.py",
    "dmp.styles.parameters.with_numbers": "`from_numbers`, with what all have in common",
    "dmp.styles.parameters.shared_recording": "what a whole batch was recorded as; see test_recorded_as.py",
    "dmp.styles.average.encoded": "of `AveragePrimitive.blend`, one average",
    "dmp.styles.average.average_by_label": "means of the batch, by `average`",
    "dmp.styles.model.learn_styles": "what differs within the batch; see test_order_of_training.py",
    "movements.trajectories.collect.collect_trajectories": "joins arrays that the table's movements are made of",
    "movements.trajectories.demonstrations.require_labels": "hands out labels, or raises",
    "movements.preparation.trim.Step.apply": "a protocol; the steps are in the table",
    "movements.trajectories.trajectory.Trajectory.n_dims": "of one movement; its length counts samples",
}


def _discovered():
    """Code objects of public functions with such a parameter, and of what public batches can do: name -> code."""
    found = {}
    for info in pkgutil.walk_packages(kineme.__path__, "kineme."):
        parts = info.name.split(".")
        if any(part.startswith("_") for part in parts) or not OTHER_PARTS.keys().isdisjoint(
            {parts[1], ".".join(parts[1:3])}
        ):
            continue
        module = importlib.import_module(info.name)
        for name, thing in vars(module).items():
            if name.startswith("_") or getattr(thing, "__module__", None) != info.name:
                continue
            where = ".".join([*parts[1:], name])
            if inspect.isfunction(thing):
                if MANY & set(inspect.signature(thing).parameters):
                    found[where] = thing.__code__
            elif inspect.isclass(thing):
                found |= {f"{where}.{key}": code for key, code in _methods(thing).items()}
    return found


def _methods(cls):
    """Public methods that take many movements; of a class with a length all that it can do, properties too."""
    holds_many = hasattr(cls, "__len__")
    codes = {}
    for key, value in vars(cls).items():
        if key.startswith("_") and key != "__call__":
            continue
        if isinstance(value, property):
            function, takes_many = value.fget, holds_many
        elif isinstance(value, cached_property):
            function, takes_many = value.func, holds_many
        else:
            function = value.__func__ if isinstance(value, (classmethod, staticmethod)) else value
            if not inspect.isfunction(function):
                continue
            takes_many = holds_many or bool(MANY & set(inspect.signature(function).parameters))
        if takes_many and not getattr(function, "__isabstractmethod__", False):
            codes[key] = inspect.unwrap(function).__code__
    return codes


def _called(patch):
    """Code objects that the rows of the table run, plain but for what is calibrated once, which takes seconds plain."""
    called = set()

    def note(frame, event, _):
        if event == "call":
            called.add(frame.f_code)

    drawn = [(20 + 7 * i, i, ("even", "jitter", "random", "coincident")[i % 4], 0, i) for i in range(5)]
    recognizer.cache_clear()
    threading.setprofile(note)
    sys.setprofile(note)
    try:
        patch.setenv("KINEME_COMPILED", "always")
        partly_seen(reaches(drawn))
        patch.setenv("KINEME_COMPILED", "never")
        for row in TABLE:
            row.call(row.draw(drawn))
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return called


@pytest.fixture(scope="module")
def missing():
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
        warnings.simplefilter("ignore", kineme.errors.DegenerateMovementWarning)
        called = _called(patch)
    return {name for name, code in _discovered().items() if code not in called}


def test_every_function_of_a_batch_is_in_the_table(missing):
    unnamed = sorted(missing - EXEMPT.keys())
    assert not unnamed, ", ".join(unnamed)


def test_exemptions_are_needed(missing):
    assert sorted(EXEMPT.keys() - missing) == []


def test_parts_left_out_exist():
    assert set(OTHER_PARTS) <= {
        info.name.removeprefix("kineme.") for info in pkgutil.walk_packages(kineme.__path__, "kineme.")
    }
