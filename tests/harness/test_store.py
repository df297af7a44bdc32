"""The store: whole files or none, forgetting, and a place for runs that name none."""

import os
import time

from nanobench_tools.harness.store import Store, encode, user_store


def test_values_come_back_as_they_went_in(tmp_path):
    value = encode({"a": float("nan"), "b": [1, 2.5, None, "ä"], "inf": float("inf"), "t": (1, 2)})
    Store(tmp_path).put("k", value, "label")
    assert repr(Store(tmp_path).get("k")) == repr(value)
    assert Store(tmp_path).get("other") is None


def test_a_file_under_the_wrong_key_is_not_believed(tmp_path):
    store = Store(tmp_path)
    store.put("a", {"x": 1})
    os.rename(store.path("a"), store.path("b"))
    assert store.get("b") is None


def test_a_store_forgets_what_nobody_asked_for(tmp_path):
    store = Store(tmp_path)
    for key in ("old", "asked"):
        store.put(key, {})
        os.utime(store.path(key), (0, time.time() - 40 * 86400))
    assert store.get("asked") == {}
    again = Store(tmp_path, keep_days=30)
    assert again.get("asked") == {}
    assert again.get("old") is None
    assert not store.path("old").exists()


def test_a_run_without_a_cache_folder_still_runs(tmp_path, monkeypatch):
    monkeypatch.setenv("NANOBENCH_CACHE", str(tmp_path / "cache"))
    assert user_store() == tmp_path / "cache" / "items"
    (tmp_path / "file").touch()
    monkeypatch.setenv("NANOBENCH_CACHE", str(tmp_path / "file"))
    assert user_store() is None
