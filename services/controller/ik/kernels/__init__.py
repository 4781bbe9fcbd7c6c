"""The arithmetic of inverse kinematics, compiled.

    box     joint limits as a box of velocities, Cholesky, the QP in a box
    chain   a serial chain: the tool's pose, its Jacobian, errors
    tick    one control tick
    search  a posture for a pose

Shapes: n joints; a pose is (3, 4) = [R | p]; twists are (linear, angular), of the tool in its own axes unless said.
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
    curve,
    forward,
    jacobian,
    lengths,
    manipulability,
    normal_matrix,
    pose_error,
    pose_gap,
    weighted,
)
from rackhand.services.controller.ik.kernels.search import nearest, search
from rackhand.services.controller.ik.kernels.tick import (
    BOX,
    CHOLESKY,
    DAMPING,
    DT,
    ERROR_ANGULAR,
    ERROR_LINEAR,
    ITERATIONS,
    LEAP,
    LM_DAMPING,
    MEASURE,
    NONE,
    REPORT,
    ROWS,
    SCALE,
    SINGULAR_AT,
    SINGULAR_DAMPING,
    SOLVER,
    TUNING,
    WEIGHTS,
    descend,
    draw,
    look_ahead,
    tick,
)

__all__ = [
    "BOX",
    "CHOLESKY",
    "DAMPING",
    "DT",
    "ERROR_ANGULAR",
    "ERROR_LINEAR",
    "ITERATIONS",
    "LEAP",
    "LM_DAMPING",
    "MEASURE",
    "NONE",
    "REPORT",
    "ROWS",
    "SCALE",
    "SINGULAR_AT",
    "SINGULAR_DAMPING",
    "SOLVER",
    "TUNING",
    "WEIGHTS",
    "acceleration_box",
    "braked",
    "cholesky",
    "cholesky_solve",
    "curve",
    "descend",
    "draw",
    "forward",
    "jacobian",
    "lengths",
    "look_ahead",
    "manipulability",
    "nearest",
    "normal_matrix",
    "pose_error",
    "pose_gap",
    "position_box",
    "search",
    "solve_box",
    "tick",
    "walk_faces",
    "weighted",
]
