"""The arithmetic of inverse kinematics, compiled. Read in this order:

    tables  what the kernels read and write, as NamedTuples
    chain   a serial chain: the tool's pose, its Jacobian, errors
    box     joint limits as a box of velocities, Cholesky, the QP in a box
    tick    one control tick
    search  a posture for a pose

Shapes: n joints; a pose is (3, 4) = [R | p]; twists are (linear, angular), of the tool in its own axes unless the
docstring says otherwise.
"""

from rackhand.services.controller.ik.kernels.box import (
    acceleration_box,
    braked,
    cholesky,
    cholesky_solve,
    position_box,
    solve_box,
    walk_faces,
)
from rackhand.services.controller.ik.kernels.chain import (
    forward,
    jacobian,
    lengths,
    manipulability,
    normal_matrix,
    pose_error,
    pose_gap,
    subtract_curvature,
    to_tool,
    weighted,
)
from rackhand.services.controller.ik.kernels.search import (
    nearest,
    search,
)
from rackhand.services.controller.ik.kernels.tables import (
    BOX,
    CHOLESKY,
    ERROR_ANGULAR,
    ERROR_LINEAR,
    ITERATIONS,
    MEASURE,
    NONE,
    REPORT,
    ROWS,
    SCALE,
    SOLVER,
    ArmTables,
    LimitTable,
    TickWork,
    Tuning,
)
from rackhand.services.controller.ik.kernels.tick import (
    brake_only,
    limited_velocity,
    look_ahead,
    newton_solve,
    posture_velocity,
    secondary_velocity_term,
    tick,
)

__all__ = [
    "BOX",
    "CHOLESKY",
    "ERROR_ANGULAR",
    "ERROR_LINEAR",
    "ITERATIONS",
    "MEASURE",
    "NONE",
    "REPORT",
    "ROWS",
    "SCALE",
    "SOLVER",
    "ArmTables",
    "LimitTable",
    "TickWork",
    "Tuning",
    "acceleration_box",
    "brake_only",
    "braked",
    "cholesky",
    "cholesky_solve",
    "forward",
    "jacobian",
    "lengths",
    "limited_velocity",
    "look_ahead",
    "manipulability",
    "nearest",
    "newton_solve",
    "normal_matrix",
    "pose_error",
    "pose_gap",
    "position_box",
    "posture_velocity",
    "search",
    "secondary_velocity_term",
    "solve_box",
    "subtract_curvature",
    "tick",
    "to_tool",
    "walk_faces",
    "weighted",
]
