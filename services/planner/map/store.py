"""Maps in memory and in SQLite: the stored ones, and the one in use as it was when it was chosen."""

from __future__ import annotations

import hashlib
from collections import deque
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from pydantic import ValidationError

from rackhand.runtime.store import Settled, Store
from rackhand.schemas.codec import explain
from rackhand.schemas.maps import CreateMap, MapData, MapSummary, Overlays, PatchMap
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.database import Database
from rackhand.services.planner.errors import StoreError
from rackhand.services.planner.map.directory import DirectoryMap

NOT_STORED = -1
_DIRECTORY_UID = "map_directory_uid"
_INSERT = "INSERT INTO maps (id, uid, record, png) VALUES (?, ?, ?, ?)"
_UPDATE = "UPDATE maps SET uid = ?, record = ? WHERE id = ?"
_UPDATE_PNG = "UPDATE maps SET png = ? WHERE id = ?"
_DELETE = "DELETE FROM maps WHERE id = ?"
_USE = "INSERT OR REPLACE INTO current_map VALUES (1, ?, ?)"
_USE_NONE = "DELETE FROM current_map"
_SET_META = "INSERT OR REPLACE INTO meta VALUES (?, ?)"

Statement = tuple[str, tuple[Any, ...]]


@dataclass(frozen=True)
class MapTable:
    """All stored maps by id, ascending; the one in use; the highest id that was ever used."""

    maps: dict[int, MapData] = field(default_factory=dict)
    current: MapData | None = None
    last_id: int = 0


class MapStore:
    """The maps of a store. Ids are never used twice. All requests raise ``RequestRefused`` saying why not.

    The map in use is a copy: patching or deleting the stored one does not change what the robot drives by, until it is
    selected again. Maps are to be checked (``map_check``) before they come here. While the planner runs, memory is the
    truth: nothing here waits for the disk. A change that cannot be written is undone by ``settle``.
    """

    def __init__(self, store: Store[Database]) -> None:
        self._store = store
        self._table = self._written = store.call(_load)
        self._unwritten: deque[tuple[int, MapTable]] = deque()  # numbers of jobs, and the table after each

    @property
    def current(self) -> MapData | None:
        return self._table.current

    def list(self) -> tuple[MapSummary, ...]:
        return tuple(_summary(data) for data in self._table.maps.values())

    def get(self, map_id: int) -> MapData:
        data = self._table.maps.get(map_id)
        if data is None:
            raise RequestRefused(RefusalCode.NOT_FOUND, f"there is no map {map_id}")
        return data

    def get_by_uid(self, uid: str) -> MapData:
        for data in self._table.maps.values():
            if data.uid == uid:
                return data
        raise RequestRefused(RefusalCode.NOT_FOUND, f"there is no map with uid {uid!r}")

    def create(self, created: CreateMap, now: int) -> MapData:
        self._check_uid(created.uid)
        data = _to_data(created, self._table.last_id + 1, now)
        table = replace(self._table, maps=self._table.maps | {data.id: data}, last_id=data.id)
        self._change(table, (_INSERT, (data.id, data.uid, _record(data), data.png)))
        return data

    def overwrite(self, map_id: int, whole: CreateMap, now: int) -> MapData:
        """Put a whole map in place of a stored one; its id and creation time stay, and its uid unless one is given."""
        old = self.get(map_id)
        self._check_uid(whole.uid, map_id)
        data = _to_data(whole.model_copy(update={"uid": whole.uid or old.uid}), map_id, now)
        data = data.model_copy(update={"create_time": old.create_time})
        table = replace(self._table, maps=self._table.maps | {map_id: data})
        self._change(table, (_UPDATE, (data.uid, _record(data), map_id)), (_UPDATE_PNG, (data.png, map_id)))
        return data

    def _check_uid(self, uid: str | None, map_id: int | None = None) -> None:
        """No two maps have one uid; ``map_id`` is the one that may have it."""
        taken = next((data.id for data in self._table.maps.values() if data.uid == uid and data.id != map_id), None)
        if taken is not None:
            raise RequestRefused(RefusalCode.INVALID, f"uid: {uid!r} is already that of map {taken}")

    def patch(self, patch: PatchMap, now: int) -> MapData:
        data = self.get(patch.id)
        update: dict[str, object] = {"last_modified_time": max(now, data.last_modified_time)}
        if patch.overlays is not None:
            update["overlays_version"] = data.overlays_version + 1
        update |= patch.model_dump(exclude={"op", "id"}, exclude_none=True)
        if patch.overlays is not None:
            update["overlays"] = patch.overlays  # with whatever nulls it holds
        data = data.model_copy(update=update)
        table = replace(self._table, maps=self._table.maps | {data.id: data})
        self._change(table, (_UPDATE, (data.uid, _record(data), data.id)))
        return data

    def delete(self, map_id: int) -> bool:
        """True if it was the map in use: that goes on as one that is not stored."""
        self.get(map_id)
        table = replace(self._table, maps={key: data for key, data in self._table.maps.items() if key != map_id})
        in_use = self.current is not None and self.current.id == map_id
        statements: list[Statement] = [(_DELETE, (map_id,))]
        if in_use and self.current is not None:
            table = replace(table, current=self.current.model_copy(update={"id": NOT_STORED}))
            statements.append(_use(table.current))
        self._change(table, *statements)
        return in_use

    def use(self, data: MapData | None) -> None:
        """Choose the map in use; it is still so after a restart."""
        self._change(replace(self._table, current=data), _use(data))

    def with_overlays(self, overlays: Overlays, now: int) -> MapData:
        """The map in use with other overlays, of the next version; nothing is changed yet."""
        assert self.current is not None
        update = {
            "overlays": overlays,
            "overlays_version": self.current.overlays_version + 1,
            "last_modified_time": max(now, self.current.last_modified_time),
        }
        return self.current.model_copy(update=update)

    def use_overlays(self, data: MapData) -> None:
        """Use what ``with_overlays`` made, and store its overlays with the map that it is, where there is one."""
        statements, maps = [_use(data)], self._table.maps
        stored = maps.get(data.id)
        if stored is not None:
            kept = {"overlays", "overlays_version", "last_modified_time"}
            stored = stored.model_copy(update={name: getattr(data, name) for name in kept})
            maps = maps | {data.id: stored}
            statements.append((_UPDATE, (stored.uid, _record(stored), stored.id)))
        self._change(replace(self._table, maps=maps, current=data), *statements)

    def import_directory(self, found: DirectoryMap, select: bool = True) -> bool:
        """Store the map of a directory and choose it (unless ``select`` is false, as for further floors), if the last
        start did not do that with the very same map.

        So a choice made since then persists, and a world that was changed or swapped is taken up. For start-up: it
        waits for the disk, and raises what goes wrong there.
        """
        uid, key = found.map.uid, _DIRECTORY_UID if select else f"{_DIRECTORY_UID} {found.map.map_name}"
        if uid is None or self._store.call(lambda database: database.get(key)) == uid:
            return False
        data = next((data for data in self._table.maps.values() if data.uid == uid), None)
        statements: list[Statement] = []
        table = self._table
        if data is None:
            data = _to_data(found.map, table.last_id + 1, found.changed)
            table = replace(table, maps=table.maps | {data.id: data}, last_id=data.id)
            statements.append((_INSERT, (data.id, data.uid, _record(data), data.png)))
        if select:
            statements.append(_use(data))
            table = replace(table, current=data)
        statements.append((_SET_META, (key, uid)))
        self._store.call(partial(_execute, statements=tuple(statements)))
        self._table = self._written = table
        return True

    def settle(self, settled: Settled) -> bool:
        """The disk's answer to a job. True if a change could not be written: the maps are as they were before it, and
        before all changes since."""
        if not any(number == settled.number for number, _ in self._unwritten):
            return False
        if settled.error is not None:
            self._table = self._written
            self._unwritten.clear()
            return True
        while self._unwritten and self._unwritten[0][0] <= settled.number:
            _, self._written = self._unwritten.popleft()
        return False

    def _change(self, table: MapTable, *statements: Statement) -> None:
        number = self._store.submit(partial(_execute, statements=statements))
        self._table = table
        if number:
            self._unwritten.append((number, table))
        else:
            self._written = table


