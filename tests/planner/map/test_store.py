"""The map table itself; what requests make of it is in ``test_service``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from rackhand.schemas.maps import PatchMap
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.database import Database
from rackhand.services.planner.map.directory import DirectoryMap
from rackhand.services.planner.map.store import NOT_STORED, MapStore, unstored
from tests.planner.fakes import a_map


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    with Database(tmp_path / "store.sqlite", "amr1") as opened:
        yield opened


def test_maps_are_there_after_the_store_is_opened_again(database: Database) -> None:
    store = MapStore(database)
    one, two = store.create(a_map("one"), 100), store.create(a_map("two"), 101)
    store.use(two)
    again = MapStore(database)
    assert [row.map_name for row in again.list()] == ["one", "two"]
    assert again.get(one.id) == one and again.get_by_uid(two.uid) == two and again.current == two


def test_a_patch_counts_the_overlays_and_never_goes_back_in_time(database: Database) -> None:
    store = MapStore(database)
    made = store.create(a_map("one"), 100)
    patched = store.patch(PatchMap(id=made.id, map_name="other", overlays=made.overlays), 90)
    assert (patched.map_name, patched.overlays_version, patched.last_modified_time) == ("other", 1, 100)
    assert store.patch(PatchMap(id=made.id), 120).overlays_version == 1


def test_the_map_in_use_is_a_copy_and_survives_its_deletion(database: Database) -> None:
    store = MapStore(database)
    made = store.create(a_map("one"), 100)
    store.use(made)
    store.patch(PatchMap(id=made.id, map_name="other"), 101)
    assert store.current == made
    assert store.delete(made.id)
    current = MapStore(database).current
    assert current is not None and (current.id, current.map_name) == (NOT_STORED, "one")
    with pytest.raises(RequestRefused) as refused:
        store.get(made.id)
    assert refused.value.code is RefusalCode.NOT_FOUND


def test_a_directory_is_stored_and_chosen_once(database: Database) -> None:
    found, store = DirectoryMap(a_map("hall", uid="abc"), 50), MapStore(database)
    assert store.import_directory(found) and not store.import_directory(found)
    assert store.current is not None and store.current.uid == "abc" and len(store.list()) == 1


def test_the_map_of_a_further_floor_is_stored_once_and_not_chosen(database: Database) -> None:
    store = MapStore(database)
    assert store.import_directory(DirectoryMap(a_map("hall", uid="abc"), 50))
    upstairs = DirectoryMap(a_map("hall_floor2", uid="def"), 50)
    assert store.import_directory(upstairs, select=False) and not store.import_directory(upstairs, select=False)
    assert store.current is not None and store.current.uid == "abc" and len(store.list()) == 2
    again = MapStore(database)
    assert again.current is not None and again.current.uid == "abc" and len(again.list()) == 2
    assert not again.import_directory(upstairs, select=False)


def test_an_unstored_map_has_the_id_that_says_so() -> None:
    assert unstored(a_map("x"), 5).id == NOT_STORED
