"""The same seed gives the same bytes."""

from __future__ import annotations

from rackhand.services.sim.chassis.noise import NoiseSettings, generator
from rackhand.services.sim.simulation import Simulation
from rackhand.worlds.chassis_model import load_profiles
from rackhand.worlds.world_model import load_world
from tests.sim.helpers import drive

WAREHOUSE = load_world("warehouse")


def run(seed: int, turn: float = 0.4) -> Simulation:
    simulation = Simulation(WAREHOUSE, load_profiles(WAREHOUSE), seed, NoiseSettings())
    drive(simulation, 1.0, linear=0.6, angular=turn)
    return simulation


def test_same_seed_same_digest_and_any_difference_shows() -> None:
    first, again = run(1), run(1)
    assert first.digest == again.digest
    assert run(2).digest != first.digest
    assert run(1, turn=0.4000001).digest != first.digest


def test_digest_grows_with_every_instant_and_asking_does_not_change_it() -> None:
    simulation = run(1)
    before = simulation.digest
    assert before == simulation.digest
    simulation.step()
    assert simulation.digest != before


def test_noise_streams_do_not_depend_on_each_other() -> None:
    one, two = generator(5, "amr1", "lidar"), generator(5, "amr1", "imu")
    first = two.standard_normal()
    assert one.standard_normal() != first
    one.standard_normal(1000)
    assert generator(5, "amr1", "imu").standard_normal() == first
    assert generator(5, "amr2", "imu").standard_normal() != first