def unstored(created: CreateMap, now: int) -> MapData:
    """A map given whole, to be used and not kept among the stored ones."""
    return _to_data(created, NOT_STORED, now)


def _load(database: Database) -> MapTable:
    rows = database.connection.execute("SELECT id, record, png FROM maps ORDER BY id")
    maps = {row[0]: _read(*row) for row in rows}
    current = database.connection.execute("SELECT record, png FROM current_map").fetchone()
    return MapTable(maps, None if current is None else _read("in use", *current), database.last_id("maps"))


def _execute(database: Database, statements: tuple[Statement, ...]) -> None:
    with database.transaction() as connection:
        for sql, values in statements:
            connection.execute(sql, values)


def _use(data: MapData | None) -> Statement:
    return (_USE_NONE, ()) if data is None else (_USE, (_record(data), data.png))


def _to_data(created: CreateMap, map_id: int, now: int) -> MapData:
    digest = hashlib.sha256(f"{map_id} {created.map_name} {created.origin} {created.resolution}".encode() + created.png)
    fields = created.model_dump(exclude={"op"}) | {"uid": created.uid or digest.hexdigest()[:24]}
    return MapData(**fields, id=map_id, create_time=now, last_modified_time=now)


def _summary(data: MapData) -> MapSummary:
    return MapSummary(**data.model_dump(include=set(MapSummary.model_fields)))


def _record(data: MapData) -> str:
    return data.model_dump_json(exclude={"png"})


def _read(map_id: int | str, record: str, png: bytes) -> MapData:
    try:
        return MapData.model_validate_json(record[:-1] + ',"png":""}').model_copy(update={"png": png})
    except ValidationError as error:
        raise StoreError(f"map {map_id} in the store cannot be read: {explain(error)}") from error
