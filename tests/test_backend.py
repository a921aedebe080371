"""Choice of the Mitsuba variant, and what is said where LLVM is missing or too old."""

from __future__ import annotations

import logging

import pytest

from shenron_rt.errors import BackendError, InputError
from shenron_rt.tracing import backend as module


@pytest.fixture
def fresh():
    """Forget what was found out, before and after."""

    def clear():
        module.backend_status.cache_clear()
        module._auto.cache_clear()

    clear()
    yield
    clear()


@pytest.fixture
def llvm_version(fresh, monkeypatch):
    import drjit

    if not module.backend_status("llvm").usable:
        pytest.skip("no usable LLVM on this machine")
    module.backend_status.cache_clear()

    def pretend(*version):
        monkeypatch.setattr(drjit.detail, "llvm_version", lambda: version)

    return pretend


def no_cuda(monkeypatch):
    real = module.os.path.exists
    monkeypatch.setattr(module.os.path, "exists", lambda path: path != "/dev/nvidiactl" and real(path))


def test_unknown_backend_gets_a_suggestion():
    with pytest.raises(
        InputError, match=r"unknown backend 'lvm'; did you mean 'llvm'\? known: auto, cuda, llvm, scalar"
    ):
        module.choose_backend("lvm")


def test_scalar_always_works():
    assert module.choose_backend("scalar") == "scalar"
    assert module.backend_status("scalar").usable


@pytest.mark.parametrize("version", [(15, 0, 6), (16, 0, 0), (14, 0, 0)])
def test_an_llvm_that_would_abort_is_refused_with_its_cure(llvm_version, version):
    llvm_version(*version)
    status = module.backend_status("llvm")
    assert not status.usable
    with pytest.raises(BackendError, match=rf"LLVM {version[0]}\.0\.\d+ aborts.*libllvm19.*DRJIT_LIBLLVM_PATH"):
        module.choose_backend("llvm")


def test_auto_falls_back_to_scalar_and_says_so_once(llvm_version, monkeypatch, caplog):
    llvm_version(15, 0, 6)
    no_cuda(monkeypatch)
    with caplog.at_level(logging.WARNING):
        assert [module.choose_backend("auto") for _ in range(3)] == ["scalar"] * 3
    warnings = [r.getMessage() for r in caplog.records if r.levelno == logging.WARNING]
    assert len(warnings) == 1
    assert "apt-get install libllvm19" in warnings[0]


def test_untested_llvm_is_tried_in_a_process_of_its_own(llvm_version, monkeypatch):
    llvm_version(17, 0, 1)
    tried = []
    monkeypatch.setattr(module, "_probe_in_subprocess", lambda: tried.append(1) or False)
    assert not module.backend_status("llvm").usable
    assert tried == [1]


def test_probe_in_a_process_of_its_own_tells_a_crash_from_success(monkeypatch):
    monkeypatch.setattr(module, "_PROBE", "import os; os.abort()")
    assert not module._probe_in_subprocess()
    monkeypatch.setattr(module, "_PROBE", "pass")
    assert module._probe_in_subprocess()


def test_missing_library_becomes_a_status_with_the_cure(fresh, monkeypatch):
    def gone():
        raise RuntimeError("LLVM shared library could not be found")

    monkeypatch.setitem(module._CHECKS, "llvm", gone)
    status = module.backend_status("llvm")
    assert not status.usable
    assert "could not be found" in status.detail
    assert "libllvm19" in status.detail


def test_variant_of_the_caller_is_put_back():
    import mitsuba as mi

    with module.use_backend("scalar"):
        assert mi.variant() == "scalar_rgb"
        with module.use_backend("scalar"):
            pass
        assert mi.variant() == "scalar_rgb"
