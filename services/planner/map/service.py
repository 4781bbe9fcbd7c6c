"""Answers requests about maps, and hands the map in use to navigation."""

from __future__ import annotations

from typing import Protocol

from rackhand.schemas.maps import (
    ChangeOverlays,
    CreateMap,
    DeleteMap,
    GetMap,
    ListMaps,
    MapData,
    MapReply,
    MapRequest,
    Overlays,
    PatchMap,
    ReplaceMap,
    SelectMap,
    UseMapData,
)
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.map.check import check_map, check_overlays
from rackhand.services.planner.map.store import MapStore, unstored


class MapUser(Protocol):
    """What drives by the map in use."""

    def set_map(self, data: MapData | None) -> None:
        """Raises ``MoveFailed(GET_MAP_FAILED)`` for a map that cannot be read; the one before is then still in use."""

    def set_overlays(self, data: MapData) -> None:
        """The map in use with other overlays; raises as ``set_map``."""


class MapService:
    """The map store and what drives by its map, kept in step. ``changes`` counts how often a map was taken into use."""

    def __init__(self, store: MapStore, user: MapUser) -> None:
        self._store = store
        self._user = user
        self.trouble: str | None = None
        self.changes = 0

    @property
    def current(self) -> MapData | None:
        return self._store.current

    def load(self) -> None:
        """Give navigation the map in use again; it drops its observations. A map it cannot read becomes ``trouble``."""
        self.trouble = None
        try:
            self._user.set_map(self.current)
        except MoveFailed as failed:
            self.trouble = failed.text
            self._user.set_map(None)

    def answer(self, request: MapRequest, now: int) -> MapReply:
        """Raises ``RequestRefused``; then nothing has changed."""
        match request.request:
            case ListMaps():
                return MapReply(maps=self._store.list())
            case GetMap(id=int(map_id)):
                return MapReply(data=self._store.get(map_id))
            case GetMap():
                if self.current is None:
                    raise RequestRefused(RefusalCode.NOT_FOUND, "no map is in use")
                return MapReply(data=self.current)
            case CreateMap() as created:
                check_map(created)
                return MapReply(data=self._store.create(created, now))
            case ReplaceMap(id=map_id, map=whole):
                check_map(whole)
                return MapReply(data=self._store.overwrite(map_id, whole, now))
            case PatchMap() as patch:
                if patch.overlays is not None:
                    check_overlays(patch.overlays)
                return MapReply(data=self._store.patch(patch, now))
            case DeleteMap(id=map_id):
                self._store.delete(map_id)
                return MapReply()
            case SelectMap(id=None, uid=None):
                return self._use(None)
            case SelectMap() as choice:
                return self._use(self._chosen(choice))
            case ChangeOverlays(overlays=overlays):
                check_overlays(overlays)
                return self._change_overlays(overlays, now)
            case UseMapData(map=created):
                check_map(created)
                return self._use(unstored(created, now))

    def _chosen(self, choice: SelectMap) -> MapData:
        data = self._store.get_by_uid(choice.uid or "") if choice.id is None else self._store.get(choice.id)
        if choice.uid is not None and choice.uid != data.uid:
            raise RequestRefused(RefusalCode.INVALID, f"map {data.id} has the uid {data.uid!r}, not {choice.uid!r}")
        return data

    def _change_overlays(self, overlays: Overlays, now: int) -> MapReply:
        """Not a change of map: what was observed on it stays, and a move goes on."""
        if self.current is None:
            raise RequestRefused(RefusalCode.NOT_FOUND, "no map is in use")
        data = self._store.with_overlays(overlays, now)
        try:
            self._user.set_overlays(data)
        except MoveFailed as failed:
            raise RequestRefused(RefusalCode.INVALID, f"the map is not usable for navigation: {failed.text}") from None
        self._store.use_overlays(data)
        return MapReply(data=data)

    def _use(self, data: MapData | None) -> MapReply:
        """Selecting counts as a change even if it is the same map: it is how patched overlays are taken up."""
        try:
            self._user.set_map(data)
        except MoveFailed as failed:
            raise RequestRefused(RefusalCode.INVALID, f"the map is not usable for navigation: {failed.text}") from None
        self._store.use(None if data is None else data.model_copy(update={"carto_map": ""}))
        self.trouble = None
        self.changes += 1
        return MapReply(data=data)
