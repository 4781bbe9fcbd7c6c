"""Answers requests about maps, and hands the map in use to navigation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

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
from rackhand.services.planner.map.grid import StaticMap
from rackhand.services.planner.map.store import MapStore, unstored
from rackhand.services.planner.perception.local_costmap import LocalCostmap

T = TypeVar("T")


class MapUser(Protocol):
    """What drives by the map in use."""

    def loads(self, data: MapData) -> Callable[[], LocalCostmap]:
        """What takes seconds of using a large map, to be called in any thread; raises as ``set_map``."""

    def loads_overlays(self, data: MapData) -> Callable[[], StaticMap]:
        """The same of using the map in use with other overlays."""

    def set_map(self, data: MapData | None, loaded: LocalCostmap | None = None) -> None:
        """Use this map, as it was ``loaded`` or is now.

        Raises ``MoveFailed(GET_MAP_FAILED)`` for a map that cannot be read; the one before is then still in use.
        """

    def set_overlays(self, data: MapData, loaded: StaticMap | None = None) -> None:
        """The map in use with other overlays; arguments and errors as of ``set_map``."""


@dataclass(frozen=True)
class Made:
    """What was done of a request beforehand: it was checked, and what is to be used was loaded from ``source``: a
    stored map, a map that the request holds, or the map in use whose overlays change."""

    source: object
    costmap: LocalCostmap | None = None
    static: StaticMap | None = None


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

    def work(self, request: MapRequest) -> Callable[[], Made] | None:
        """What takes long of a request: may be called in any thread, and its result given to ``answer``. It raises
        ``RequestRefused``, as this does. None for a request that takes no time."""
        match request.request:
            case CreateMap() as created:
                return lambda: _checked(created)
            case ReplaceMap(map=whole):
                return lambda: _checked(whole)
            case UseMapData(map=created):
                loads = self._user.loads(unstored(created, 0))
                return lambda: Made(_checked(created).source, costmap=_usable(loads))
            case SelectMap(id=map_id, uid=uid) as choice if map_id is not None or uid is not None:
                data = self._chosen(choice)
                loads = self._user.loads(data)
                return lambda: Made(data, costmap=_usable(loads))
            case ChangeOverlays(overlays=overlays):
                check_overlays(overlays)
                if self.current is None:
                    raise RequestRefused(RefusalCode.NOT_FOUND, "no map is in use")
                current = self.current
                loads_overlays = self._user.loads_overlays(self._store.with_overlays(overlays, 0))
                return lambda: Made(current, static=_usable(loads_overlays))
        return None

    def answer(self, request: MapRequest, now: int, made: Made | None = None) -> MapReply:
        """Raises ``RequestRefused``; then nothing has changed. ``made``: what ``work`` made of it, if it was called."""
        if made is None and (work := self.work(request)) is not None:
            made = work()
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
                return MapReply(data=self._store.create(created, now))
            case ReplaceMap(id=map_id, map=whole):
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
                data = self._chosen(choice)
                return self._use(data, _costmap(made, data))
            case ChangeOverlays(overlays=overlays):
                return self._change_overlays(overlays, now, made)
            case UseMapData(map=created):
                return self._use(unstored(created, now), _costmap(made, created))

    def _chosen(self, choice: SelectMap) -> MapData:
        data = self._store.get_by_uid(choice.uid or "") if choice.id is None else self._store.get(choice.id)
        if choice.uid is not None and choice.uid != data.uid:
            raise RequestRefused(RefusalCode.INVALID, f"map {data.id} has the uid {data.uid!r}, not {choice.uid!r}")
        return data

    def _change_overlays(self, overlays: Overlays, now: int, made: Made | None) -> MapReply:
        """Not a change of map: what was observed on it stays, and a move goes on."""
        if self.current is None:
            raise RequestRefused(RefusalCode.NOT_FOUND, "no map is in use")
        data = self._store.with_overlays(overlays, now)
        try:
            self._user.set_overlays(data, made.static if made is not None and made.source is self.current else None)
        except MoveFailed as failed:
            raise _unusable(failed) from None
        self._store.use_overlays(data)
        return MapReply(data=data)

    def _use(self, data: MapData | None, loaded: LocalCostmap | None = None) -> MapReply:
        """Selecting counts as a change even if it is the same map: it is how patched overlays are taken up."""
        try:
            self._user.set_map(data, loaded)
        except MoveFailed as failed:
            raise _unusable(failed) from None
        self._store.use(None if data is None else data.model_copy(update={"carto_map": ""}))
        self.trouble = None
        self.changes += 1
        return MapReply(data=data)


def _checked(created: CreateMap) -> Made:
    check_map(created)
    return Made(created)


def _usable(loads: Callable[[], T]) -> T:
    try:
        return loads()
    except MoveFailed as failed:
        raise _unusable(failed) from None


def _unusable(failed: MoveFailed) -> RequestRefused:
    return RequestRefused(RefusalCode.INVALID, f"the map is not usable for navigation: {failed.text}")


def _costmap(made: Made | None, source: object) -> LocalCostmap | None:
    """What was loaded from that very map; None if it has changed since, and must be loaded again."""
    return made.costmap if made is not None and made.source is source else None
