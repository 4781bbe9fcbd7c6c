"""Arms in physics: what their drives do with commands, and what they do without."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS, Pose2
from rackhand.schemas.motion import STREAM_INTERVALS, ArmCommand, ArmState, FencingToken, Gripper
from rackhand.schemas.refusal import RequestRefused
from rackhand.schemas.world import Place
from rackhand.services.sim.arm.arm import Arm
from rackhand.services.sim.arm.servo import BANDWIDTH
from rackhand.services.sim.simulation import Simulation
from rackhand.worlds.arm_model import GRIPPER_LENGTH, arm_mjcf, load_arm_descriptions
from rackhand.worlds.chassis_model import load_profiles
from rackhand.worlds.data import WorldFileError
from rackhand.worlds.world_model import ARM_INSTANT_NS, World, load_world
from tests.sim.helpers import EXACT, drive, make_simulation, make_world

KINDS = ("ur5e", "fr3")
PERIOD = 2 * ARM_INSTANT_NS
TOKEN = FencingToken(epoch="first", lease=1)
PICK_STATION = load_world("pick_station")
PICK_STATION_HOME = load_arm_descriptions(PICK_STATION)["arm1"].home


def arm_world(kind: str = "ur5e", **place: Any) -> World:
    """The pick station with another arm, or otherwise placed."""
    content = PICK_STATION.model_dump(exclude={"timestep"})
    content["arms"]["arm1"] |= {"kind": kind, **place}
    return World.model_validate(content)


def arm_of(simulation: Simulation) -> Arm:
    return simulation.arms["arm1"]


def state_of(simulation: Simulation) -> ArmState:
    return next(output.message for output in simulation.outputs if output.topic is topics.ARM_STATE)


def send(
    simulation: Simulation, mode: Any, values: Any, token: FencingToken = TOKEN, age: int = 0, suction: bool = False
) -> bool:
    values, answers = tuple(np.asarray(values, dtype=float).tolist()), simulation.stamp - age
    command = ArmCommand(answers=answers, mode=mode, values=values, token=token, suction=suction)
    return simulation.command("arm1", command)


def control(
    simulation: Simulation, seconds: float, mode: str, values: Callable[[float], Any], suction: bool = False
) -> list[ArmState]:
    """Answer each period with ``values`` of the time since now; returns the states meanwhile."""
    begun, states = simulation.stamp, []
    while simulation.stamp - begun < round(seconds * 1e9):
        if simulation.stamp % PERIOD == 0:
            assert send(simulation, mode, values((simulation.stamp - begun) * 1e-9), suction=suction)
        simulation.step()
        states.append(state_of(simulation))
    return states


def wait(simulation: Simulation, seconds: float) -> list[ArmState]:
    """Let time pass without commands."""
    states = []
    for _ in range(round(seconds * 1e9 / ARM_INSTANT_NS)):
        simulation.step()
        states.append(state_of(simulation))
    return states


def positions(states: list[ArmState]) -> Any:
    return np.array([state.q for state in states])


def velocities(states: list[ArmState]) -> Any:
    return np.array([state.dq for state in states])


@pytest.fixture(params=KINDS)
def simulation(request: pytest.FixtureRequest) -> Simulation:
    return Simulation(arm_world(request.param), {}, 0, EXACT)


@pytest.fixture
def ur5e() -> Simulation:
    return Simulation(arm_world(), {}, 0, EXACT)


# -- the model ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_the_attached_arm_is_the_arm_of_the_file(kind: str) -> None:
    """Mass matrix, bias forces (turned with the base about z, gravity is the same) and the flange, 20 random states."""
    pose, mount = (0.3, -0.2, 0.7), 0.6
    cell = Simulation(arm_world(kind, pose=pose, mount=mount), {}, 0, EXACT)
    alone = mujoco.MjModel.from_xml_path(str(arm_mjcf(kind)))
    alone_data, rng = mujoco.MjData(alone), np.random.default_rng(3)
    assert cell.model.nv == alone.nv
    for _ in range(20):
        q = rng.uniform(alone.jnt_range[:, 0], alone.jnt_range[:, 1])
        dq = rng.uniform(-2, 2, alone.nv)
        for model, data in ((cell.model, cell.data), (alone, alone_data)):
            data.qpos[:], data.qvel[:] = q, dq
            mujoco.mj_forward(model, data)
        masses = np.zeros((2, alone.nv, alone.nv))
        mujoco.mj_fullM(cell.model, cell.data, masses[0])
        mujoco.mj_fullM(alone, alone_data, masses[1])
        np.testing.assert_allclose(masses[0], masses[1], atol=1e-10)
        np.testing.assert_allclose(cell.data.qfrc_bias, alone_data.qfrc_bias, atol=1e-10)
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        expected = turn @ alone_data.site("flange").xpos + (pose[0], pose[1], mount)
        np.testing.assert_allclose(cell.data.site("arm1/flange").xpos, expected, atol=1e-10)
        rotation = turn @ alone_data.site("flange").xmat.reshape(3, 3)
        np.testing.assert_allclose(cell.data.site("arm1/flange").xmat.reshape(3, 3), rotation, atol=1e-10)


def test_joint_ranges_and_torque_limits_are_those_of_the_file(simulation: Simulation) -> None:
    kind = simulation.world.arms["arm1"].kind
    alone, limits = mujoco.MjModel.from_xml_path(str(arm_mjcf(kind))), arm_of(simulation).limits
    np.testing.assert_allclose(np.array([limits.lower, limits.upper]).T, alone.jnt_range)
    np.testing.assert_allclose(limits.torque, alone.jnt_actfrcrange[:, 1])


@pytest.mark.parametrize(
    ("place", "told"),
    [
        ({"home": (0.0, 0.0, 9.0, 0.0, 0.0, 0.0)}, r"arms\.arm1\.home: .* not within"),
    ],
)
def test_a_wrong_arm_is_reported_with_its_place(place: dict[str, Any], told: str) -> None:
    with pytest.raises(WorldFileError, match=told):
        Simulation(arm_world(**place), {}, 0, EXACT)


@pytest.mark.parametrize("name", ["warehouse", "empty", "pick_station"])
def test_the_arm_of_a_world_collides_with_nothing(name: str) -> None:
    """Nothing can be reached by less than 10 cm of it at home; the pedestal's top is what its base stands on."""
    world = load_world(name)
    simulation = Simulation(world, load_profiles(world), 0, EXACT)
    wait(simulation, 0.1)
    assert simulation.contact_log.count == 0
    model, data, arm = simulation.model, simulation.data, arm_of(simulation)
    others = [g for g in range(model.ngeom) if not model.geom(g).name.startswith(("arm1/", "pedestal", "slot/"))]
    moving = [g for g in arm.geoms if model.geom(g).name != "arm1/base"]
    near = [(model.geom(g).name, d) for m in moving for g in others
            if (d := mujoco.mj_geomDistance(model, data, int(m), g, 0.1, None)) < 0.1]  # fmt: skip
    assert near == []


