from __future__ import annotations

import sys

import pytest

import xrds_core
from xrds_core import errors


def test_every_public_name_is_there() -> None:
    for name in xrds_core.__all__:
        assert callable(getattr(xrds_core, name))
        assert name in dir(xrds_core)


def test_what_a_missing_torch_costs_is_one_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in [name for name in sys.modules if name.startswith("xrds_core.superres")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(vars(xrds_core), "Upscaler", raising=False)
    monkeypatch.setitem(sys.modules, "torch", None)
    told = r"^Upscaler needs torch, which is not installed: run pip install xrds\[net"
    with pytest.raises(xrds_core.XRDSError, match=told):
        _ = xrds_core.Upscaler


def test_other_names_are_not() -> None:
    with pytest.raises(AttributeError, match="no attribute 'downscale'"):
        _ = xrds_core.downscale


def test_all_errors_can_be_caught_as_one() -> None:
    found = [x for x in vars(errors).values() if isinstance(x, type)]
    found = [x for x in found if x.__module__ == errors.__name__]
    assert len(found) > 4
    assert all(issubclass(error, xrds_core.XRDSError) for error in found)
    assert str(errors.Cancelled()) == "cancelled"
