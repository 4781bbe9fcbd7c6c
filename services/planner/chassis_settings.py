"""The options of one chassis, under what clients may change of them."""

from __future__ import annotations

from dataclasses import dataclass, field

from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.modes import RemoteSettings
from rackhand.services.planner.parameters import Basis
from rackhand.services.planner.settings import Limits


@dataclass(frozen=True)
class ChassisSettings:
    """What holds until a client sets it otherwise. ``refuse_moves_while_jacking``: refuse moves while the jack moves,
    instead of holding them until it arrives."""

    remote: RemoteSettings = field(default_factory=RemoteSettings)
    refuse_moves_while_jacking: bool = False

    def basis(self, rack_specs: tuple[RackSpec, ...]) -> Basis:
        """What clients may change of these settings."""
        fastest = self.remote.limits.max_forward_velocity
        return Basis(Limits(), fastest, self.refuse_moves_while_jacking, rack_specs)
