"""A joined world behind a gateway: HTTP and WebSocket clients reach the planner core and the simulator of one process.

All of it runs in the thread of the gateway's event loop: time passes in ``ServedWorld.advance`` only, and never while a
request is answered.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rackhand.bus import Presence, Refused
from rackhand.schemas import topics
from rackhand.schemas.base import Message
from rackhand.schemas.codec import codec_for
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.schemas.service import DRIVER, WORLD, ServiceId
from rackhand.schemas.topics import Query
from rackhand.schemas.world import Contact
from rackhand.services.gateway.settings import Settings
from rackhand.services.gateway.ws.payloads import PAYLOADS
from rackhand.services.sim.simulation import Output
from tests.gateway.harness import UNPACED, Gateway, running_gateway
from tests.joined.world import JoinedWorld

ROBOT = "amr1"
READ = frozenset(topics.read_by("gateway"))
UP = (ServiceId("planner", ROBOT), ServiceId(DRIVER, ROBOT), ServiceId("sim", WORLD))
Publish = Callable[[topics.Topic[Any], str, Message], None]


class PublishedWorld(JoinedWorld):
    """A joined world that tells ``publish`` all that its driver and its planner publish, and keeps none of it."""

    publish: Publish | None = None

    def _deliver(self, outputs: tuple[Output, ...]) -> None:
        super()._deliver(outputs)
        if self.publish is None:
            return
        for output in outputs:
            self.publish(output.topic, output.robot, output.message)
        self.publish(topics.CLOCK, WORLD, self.session.clock)
        self.flush()

    def flush(self) -> None:
        """What the planner has published by now."""
        for chassis in self._chassis.values():
            chassis.published += [(one.topic, one.message) for one in chassis.core.take_publications()]
            published, chassis.published = chassis.published, []
            chassis.commands, chassis.odometry = chassis.commands[-1:], chassis.odometry[-1:]
            for topic, message in published:
                if self.publish is not None:
                    self.publish(topic, chassis.name, message)


class WorldBus:
    """The bus as a gateway sees it, without one: requests are answered by the cores, coded and decoded on the way."""

    def __init__(self, world: PublishedWorld) -> None:
        self._world = world

    async def acall(self, query: Query[Any, Any], request: Any, robot: str, timeout: float) -> Any:
        """Raises ``Refused`` as a service would: INTERNAL for one that failed to answer."""
        del timeout
        try:
            reply = self._serve(query, robot)(_decoded(query.request, request))
        except RequestRefused as refused:
            raise Refused(refused.code, refused.text) from None
        except Exception as error:
            raise Refused(RefusalCode.INTERNAL, f"{type(error).__name__}: {error}") from error
        finally:
            self._world.flush()
        return _decoded(query.reply, reply)

    def _serve(self, query: Query[Any, Any], robot: str) -> Callable[[Any], Any]:
        if query is topics.WORLD_CONTROL:
            return lambda asked: self._world.ask(asked.request)
        core = self._world.chassis(robot).core
        serving: dict[str, Callable[[Any], Any]] = {
            topics.MOVES.name: core.moves,
            topics.MAPS.name: core.maps,
            topics.EXPLAIN.name: core.explain,
            topics.CHASSIS_REQUEST.name: core.chassis,
            topics.CHASSIS_PARAMETERS.name: core.parameters.answer,
        }
        return serving[query.name]


def _decoded(model: type[Message], message: Message) -> Any:
    codec = codec_for(model)
    return codec.loads(codec.dumps(message), codec.encoding)


class Served:
    """What only a test does: begin anew, let time pass, look at the ground truth."""

    def __init__(self, gateway: Gateway, name: str, folder: Path) -> None:
        self.gateway = gateway
        self._name, self._folder, self._runs = name, folder, 0
        self._world: PublishedWorld | None = None

    @property
    def world(self) -> PublishedWorld:
        assert self._world is not None, "begin first"
        return self._world

    def begin(self, seed: int) -> None:
        """A new world with a planner that has nothing in its store; the gateway forgets the former ones."""
        self.gateway.reset()
        self.gateway.call(lambda: self._replace(seed))
        self.gateway.presence(*(Presence(service, alive=True) for service in UP))

    def advance(self, seconds: float) -> None:
        self.gateway.call(lambda: self.world.advance(seconds))

    def contacts(self) -> tuple[Contact, ...]:
        contacts: tuple[Contact, ...] = self.gateway.call(lambda: self.world.inspect().contacts)
        return contacts

    def close(self) -> None:
        if self._world is not None:
            self.gateway.call(lambda: self.world.__exit__(None, None, None))
            self._world = None

    def _replace(self, seed: int) -> None:
        if self._world is not None:
            self._world.__exit__(None, None, None)
        self._runs += 1
        folder = self._folder / str(self._runs)
        folder.mkdir()
        self._world = world = PublishedWorld(self._name, folder, seed, with_arms=False)
        shared = self.gateway.shared
        fleet = shared.fleet

        def publish(topic: topics.Topic[Any], robot: str, message: Message) -> None:
            if topic in READ:
                (fleet.on_world_message if topic.owner == "world" else fleet.on_message)(topic, robot, message)

        world.publish = publish
        object.__setattr__(shared, "bus", WorldBus(world))
        publish(topics.CHASSIS_MODEL, ROBOT, world.simulation.robots[ROBOT].chassis_model())
        world.flush()


@contextmanager
def served_world(name: str, folder: Path) -> Iterator[Served]:
    """A gateway on a loopback port for joined worlds of this name without arms; ``begin`` makes one."""
    settings = Settings(rates=dict.fromkeys(PAYLOADS, UNPACED), planning_state_timeout=0)
    with running_gateway(settings) as gateway:
        served = Served(gateway, name, folder)
        try:
            yield served
        finally:
            served.close()