def test_an_arm_needs_a_fast_physics() -> None:
    with pytest.raises(ValueError, match=r"timestep 0\.002: the servo of an arm needs 0\.001 or less"):
        World.model_validate(PICK_STATION.model_dump() | {"timestep": 0.002})
    assert make_world().timestep == 0.002 and arm_world().timestep == 0.001


# -- modes -------------------------------------------------------------------------------------------------------------


def test_it_holds_against_gravity_without_a_command(simulation: Simulation) -> None:
    home = np.array(arm_of(simulation).kind.home)
    states = wait(simulation, 0.5)
    np.testing.assert_allclose(positions(states), np.tile(home, (len(states), 1)), atol=1e-9)
    assert np.abs(states[-1].efforts).max() > 5, "gravity asks for torque"


def test_states_come_at_500_hz_at_their_stamps(ur5e: Simulation) -> None:
    stamps = [state.stamp for state in wait(ur5e, 0.04)]
    assert stamps == list(range(2_000_000, 40_000_001, 2_000_000))


def test_a_stream_of_positions_is_followed_without_lag(simulation: Simulation) -> None:
    """A position that answers t is where the arm is a period later, to 20 µrad, at 1.2 rad/s and 4.8 rad/s²."""
    home = np.array(state_of(simulation).q)

    def wave(time: float) -> Any:
        return home + 0.3 * (1 - np.cos(4 * time))

    states = control(simulation, 1.0, "position", lambda time: wave(time + PERIOD * 1e-9))
    wanted = np.array([wave(state.stamp * 1e-9) for state in states])
    np.testing.assert_allclose(positions(states), wanted, atol=2e-5)


