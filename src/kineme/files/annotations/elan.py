"""Annotations as a document of ELAN, in its Annotation Format 3.0."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from kineme.errors import DataError
from kineme.files.annotations.annotation import Annotation
from kineme.files.annotations.audacity import UNKNOWN
from kineme.output.atomic import write_atomically
from kineme.output.text import printable

_SCHEMA = {
    "xmlns:xsi": "http://www.w3.org/2001/XMLSchema-instance",
    "xsi:noNamespaceSchemaLocation": "http://www.mpi.nl/tools/elan/EAFv3.0.xsd",
}
_ASSOCIATION = "Symbolic_Association"
_MEANING = "1-1 association with a parent annotation"

#: Tiers below that of the symbols: one annotation each for every annotation of it.
_DEPENDENT: dict[str, Callable[[Annotation], str]] = {
    "p-value": lambda one: f"{one.p_value:.3g}",
    "confidence": lambda one: f"{one.confidence:.3g}",
}


def write_elan(path: Path, annotations: Sequence[Annotation], source: Path | None) -> Path:
    """Write a document with the tier ``symbol`` and, below it, tiers with p-values and confidences.

    Times are milliseconds since the first sample. Unknown motion is annotated as ``unknown``.

    Raises
    ------
    DataError
        A time before the first sample: the format has no negative times.
    """
    root = Element(
        "ANNOTATION_DOCUMENT",
        {"AUTHOR": "", "DATE": datetime.now(UTC).isoformat(timespec="seconds"), "FORMAT": "3.0", "VERSION": "3.0"}
        | _SCHEMA,
    )
    SubElement(root, "HEADER", MEDIA_FILE="", TIME_UNITS="milliseconds")
    order = SubElement(root, "TIME_ORDER")
    tier = SubElement(root, "TIER", LINGUISTIC_TYPE_REF="symbol", TIER_ID="symbol")
    for k, one in enumerate(annotations, 1):
        start, end = _milliseconds(one)
        slots = {f"TIME_SLOT_REF{i}": f"ts{2 * k - 2 + i}" for i in (1, 2)}
        for slot, value in zip(slots.values(), (start, end), strict=True):
            SubElement(order, "TIME_SLOT", TIME_SLOT_ID=slot, TIME_VALUE=str(value))
        ids = {"ANNOTATION_ID": f"a{k}"} | slots
        aligned = SubElement(SubElement(tier, "ANNOTATION"), "ALIGNABLE_ANNOTATION", ids)
        SubElement(aligned, "ANNOTATION_VALUE").text = UNKNOWN if one.symbol is None else printable(one.symbol)
    for number, (name, text) in enumerate(_DEPENDENT.items(), 1):
        below = SubElement(root, "TIER", LINGUISTIC_TYPE_REF="number", PARENT_REF="symbol", TIER_ID=name)
        for k, one in enumerate(annotations, 1):
            ids = {"ANNOTATION_ID": f"a{number * len(annotations) + k}", "ANNOTATION_REF": f"a{k}"}
            referring = SubElement(SubElement(below, "ANNOTATION"), "REF_ANNOTATION", ids)
            SubElement(referring, "ANNOTATION_VALUE").text = text(one)
    _types(root)
    indent(root, " ")
    return write_atomically(path, tostring(root, "UTF-8", xml_declaration=True) + b"\n")


def _types(root: Element) -> None:
    plain = {"GRAPHIC_REFERENCES": "false"}
    SubElement(root, "LINGUISTIC_TYPE", plain, LINGUISTIC_TYPE_ID="symbol", TIME_ALIGNABLE="true")
    below = {"CONSTRAINTS": _ASSOCIATION, "LINGUISTIC_TYPE_ID": "number", "TIME_ALIGNABLE": "false"}
    SubElement(root, "LINGUISTIC_TYPE", plain | below)
    SubElement(root, "CONSTRAINT", DESCRIPTION=_MEANING, STEREOTYPE=_ASSOCIATION)


def _milliseconds(one: Annotation) -> tuple[int, int]:
    """Start and end, at least a millisecond apart."""
    start, end = (round(1000 * time) for time in one.span)
    if start < 0:
        raise DataError(
            f"expected annotations that start after the first sample of {one.recording}, got one at {start / 1000} s"
        )
    return start, max(end, start + 1)
