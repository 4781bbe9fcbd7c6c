"""The simulator: MuJoCo behind the interface of a hardware driver, and ``world/*``, which only a simulator has.

Read in this order: ``service`` (bus), ``session`` (requests, participants, resets), ``pacing`` (when the next control
step is due), ``simulation`` (one control step: commands in, measurements out), ``physics`` (steps, compiled);
``chassis``, ``arm`` (one robot each), ``actors`` (obstacles, people), ``mjcf`` (data to a MuJoCo model), ``world``
(maps, contact log, scene); ``warm_up`` (compiles before the first start).
"""