def follow_late(
    simulation: Simulation, seconds: float, seed: int, lost: float, wanted: Callable[[float], Any]
) -> tuple[Any, Any, Any]:
    """Times, positions and velocities of joint 0 while it follows a stream as in real time: commands come never at the
    instant itself, one in five several milliseconds later, and a share ``lost`` of them not at all."""
    generator, states = np.random.default_rng(seed), []
    on_its_way: list[tuple[int, ArmCommand]] = []
    while simulation.stamp < seconds * NANOSECONDS:
        stamp = simulation.stamp
        if stamp % PERIOD == 0:
            values = tuple(wanted((stamp + PERIOD) / NANOSECONDS).tolist())
            late = generator.integers(2, 6) if generator.random() < 0.2 else 1
            arrives = max([stamp + int(late) * ARM_INSTANT_NS, *(before for before, _ in on_its_way)])
            if not lost or generator.random() >= lost:
                command = ArmCommand(answers=stamp, mode="position", values=values, token=TOKEN)
                on_its_way.append((arrives, command))
        while on_its_way and on_its_way[0][0] <= stamp:
            assert simulation.command("arm1", on_its_way.pop(0)[1])
        simulation.step()
        states.append(state_of(simulation))
    t = np.array([state.stamp for state in states]) / NANOSECONDS
    return t, positions(states)[:, 0], velocities(states)[:, 0]


def test_a_stream_whose_commands_come_late_is_followed_without_lag_and_gently(ur5e: Simulation) -> None:
    home = np.array(PICK_STATION_HOME)
    t, q, dq = follow_late(ur5e, 4.0, 7, 0.0, lambda seconds: home + 0.3 * (1 - np.cos(2 * seconds)))
    true = 0.6 * np.sin(2 * t)
    fast = np.abs(true) > 0.3
    lag = (q - (home[0] + 0.3 * (1 - np.cos(2 * t))))[fast] / -true[fast]
    assert np.abs(lag).max() < 5e-5
    assert np.abs(dq - true).max() < 0.01
    assert np.abs(np.diff(dq) / np.diff(t)).max() < 6.0, "1.2 rad/s² is what the stream asks for"


def test_a_stream_that_begins_to_brake_is_followed_gently_though_its_commands_come_late(ur5e: Simulation) -> None:
    """There and back at 1.5 rad/s with half of the acceleration limit; two commands in a hundred are lost."""
    home, limit = np.array(PICK_STATION_HOME), arm_of(ur5e).limits.acceleration[0]
    times = np.arange(0.0, 2.0, 1e-4)
    speed = np.clip(limit / 2 * (0.3 - np.abs(times % 1.0 - 0.4)), 0.0, 1.5) * np.where(times < 1.0, 1.0, -1.0)
    way = np.cumsum(speed) * 1e-4
    t, q, dq = follow_late(
        ur5e, 1.9, 3, 0.02, lambda seconds: home + np.eye(6)[0] * np.interp(seconds, times + 1e-4, way)
    )
    assert np.abs(q - home[0] - np.interp(t, times + 1e-4, way)).max() < 4e-3
    assert np.abs(np.diff(dq) / np.diff(t)).max() < 1.6 * limit


