"""Navigation of one chassis: map and scans in, body twists out. Pure: no bus, no clock, no files."""

from services.planner.navigation.navigator import ChassisNavigator
from services.planner.navigation.settings import NavigationSettings

__all__ = ["ChassisNavigator", "NavigationSettings"]
