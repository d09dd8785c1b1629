"""A new record: what follows from its layout, its types and the annotations of what makes and draws it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
import xarray

from cellmap._lib.arrays import Floats, Ints
from cellmap._lib.records import Array, ConvertsToDataFrame, ConvertsToXarray, Layout
from cellmap.attractors.labels import Label
from cellmap.exchange import from_xarray, to_dataframe
from cellmap.exchange.records import _Read


@dataclass(frozen=True, eq=False)
class Decay(ConvertsToXarray, ConvertsToDataFrame):
    """Numbers over a parameter."""

    _layout: ClassVar = Layout(
        "Decay of {0.name}",
        {"values": Array("{parameter}", "{0.parameter}", "{parameter}")},
        {"rate": Array("{parameter}", "rate of decay", unit="1/s"), "ends": Array("{parameter}", flags=Label)}
        | {name: Array("{parameter}") for name in ("steps", "orders", "words", "errors")},
        {"bound": "upper_bound"},
    )
    _made_by: ClassVar = "decay_of"

    name: str
    parameter: str
    values: Floats
    rate: Floats
    ends: Ints
    bound: float = 1.0
    steps: tuple[float, ...] = (0.25, 1e6)
    orders: tuple[int, ...] = (70_000, -1)
    words: tuple[str, ...] = ("a", "b")
    errors: Floats | None = None
    limit: float | None = None
    sure: bool = False


DECAY = Decay("rods", "my rate", np.array([1.0, 2.0]), np.array([0.5, 0.25]), np.array([-1, -2]), 3.0)


def test_variables_attributes_and_a_table_follow():
    found = DECAY.to_xarray()
    assert found.attrs["title"] == "Decay of rods" and found.attrs["record"] == "Decay"
    assert (found.attrs["system"], found.attrs["upper_bound"], found.attrs["parameter"]) == ("rods", 3.0, "my rate")
    assert found["rate"].dims == ("my_rate",) and found["rate"].attrs == {"long_name": "rate of decay", "units": "1/s"}
    assert found["my_rate"].attrs == {"long_name": "my rate"} and "my_rate" in found.coords
    assert found["ends"].attrs["flag_values"].tolist()[0] == int(next(iter(Label)))
    assert "errors" not in found and "limit" not in found.attrs
    table = to_dataframe(DECAY)
    assert table["rate"].tolist() == [0.5, 0.25] and "errors" not in table


def test_it_is_read_by_its_types(tmp_path):
    again = _Read(DECAY.to_xarray()).record(Decay)
    assert (again.name, again.parameter, again.bound) == ("rods", "my rate", 3.0)
    assert again.rate.dtype == np.float64 and again.ends.tolist() == [-1, -2]
    assert (again.steps, again.orders, again.words) == (DECAY.steps, DECAY.orders, DECAY.words)
    assert (again.errors, again.limit, again.sure) == (None, None, False)
    other = replace(DECAY, errors=np.array([0.1, 0.2]), limit=2.0, sure=True)
    other.to_xarray().to_netcdf(tmp_path / "decay.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "decay.nc", engine="h5netcdf") as file:
        again = _Read(file.load()).record(Decay)
    assert (again.errors.tolist(), again.limit, again.sure, again.words) == ([0.1, 0.2], 2.0, True, ("a", "b"))
    with pytest.raises(ValueError, match="rate is int64"):
        _Read(DECAY.to_xarray().assign(rate=DECAY.to_xarray()["rate"].astype(np.int64))).record(Decay)
    with pytest.raises(ValueError, match="record='Decay': give what to_xarray"):
        from_xarray(DECAY.to_xarray())  # which is no public record