def test_a_jump_is_made_within_the_limits_and_ends_at_rest(simulation: Simulation) -> None:
    goal, limits = np.array(state_of(simulation).q) + 0.5, arm_of(simulation).limits
    states = control(simulation, 0.8, "position", lambda _: goal)
    np.testing.assert_allclose(states[-1].q, goal, atol=1e-6)
    assert (np.abs(velocities(states)) < 1.02 * limits.velocity).all()
    # The braking ends within a step of the physics. At worst the servo swings as an acceleration deflects it that it
    # has not been told of: a / ω².
    assert (positions(states) < goal + limits.acceleration / BANDWIDTH**2).all()
    first = positions(states)[0] - (goal - 0.5)
    assert (first <= limits.acceleration * 0.002**2).all(), "it does not leap"


@pytest.mark.parametrize(("mode", "value"), [("position", 9.0), ("velocity", 3.0)])
def test_no_joint_leaves_its_range(mode: str, value: float) -> None:
    """The base joint, 0.4 rad before the end of its range, is told to go beyond it: it stops there, and gently."""
    home = (2 * np.pi - 0.4, *PICK_STATION_HOME[1:])
    simulation = Simulation(arm_world(home=home), {}, 0, EXACT)
    wanted = np.array((value, *(home[1:] if mode == "position" else (0.0,) * 5)))
    states = control(simulation, 0.6, mode, lambda _: wanted)
    upper = arm_of(simulation).limits.upper[0]
    assert velocities(states)[:, 0].max() > 1
    assert positions(states)[:, 0].max() <= upper + 1e-3
    assert states[-1].q[0] == pytest.approx(upper, abs=1e-3) and abs(states[-1].dq[0]) < 1e-3


@pytest.mark.parametrize("seconds", [0.6, 0.34])
def test_a_stream_of_positions_cannot_drive_a_joint_out_of_its_range(seconds: float) -> None:
    """Sped up gently, so that it is followed, it runs through the end of the range at 2 rad/s; or is cut just there."""
    home = (2 * np.pi - 0.4, *PICK_STATION_HOME[1:])
    simulation = Simulation(arm_world(home=home), {}, 0, EXACT)

    def there(time: float) -> Any:
        return home + np.eye(6)[0] * (4 * time**2 if time < 0.25 else 2 * time - 0.25)

    states = control(simulation, seconds, "position", there) + wait(simulation, 0.4)
    assert velocities(states)[:, 0].max() > 1.7
    assert positions(states)[:, 0].max() <= arm_of(simulation).limits.upper[0] + 1e-3
    assert abs(states[-1].dq[0]) < 1e-3


def test_velocities_are_followed_and_capped(simulation: Simulation) -> None:
    wanted = np.zeros(arm_of(simulation).n)
    wanted[0], wanted[-1] = 0.8, -99.0
    states = control(simulation, 0.5, "velocity", lambda _: wanted)
    expected = np.clip(wanted, -arm_of(simulation).limits.velocity, arm_of(simulation).limits.velocity)
    reached = velocities(states)[200]
    np.testing.assert_allclose(reached[:-1], expected[:-1], atol=1e-3)
    np.testing.assert_allclose(reached[-1], expected[-1], atol=1e-3)


def test_torques_come_on_top_of_gravity(simulation: Simulation) -> None:
    """No torque: it floats. 1 N·m on the last joint turns it by the equation of motion, its damping included."""
    home, n = np.array(state_of(simulation).q), arm_of(simulation).n
    states = control(simulation, 0.2, "torque", lambda _: np.zeros(n))
    np.testing.assert_allclose(positions(states), np.tile(home, (len(states), 1)), atol=1e-9)
    torque = np.eye(n)[-1]
    mass = np.zeros((n, n))
    mujoco.mj_fullM(simulation.model, simulation.data, mass)
    states = control(simulation, 0.02, "torque", lambda _: torque)
    assert states[-1].dq[-1] == pytest.approx(0.02 * np.linalg.solve(mass, torque)[-1], rel=0.1)


def test_torque_limits_hold_and_so_does_the_speed(simulation: Simulation) -> None:
    limits = arm_of(simulation).limits
    wanted = np.zeros(arm_of(simulation).n)
    wanted[0], wanted[-1] = 1e4, 1e4
    states = control(simulation, 0.1, "torque", lambda _: wanted)
    efforts = np.array([state.efforts for state in states])
    assert (np.abs(efforts) <= limits.torque).all()
    assert efforts[:, 0].max() == pytest.approx(limits.torque[0], rel=1e-3)
    assert (velocities(states)[:, -1] < 1.4 * limits.velocity[-1]).all()


