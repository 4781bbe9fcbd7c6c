"""Maps in SQLite: the stored ones, and the one in use as it was when it was chosen."""

from __future__ import annotations

import hashlib

from pydantic import ValidationError

from rackhand.schemas.codec import explain
from rackhand.schemas.maps import CreateMap, MapData, MapSummary, PatchMap
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.database import Database
from rackhand.services.planner.errors import StoreError
from rackhand.services.planner.map.directory import DirectoryMap

NOT_STORED = -1
_DIRECTORY_UID = "map_directory_uid"


class MapStore:
    """The maps of a store. Ids are never used twice. All requests raise ``RequestRefused`` saying why not.

    The map in use is a copy: patching or deleting the stored one does not change what the robot drives by, until it is
    selected again. Maps are to be checked (``map_check``) before they come here.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self.current: MapData | None = self._read_current()

    def list(self) -> tuple[MapSummary, ...]:
        rows = self._database.connection.execute("SELECT id, record FROM maps ORDER BY id")
        return tuple(_summary(_read(map_id, record, b"")) for map_id, record in rows)

    def get(self, map_id: int) -> MapData:
        return self._find("id", map_id if -(2**63) <= map_id < 2**63 else 0, f"there is no map {map_id}")

    def get_by_uid(self, uid: str) -> MapData:
        return self._find("uid", uid, f"there is no map with uid {uid!r}")

    def create(self, created: CreateMap, now: int) -> MapData:
        with self._database.transaction() as connection:
            taken = connection.execute("SELECT id FROM maps WHERE uid = ?", (created.uid,)).fetchone()
            if taken:
                raise RequestRefused(RefusalCode.INVALID, f"uid: {created.uid!r} is already that of map {taken[0]}")
            # A placeholder first: the id is part of what a generated uid is made from.
            cursor = connection.execute("INSERT INTO maps (uid, record, png) VALUES ('', '', ?)", (created.png,))
            data = _to_data(created, int(cursor.lastrowid or 0), now)
            self._write(data)
        return data

    def replace(self, map_id: int, whole: CreateMap, now: int) -> MapData:
        """Overwrite a map; it keeps its id and creation time, and its uid unless another is given."""
        old = self.get(map_id)
        uid = whole.uid or old.uid
        with self._database.transaction() as connection:
            taken = connection.execute("SELECT id FROM maps WHERE uid = ? AND id != ?", (uid, map_id)).fetchone()
            if taken:
                raise RequestRefused(RefusalCode.INVALID, f"uid: {uid!r} is already that of map {taken[0]}")
            data = _to_data(whole.model_copy(update={"uid": uid}), map_id, now)
            data = data.model_copy(update={"create_time": old.create_time})
            connection.execute("UPDATE maps SET png = ? WHERE id = ?", (whole.png, map_id))
            self._write(data)
        return data

    def patch(self, patch: PatchMap, now: int) -> MapData:
        data = self.get(patch.id)
        update: dict[str, object] = {"last_modified_time": max(now, data.last_modified_time)}
        if patch.overlays is not None:
            update["overlays_version"] = data.overlays_version + 1
        update |= patch.model_dump(exclude={"op", "id"}, exclude_none=True)
        if patch.overlays is not None:
            update["overlays"] = patch.overlays  # with whatever nulls it holds
        data = data.model_copy(update=update)
        self._write(data)
        return data

    def delete(self, map_id: int) -> bool:
        """True if it was the map in use: that goes on as one that is not stored."""
        self.get(map_id)
        with self._database.transaction() as connection:
            connection.execute("DELETE FROM maps WHERE id = ?", (map_id,))
            if self.current is None or self.current.id != map_id:
                return False
            self.use(self.current.model_copy(update={"id": NOT_STORED}))
        return True

    def use(self, data: MapData | None) -> None:
        """Choose the map in use; it is still so after a restart."""
        connection = self._database.connection
        if data is None:
            connection.execute("DELETE FROM current_map")
        else:
            connection.execute("INSERT OR REPLACE INTO current_map VALUES (1, ?, ?)", (_record(data), data.png))
        self.current = data

    def import_directory(self, found: DirectoryMap) -> bool:
        """Store and choose the map of a directory, unless the last start did that with the very same map.

        So a choice made since then persists, and a world that was changed or swapped is taken up.
        """
        uid = found.map.uid
        if uid is None or self._database.get(_DIRECTORY_UID) == uid:
            return False
        try:
            data = self.get_by_uid(uid)
        except RequestRefused:
            data = self.create(found.map, found.changed)
        with self._database.transaction():
            self.use(data)
            self._database.set(_DIRECTORY_UID, uid)
        return True

    def _find(self, column: str, value: int | str, missing: str) -> MapData:
        rows = self._database.connection.execute(f"SELECT id, record, png FROM maps WHERE {column} = ?", (value,))
        for row in rows:
            return _read(*row)
        raise RequestRefused(RefusalCode.NOT_FOUND, missing)

    def _write(self, data: MapData) -> None:
        self._database.connection.execute(
            "UPDATE maps SET uid = ?, record = ? WHERE id = ?", (data.uid, _record(data), data.id)
        )

    def _read_current(self) -> MapData | None:
        row = self._database.connection.execute("SELECT record, png FROM current_map").fetchone()
        return None if row is None else _read("in use", *row)


def unstored(created: CreateMap, now: int) -> MapData:
    """A map given whole, to be used and not kept among the stored ones."""
    return _to_data(created, NOT_STORED, now)


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
