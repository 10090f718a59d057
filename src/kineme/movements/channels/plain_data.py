"""Channels as plain data, for headers of files."""

from __future__ import annotations

import math
from typing import Any

from kineme.movements.channels.channel import KINDS, ORDERS, Channel, Channels


def channels_to_data(channels: Channels) -> list[dict[str, Any]]:
    """A list of objects with the fields of `Channel`, as JSON can hold them."""
    return [one._asdict() | {"columns": list(one.columns)} for one in channels]


def channels_from_data(data: Any, n_dims: int) -> Channels:
    """The inverse, of movements of so many dimensions.

    Raises
    ------
    ValueError, TypeError, KeyError, AttributeError
        What is no list of channels of so many coordinates; callers name the file.
    """
    channels = tuple(_channel(one) for one in data)
    if sum(len(one.coordinates) for one in channels) != n_dims:
        raise ValueError(f"channels should have {n_dims} coordinates")
    return channels


def _channel(one: dict[str, Any]) -> Channel:
    columns, unit = tuple(one["columns"]), one["unit"]
    period = one.get("period", 0.0)  # earlier versions did not say it
    channel = Channel(one["name"], one["kind"], columns, unit, one["order"], period)
    texts = [channel.name, *columns, *([] if unit is None else [unit])]
    sized = len(columns) == (4 if channel.kind == "orientation" else 1)
    ordered = channel.order in ORDERS if channel.kind == "orientation" else channel.order == ""
    periodic = period is None or (isinstance(period, float) and math.isfinite(period) and period >= 0)
    told = periodic and all(isinstance(text, str) for text in texts)
    if channel.kind not in KINDS or not (sized and ordered and told):
        raise ValueError("channels should have a name, a kind, columns, a unit, an order and a period")
    return channel