# -- without commands --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["position", "velocity", "torque"])
def test_a_stream_that_is_cut_brakes_the_arm_to_rest(simulation: Simulation, mode: str) -> None:
    n, home = arm_of(simulation).n, np.array(state_of(simulation).q)
    streams: dict[str, Callable[[float], Any]] = {
        "position": lambda time: home + np.eye(n)[0] * 1.5 * time,
        "velocity": lambda _: np.eye(n)[0] * 1.5,
        "torque": lambda _: np.eye(n)[0] * 15.0,
    }
    moving = control(simulation, 0.3, mode, streams[mode])[-1]
    assert moving.dq[0] > 0.5
    states = wait(simulation, 0.6)
    speeds = velocities(states)[:, 0]
    longest = 0.1 + speeds.max() / arm_of(simulation).limits.acceleration[0] + 0.02
    assert np.abs(velocities(states)[round(longest / 0.002) :]).max() < 1e-3
    braking = np.diff(speeds[51:]) / 0.002
    assert braking.min() > -1.3 * arm_of(simulation).limits.acceleration[0]
    np.testing.assert_allclose(states[-1].q, states[-20].q, atol=1e-6)


def test_a_stream_of_positions_goes_on_as_it_went_for_as_long_as_the_contract_says(simulation: Simulation) -> None:
    home = np.array(state_of(simulation).q)
    control(simulation, 0.3, "position", lambda time: home + np.eye(len(home))[0] * 1.5 * (time + PERIOD * 1e-9))
    speeds = velocities(wait(simulation, 0.03))[:, 0]
    bridged = (STREAM_INTERVALS - 1) * PERIOD // ARM_INSTANT_NS  # the first interval was that of the newest command
    np.testing.assert_allclose(speeds[:bridged], 1.5, atol=1e-4)
    assert (np.diff(speeds[bridged - 1 :]) < -0.01).all(), "it brakes"


def test_a_velocity_stays_in_force_for_100_ms_and_no_longer(ur5e: Simulation) -> None:
    control(ur5e, 0.3, "velocity", lambda _: np.eye(6)[0])
    speeds = velocities(wait(ur5e, 0.2))[:, 0]
    last = ur5e.stamp - 200_000_000 - PERIOD  # the stamp of the newest command's answer
    assert last + 100_000_000 == 396_000_000
    np.testing.assert_allclose(speeds[:48], 1.0, atol=1e-6)
    assert (speeds[48:60] < 0.999).all()


def test_who_is_silenced_brakes_at_once(ur5e: Simulation) -> None:
    control(ur5e, 0.3, "velocity", lambda _: np.eye(6)[0])
    ur5e.silence("arm1")
    assert velocities(wait(ur5e, 0.002))[-1, 0] < 0.99


def test_a_joint_that_is_held_back_does_not_wind_up() -> None:
    """It leans on the floor beyond the table for 0.4 s, and turns back 0.12 s after it is told to."""
    simulation = Simulation(arm_world(home=(0, -0.3, 1.0, -1.5708, -1.5708, 0)), {}, 0, EXACT)
    down = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    blocked = control(simulation, 1.3, "velocity", lambda _: down)[-1]
    assert abs(blocked.dq[1]) < 0.05
    assert {(row.robot, row.other) for row in simulation.contact_log.rows} == {("arm1", "floor")}
    states = control(simulation, 0.13, "velocity", lambda _: -down)
    assert states[60].dq[1] < -0.8


# -- whom it obeys -----------------------------------------------------------------------------------------------------


