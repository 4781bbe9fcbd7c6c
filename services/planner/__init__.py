"""The planner of one chassis: from requests to paths to velocities.

Read in this order: ``service`` (bus to core), ``chassis`` (the core: requests and one tick), ``motion`` (perceive →
behaviour → braking guard → command); ``moves`` (create, replace, cancel, history), ``behaviors`` (one file per move
type), ``perception``, ``planning``, ``control``, ``map``, ``geometry``; ``modes``, ``parameters``, ``load``,
``jacking``, ``alerts``, ``reports``; ``store`` and ``database`` (SQLite); ``settings``, ``warm_up``.
"""