def test_commands_of_a_grant_that_was_replaced_do_not_pass(ur5e: Simulation) -> None:
    wait(ur5e, 0.1)
    values = np.zeros(6)
    newer, restarted = FencingToken(epoch="first", lease=2), FencingToken(epoch="second", lease=0)
    assert send(ur5e, "velocity", values)
    assert send(ur5e, "velocity", values, newer, age=PERIOD), "stamps begin anew with each grant"
    assert not send(ur5e, "velocity", values + 1)
    assert send(ur5e, "velocity", values, newer)
    assert not send(ur5e, "velocity", values + 1, newer, age=PERIOD), "a late sample"
    assert send(ur5e, "velocity", values, restarted)
    assert not send(ur5e, "velocity", values + 1, newer), "an epoch that was replaced does not come back"
    assert np.abs(velocities(wait(ur5e, 0.02))).max() < 1e-9, "what was refused moves nothing"


@pytest.mark.parametrize("values", [(), (0.0,) * 5, (0.0,) * 7, (np.nan,) * 6, (np.inf, 0, 0, 0, 0, 0)])
def test_malformed_commands_do_not_pass(ur5e: Simulation, values: tuple[float, ...]) -> None:
    command = ArmCommand.model_construct(answers=0, mode="position", values=values, token=TOKEN)
    assert arm_of(ur5e).fault_of(command)
    assert not ur5e.command("arm1", command)


def test_a_command_of_a_run_that_is_over_does_not_pass(ur5e: Simulation) -> None:
    assert not send(ur5e, "velocity", np.ones(6), age=-PERIOD)
    assert not ur5e.command("arm2", ArmCommand(answers=0, mode="velocity", values=(0.0,) * 6, token=TOKEN))


# -- the cell ----------------------------------------------------------------------------------------------------------


def test_the_same_commands_give_the_same_bytes_and_others_do_not() -> None:
    def run(speed: float) -> str:
        simulation = Simulation(arm_world(), {}, 0, EXACT)
        control(simulation, 0.1, "velocity", lambda time: np.full(6, speed * time))
        return simulation.digest

    assert run(1.0) == run(1.0)
    assert run(1.0) != run(1.0000001)


def test_the_arm_meets_itself(ur5e: Simulation) -> None:
    control(ur5e, 1.5, "velocity", lambda _: np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0]))
    assert ("arm1", "arm1") in {(row.robot, row.other) for row in ur5e.contact_log.rows}


def test_nothing_can_be_placed_into_it(ur5e: Simulation) -> None:
    with pytest.raises(RequestRefused, match="'crate' would overlap 'arm1'"):
        ur5e.change(Place(name="crate", pose=Pose2(x=0, y=0, yaw=0), size=(0.3, 0.3, 2.0)))
    with pytest.raises(RequestRefused, match="'arm1' is already used in this world"):
        ur5e.change(Place(name="arm1", pose=Pose2(x=1.5, y=1.5, yaw=0)))


def test_its_bodies_are_in_scene_and_objects(ur5e: Simulation) -> None:
    links = {"arm1/base", "arm1/upper_arm_link", "arm1/wrist_3_link"}
    assert links <= {geom.body for geom in ur5e.scene().geoms}
    poses = {pose.name: pose for pose in ur5e.objects().objects}
    assert links <= set(poses)
    assert poses["arm1/base"].position == pytest.approx((0, 0, 0.6))


def test_a_chassis_beside_it_drives_as_ever() -> None:
    """The same commands at the same instants: 20 ms of its own beside the 2 ms of the arm."""
    arms = {"arm1": {"kind": "ur5e", "pose": (0.0, 3.0, 0.0), "mount": 0.6}}
    beside, alone = make_simulation(make_world(arms=arms)), make_simulation(make_world(timestep=0.001))
    beside_heard, alone_heard = (drive(each, 1.0, linear=0.5, angular=0.2) for each in (beside, alone))
    stamps = [[m.stamp for topic, m in heard if topic is topics.ODOMETRY] for heard in (beside_heard, alone_heard)]
    assert stamps[0] == stamps[1]
    np.testing.assert_allclose(beside.robots["amr1"].pose, alone.robots["amr1"].pose, atol=1e-6)


# -- flange and gripper ------------------------------------------------------------------------------------------------


def test_the_wrench_is_what_the_tool_does_to_the_flange_in_its_frame() -> None:
    """At rest: the gripper's weight, and its moment about the flange."""
    bare = Simulation(arm_world(), {}, 0, EXACT)
    assert np.abs(state_of(bare).wrench).max() < 1e-9
    cell = Simulation(arm_world(gripper="suction", home=(0.3, -1.2, 1.0, -0.6, -1.1, 0.5)), {}, 0, EXACT)
    rotation = cell.data.site("arm1/flange").xmat.reshape(3, 3)
    force = rotation.T @ (0, 0, -0.4 * 9.81)
    wrench = np.array(state_of(cell).wrench)
    np.testing.assert_allclose(wrench[:3], force, atol=1e-6)
    np.testing.assert_allclose(wrench[3:], np.cross((0, 0, 0.06), force), atol=1e-6)


def crate_world() -> World:
    """A crate of 2 kg on the floor, whose lid is just under the cup of an arm that stands on the floor, too."""
    bare = arm_world(mount=0.0, gripper="suction").model_dump() | {"statics": {}}
    x, y, flange = Simulation(World.model_validate(bare), {}, 0, EXACT).data.site("arm1/flange").xpos.tolist()
    crate = {"size": (0.2, 0.2, flange - 0.1201), "pose": (x, y, 0.0), "mass": 2.0}
    return World.model_validate(bare | {"items": {"crate": crate}})


LIFT = np.array([0.0, -0.4, 0.0, 0.0, 0.0, 0.0])


def lift_the_crate(simulation: Simulation) -> None:
    control(simulation, 0.05, "velocity", lambda _: -0.1 * LIFT)
    control(simulation, 0.6, "velocity", lambda time: LIFT * min(time, 0.6 - time) / 0.3, suction=True)


def test_the_gripper_lifts_what_it_sucks_and_lets_go() -> None:
    """The flange feels the crate's weight; the contact_log finds nothing wrong."""
    simulation = Simulation(crate_world(), {}, 0, EXACT)
    assert state_of(simulation).gripper == Gripper(suction=False, holding=False)
    lift_the_crate(simulation)
    held = control(simulation, 0.4, "velocity", lambda _: np.zeros(6), suction=True)[100:]
    assert {state.gripper for state in held} == {Gripper(suction=True, holding=True)}
    assert lowest(simulation, "crate") > 0.05
    felt = np.mean([state.wrench[:3] for state in held], axis=0)
    assert np.linalg.norm(felt) == pytest.approx((0.4 + 2.0) * 9.81, rel=0.05)
    states = control(simulation, 0.5, "velocity", lambda _: np.zeros(6))
    assert states[-1].gripper == Gripper(suction=False, holding=False)
    assert lowest(simulation, "crate") < 0.01
    assert simulation.contact_log.count == 0


def lowest(simulation: Simulation, item: str) -> float:
    """Height of the underside of an item that lies level, m."""
    return float(simulation.data.body(item).xpos[2]) - simulation.world.items[item].size[2] / 2


def test_what_is_held_is_not_dropped_when_commands_fall_silent() -> None:
    """Nor when the controller is gone, nor by what a replaced grant says."""
    simulation = Simulation(crate_world(), {}, 0, EXACT)
    lift_the_crate(simulation)
    height = lowest(simulation, "crate")
    assert height > 0.05
    assert send(simulation, "velocity", np.zeros(6), FencingToken(epoch="first", lease=2), suction=True)
    assert not send(simulation, "velocity", np.zeros(6), suction=False)
    simulation.silence("arm1")
    states = wait(simulation, 0.5)
    assert states[-1].gripper == Gripper(suction=True, holding=True)
    assert lowest(simulation, "crate") == pytest.approx(height, abs=0.02)


def test_a_cup_draws_nothing_but_air_beside_its_mouth(ur5e: Simulation) -> None:
    """A crate that touches its side is not held."""
    assert state_of(ur5e).gripper is None, "this one has none"
    x, y, flange = ur5e.data.site("arm1/flange").xpos.tolist()
    crate = {"size": (0.2, 0.2, flange - 0.02), "pose": (x, y - 0.1255, 0.0), "mass": 50.0}
    world = arm_world(gripper="suction").model_dump() | {"statics": {}, "items": {"crate": crate}}
    simulation = Simulation(World.model_validate(world), {}, 0, EXACT)
    states = control(simulation, 0.2, "velocity", lambda _: 0.05 * np.eye(6)[0], suction=True)
    cup = simulation.model.geom("arm1/cup").id
    assert (simulation.data.contact.geom == cup).any(), "they touch"
    assert {state.gripper for state in states} == {Gripper(suction=True, holding=False)}


def test_the_arm_carries_a_parcel_across_the_table() -> None:
    """In the warehouse: taken off the table, lifted by 0.2 m, carried sideways by 0.26 m, let go: it falls back on."""
    simulation = warehouse()
    pose = simulation.data.body("parcel_red").xpos.copy()
    top = float(pose[2]) + 0.05
    asleep = simulation.data.body_awake[simulation.model.body("parcel_red").id] == 0
    assert asleep, "it costs nothing while it lies"
    over, down = goal(simulation, pose[0], pose[1], top + 0.05), goal(simulation, pose[0], pose[1], top - 0.0005)
    go(simulation, over, 1.5)
    go(simulation, down, 1.0, suction=True)
    assert state_of(simulation).gripper == Gripper(suction=True, holding=True)
    bare = np.linalg.norm(state_of(Simulation(simulation.world, {}, 0, EXACT)).wrench[:3])
    up = goal(simulation, pose[0], pose[1], top + 0.2)
    go(simulation, up, 2.0, suction=True)
    assert simulation.data.body("parcel_red").xpos[2] - pose[2] == pytest.approx(0.2, abs=0.01)
    felt = np.mean([np.linalg.norm(s.wrench[:3]) for s in go(simulation, up, 0.5, suction=True)])
    assert felt - bare == pytest.approx(0.6 * 9.81, rel=0.1), "the sensor feels the load"
    aside = goal(simulation, pose[0] + 0.26, pose[1], top + 0.2)
    go(simulation, aside, 2.0, suction=True)
    assert state_of(simulation).gripper == Gripper(suction=True, holding=True)
    go(simulation, aside, 1.0)
    lies = simulation.data.body("parcel_red").xpos
    assert np.linalg.norm(lies[:2] - pose[:2] - (0.26, 0.0)) < 0.05
    assert lies[2] == pytest.approx(pose[2], abs=0.03), "it lies on the table again"
    assert simulation.contact_log.count == 0


def warehouse() -> Simulation:
    world = load_world("warehouse").model_copy(update={"robots": {}, "movers": {}})
    return Simulation(world, {}, 0, EXACT)


def goal(simulation: Simulation, x: float, y: float, cup: float) -> Any:
    """Joint positions with the cup's mouth there in the map, pointing down; by damped least squares on the physics."""
    model, data, arm = simulation.model, mujoco.MjData(simulation.model), arm_of(simulation)
    data.qpos[:] = simulation.data.qpos
    site = model.site("arm1/flange").id
    down = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    rows, turn = np.zeros((6, model.nv)), np.zeros(3)
    for _ in range(200):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacSite(model, data, rows[:3], rows[3:], site)
        away = down @ data.site_xmat[site].reshape(3, 3).T
        turn[:] = (away[2, 1] - away[1, 2], away[0, 2] - away[2, 0], away[1, 0] - away[0, 1])
        error = np.concatenate([(x, y, cup + GRIPPER_LENGTH) - data.site_xpos[site], turn / 2])
        jacobian = rows[:, arm._qvel]
        data.qpos[arm._qpos] += np.linalg.lstsq(jacobian, 0.5 * error, rcond=1e-3)[0]
    assert np.abs(error).max() < 1e-6
    return data.qpos[arm._qpos].copy()


def go(simulation: Simulation, goal: Any, seconds: float, suction: bool = False) -> list[ArmState]:
    """There on a quintic from rest to rest."""
    start = np.array(state_of(simulation).q)

    def there(time: float) -> Any:
        s = min(time / seconds, 1.0)
        return start + (10 * s**3 - 15 * s**4 + 6 * s**5) * (goal - start)

    return control(simulation, seconds, "position", there, suction)
